//! Cones of directions (spherical caps): where a group of lights sends light.
//!
//! Based on CK18 4.1 and the cone union of pbrt-v4. Differs: one cap of *emission* directions instead of a normal
//! cone and an emission angle (docs/math.md); angles by atan2, so that neither narrow cones nor opposite axes lose
//! digits; opposite axes give a cap about a perpendicular, never a half sphere that misses one of the two.

use std::f32::consts::PI;

use glam::Vec3;

/// Added to the half-angle of every union, in radians: atan2, sin and cos are good to a few 1e-7.
pub(crate) const UNION_PADDING: f32 = 1.0e-6;

/// All directions within `half_angle` of `axis`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Unit vector.
    pub axis: Vec3,
    /// Radians in [0, pi]; negative for the empty cone.
    pub half_angle: f32,
}

impl Cone {
    /// Holds no direction; the identity of [`Cone::union`].
    pub const EMPTY: Self = Self { axis: Vec3::Z, half_angle: -1.0 };
    /// Holds every direction.
    pub const FULL: Self = Self { axis: Vec3::Z, half_angle: PI };

    /// True for the cone that holds no direction.
    pub fn is_empty(&self) -> bool {
        self.half_angle < 0.0
    }

    /// Whether the cone proves nothing.
    pub fn is_full(&self) -> bool {
        self.half_angle >= PI
    }

    /// A cone that holds both, at most a few 1e-6 rad wider than the smallest.
    pub fn union(&self, other: &Self) -> Self {
        let (a, b) = if self.half_angle >= other.half_angle { (self, other) } else { (other, self) };
        if b.is_empty() || a.is_full() {
            return *a;
        }
        let between = angle(a.axis, b.axis);
        if between + b.half_angle <= a.half_angle {
            return *a;
        }
        let half_angle = 0.5 * (a.half_angle + between + b.half_angle) + UNION_PADDING;
        if half_angle >= PI {
            return Self { axis: a.axis, half_angle: PI };
        }
        // Turn a's axis towards b's, in the plane of both; any plane will do when they are opposite.
        let toward = (b.axis - a.axis * a.axis.dot(b.axis)).normalize_or(a.axis.any_orthonormal_vector());
        let (sin, cos) = (half_angle - a.half_angle).sin_cos();
        Self { axis: (a.axis * cos + toward * sin).normalize_or(a.axis), half_angle }
    }

    /// Whether a unit direction lies inside.
    pub fn contains(&self, direction: Vec3) -> bool {
        !self.is_empty() && (self.is_full() || angle(self.axis, direction) <= self.half_angle)
    }
}

/// The angle between two unit vectors, accurate everywhere.
///
/// Source: Kahan, How Futile are Mindless Assessments of Roundoff (2006), section 12.
pub(crate) fn angle(a: Vec3, b: Vec3) -> f32 {
    2.0 * (a - b).length().atan2((a + b).length())
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
    fn a_union_holds_every_direction_of_both() {
        let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::new(1.0, 1e-6, 0.0).normalize(), Vec3::NEG_Z];
        for a in axes {
            for b in axes {
                for (p, q) in [(0.0, 0.0), (1e-4, 0.3), (1.5, 1.6), (PI / 2.0, PI / 2.0), (3.0, 0.2)] {
                    let (a, b) = (Cone { axis: a, half_angle: p }, Cone { axis: b, half_angle: q });
                    let both = a.union(&b);
                    assert!((both.axis.length() - 1.0).abs() < 1e-5);
                    for d in directions().filter(|d| a.contains(*d) || b.contains(*d)) {
                        assert!(both.contains(d), "{a:?} {b:?} {both:?} {d}");
                    }
                    assert!(both.contains(a.axis) && both.contains(b.axis));
                }
            }
        }
    }

    #[test]
    fn opposite_half_spheres_make_the_full_sphere() {
        let up = Cone { axis: Vec3::Y, half_angle: 0.5 * PI };
        let down = Cone { axis: Vec3::NEG_Y, half_angle: 0.5 * PI };
        assert!(up.union(&down).is_full());
        assert_eq!(Cone::EMPTY.union(&up), up);
        assert_eq!(up.union(&Cone::EMPTY), up);
    }
}
