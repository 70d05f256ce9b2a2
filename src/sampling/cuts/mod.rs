//! Cuts that neighbours share: one cut for all shading points of a cell.
//!
//! A cell is a cube of the world and a direction of the normal, of a size that follows the pixels in
//! which it is seen. Shading points are marked; each cell then gets a cut that suits a few of its
//! points, with far more splits than a point could pay for alone, and all of its points choose from
//! it. docs/math.md, "Shared cuts", has the weights; docs/cuts.md says when to use them.

mod build;
pub(crate) mod builds;
mod cell;
mod marks;
pub(crate) mod options;
mod placed;
mod shared;
pub(crate) mod table;
