//! A reference in f64 for what the library computes in f32: the merging of clusters, their
//! placement in the world, their importance, and the choice down two levels of trees.
//!
//! Written from docs/math.md and not from the code. It shares records and constants with the
//! library, and no function that computes: a mistake of the code is no mistake of the reference. It
//! reads packed nodes, which are what the library samples, so packing itself is not a part of the
//! differences. Only tests use it.

mod child;
mod choice;
mod gloss;
mod importance;
mod merge;
mod place;
mod tests;

/// Half an ulp of 1 in f32: the relative error of one rounding.
const ROUNDING: f64 = 0.5 * f32::EPSILON as f64;
