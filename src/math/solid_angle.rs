//! Samples flat emitters uniformly by the solid angle that they subtend, where they are large or
//! near.
//!
//! Twin of `shaders/solid_angle.wgsl`. The map is that of Arvo, Stratified Sampling of Spherical
//! Triangles (1995), as in [PBRT4] 6.5.4: one number divides the solid angle, the other the height.
//! Differs: half angles replace all angles of the spherical triangle, so that nothing cancels, and
//! the result is a point of the plane triangle instead of a direction (docs/math.md).

use glam::Vec3;

/// The size of an emitter, as the sum of its squared edges over the squared distance of its centre,
/// from which on it is sampled by solid angle.
///
/// From here on sampling by area has at least 14 % more variance, and a sample by solid angle takes
/// 200 to 300 ns more. A lower limit would include lights where the time exceeds the gain
/// (docs/math.md has the measurement).
pub(crate) const NEAR_SIZE_SQ: f32 = 0.5;

/// The least determinant of the unit vectors to three corners. Below it a triangle is seen from its
/// edge, touched, or a sliver, and the rounding of its solid angle could exceed a percent.
pub(crate) const MIN_DETERMINANT: f32 = 3.0e-5;
/// The largest determinant of three unit vectors is 1. Larger ones follow from roundings alone.
pub(crate) const MAX_DETERMINANT: f32 = 1.5;

/// A flat emitter that is sampled by solid angle. Vectors lead from the shading point, in metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NearSurface {
    /// A triangle, or one half of a parallelogram.
    first: SphericalTriangle,
    /// The other half of a parallelogram.
    second: Option<SphericalTriangle>,
}

#[derive(Clone, Copy, Debug)]
struct SphericalTriangle {
    /// One corner, and the edges from it to the other two.
    corner: Vec3,
    edges: [Vec3; 2],
    /// Of the unit vectors to the corners.
    determinant: f32,
    /// In steradians.
    solid_angle: f32,
}

impl NearSurface {
    /// A parallelogram with this centre and these halves of its edges. `None` if it is to be
    /// sampled by area: it is small and far, touched, or seen from its edge.
    pub fn parallelogram(center: Vec3, half_u: Vec3, half_v: Vec3) -> Option<Self> {
        let (u, v) = (2.0 * half_u, 2.0 * half_v);
        is_near(center, u, v).then_some(())?;
        let first = SphericalTriangle::new(center - half_u - half_v, u, v)?;
        let second = SphericalTriangle::new(center + half_u + half_v, -u, -v)?;
        Some(Self { first, second: Some(second) })
    }

    /// A triangle with this corner and these edges from it. `None` as for
    /// [`NearSurface::parallelogram`].
    pub fn triangle(corner: Vec3, u: Vec3, v: Vec3) -> Option<Self> {
        is_near(corner + (u + v) * (1.0 / 3.0), u, v).then_some(())?;
        Some(Self { first: SphericalTriangle::new(corner, u, v)?, second: None })
    }

    /// The solid angle of the whole emitter, in steradians; its inverse is the density of each
    /// direction.
    pub fn solid_angle(&self) -> f32 {
        self.first.solid_angle + self.second.map_or(0.0, |second| second.solid_angle)
    }

    /// The vector to a point of the emitter. Numbers of `u` outside [0, 1] are clamped.
    pub fn sample(&self, u: [f32; 2]) -> Vec3 {
        let u = u.map(|u| u.clamp(0.0, 1.0));
        let at = u[0] * self.solid_angle();
        match self.second {
            Some(second) if at >= self.first.solid_angle => second.sample(at - self.first.solid_angle, u[1]),
            _ => self.first.sample(at, u[1]),
        }
    }
}

fn is_near(center: Vec3, u: Vec3, v: Vec3) -> bool {
    u.length_squared() + v.length_squared() >= NEAR_SIZE_SQ * center.length_squared()
}

impl SphericalTriangle {
    /// `None` if the triangle is touched, seen from its edge or a sliver.
    fn new(corner: Vec3, u: Vec3, v: Vec3) -> Option<Self> {
        let (to_u, to_v) = (corner + u, corner + v);
        let [a, b, c] = [corner, to_u, to_v].map(Vec3::length);
        (a.min(b).min(c) >= f32::MIN_POSITIVE).then_some(())?;
        let direction = corner / a;
        let determinant = u.cross(v).dot(direction).abs() / (b * c);
        (MIN_DETERMINANT..=MAX_DETERMINANT).contains(&determinant).then_some(())?;
        // Van Oosterom and Strackee (1983). The sum of the cosines follows from that of the
        // vectors.
        let sum = direction + to_u / b + to_v / c;
        let solid_angle = 2.0 * determinant.atan2(0.5 * (sum.length_squared() - 1.0));
        Some(Self { corner, edges: [u, v], determinant, solid_angle })
    }

    /// The vector to the point that has the solid angle `at` on one side, seen from the second
    /// corner, and a share `height` of the arc from the second corner to the opposite edge.
    fn sample(&self, at: f32, height: f32) -> Vec3 {
        let Self { corner, edges: [u, v], determinant, solid_angle } = *self;
        let (to_u, to_v) = (corner + u, corner + v);
        let [a_length, b_length, c_length] = [corner, to_u, to_v].map(Vec3::length);
        let (a, b, c) = (corner / a_length, to_u / b_length, to_v / c_length);
        // The arc from a to c, and the part of it up to the point that divides the solid angle;
        // both as the sine and cosine of half the angle.
        let (arc_sin, arc_cos) = (0.5 * (a - c).length(), 0.5 * (a + c).length());
        let (at_sin, at_cos) = (0.5 * at.min(solid_angle)).sin_cos();
        let sin = at_sin * (a + b).length_squared() * arc_sin * arc_cos;
        let cos = (at_cos * determinant - at_sin * (b.dot(c) - a.dot(b) * a.dot(c))).max(0.0);
        let opposite = corner + v * share([a_length, c_length], [sin, cos], [arc_sin, arc_cos]);
        // The arc from b to that point, and the part of it up to the sample.
        let opposite_length = opposite.length();
        let d = opposite / opposite_length;
        let (arc_sin, arc_cos) = ((0.5 * (b - d).length()).min(1.0), 0.5 * (b + d).length());
        let (sin, cos) = (height.sqrt() * arc_sin, (1.0 - height * arc_sin * arc_sin).sqrt());
        to_u + (opposite - to_u) * share([b_length, opposite_length], [sin, cos], [arc_sin, arc_cos])
    }
}

/// The share of a segment that is seen under a part of the angle of all of it.
///
/// `lengths` are the distances of its ends. The angles are given by the sine and cosine of their
/// halves, that of the part up to a common factor.
fn share(lengths: [f32; 2], [sin, cos]: [f32; 2], [all_sin, all_cos]: [f32; 2]) -> f32 {
    let before = lengths[0] * sin * cos;
    let after = lengths[1] * (all_sin * cos - all_cos * sin).max(0.0) * (all_cos * cos + all_sin * sin);
    // Both are 0 at most where the sample is the first end: then `cos` is above 0.
    if before > 0.0 { before / (before + after) } else { 0.0 }
}
