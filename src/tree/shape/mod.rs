//! The shape of a tree: which lights and nodes are the children of which node.
//!
//! Based on CK18 4.2-4.4. Differs: the binary splits are collected into wide nodes (`children.rs`).

mod bins;
mod children;
mod counts;
mod group;
mod median;
mod planes;
mod shaping;
mod sides;
mod split;
#[cfg(test)]
mod tests;

pub(crate) use group::BuildItem;
#[cfg(feature = "gpu-plan")]
pub(crate) use planes::BY_IDENTITY;
pub(crate) use planes::{EXIT, Planes, divide};
pub(super) use shaping::Shaping;
pub(crate) use shaping::{ShapeNode, shape};
