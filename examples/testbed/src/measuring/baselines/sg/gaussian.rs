//! Integrals of spherical Gaussians with a peak of 1, over the sphere, over a hemisphere, and times
//! a clamped cosine.
//!
//! Source: Tokuyoshi et al. (2024) and its supplement, where the two blends between the poles were
//! fitted. All functions are free of branches, so that the compiler can use vectors. For that, exp
//! and erfc are polynomials here.

use std::f32::consts::{FRAC_1_PI, LN_2, LOG2_E, PI};

/// 1 / sqrt(pi).
const INVERSE_SQRT_PI: f32 = 0.564_189_6;
/// The least exponent. Its power leaves room for factors: denormal numbers take a hundred cycles.
const LEAST_EXPONENT: f32 = -40.0;
/// Added to a number of less than 22 bits, it leaves the nearest whole number in the last bits.
const ROUNDING: f32 = 12_582_912.0;
/// The sharpness below which closed forms lose digits and series take their place.
const SMALL: f32 = 0.5;

/// e^x for x at most 0; e^[`LEAST_EXPONENT`] at least. Relative error below 5e-6 above
/// that, from the rounding of the exponent.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    let power = max(x, LEAST_EXPONENT) * LOG2_E;
    let rounded = power + ROUNDING;
    let y = (power - (rounded - ROUNDING)) * LN_2;
    let series =
        ((((((1.0 / 720.0) * y + 1.0 / 120.0) * y + 1.0 / 24.0) * y + 1.0 / 6.0) * y + 0.5) * y + 1.0) * y + 1.0;
    let scale = f32::from_bits((rounded.to_bits() << 23).wrapping_add(127 << 23));
    scale * series
}

/// e^(x^2) erfc(x) for x at least 0. Relative error below 1e-6.
///
/// A minimax fit of degree 8 in 1 / (1 + x / 2).
#[inline(always)]
fn scaled_erfc(x: f32) -> f32 {
    let s = 1.0 / (1.0 + 0.5 * x);
    let high = (((-0.043_854_54 * s + 0.220_944_82) * s - 0.377_158_75) * s + 0.176_280_62) * s + 0.027_789_555;
    ((((high * s + 0.185_729_93) * s + 0.246_055_28) * s + 0.282_119_06) * s + 0.282_094_67) * s
}

/// The integral over the sphere: 4 pi for a sharpness of 0.
#[inline(always)]
pub fn integral(sharpness: f32) -> f32 {
    let series = 4.0 * PI * (1.0 - sharpness * (1.0 - sharpness * (2.0 / 3.0)));
    let closed = 2.0 * PI * (1.0 - exp(-2.0 * sharpness)) / sharpness;
    if sharpness < 1.0e-2 { series } else { closed }
}

/// The integral times the clamped cosine over pi. `cosine` is that of the angle between the axis
/// and the normal.
#[inline(always)]
pub fn cosine_integral(cosine: f32, sharpness: f32) -> f32 {
    let x = sharpness;
    // The closed forms for an axis along the normal and against it, over 2 pi.
    let fall = exp(-x);
    let inverse = 1.0 / x;
    let mean = (1.0 - fall) * inverse;
    let upper = if x < SMALL {
        0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0 - x * (1.0 / 720.0 - x * (1.0 / 5040.0)))))
    } else {
        (1.0 - mean) * inverse
    };
    let lower = if x < SMALL {
        0.5 - x * (1.0 / 3.0 - x * (1.0 / 8.0 - x * (1.0 / 30.0 - x * (1.0 / 144.0 - x * (1.0 / 840.0)))))
    } else {
        (mean - fall) * inverse
    };
    let lower = fall * lower;
    // The blend: the share of a Gaussian about the axis that is above the horizon, with a fitted
    // width 1 / t.
    let ratio = ((x + 2.736_083_2) * x + 17.021_298) / (((x + 4.010_082_7) * x + 15.219_156) * x + 76.087_9);
    let t = max(x * (0.5 * ratio).sqrt(), 1.0e-3);
    let height = t * cosine.abs();
    let (at_height, at_rim) = (exp(-height * height), exp(-t * t));
    let tail = at_height * scaled_erfc(height);
    let above = if cosine > 0.0 { 2.0 - tail } else { tail };
    let rest = at_rim * scaled_erfc(t) + (at_height - at_rim) * (INVERSE_SQRT_PI / t);
    let blend = clamp(0.5 * (cosine * above + rest));
    2.0 * (lower + (upper - lower) * blend)
}

/// The share of the integral that is in the hemisphere about a pole. `cosine` is that of the angle
/// between the axis and the pole.
#[inline(always)]
pub fn share_above(cosine: f32, sharpness: f32) -> f32 {
    let x = sharpness;
    let steepness = max(x * ((0.5 * x + 0.651_732_9) / ((x + 1.341_828) * x + 7.221_669)).sqrt(), 1.0e-3);
    let erf = |y: f32| 1.0 - exp(-y * y) * scaled_erfc(y);
    let half = 0.5 * erf(steepness * cosine.abs()) / erf(steepness);
    let blend = clamp(0.5 + if cosine > 0.0 { half } else { -half });
    let fall = exp(-x);
    (fall + (1.0 - fall) * blend) / (1.0 + fall)
}

/// The sharpness of the normalised SG whose mean direction has this length, below 1.
///
/// Source: Banerjee et al., Clustering on the Unit Hypersphere using von Mises-Fisher Distributions
/// (2005).
pub fn sharpness_of(length: f32) -> f32 {
    length * (3.0 - length * length) / (1.0 - length * length)
}

/// The intensity along the axis of a normalised SG, per unit of power.
pub fn peak(sharpness: f32) -> f32 {
    if sharpness > 0.0 { 1.0 / integral(sharpness) } else { 0.25 * FRAC_1_PI }
}

/// Unlike [`f32::max`], one instruction.
#[inline(always)]
pub fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Clamps to [0, 1].
#[inline(always)]
fn clamp(x: f32) -> f32 {
    let x = max(x, 0.0);
    if x < 1.0 { x } else { 1.0 }
}

#[cfg(test)]
mod tests;
