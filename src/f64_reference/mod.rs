//! A reference in f64 for what the library computes in f32: the merging of clusters, their
//! placement in the world, their importance, and the choice down two levels of trees.
//!
//! Importance, gloss and choice are in `testbed`, since programs use them too. It is built with the
//! library as its users see it, whose records have other types than those of the tests and the same
//! bytes.

mod merge;
mod place;
mod tests;

/// Half an ulp of 1 in f32: the relative error of one rounding.
const ROUNDING: f64 = 0.5 * f32::EPSILON as f64;
