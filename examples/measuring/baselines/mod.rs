//! Published light trees to compare with, written from their formulas: binary, with one light per
//! leaf.

mod bounds;
mod cycles;
mod pbrt;
mod saoh;
mod tree;

pub use cycles::Cycles;
pub use pbrt::Pbrt;
pub use tree::{BinaryTree, Formula};
