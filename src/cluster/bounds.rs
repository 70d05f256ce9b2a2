//! Axis-aligned boxes. Rounding only makes them larger.

use bytemuck::{Pod, Zeroable};
use glam::{Mat3, Vec3};

/// Relative outward padding of a transformed box. Three products and sums in f32 lose at most 4 ulp
/// (2.4e-7) of the largest term. Twice as much covers the caller's own rounding of the transform.
pub(crate) const TRANSFORM_PADDING: f32 = 5.0e-7;

/// An axis-aligned box in metres. [`Aabb::EMPTY`] contains nothing and is the identity of
/// [`Aabb::union`].
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Aabb {
    /// Least corner.
    pub min: Vec3,
    /// Greatest corner.
    pub max: Vec3,
}

impl Aabb {
    /// Contains nothing: `min` is +infinity and `max` is -infinity.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The box of one point.
    pub fn point(p: Vec3) -> Self {
        Self { min: p, max: p }
    }

    /// The smallest box around some points. Empty if there are none.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| b.union(&Self::point(p)))
    }

    /// Whether the box contains nothing.
    pub fn is_empty(&self) -> bool {
        self.min.x > self.max.x
    }

    /// The smallest box around both boxes.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether `other` lies inside. Every box contains the empty box.
    pub fn contains(&self, other: &Self) -> bool {
        other.is_empty() || (self.min.cmple(other.min).all() && self.max.cmpge(other.max).all())
    }

    /// The centre. NaN for an empty box.
    pub fn center(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    /// The edge lengths. Zero for an empty box.
    pub fn extent(&self) -> Vec3 {
        if self.is_empty() { Vec3::ZERO } else { self.max - self.min }
    }

    /// The sum of the three edge lengths. Unlike area and volume it is positive for a street of
    /// lamps.
    pub fn half_perimeter(&self) -> f32 {
        self.extent().element_sum()
    }

    /// The intersection of both boxes. Empty if they do not meet.
    pub fn intersection(&self, other: &Self) -> Self {
        let b = Self { min: self.min.max(other.min), max: self.max.min(other.max) };
        if b.min.cmple(b.max).all() { b } else { Self::EMPTY }
    }

    /// The box around this box after the transform `x -> linear * x + translation`, rounded
    /// outward.
    ///
    /// Source: Arvo, Transforming Axis-Aligned Bounding Boxes (Graphics Gems, 1990).
    #[must_use]
    pub fn transformed(&self, linear: &Mat3, translation: Vec3) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let center = self.center();
        // Measure the half extent from the rounded centre, which may not be the exact one.
        let half = (self.max - center).max(center - self.min);
        let moved = *linear * center + translation;
        let absolute = Mat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
        let size = absolute * (center.abs() + half) + translation.abs();
        let reach = absolute * half + size * TRANSFORM_PADDING;
        Self { min: moved - reach, max: moved + reach }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transformed_box_contains_the_exact_images_of_its_corners() {
        let b = Aabb { min: Vec3::new(1.0e6, -3.0, 0.1), max: Vec3::new(1.0e6 + 1.0, 7.0, 0.3) };
        let linear = Mat3::from_cols(Vec3::new(0.3, -1.7, 0.2), Vec3::new(11.0, 0.01, -3.0), Vec3::new(0.4, 0.5, -0.6));
        let t = Vec3::new(-3.0e5, 12.0, 9.0);
        let moved = b.transformed(&linear, t);
        for corner in 0..8u32 {
            let pick = |k: usize| f64::from(if corner >> k & 1 == 0 { b.min[k] } else { b.max[k] });
            for row in 0..3 {
                let exact = (0..3).map(|k| f64::from(linear.col(k)[row]) * pick(k)).sum::<f64>() + f64::from(t[row]);
                assert!(f64::from(moved.min[row]) <= exact && exact <= f64::from(moved.max[row]));
            }
        }
    }

    #[test]
    fn the_empty_box_is_the_identity_of_union_and_stays_empty_after_a_transform() {
        let b = Aabb::around([Vec3::ONE, Vec3::NEG_ONE]);
        assert_eq!(Aabb::EMPTY.union(&b), b);
        assert!(Aabb::EMPTY.transformed(&Mat3::IDENTITY, Vec3::ONE).is_empty());
        assert_eq!(Aabb::EMPTY.half_perimeter(), 0.0);
        assert!(b.contains(&Aabb::EMPTY));
    }
}
