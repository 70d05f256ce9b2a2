//! The cost of a group of lights: flux · size · orientation.
//!
//! Source: CK18 4.2 (surface area orientation heuristic). Differs: the orientation comes from the
//! mean direction, which adds up over bins, and not from cones, which need trigonometry
//! (docs/decisions.md, 2); the size counts the diagonal, so that a street of collinear lamps, whose
//! box has no area, still has a cost.
//!
//! Builds use [`build_cost`], for four groups at once (`shape/group.rs`). The attributes of a tree use [`size`] and
//! [`orientation`].

use std::f32::consts::PI;
use std::ops::{Add, Mul, Sub};

use glam::Vec4;

use crate::light::LAMBERTIAN;

/// Weight of the squared diagonal beside the half area in a group's size. It is small, so it
/// decides only where the areas vanish.
pub(crate) const DIAGONAL_WEIGHT: f32 = 0.05;

/// Orientation of emission to all sides. The unit is the orientation of flat emitters that agree.
pub(crate) const ALL_SIDES: f32 = 4.0;

/// How fast the orientation falls from [`ALL_SIDES`] to 1 as the length of the mean direction
/// rises to that of flat emitters that agree.
pub(crate) const FALL_TO_FLAT: f32 = 3.0 / LAMBERTIAN;

/// How fast it falls from there to 0 as the length rises to that of a beam.
pub(crate) const FALL_TO_BEAM: f32 = 3.0;

/// The least orientation in a build's cost, in the same unit. Beams that agree would have none, and
/// the rounding of f32 sums over a million directions would choose their splits.
pub(crate) const MIN_ORIENTATION: f32 = 1.0 / 256.0;

/// One number, or one number for each of several groups.
pub(crate) trait Lane:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Mul<f32, Output = Self>
{
}

impl Lane for f32 {}
impl Lane for Vec4 {}

/// A group's size in square metres, from the edges of its box.
#[inline(always)]
pub(crate) fn size<T: Lane>([x, y, z]: [T; 3]) -> T {
    x * y + y * z + z * x + (x * x + y * y + z * z) * DIAGONAL_WEIGHT
}

/// Flux times orientation while the mean direction is at most [`LAMBERTIAN`] long.
/// `directed` is the flux times that length.
#[inline(always)]
fn wide<T: Lane>(flux: T, directed: T) -> T {
    flux * ALL_SIDES - directed * FALL_TO_FLAT
}

/// Flux times orientation where the mean direction is longer.
#[inline(always)]
fn narrow<T: Lane>(flux: T, directed: T) -> T {
    (flux - directed) * FALL_TO_BEAM
}

/// The costs of four groups in a build. `size` is their [`size()`], the next argument is their flux times their
/// mean direction. This is equation 2 of CK18 but for a constant factor, with an orientation of at
/// least [`MIN_ORIENTATION`].
///
/// Multiplying by the orientation this way needs no division by the flux.
#[inline(always)]
pub(crate) fn build_cost(size: Vec4, [x, y, z]: [Vec4; 3], flux: Vec4) -> Vec4 {
    let directed = Vec4::from_array((x * x + y * y + z * z).to_array().map(f32::sqrt));
    size * wide(flux, directed).max(narrow(flux, directed)).max(flux * MIN_ORIENTATION)
}

/// How widely a group emits, in steradians, from the length of its mean direction: 4π to all sides,
/// π for flat emitters that agree (length 2/3), 0 for a beam, and linear in between. Agrees with
/// the orientation measure of CK18 equation 1 at these three lengths, and needs no cone.
#[inline(always)]
pub(super) fn orientation(axis_length: f32) -> f32 {
    let (wide, narrow) = (wide(1.0, axis_length), narrow(1.0, axis_length));
    let spread = if axis_length <= LAMBERTIAN { wide } else { narrow };
    PI * if spread > 0.0 { spread } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Edges, mean direction and flux of four groups: to all sides, flat, between flat and beam, a
    /// beam.
    const GROUPS: [([f32; 3], [f32; 3], f32); 4] = [
        ([3.0, 0.25, 7.0], [0.0, 0.0, 0.0], 5.0),
        ([100.0, 0.0, 0.0], [0.0, LAMBERTIAN, 0.0], 0.3),
        ([0.5, 1.5, 2.5], [0.5, -0.5, 0.5], 70.0),
        ([1.0, 1.0, 0.0], [0.0, 0.0, 1.0], 2.0),
    ];

    fn directed(group: &([f32; 3], [f32; 3], f32)) -> [f32; 3] {
        group.1.map(|v| v * group.2)
    }

    /// The cost of one group in a build.
    fn alone(size: f32, directed: [f32; 3], flux: f32) -> f32 {
        build_cost(Vec4::splat(size), directed.map(Vec4::splat), Vec4::splat(flux)).x
    }

    #[test]
    fn four_groups_at_once_cost_the_same_bits_as_one_group_alone() {
        let lanes = |of: &dyn Fn(usize) -> f32| Vec4::new(of(0), of(1), of(2), of(3));
        let edges = [0, 1, 2].map(|k| lanes(&|i| GROUPS[i].0[k]));
        let powers = [0, 1, 2].map(|k| lanes(&|i| directed(&GROUPS[i])[k]));
        let four = build_cost(size(edges), powers, lanes(&|i| GROUPS[i].2));
        let single = GROUPS.map(|group| alone(size(group.0), directed(&group), group.2));
        assert_eq!(four.to_array().map(f32::to_bits), single.map(f32::to_bits));
    }

    #[test]
    fn a_cost_in_a_build_is_that_of_the_attributes_but_for_a_factor_and_the_least_orientation() {
        for group in GROUPS {
            let length = group.1.iter().map(|v| v * v).sum::<f32>().sqrt();
            let measured = group.2 * size(group.0) * orientation(length) / PI;
            let least = group.2 * size(group.0) * MIN_ORIENTATION;
            let built = alone(size(group.0), directed(&group), group.2);
            assert!((built - measured.max(least)).abs() <= 1.0e-5 * built, "{built} {measured} {least}");
        }
    }

    #[test]
    fn costs_have_the_values_worked_out_by_hand() {
        // A box of 1 m x 2 m x 3 m has a half area of 11 m² and a squared diagonal of 14 m².
        let square_metres = 11.0 + 0.05 * 14.0;
        let close = |a: f32, b: f32| assert!((a - b).abs() <= 1.0e-5 * b.abs(), "{a} {b}");
        for (length, expected) in [(0.0, 4.0), (1.0 / 3.0, 2.5), (2.0 / 3.0, 1.0), (5.0 / 6.0, 0.5), (1.0, 1.0 / 256.0)]
        {
            close(alone(size([1.0, 2.0, 3.0]), [0.0, 10.0 * length, 0.0], 10.0), 10.0 * square_metres * expected);
        }
        close(orientation(0.0), 4.0 * PI);
        close(orientation(2.0 / 3.0), PI);
        assert_eq!(orientation(1.0), 0.0);
    }
}
