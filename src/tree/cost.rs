//! What a group of lights costs, as an attribute of a tree. `shape/group.rs` has the same measure for four groups at
//! once.
//!
//! Source: CK18 4.2 (surface area orientation heuristic). Differs: orientation is measured by the mean direction, which
//! adds up over bins, instead of by cones, which need trigonometry (docs/decisions.md, 2); a group's size is measured
//! so that a street of collinear lamps, whose box has no area, still has a cost.

use crate::light::LAMBERTIAN;

/// Weight of the squared diagonal beside the half area in a group's size. Small, so that it decides only where the
/// areas vanish.
pub(crate) const DIAGONAL_WEIGHT: f32 = 0.05;

/// A group's size in square metres, from its box's edges.
#[inline(always)]
pub(super) fn size([x, y, z]: [f32; 3]) -> f32 {
    x * y + y * z + z * x + DIAGONAL_WEIGHT * (x * x + y * y + z * z)
}

/// How widely a group emits, from the length of its mean direction: 4 pi to all sides, pi for flat emitters that agree
/// (length 2/3), 0 for a beam. Meets the orientation measure of CK18 equation 1 at these three; needs no cone.
#[inline(always)]
pub(super) fn orientation(axis_length: f32) -> f32 {
    let wide = 4.0 - (3.0 / LAMBERTIAN) * axis_length;
    let narrow = 3.0 * (1.0 - axis_length);
    let spread = if axis_length <= LAMBERTIAN { wide } else { narrow };
    std::f32::consts::PI * if spread > 0.0 { spread } else { 0.0 }
}
