//! Estimates how much light each child of a node sends to a shading point.
//!
//! The estimate comes from the child's moments. It is 0 only where the child's bounds prove that no
//! light arrives.
//!
//! Twin of `shaders/importance.wgsl`; `tests/all/gpu.rs` runs both on the same inputs. Based on
//! CK18 5.1 and pbrt-v4's light bounds. Differs: the flux-weighted mean and variance of position
//! replace the box's centre, the cosine at the shading point is smooth, the emission is a lobe
//! about the mean direction, and clusters whose box is nearer than their mean position count as
//! more doubtful and brighter (docs/math.md). All eight children of a node are evaluated together
//! and without branches, so that the compiler can use vectors.

use glam::Vec3;

use crate::light::{LAMBERTIAN, UNLIMITED_RANGE};
use crate::math::simd::{VectorJob, with_vectors};
use crate::shading::gloss::LocalGloss;
use crate::shading::segment::{LocalSegment, SegmentView, clamped, gap_sq};
use crate::shading::shading_point::ShadingPoint;
use crate::shading::world_map::WorldMap;
use crate::tree::{LEAF, Lanes, Node, Unpacked, WIDTH};

/// A shading point in the space of a tree. Where an instance is scaled, sheared or mirrored it is in
/// the axes of the instance instead, and the tree is mapped to them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalShadingPoint<'a> {
    pub position: Vec3,
    /// A unit vector, or zero.
    pub normal: Vec3,
    /// False in a volume.
    pub has_normal: bool,
    /// The largest rounding error of a position, per metre of its coordinates.
    pub margin: f32,
    /// The bit of [`Node::children`] that marks single lights: [`LEAF`] in a tree,
    /// `part::SINGLE` in a top level, whose leaves are parts of instances.
    pub light_bit: u32,
    /// The tree is that of the sky, which is at one distance from every shading point.
    pub is_sky: bool,
    /// The intensity of a light that shines to all sides, per unit of flux and after the factor of
    /// the instance: [`CANDELA_PER_LUMEN`] without a factor.
    pub candela_per_lumen: f32,
    /// The map of the tree to the axes of an instance that is scaled, sheared or mirrored.
    pub map: Option<WorldMap<'a>>,
    /// How a glossy surface reflects.
    pub gloss: Option<LocalGloss>,
    /// A segment about the position; `None` for a point.
    pub segment: Option<LocalSegment>,
}

impl LocalShadingPoint<'_> {
    /// A shading point whose coordinates are already in the nodes' space.
    pub fn of(shading_point: &ShadingPoint) -> Self {
        // A normal too short to have a direction proves nothing.
        let normal = shading_point.normal.normalize_or_zero();
        Self {
            position: shading_point.position,
            normal,
            has_normal: normal != Vec3::ZERO,
            margin: POSITION_MARGIN,
            light_bit: LEAF,
            is_sky: false,
            candela_per_lumen: CANDELA_PER_LUMEN,
            map: None,
            gloss: Self::gloss_of(shading_point),
            segment: LocalSegment::of(shading_point),
        }
    }

    /// The child in a slot of a node, as the shading point sees it.
    #[inline(always)]
    pub fn child(&self, node: &Node, slot: usize) -> Unpacked {
        match &self.map {
            None => node.unpack(slot, &node.grid(self.position)),
            Some(map) => map.child(&node.unpack(slot, &node.grid(Vec3::ZERO)), node.flux_shares(slot), self.position),
        }
    }

    /// The gloss of a shading point in the space of its position.
    pub fn gloss_of(shading_point: &ShadingPoint) -> Option<LocalGloss> {
        shading_point.gloss.and_then(|gloss| LocalGloss::of(&gloss, shading_point.normal.normalize_or_zero()))
    }
}

/// The intensity in candela of a light of one lumen that shines to all sides.
pub(crate) const CANDELA_PER_LUMEN: f32 = 0.25 * std::f32::consts::FRAC_1_PI;
/// The share of the variance of position that is added to the squared distance.
pub(crate) const VARIANCE_SHARE: f32 = 0.5;
/// The squared width of the smooth cosine at the shading point, per unit of the cluster's angular
/// size along the normal.
pub(crate) const COSINE_WIDTH_SQ: f32 = 0.5;
/// The brightness that a cluster gains per unit of doubt: a weak light at the shading point may
/// outshine the strong ones that decide the mean position.
pub(crate) const NEAR_GAIN: f32 = 0.2;
/// The share of the variance of position that is added to the squared distance of the box. It
/// limits the doubt about a cluster around the shading point.
pub(crate) const NEAR_VARIANCE: f32 = 0.02;
/// The least squared distance of a box, per unit of that of the mean position.
pub(crate) const MIN_GAP: f32 = 1.0e-6;
/// The greatest amount by which the smooth cosine exceeds max(cos, 0), per unit of h / d: h is the
/// height of the box above the horizon, and d the distance of the mean position. Without this
/// limit, sigma of city S is 0.97 instead of 0.88. At 0.5, city M has 1 to 2 % less noise and city
/// S more.
pub(crate) const HORIZON_SHARE: f32 = 0.25;
/// The least cosine at the shading point. It keeps the probability of what the bounds cannot
/// exclude above 0.
pub(crate) const MIN_COSINE: f32 = 1.0e-3;
/// The largest share of the light that goes along the lobe. Measured in docs/decisions.md, 5.
pub(crate) const LOBE_SHARE: f32 = 0.9;
/// The squared width of the lobe's smooth rim, per unit of the cluster's angular size.
pub(crate) const RIM_WIDTH_SQ: f32 = 0.06;
/// The squared width of the rim for a cluster without size, per unit of the lobe's own squared
/// width.
pub(crate) const RIM_MIN_SQ: f32 = 0.002;
/// The length of a mean direction is clamped to this, which bounds how narrow a lobe can be.
pub(crate) const MAX_LOBE_LENGTH: f32 = 0.999;
/// Importances lie in [`MIN_IMPORTANCE`, `MAX_IMPORTANCE`], so that their sum is finite and
/// positive in any unit of length and flux.
pub(crate) const MIN_IMPORTANCE: f32 = 1.0e-30;
/// See [`MIN_IMPORTANCE`].
pub(crate) const MAX_IMPORTANCE: f32 = 1.0e36;
/// The rounding error of positions, relative to the sum of all coordinates that are added and
/// rotated. Each transform, at either end, loses at most 3e-7 of the largest coordinate. One
/// coordinate alone is not enough: rotations mix all three.
pub(crate) const POSITION_MARGIN: f32 = 1.0e-6;
/// Squared distances above this prove nothing, because their squares leave f32. Far shading points
/// reach it in the space of small instances.
pub(crate) const MAX_DIST_SQ: f32 = 1.0e38;
/// The relative error of a distance that is compared with a range: of rounding, and of a placement
/// that counts as a rotation.
pub(crate) const COSINE_MARGIN: f32 = 1.0e-4;
/// The rounding error of angles, as a share of the distance: the sine of a small angle, computed
/// from its cosine, is accurate to 3.5e-4.
pub(crate) const ANGLE_MARGIN: f32 = 1.0e-3;

// A child is *unresolved* if its distance and its extent are less than its node can tell. It may
// then send nothing at all, because the shading point lies on the lamp, or nearly all the light
// (docs/decisions.md, 30). Two errors limit what a node can tell; (a + b)^2 <= 2 (a^2 + b^2) bounds
// their sum.

/// The largest error of a mean position, which is stored as a byte per axis: a share of half its
/// box's diagonal, squared and doubled.
pub(crate) const MEAN_ERROR_SQ: f32 = 2.0 / (u8::MAX as f32 * u8::MAX as f32);
/// The typical error of a shading point's position in a tree's space, along each axis, relative to
/// the sum of its coordinates.
pub(crate) const POSITION_ERROR: f32 = 3.0e-7;
/// The least error in metres: twice the distance below which a light counts as sending nothing
/// (`MIN_DIST_SQ`).
pub(crate) const MIN_POSITION_ERROR: f32 = 2.0e-11;
/// The doubt about an unresolved child, relative to its importance. It is twice the greatest doubt
/// that other children have at a matte shading point.
pub(crate) const UNRESOLVED_DOUBT: f32 = 2.0 / NEAR_VARIANCE;

/// How much light the children of a node send to a shading point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ChildImportances {
    /// Estimated illuminance in lux, with a negative sign if the child is unresolved. 0 only if the
    /// box, the cap or the range proves that it is 0.
    pub importance: Lanes,
    /// The error that the estimate of a child may have, relative to the estimate: from 0 (far away)
    /// to 1 / [`NEAR_VARIANCE`] (the shading point is inside). A glossy surface adds to it without
    /// limit. 0 for a single light, which cannot be split.
    pub doubt: Lanes,
}

impl ChildImportances {
    /// Whether a child is unresolved. That is rare.
    #[inline(always)]
    pub fn has_unresolved(&self) -> bool {
        self.importance.iter().fold(0, |bits, importance| bits | importance.to_bits()) >> 31 == 1
    }

    /// What a walk chooses one of the children by: the importances, where those of unresolved
    /// children add up to at most the sum of the others.
    #[inline(always)]
    pub fn weights(&self) -> Lanes {
        if self.has_unresolved() { limited_weights(&self.importance) } else { self.importance }
    }
}

/// Estimates the importances of a node's children.
#[inline(always)]
pub(crate) fn child_importances(node: &Node, local: &LocalShadingPoint) -> ChildImportances {
    if let Some(segment) = &local.segment {
        return segment_importances(node, local, segment);
    }
    // Two copies of the loop, so that matte surfaces take no more time than without gloss.
    match &local.gloss {
        None => importances(node, local, None),
        Some(gloss) => importances(node, local, Some(gloss)),
    }
}

/// The squared error of a shading point's position, doubled as [`MEAN_ERROR_SQ`] is, over three axes.
/// `reach` is the sum of the coordinates.
#[inline(always)]
fn position_error_sq(reach: f32) -> f32 {
    let error = POSITION_ERROR * reach + MIN_POSITION_ERROR;
    (2.0 * 3.0) * (error * error)
}

#[inline(always)]
fn importances(node: &Node, local: &LocalShadingPoint, gloss: Option<&LocalGloss>) -> ChildImportances {
    if let Some(map) = &local.map {
        return importances_in_axes(node, local, map);
    }
    let grid = node.grid(local.position);
    let coordinates = local.position.abs().element_sum();
    let margin = (node.reach(&grid) + coordinates) * local.margin;
    estimate_children(node, local, gloss, margin, |i| node.unpack(i, &grid))
}

/// [`importances`] in an instance that is scaled, sheared or mirrored. Not a part of the loops that
/// call it, so that others take no more time.
#[inline(never)]
fn importances_in_axes(node: &Node, local: &LocalShadingPoint, map: &WorldMap) -> ChildImportances {
    let grid = node.grid(Vec3::ZERO);
    let margin = (node.reach(&grid) * map.scale() + local.position.abs().element_sum()) * local.margin;
    let child = |i| map.child(&node.unpack(i, &grid), node.flux_shares(i), local.position);
    estimate_children(node, local, local.gloss.as_ref(), margin, child)
}

#[inline(always)]
fn estimate_children(
    node: &Node,
    local: &LocalShadingPoint,
    gloss: Option<&LocalGloss>,
    margin: f32,
    child: impl Fn(usize) -> Unpacked,
) -> ChildImportances {
    let position_error_sq = position_error_sq(local.position.abs().element_sum());
    let mut children = ChildImportances { importance: [0.0; WIDTH], doubt: [0.0; WIDTH] };
    for i in 0..WIDTH {
        let child = child(i);
        let gap_sq = child.gap_sq(margin);
        let is_light = node.children[i] & local.light_bit != 0;
        let view = ClusterView::new(&child, local, gap_sq);
        let (importance, doubt) = estimate(&child, &view, is_light, local, gloss, position_error_sq);
        let is_lit = (child.flux > 0.0) & !is_provably_dark(&child, &view, local, margin);
        children.importance[i] = if is_lit { importance } else { 0.0 };
        children.doubt[i] = doubt;
    }
    children
}

/// A cluster as the shading point sees it. Lengths are in metres.
struct ClusterView {
    /// Squared distance of the mean position.
    dist_sq: f32,
    /// The component along the normal of the vector from the shading point to the mean position.
    along: f32,
    /// The greatest height of the box above the plane of the surface, which may be negative.
    highest: f32,
    /// The component of the same vector along the axis of emission. Negative where that axis points
    /// toward the shading point.
    facing: f32,
    /// Squared distance of the box.
    gap_sq: f32,
    /// The part of the variance along the normal, times 3; at most the variance.
    normal_variance: f32,
}

impl ClusterView {
    #[inline(always)]
    fn new(child: &Unpacked, local: &LocalShadingPoint, gap_sq: f32) -> Self {
        let [x, y, z] = child.toward;
        let normal = local.normal;
        let (mut highest, mut across_sq) = (0.0, 0.0);
        for (k, normal) in normal.to_array().into_iter().enumerate() {
            highest += normal * child.center[k] + normal.abs() * child.half[k];
            across_sq += (normal * child.half[k]) * (normal * child.half[k]);
        }
        Self {
            dist_sq: x * x + y * y + z * z,
            along: normal.x * x + normal.y * y + normal.z * z,
            highest,
            facing: child.axis[0] * x + child.axis[1] * y + child.axis[2] * z,
            gap_sq,
            normal_variance: min(3.0 * child.deviation_sq * across_sq, child.variance),
        }
    }
}

/// The importance and the doubt of one child. See [`ChildImportances`]. `is_light` is set for a
/// single light.
#[inline(always)]
fn estimate(
    child: &Unpacked,
    view: &ClusterView,
    is_light: bool,
    local: &LocalShadingPoint,
    gloss: Option<&LocalGloss>,
    position_error_sq: f32,
) -> (f32, f32) {
    let variance = child.variance;
    let toward_sq = max(view.dist_sq, MIN_IMPORTANCE);
    // The angular size of the cluster, from 0 (far away) to 1 (the shading point is inside).
    let spread = variance / (toward_sq + variance);

    // A cluster whose box is nearer than its mean position may have lights that are, too. All of the
    // sky is at the same distance, which is the root of the mean square.
    let mean_sq = toward_sq + variance * if local.is_sky { 1.0 } else { VARIANCE_SHARE };
    let near_sq = max(view.gap_sq + NEAR_VARIANCE * variance, MIN_GAP * mean_sq);
    let near_sq = if local.is_sky { mean_sq } else { near_sq };
    let doubt = spread * (mean_sq / near_sq);
    let doubt = if is_light { 0.0 } else { doubt };
    let nearness = 1.0 + if local.is_sky { 0.0 } else { NEAR_GAIN } * doubt;
    let dist_sq = if local.is_sky { mean_sq } else { toward_sq };
    let dist = dist_sq.sqrt();

    // Cosines stay multiplied by the distance until the end, which need not wait for a division.
    // The cosine at the shading point is a hyperbola that follows max(cos, 0), rounded off over the
    // angular size of the cluster. Only its extent along the normal changes the cosine: a façade
    // that faces another one, or a ceiling over a floor, has none. The hyperbola falls off too
    // slowly where the mean position is below the horizon and only a part of the box rises above
    // it.
    let nearby = if local.is_sky { 0.0 } else { spread };
    let width_sq = COSINE_WIDTH_SQ * view.normal_variance * (1.0 - nearby);
    let cosine = 0.5 * (view.along + (view.along * view.along + width_sq).sqrt());
    let cosine = min(cosine, max(view.along, 0.0) + HORIZON_SHARE * view.highest);
    let cosine = if local.has_normal { max(cosine, MIN_COSINE * dist) } else { dist };

    let Lobe { value: lobe, width_sq } = Lobe::new(child.length, view.facing, spread, dist_sq, dist);

    // Each factor is divided by one distance, because the fourth power of a long distance leaves
    // f32.
    let inverse = 1.0 / dist;
    let reach = width_sq * mean_sq;
    let intensity = child.flux * local.candela_per_lumen * nearness;
    let lux = intensity * ((lobe * inverse) * (cosine * inverse) / reach);
    let (lux, doubt) = match gloss {
        Some(gloss) => {
            let [x, y] = gloss.along(child.toward);
            let (reflected, gloss_doubt) = gloss.reflected(x * inverse, y * inverse, cosine * inverse, spread);
            (lux * reflected, if is_light { 0.0 } else { doubt + gloss_doubt })
        }
        None => (lux, doubt),
    };
    let importance = min(max(lux, MIN_IMPORTANCE), MAX_IMPORTANCE);
    let [x, y, z] = child.toward;
    let is_unresolved = x * x + y * y + z * z + child.variance <= MEAN_ERROR_SQ * child.radius_sq + position_error_sq;
    (if is_unresolved { -importance } else { importance }, doubt)
}

/// The emission of a cluster toward the shading point.
///
/// A share of the light goes along a lobe about the mean direction, the rest to all sides: emitters
/// that disagree, or that are near, form no broad lobe but a mixture whose back must not be
/// starved. The lobe is a clamped cosine. It is clamped at 0 for a Lambertian emitter and higher
/// for beams, so that its mean cosine is that of the emitters.
pub(crate) struct Lobe {
    /// The mixture, times the distance.
    pub value: f32,
    /// The squared width that the value is still to be divided by.
    pub width_sq: f32,
}

impl Lobe {
    /// `length` is that of the mean direction, and `facing` as in [`ClusterView`].
    #[inline(always)]
    pub fn new(length: f32, facing: f32, spread: f32, dist_sq: f32, dist: f32) -> Self {
        let length = min(length, MAX_LOBE_LENGTH);
        let share = LOBE_SHARE * min(length * (1.0 / LAMBERTIAN), 1.0) * (1.0 - spread);
        let min_cos = max(3.0 * length - 2.0, 0.0);
        let width_sq = (1.0 - min_cos) * (1.0 - min_cos);
        let above = -facing - min_cos * dist;
        let rim = (RIM_WIDTH_SQ * spread + RIM_MIN_SQ * width_sq) * dist_sq;
        let value = (1.0 - share) * width_sq * dist + 2.0 * share * (above + (above * above + rim).sqrt());
        Self { value, width_sq }
    }
}

/// [`child_importances`] for a segment, with the vector instructions of the machine. Not a part of
/// the loops that call it, so that points take no more time than without segments.
#[inline(never)]
fn segment_importances(node: &Node, local: &LocalShadingPoint, segment: &LocalSegment) -> ChildImportances {
    with_vectors(SegmentJob { node, local, segment })
}

struct SegmentJob<'a> {
    node: &'a Node,
    local: &'a LocalShadingPoint<'a>,
    segment: &'a LocalSegment,
}

impl VectorJob for SegmentJob<'_> {
    type Output = ChildImportances;

    #[inline(always)]
    fn run(self) -> ChildImportances {
        let Self { node, local, segment } = self;
        let coordinates = local.position.abs().element_sum() + segment.reach();
        // Two copies of the loop: a branch inside of it would keep the compiler from using vectors.
        match &local.map {
            None => {
                let grid = node.grid(local.position);
                let margin = (node.reach(&grid) + coordinates) * local.margin;
                importances_along(node, local, segment, margin, |i| node.unpack(i, &grid))
            }
            Some(map) => {
                let grid = node.grid(Vec3::ZERO);
                let margin = (node.reach(&grid) * map.scale() + coordinates) * local.margin;
                let child = |i| map.child(&node.unpack(i, &grid), node.flux_shares(i), local.position);
                importances_along(node, local, segment, margin, child)
            }
        }
    }
}

#[inline(always)]
fn importances_along(
    node: &Node,
    local: &LocalShadingPoint,
    segment: &LocalSegment,
    margin: f32,
    child: impl Fn(usize) -> Unpacked,
) -> ChildImportances {
    let position_error_sq = position_error_sq(local.position.abs().element_sum() + segment.reach());
    let mut children = ChildImportances { importance: [0.0; WIDTH], doubt: [0.0; WIDTH] };
    for i in 0..WIDTH {
        let child = child(i);
        let (gap_sq, center_sq) = gap_sq(&child, segment, margin);
        let is_dark = segment_is_provably_dark(&child, segment, (gap_sq, center_sq), margin);
        let cluster = SegmentCluster::new(&child, segment, gap_sq);
        let error_sq = MEAN_ERROR_SQ * child.radius_sq + position_error_sq;
        let is_unresolved = cluster.view.near_sq() + child.variance <= error_sq;
        let is_light = node.children[i] & local.light_bit != 0;
        let (importance, doubt) = cluster.estimate(child.length, is_light, local.candela_per_lumen);
        let importance = if is_unresolved { -importance } else { importance };
        children.importance[i] = if (child.flux > 0.0) & !is_dark { importance } else { 0.0 };
        children.doubt[i] = doubt;
    }
    children
}

/// A cluster as a segment sees it. Lengths are in metres.
struct SegmentCluster {
    /// The mean position.
    view: SegmentView,
    /// The component along the axis of emission of the vector from the middle of the segment to the
    /// mean position.
    facing: f32,
    /// The component along the axis of emission of the segment's unit vector.
    facing_along: f32,
    /// Squared distance of the box.
    gap_sq: f32,
    variance: f32,
    flux: f32,
}

impl SegmentCluster {
    #[inline(always)]
    fn new(child: &Unpacked, segment: &LocalSegment, gap_sq: f32) -> Self {
        let unit = segment.unit.to_array();
        let (mut facing, mut facing_along) = (0.0, 0.0);
        for k in 0..3 {
            facing += child.axis[k] * child.toward[k];
            facing_along += child.axis[k] * unit[k];
        }
        Self {
            view: SegmentView::new(child.toward, segment),
            facing,
            facing_along,
            gap_sq,
            variance: child.variance,
            flux: child.flux,
        }
    }

    /// The importance and the doubt of the cluster. See [`ChildImportances`]. The importance is the
    /// mean over the segment. `length` is that of the mean direction of emission.
    #[inline(always)]
    fn estimate(&self, length: f32, is_light: bool, candela_per_lumen: f32) -> (f32, f32) {
        let Self { view, variance, .. } = *self;
        let near_sq = max(view.near_sq(), MIN_IMPORTANCE);
        let spread = variance / (near_sq + variance);
        let mean_sq = near_sq + VARIANCE_SHARE * variance;
        let doubt = spread * (mean_sq / max(self.gap_sq + NEAR_VARIANCE * variance, MIN_GAP * mean_sq));
        let doubt = if is_light { 0.0 } else { doubt };
        // The mean over a long segment hides how near single lights are.
        let length_sq = 4.0 * (view.half * view.half);
        let nearness = 1.0 + NEAR_GAIN * doubt * ((near_sq + variance) / (near_sq + variance + length_sq));

        let soft_sq = max(view.line_sq + VARIANCE_SHARE * variance, MIN_IMPORTANCE);
        let reach = view.mean_sq(soft_sq.sqrt());
        // The emission is the mean of that toward two points, each in the middle of half of the
        // angle under which the segment is seen. One point has 1.4 times the noise on rays of
        // 100 m; four have a tenth less and take an eighth more time.
        let end = |place: f32| [place, (soft_sq + place * place).sqrt()];
        let (a, b) = (end(-view.half - view.foot), end(view.half - view.foot));
        let middle = SegmentView::halved(soft_sq, a, b);
        let emitted = |a: [f32; 2], b: [f32; 2]| {
            let [place, _] = SegmentView::halved(soft_sq, a, b);
            let dist_sq = max(view.line_sq + place * place, MIN_IMPORTANCE);
            let dist = dist_sq.sqrt();
            let facing = self.facing - (place + view.foot) * self.facing_along;
            let lobe = Lobe::new(length, facing, variance / (dist_sq + variance), dist_sq, dist);
            lobe.value / (lobe.width_sq * dist)
        };
        let emitted = 0.5 * (emitted(a, middle) + emitted(middle, b));
        let lux = self.flux * candela_per_lumen * nearness * (emitted / reach);
        (min(max(lux, MIN_IMPORTANCE), MAX_IMPORTANCE), doubt)
    }
}

/// Whether the bounds prove that no light of a child reaches any point of a segment. `gap_sq` and
/// `center_sq` are the squared distances of the box and of its centre from the segment.
#[inline(always)]
fn segment_is_provably_dark(
    child: &Unpacked,
    segment: &LocalSegment,
    (gap_sq, center_sq): (f32, f32),
    margin: f32,
) -> bool {
    let reach = child.range * (1.0 + COSINE_MARGIN);
    let is_out_of_range = (child.range < UNLIMITED_RANGE) & (gap_sq > reach * reach) & (gap_sq <= MAX_DIST_SQ);

    // As for points, with the greatest part along the axis that any point of the segment has, and
    // with the least part across it; with the greatest where the cap is more than half of the
    // sphere, because the angle beyond the cap then falls with both. All points are vectors from
    // the box's centre.
    let (unit, half) = (segment.unit.to_array(), segment.half);
    let (mut along, mut axis_unit) = (0.0, 0.0);
    for k in 0..3 {
        along -= child.axis[k] * child.center[k];
        axis_unit += child.axis[k] * unit[k];
    }
    let (mut across_sq, mut turn_sq, mut product) = (0.0, 0.0, 0.0);
    let (mut across, mut turn) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        across[k] = -child.center[k] - along * child.axis[k];
        turn[k] = unit[k] - axis_unit * child.axis[k];
        across_sq += across[k] * across[k];
        turn_sq += turn[k] * turn[k];
        product += across[k] * turn[k];
    }
    let nearest = clamped(-product / max(turn_sq, MIN_IMPORTANCE), half);
    let mut least_sq = 0.0;
    for k in 0..3 {
        let place = across[k] + nearest * turn[k];
        least_sq += place * place;
    }
    let most = (across_sq + 2.0 * half * product.abs() + half * half * turn_sq).sqrt();
    let max_along = along + half * axis_unit.abs();
    let cos = child.cos_half_angle;
    let sin = max(1.0 - cos * cos, 0.0).sqrt();
    let slack = ANGLE_MARGIN * (along.abs() + across_sq.sqrt() + 2.0 * half) + margin;
    let radius = child.radius_sq.sqrt() + slack;
    let beyond = (if cos >= 0.0 { least_sq.sqrt() } else { most }) * cos - max_along * sin;
    let is_behind =
        (cos >= 0.0) & (beyond > 0.0) & (max_along * cos + most * sin < -slack) & (center_sq > radius * radius);
    let farthest = along.abs() + across_sq.sqrt() + half;
    let is_turned_away = (cos > -1.0) & ((beyond > radius) | is_behind) & (farthest * farthest <= MAX_DIST_SQ);

    is_out_of_range | is_turned_away
}

#[cold]
fn limited_weights(importance: &Lanes) -> Lanes {
    scale_unresolved(importance, unresolved_scale(resolved_sum(importance), unresolved_sum(importance)))
}

/// The sum of the resolved importances.
#[inline(always)]
pub(crate) fn resolved_sum(importance: &Lanes) -> f32 {
    running_sums(&importance.map(|importance| max(importance, 0.0)))[WIDTH - 1]
}

/// The sum of the unresolved importances.
pub(crate) fn unresolved_sum(importance: &Lanes) -> f32 {
    resolved_sum(&importance.map(|importance| -importance))
}

/// The factor that limits the sum of all unresolved importances to that of the others. If there are
/// no others, there is no limit.
///
/// Equal parts make the worst case the best: the relative variance is at most 1, whether the
/// unresolved children send nothing or everything.
pub(crate) fn unresolved_scale(others: f32, unresolved: f32) -> f32 {
    if others > 0.0 && unresolved > others { others / unresolved } else { 1.0 }
}

/// Turns importances into weights: multiplies those of unresolved children by `scale`, and makes
/// them positive.
pub(crate) fn scale_unresolved(importance: &Lanes, scale: f32) -> Lanes {
    importance.map(|importance| if importance < 0.0 { max(-importance * scale, MIN_IMPORTANCE) } else { importance })
}

/// Whether the bounds prove that no light of a child reaches the shading point. `margin` is the
/// largest rounding error of a position.
#[inline(always)]
fn is_provably_dark(child: &Unpacked, view: &ClusterView, local: &LocalShadingPoint, margin: f32) -> bool {
    let (mut dist_sq, mut along) = (0.0, 0.0);
    for k in 0..3 {
        dist_sq += child.center[k] * child.center[k];
        along -= child.axis[k] * child.center[k];
    }

    let [x, y, z] = local.normal.to_array();
    let rise = view.highest + margin * (x.abs() + y.abs() + z.abs());
    let is_below_horizon = local.has_normal & (rise <= 0.0);

    let reach = child.range * (1.0 + COSINE_MARGIN);
    let is_out_of_range =
        (child.range < UNLIMITED_RANGE) & (view.gap_sq > reach * reach) & (view.gap_sq <= MAX_DIST_SQ);

    // Everything is turned away if, with the angle b beyond the cap at which the box's centre sees
    // the shading point and the box's bounding sphere of radius r at the distance d, sin(b) d > r,
    // or if b is beyond a right angle and the shading point is outside the sphere.
    let across = max(dist_sq - along * along, 0.0).sqrt();
    let cos = child.cos_half_angle;
    let sin = max(1.0 - cos * cos, 0.0).sqrt();
    let slack = ANGLE_MARGIN * (along.abs() + across) + margin;
    let radius = child.radius_sq.sqrt() + slack;
    let beyond = across * cos - along * sin;
    let is_behind = (beyond > 0.0) & (along * cos + across * sin < -slack) & (dist_sq > radius * radius);
    let is_turned_away = (cos > -1.0) & ((beyond > radius) | is_behind) & (dist_sq <= MAX_DIST_SQ);

    is_below_horizon | is_out_of_range | is_turned_away
}

/// The sums of the first one, two, ... values; the last is the sum of all. Three steps instead of
/// seven.
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

/// Faster than [`f32::max`], which takes several instructions to discard NaN on either side. A NaN
/// in `a` is discarded; only a shading point whose position is no number makes one, and its
/// importances become the least.
#[inline(always)]
pub(crate) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
pub(crate) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[cfg(test)]
mod tests;
