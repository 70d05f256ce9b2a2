//! Positions as a cell of a coarse grid and a rest, for worlds whose origin lies on that grid.
//!
//! A sector is a cube with an edge of [`ORIGIN_GRID`] metres whose centre lies on the grid. The
//! rest is at most half an edge along each axis, so f32 holds it to 15 micrometres anywhere in the
//! world. Relative to an origin on the grid, a position is the rest plus a whole number of edges.
//! f32 holds the length of these edges exactly, so the sum is rounded once (docs/math.md,
//! "Sectors").

use glam::{DVec3, Vec3};

/// The step of the grid that the origin of a world lies on, in metres: a power of two. See
/// [`LightWorld::set_origin_near`](crate::LightWorld::set_origin_near).
///
/// A larger step would move the origin less often and leave less precision: 2 to 4 km from the
/// origin, f32 resolves a quarter of a millimetre.
pub const ORIGIN_GRID: f64 = EDGE as f64;

/// The edge of a sector, in metres. A power of two, so that products with it are exact.
pub(crate) const EDGE: f32 = 1024.0;

/// A position that f32 coordinates relative to zero would round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SectorPoint {
    /// The centre of the sector, in metres. f32 holds it exactly up to 10^10 m: it is a multiple of
    /// the edge.
    pub center: Vec3,
    /// From the centre to the position, in metres.
    pub rest: Vec3,
}

impl SectorPoint {
    /// From a position with finite coordinates of at most 10^9 m. Positions that are a multiple of
    /// the grid apart have the same rest, bit for bit.
    pub fn new(position: DVec3) -> Self {
        let center = nearest(position);
        // Exact in f64, and rounded once.
        Self { center: center.as_vec3(), rest: (position - center).as_vec3() }
    }

    /// The position relative to the centre of another sector, rounded once. Twin of
    /// `light_from_home` in `shaders/instance.wgsl`, which has integers because shader compilers
    /// may reorder sums of floats.
    pub fn relative_to(&self, home: Vec3) -> Vec3 {
        self.rest + (self.center - home)
    }
}

/// The centre of the sector in which a position lies; the position must be finite.
pub(crate) fn nearest(position: DVec3) -> DVec3 {
    let sectors = position / ORIGIN_GRID;
    // Not `round`, which rounds ties away from zero, and not a sum with 0.5, which may round.
    let below = sectors.floor();
    let is_upper_half = (sectors - below).cmpge(DVec3::splat(0.5));
    (below + DVec3::select(is_upper_half, DVec3::ONE, DVec3::ZERO)) * ORIGIN_GRID
}

/// The number of a sector along each axis, from its centre.
pub(crate) fn number(center: Vec3) -> [i32; 3] {
    (center / EDGE).to_array().map(|sectors| sectors as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::dice::hash;

    /// A coordinate of up to 2^`bits` metres, in steps of 2^-22 m.
    fn coordinate(i: u32, bits: i32) -> f64 {
        let random = f64::from(hash(i)) / f64::from(u32::MAX) * 2.0 - 1.0;
        (random * f64::powi(2.0, bits + 22)).round() * f64::powi(2.0, -22)
    }

    #[test]
    fn a_position_is_its_sector_and_a_rest_of_at_most_half_an_edge() {
        for i in 0..30_000 {
            let position = DVec3::new(coordinate(3 * i, 29), coordinate(3 * i + 1, 20), coordinate(3 * i + 2, 9));
            let point = SectorPoint::new(position);
            assert!(point.rest.abs().max_element() <= 0.5 * EDGE, "{position}");
            assert!(point.center.to_array().iter().all(|v| v % EDGE == 0.0));
            let error = point.center.as_dvec3() + point.rest.as_dvec3() - position;
            assert!(error.abs().max_element() <= f64::powi(2.0, -16), "{position}: {error}");
        }
    }

    #[test]
    fn positions_a_multiple_of_the_grid_apart_have_the_same_rest() {
        for i in 0..30_000 {
            let edge = |k: u32| if (i + k).is_multiple_of(5) { 512.0 } else { coordinate(7 * i + k, 12) };
            let position = DVec3::new(edge(0), -edge(1), edge(2));
            let shift = DVec3::new(f64::from(hash(i) as i32 >> 13), f64::from(i) - 15_000.0, -9766.0) * ORIGIN_GRID;
            let (here, there) = (SectorPoint::new(position), SectorPoint::new(position + shift));
            assert_eq!((there.center - shift.as_vec3(), there.rest), (here.center, here.rest), "{position}");
        }
    }

    #[test]
    fn a_position_from_home_is_rounded_once() {
        for i in 0..30_000 {
            let position = DVec3::new(coordinate(5 * i, 29), coordinate(5 * i + 1, 16), coordinate(5 * i + 2, 12));
            let point = SectorPoint::new(position);
            let home = Vec3::new((hash(i) as i32 >> 12) as f32, 3.0, -((i % 7) as f32)) * EDGE;
            let exact = point.center.as_dvec3() - home.as_dvec3() + point.rest.as_dvec3();
            assert_eq!(point.relative_to(home), exact.as_vec3(), "{position}");
        }
    }
}
