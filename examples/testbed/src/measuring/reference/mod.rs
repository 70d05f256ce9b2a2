//! The choice of a light in f64: the importance of what nodes store, and the probability of every
//! light down two levels of trees.
//!
//! Written from docs/math.md and not from the code. It shares records with the library, and no
//! function that computes: a mistake of the code is no mistake of the reference. It reads packed
//! nodes, which are what the library samples, so packing itself is not a part of the differences.
//! The library's own tests include this folder as well.

pub mod child;
pub mod gloss;
pub mod place;

pub mod terms;

pub mod point;
pub mod segment;

pub mod importance;

pub mod choice;
pub mod rough;
