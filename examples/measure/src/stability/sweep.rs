//! What is varied, and in which steps.

use girandole::glam::{DVec3, dvec3};
use testbed::measuring::street::Street;

/// The direction in which the scene moves away from the origin, a unit vector.
const DIAGONAL: DVec3 = dvec3(0.48, 0.6, 0.64);

/// What a sweep varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sweep {
    /// All lengths.
    Scale,
    /// The distance between the scene and the origin.
    Distance,
    /// The brightness of the brightest light over that of the faintest, where all would be equal.
    Contrast,
}

impl Sweep {
    pub const ALL: [Self; 3] = [Self::Scale, Self::Distance, Self::Contrast];

    /// The name in the table.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scale => "scale",
            Self::Distance => "distance",
            Self::Contrast => "contrast",
        }
    }

    /// The value that leaves the scene as it is.
    pub fn base(self) -> f64 {
        match self {
            Self::Scale | Self::Contrast => 1.0,
            Self::Distance => 0.0,
        }
    }

    /// The values, ascending: two for each decade, or a few.
    pub fn values(self, is_quick: bool) -> Vec<f64> {
        let powers = |halves: std::ops::RangeInclusive<i32>, step: usize| {
            halves.step_by(step).map(|half| 10.0_f64.powf(0.5 * f64::from(half))).collect::<Vec<_>>()
        };
        match self {
            Self::Scale => powers(-12..=12, if is_quick { 6 } else { 1 }),
            Self::Distance => [vec![0.0], powers(0..=18, if is_quick { 6 } else { 1 })].concat(),
            Self::Contrast => powers(0..=48, if is_quick { 16 } else { 2 }),
        }
    }

    /// The scene at a value, around zero, and how far the samplers see it from zero.
    pub fn at(self, street: &Street, value: f64) -> (Street, DVec3) {
        match self {
            Self::Scale => (street.clone().scaled(value), DVec3::ZERO),
            Self::Distance => (street.clone(), DIAGONAL * value),
            Self::Contrast => (street.clone().with_contrast(value), DVec3::ZERO),
        }
    }
}
