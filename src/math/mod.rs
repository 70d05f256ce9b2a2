//! Numbers and geometry that know nothing about lights: loops in vector instructions and on threads, random numbers
//! and probabilities, solid angles.

pub(crate) mod dice;
pub(crate) mod parallel;
pub(crate) mod simd;
pub(crate) mod solid_angle;
