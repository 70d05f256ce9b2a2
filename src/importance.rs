//! How much light a cluster probably sends to a shading point, judged by its moments; zero only where its bounds prove it.
//!
//! Twin of `shaders/importance.wgsl`; `tests/all/gpu.rs` runs both on the same inputs. Starts from CK18 5.1 and
//! pbrt-v4's light bounds. Differs: flux-weighted mean and variance of position in place of the box's centre, a smooth
//! cosine at the shading point, a lobe about the mean direction of emission (docs/math.md); all eight children of a node at
//! once, without branches, so that the compiler can use vectors.

use glam::Vec3;

use crate::light::LAMBERTIAN;
use crate::shading_point::ShadingPoint;
use crate::tree::{Lanes, Node, UNLIMITED_RANGE, Unpacked, WIDTH};

/// A shading point in the space of the nodes that are walked, and what that space does to bounds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    pub position: Vec3,
    /// Unit, or zero.
    pub normal: Vec3,
    /// False in a volume.
    pub has_normal: bool,
    /// Metres of this space per metre of the world, at most: ranges are metres of the world.
    pub range_scale: f32,
    /// What rounding of positions may add up to, per metre of coordinates: more where the space is squeezed.
    pub margin: f32,
    /// False where the space is sheared or scaled unevenly, so that angles and caps mean nothing.
    pub keeps_angles: bool,
}

impl View {
    /// The view of a shading point in the nodes' own space.
    pub fn of(shading_point: &ShadingPoint) -> Self {
        // A normal too short to have a direction proves nothing.
        let normal = shading_point.normal.normalize_or_zero();
        Self {
            position: shading_point.position,
            normal,
            has_normal: normal != Vec3::ZERO,
            range_scale: 1.0,
            margin: POSITION_MARGIN,
            keeps_angles: true,
        }
    }
}

/// Share of the variance of position that is added to the squared distance.
pub(crate) const VARIANCE_SHARE: f32 = 0.4;
/// Width of the smooth cosine at the shading point, squared, per unit of the cluster's angular size.
pub(crate) const COSINE_WIDTH_SQ: f32 = 0.81;
/// Least cosine: what the bounds cannot exclude keeps a chance.
pub(crate) const FLOOR: f32 = 1.0e-3;
/// The most that goes along the lobe: measured in docs/decisions.md, 5.
pub(crate) const LOBE_SHARE: f32 = 0.9;
/// Width of the smooth rim of the lobe, squared, per unit of the cluster's angular size.
pub(crate) const RIM_WIDTH_SQ: f32 = 0.06;
/// The same for a cluster without size, per unit of the lobe's own width, squared.
pub(crate) const RIM_MIN_SQ: f32 = 0.002;
/// Clusters whose mean direction is longer than this have a lobe this narrow.
pub(crate) const MAX_LOBE_LENGTH: f32 = 0.999;
/// Importances stay inside this span, so that a sum of them is finite and positive whatever the scene's units.
pub(crate) const MIN_IMPORTANCE: f32 = 1.0e-30;
/// See [`MIN_IMPORTANCE`].
pub(crate) const MAX_IMPORTANCE: f32 = 1.0e36;
/// Rounding of positions, relative to the sum of all coordinates that are added and turned: each transform, at either
/// end, loses at most 3e-7 of the largest. Not of the coordinate at hand: turns mix all three.
pub(crate) const POSITION_MARGIN: f32 = 1.0e-6;
/// Square metres beyond which squares leave f32, and prove nothing: far shading points seen from small instances get there.
pub(crate) const MAX_DIST_SQ: f32 = 1.0e38;
/// What a similarity may be off by, and rounding of lengths.
pub(crate) const COSINE_MARGIN: f32 = 1.0e-4;
/// Rounding of angles, as a share of the distance: the sine of a small angle, from its cosine, is good to 3.5e-4.
pub(crate) const ANGLE_MARGIN: f32 = 1.0e-3;

/// What a shading point sees of a node's children.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    /// Estimated illuminance in lux; 0 only if box, cap or range prove that it is 0.
    pub importance: Lanes,
    /// How large a child looks: 0 far away, 1 from inside. The estimate is the worse for it.
    pub spread: Lanes,
}

/// The importances of a node's children.
#[inline(always)]
pub(crate) fn see(node: &Node, view: &View) -> Seen {
    let grid = node.grid(view.position);
    let margin = (node.reach(&grid) + view.position.abs().element_sum()) * view.margin;
    let mut seen = Seen { importance: [0.0; WIDTH], spread: [0.0; WIDTH] };
    for i in 0..WIDTH {
        let child = node.unpack(i, &grid);
        let (importance, spread) = estimate(&child, view);
        let is_lit = (child.flux > 0.0) & !provably_dark(&child, view, margin);
        seen.importance[i] = if is_lit { importance } else { 0.0 };
        seen.spread[i] = spread;
    }
    seen
}

/// The estimate for one child, in lux, and how large it looks.
#[inline(always)]
fn estimate(child: &Unpacked, view: &View) -> (f32, f32) {
    let [x, y, z] = child.toward;
    let dist_sq = max(x * x + y * y + z * z, MIN_IMPORTANCE);
    let distance = dist_sq.sqrt();
    let variance = child.variance;
    let spread = variance / (dist_sq + variance);

    // Cosines are kept times the distance until the end, which does not have to wait for a division. At the shading point a
    // hyperbola follows max(cos, 0) and is rounded off as wide as the cluster is seen.
    let normal = view.normal;
    let along = normal.x * x + normal.y * y + normal.z * z;
    let cosine = 0.5 * (along + (along * along + COSINE_WIDTH_SQ * spread * dist_sq).sqrt());
    let cosine = if view.has_normal { max(cosine, FLOOR * distance) } else { distance };

    // A share of the light goes along a lobe about the mean direction, the rest to all sides: emitters that disagree,
    // or are seen from nearby, are no broad lobe but a mixture, whose back must not be starved. The lobe is a cosine,
    // clamped at 0 for a Lambertian emitter and higher for beams, such that its mean cosine is the emitters' own.
    let length = min(child.length, MAX_LOBE_LENGTH);
    let share = LOBE_SHARE * min(length * (1.0 / LAMBERTIAN), 1.0) * (1.0 - spread);
    let least_cos = max(3.0 * length - 2.0, 0.0);
    let width_sq = (1.0 - least_cos) * (1.0 - least_cos);
    let above = -(child.axis[0] * x + child.axis[1] * y + child.axis[2] * z) - least_cos * distance;
    let rim = (RIM_WIDTH_SQ * spread + RIM_MIN_SQ * width_sq) * dist_sq;
    let lobe = (1.0 - share) * width_sq * distance + 2.0 * share * (above + (above * above + rim).sqrt());

    // Divided by one distance each, since the fourth power of a long one leaves f32.
    let inverse = 1.0 / distance;
    let reach = width_sq * (dist_sq + VARIANCE_SHARE * variance);
    let lux = child.flux * (0.25 * std::f32::consts::FRAC_1_PI) * ((lobe * inverse) * (cosine * inverse) / reach);
    (min(max(lux, MIN_IMPORTANCE), MAX_IMPORTANCE), spread)
}

/// Whether the bounds prove that no light of a child reaches the shading point. `margin` is what rounding may add to
/// positions.
#[inline(always)]
fn provably_dark(child: &Unpacked, view: &View, margin: f32) -> bool {
    let normal = view.normal.to_array();
    let mut highest = margin * (normal[0].abs() + normal[1].abs() + normal[2].abs());
    let (mut gap_sq, mut dist_sq, mut along) = (0.0, 0.0, 0.0);
    for k in 0..3 {
        highest += normal[k] * child.center[k] + normal[k].abs() * child.half[k];
        let outside = max(child.center[k].abs() - (child.half[k] + margin), 0.0);
        gap_sq += outside * outside;
        dist_sq += child.center[k] * child.center[k];
        along -= child.axis[k] * child.center[k];
    }

    // Everything below the horizon.
    let is_below = view.has_normal & (highest <= 0.0);

    // Everything out of range.
    let reach = child.range * (view.range_scale * (1.0 + COSINE_MARGIN));
    let is_out_of_range = (child.range < UNLIMITED_RANGE) & (gap_sq > reach * reach) & (gap_sq <= MAX_DIST_SQ);

    // Everything turned away: with the angle b beyond the cap at which the box's middle sees the shading point, and the
    // box's sphere of radius r at distance d, sin(b) d > r, or b is beyond a right angle and the shading point outside.
    let across = max(dist_sq - along * along, 0.0).sqrt();
    let cos = child.cos_half_angle;
    let sin = max(1.0 - cos * cos, 0.0).sqrt();
    let slack = ANGLE_MARGIN * (along.abs() + across) + margin;
    let radius = child.radius_sq.sqrt() + slack;
    let beside = across * cos - along * sin;
    let is_behind = (beside > 0.0) & (along * cos + across * sin < -slack) & (dist_sq > radius * radius);
    let is_turned_away = view.keeps_angles & (cos > -1.0) & ((beside > radius) | is_behind) & (dist_sq <= MAX_DIST_SQ);

    is_below | is_out_of_range | is_turned_away
}

/// Sums of the first one, two, ... of some numbers, in three steps instead of seven; the last is the sum of all.
#[inline(always)]
pub(crate) fn running_sums(values: &Lanes) -> Lanes {
    let mut sums = *values;
    for turn in [1, 2, 4] {
        let before = sums;
        for i in turn..WIDTH {
            sums[i] = before[i] + before[i - turn];
        }
    }
    sums
}

/// Not [`f32::max`], which takes several instructions to let NaN give way from either side. Here it gives way if it is
/// `a`: only a shading point that is no place makes one, and gets the least importance.
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Light;
    use crate::simd::{Job, with_vectors};
    use crate::tree::LightTree;

    struct See<'a>(&'a Node, &'a View);

    impl Job for See<'_> {
        type Output = Seen;

        #[inline(always)]
        fn run(self) -> Seen {
            see(self.0, self.1)
        }
    }

    #[test]
    fn importances_are_the_same_bits_with_vectors_and_without() {
        let turn = |i: usize, speed: f32| (i as f32 * speed).sin();
        let place = |i: usize| Vec3::new(turn(i, 0.7), turn(i, 1.3), turn(i, 2.1)) * 30.0;
        let light = |i: usize| {
            let direction = place(i + 1).normalize();
            let emission = Vec3::splat(1.0 + turn(i, 3.7));
            match i % 3 {
                0 => Light::rectangle(place(i), direction, place(i + 2) * 0.01, emission),
                1 => Light::spot(place(i), direction, 0.1, 0.1 + turn(i, 0.3).abs(), emission).with_range(20.0),
                _ => Light::point(place(i), emission),
            }
        };
        let tree = LightTree::new((0..2000).map(light).collect()).expect("valid lights");
        let bits = |seen: Seen| [seen.importance, seen.spread].map(|lanes| lanes.map(f32::to_bits));
        for (i, node) in tree.nodes().iter().enumerate() {
            for shading_point in [ShadingPoint::surface(place(i + 7), place(i + 9)), ShadingPoint::volume(place(i + 7))]
            {
                let view = View::of(&shading_point);
                assert_eq!(bits(with_vectors(See(node, &view))), bits(See(node, &view).run()));
            }
        }
    }
}
