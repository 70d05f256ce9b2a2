//! Numbers and vectors that are f32 or f64, so that one formula can be evaluated in both.
//!
//! The operations on vectors are those of glam, which round in f32 as they do in a renderer that
//! uses glam.

use girandole::glam::{DQuat, DVec3, Quat, Vec3};
use num_traits::{Float, FloatConst};
use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// f32 or f64.
pub trait Real: Float + FloatConst + Debug + Default + Send + Sync + Into<f64> + 'static {
    /// A vector of three such numbers.
    type Vec3: Vector<Self>;

    /// The nearest number.
    fn of(value: f64) -> Self;
}

/// A vector of three numbers.
pub trait Vector<R>:
    Copy
    + Debug
    + PartialEq
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + Mul<R, Output = Self>
    + Div<R, Output = Self>
    + 'static
{
    const ZERO: Self;
    const Z: Self;

    fn splat(value: R) -> Self;
    fn from_array(values: [R; 3]) -> Self;
    fn to_array(self) -> [R; 3];
    /// The nearest vector.
    fn of(vector: DVec3) -> Self;
    fn as_dvec3(self) -> DVec3;

    fn dot(self, other: Self) -> R;
    fn cross(self, other: Self) -> Self;
    fn length(self) -> R;
    fn length_squared(self) -> R;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn abs(self) -> Self;
    fn element_sum(self) -> R;
    fn normalize(self) -> Self;
    /// `None` for a vector without a direction: zero, too short or not finite.
    fn try_normalize(self) -> Option<Self>;
    /// The vector after a turn about a unit vector, by an angle in radians.
    fn turned(self, axis: Self, angle: R) -> Self;

    fn normalize_or(self, fallback: Self) -> Self {
        self.try_normalize().unwrap_or(fallback)
    }

    fn normalize_or_zero(self) -> Self {
        self.normalize_or(Self::ZERO)
    }

    fn distance(self, other: Self) -> R {
        (self - other).length()
    }
}

macro_rules! real {
    ($real:ty, $vector:ty, $quaternion:ty) => {
        impl Real for $real {
            type Vec3 = $vector;

            fn of(value: f64) -> Self {
                value as Self
            }
        }

        impl Vector<$real> for $vector {
            const ZERO: Self = Self::ZERO;
            const Z: Self = Self::Z;

            fn splat(value: $real) -> Self {
                Self::splat(value)
            }

            fn from_array(values: [$real; 3]) -> Self {
                Self::from_array(values)
            }

            fn to_array(self) -> [$real; 3] {
                Self::to_array(&self)
            }

            fn of(vector: DVec3) -> Self {
                Self::from_array(vector.to_array().map(<$real as Real>::of))
            }

            fn as_dvec3(self) -> DVec3 {
                DVec3::from_array(self.to_array().map(f64::from))
            }

            fn dot(self, other: Self) -> $real {
                Self::dot(self, other)
            }

            fn cross(self, other: Self) -> Self {
                Self::cross(self, other)
            }

            fn length(self) -> $real {
                Self::length(self)
            }

            fn length_squared(self) -> $real {
                Self::length_squared(self)
            }

            fn min(self, other: Self) -> Self {
                Self::min(self, other)
            }

            fn max(self, other: Self) -> Self {
                Self::max(self, other)
            }

            fn abs(self) -> Self {
                Self::abs(self)
            }

            fn element_sum(self) -> $real {
                Self::element_sum(self)
            }

            fn normalize(self) -> Self {
                Self::normalize(self)
            }

            fn try_normalize(self) -> Option<Self> {
                Self::try_normalize(self)
            }

            fn turned(self, axis: Self, angle: $real) -> Self {
                <$quaternion>::from_axis_angle(axis, angle) * self
            }
        }
    };
}

real!(f32, Vec3, Quat);
real!(f64, DVec3, DQuat);
