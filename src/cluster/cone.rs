//! Cones of directions (spherical caps), which bound the directions that lights emit to.
//!
//! Based on CK18 4.1. Differs: one cap of *emission* directions replaces the cone of normals and
//! the angle of emission (docs/math.md). A group's cap is about its mean direction, so both share
//! one axis.

use std::f32::consts::PI;

use glam::Vec3;

/// Subtracted from the cosine of every cap that is merged from others. In f32, cosines and sines of
/// directions are accurate to a few 1e-7, and the sine of a cap of 1e-3 rad, from its cosine, to
/// 1e-4.
pub(crate) const CAP_PADDING: f32 = 5.0e-4;

/// All directions within `half_angle` of `axis`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Unit vector.
    pub axis: Vec3,
    /// Radians in [0, pi].
    pub half_angle: f32,
}

impl Cone {
    /// Contains every direction.
    pub const FULL: Self = Self { axis: Vec3::Z, half_angle: PI };

    /// Whether the cone contains every direction.
    pub fn is_full(&self) -> bool {
        self.half_angle >= PI
    }

    /// Whether the cone contains a direction, given as a unit vector.
    pub fn contains(&self, direction: Vec3) -> bool {
        self.is_full() || angle(self.axis, direction) <= self.half_angle
    }
}

/// The angle between two unit vectors in radians, accurate for all angles.
///
/// Source: Kahan, How Futile are Mindless Assessments of Roundoff (2006), section 12.
pub(crate) fn angle(a: Vec3, b: Vec3) -> f32 {
    2.0 * (a - b).length().atan2((a + b).length())
}

/// Cosine of the half-angle of the cap about `axis` that contains the cap about `other` with the
/// cosine `cos_half_angle`; -1 if that is every direction. `axis` and `other` are unit vectors.
/// Twin of `cap_about` in `shaders/cluster.wgsl`.
#[inline(always)]
pub(crate) fn cap_about(axis: [f32; 3], other: [f32; 3], cos_half_angle: f32) -> f32 {
    let [a, b] = [axis, other];
    let cos = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    // Take the sine from the cross product: the root of 1 - cos² has no digits left where the axes
    // agree.
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let sin = (cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]).sqrt();
    let rest = 1.0 - cos_half_angle * cos_half_angle;
    let sin_half_angle = if rest > 0.0 { rest } else { 0.0 }.sqrt();
    let reach = cos * cos_half_angle - sin * sin_half_angle - CAP_PADDING;
    // The sine of the sum of both angles is negative once the sum exceeds half a turn.
    let is_beyond = sin * cos_half_angle + cos * sin_half_angle < 0.0;
    if is_beyond || cos_half_angle <= -1.0 || reach < -1.0 { -1.0 } else { reach }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn directions() -> impl Iterator<Item = Vec3> {
        (0..2000).map(|i| {
            let z = 1.0 - (2.0 * i as f32 + 1.0) / 2000.0;
            let (s, c) = (i as f32 * 2.399_963_2).sin_cos();
            Vec3::new(c, s, 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z
        })
    }

    #[test]
    fn a_cap_about_any_axis_contains_every_direction_of_the_other_cap() {
        let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::new(1.0, 1e-6, 0.0).normalize(), Vec3::NEG_Z];
        for a in axes {
            for b in axes {
                for half_angle in [0.0, 1e-4, 1e-2, 0.3, 1.5, PI / 2.0, 1.6, 3.0, PI - 1e-3, PI] {
                    let cap = cap_about(a.to_array(), b.to_array(), half_angle.cos());
                    let inner = Cone { axis: b, half_angle };
                    for d in directions().chain([a, b]).filter(|d| inner.contains(*d)) {
                        assert!(f64::from(a.dot(d)) >= f64::from(cap) - 1.0e-7, "{a} {b} {half_angle} {cap} {d}");
                    }
                    // It is hardly wider: its cosine is that of the sum of both angles, less the
                    // padding.
                    let sum = (angle(a, b) + half_angle).min(PI);
                    assert!(cap >= sum.cos() - CAP_PADDING - 4.0e-4, "{a} {b} {half_angle} {cap}");
                }
            }
        }
    }
}
