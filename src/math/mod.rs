//! Numbers and geometry that know nothing about lights: loops in vector instructions, random numbers
//! and probabilities, solid angles.

pub(crate) mod dice;
pub(crate) mod simd;
pub(crate) mod solid_angle;
