//! Published light trees to compare with, written from their formulas: binary, with one light per
//! leaf. One has a second variant on the nodes of this library.

mod tree;
mod pbrt;
mod cycles;
mod sg;
pub mod moving;

pub use cycles::Cycles;
pub use pbrt::Pbrt;
pub use sg::GaussianTree;
pub use tree::{BinaryTree, Formula};
