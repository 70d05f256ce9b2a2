//! The estimate that walks below the cut of a cell choose by: the light of a cluster at its mean position.
//!
//! Twin of `shaders/rough.wgsl`. It proves nothing to be dark and has no doubt: both have served when the cut was
//! made, which decides nearly all of a choice (docs/decisions.md, 80).

use glam::Vec3;

use crate::shading::gloss::LocalGloss;
use crate::shading::importance::{COSINE_MARGIN, Lobe, LocalShadingPoint, MAX_IMPORTANCE, MIN_IMPORTANCE, max, min};
use crate::tree::{Lanes, Node, Unpacked, WIDTH};

/// The least cosine at the shading point.
pub(crate) const ROUGH_COSINE: f32 = 0.002;
/// What the cosine at the shading point gains per unit of the cluster's angular size.
pub(crate) const ROUGH_RISE: f32 = 0.25;
/// How much farther than its cap a cluster shines, per unit of its angular size.
pub(crate) const ROUGH_SPILL: f32 = 4.0;
/// The weight of a cluster whose cap or range does not reach the shading point, over what it would have.
pub(crate) const UNLIKELY: f32 = 0.1;
/// The weight of a cluster whose box is below the horizon, over what it would have.
pub(crate) const BELOW: f32 = 0.01;

/// What a walk chooses one of a node's children by, in lux; 0 only for a child without flux. Not for segments.
#[inline(always)]
pub(crate) fn rough_weights(node: &Node, local: &LocalShadingPoint) -> Lanes {
    match &local.map {
        None => {
            let grid = node.grid(local.position);
            // Two copies of the loop, so that matte surfaces take no more time than without gloss.
            match &local.gloss {
                None => weights(local, None, |i| node.unpack(i, &grid)),
                Some(gloss) => weights(local, Some(gloss), |i| node.unpack(i, &grid)),
            }
        }
        Some(map) => {
            let grid = node.grid(Vec3::ZERO);
            let child = |i| map.child(&node.unpack(i, &grid), node.flux_shares(i), local.position);
            weights(local, local.gloss.as_ref(), child)
        }
    }
}

#[inline(always)]
fn weights(local: &LocalShadingPoint, gloss: Option<&LocalGloss>, child: impl Fn(usize) -> Unpacked) -> Lanes {
    let mut weights = [0.0; WIDTH];
    for i in 0..WIDTH {
        let child = child(i);
        let [x, y, z] = child.toward;
        let dist_sq = max(x * x + y * y + z * z, MIN_IMPORTANCE);
        let dist = dist_sq.sqrt();
        let inverse = 1.0 / dist;
        let inverse_sq = 1.0 / (dist_sq + child.variance);
        let spread = child.variance * inverse_sq;

        let (mut along, mut highest) = (0.0, 0.0);
        for (k, normal) in local.normal.to_array().into_iter().enumerate() {
            along += normal * child.toward[k];
            highest += normal * child.center[k] + normal.abs() * child.half[k];
        }
        let cosine = max(along * inverse, ROUGH_COSINE) + ROUGH_RISE * spread;
        let cosine = if highest <= 0.0 { BELOW * cosine } else { cosine };
        let cosine = if local.has_normal { cosine } else { 1.0 };

        let facing = child.axis[0] * x + child.axis[1] * y + child.axis[2] * z;
        let lobe = Lobe::new(child.length, facing, spread, dist_sq, dist);
        let is_beyond_cap = ROUGH_SPILL * spread + COSINE_MARGIN - facing * inverse < child.cos_half_angle;
        let is_beyond_range = dist > child.range;
        let unlikely = if is_beyond_cap | is_beyond_range { UNLIKELY } else { 1.0 };

        let intensity = child.flux * local.candela_per_lumen * (lobe.value / (dist * lobe.width_sq));
        let mut lux = intensity * unlikely * (cosine * inverse_sq);
        if let Some(gloss) = gloss {
            let [u, v] = gloss.along(child.toward);
            lux *= gloss.reflected(u * inverse, v * inverse, cosine, spread).0;
        }
        let weight = min(max(lux, MIN_IMPORTANCE), MAX_IMPORTANCE);
        weights[i] = if child.flux > 0.0 { weight } else { 0.0 };
    }
    weights
}
