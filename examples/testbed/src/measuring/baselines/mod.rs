//! Published light trees to compare with, written from their formulas: binary, with one light per
//! leaf. One has a second variant on the nodes of this library.

mod attributes;
mod bounds;
mod cycles;
pub mod lightcuts;
pub mod moving;
mod pbrt;
mod saoh;
mod sg;
mod tree;

pub use cycles::Cycles;
pub use pbrt::Pbrt;
pub use sg::GaussianTree;
pub use tree::{BinaryTree, Formula};
