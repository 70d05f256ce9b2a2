//! Published light trees to compare with, written from their formulas: binary, with one light per
//! leaf.

mod attributes;
mod bounds;
mod cycles;
pub mod moving;
mod pbrt;
mod saoh;
mod tree;

pub use cycles::Cycles;
pub use pbrt::Pbrt;
pub use tree::{BinaryTree, Formula};
