//! A reference in f64 for what the library computes in f32: the merging of clusters, their
//! placement in the world, their importance, and the choice down two levels of trees.
//!
//! Importance, gloss and choice are `formulas`, which programs use too. Only tests use this module.

#[path = "../../examples/measuring/reference/mod.rs"]
#[allow(dead_code, missing_docs, reason = "the programs use what the tests do not")]
mod formulas;
mod merge;
mod place;
mod tests;

/// Half an ulp of 1 in f32: the relative error of one rounding.
const ROUNDING: f64 = 0.5 * f32::EPSILON as f64;
