//! Published light trees to compare with: binary, one light a leaf, each written from its formulas.

mod bounds;
mod cycles;
mod pbrt;
mod saoh;
mod tree;

pub use cycles::Cycles;
pub use pbrt::Pbrt;
pub use tree::{BinaryTree, Formula};
