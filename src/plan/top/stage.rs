//! The WGSL texts of the build's stages.

use std::mem::offset_of;

use super::super::sort;
use super::super::text::wgsl_of_kernel;
use super::partition::PlanesRecord;
use crate::cluster;
use crate::cluster::bounds;
use crate::cluster::cone;
use crate::top;
use crate::top::stages::BLOCK;
use crate::tree;

/// Invocations in a workgroup of the stages that take parts one by one. Half of WebGPU's limit,
/// because merging clusters takes many registers.
pub(super) const LANES: u32 = 128;

/// Invocations in a workgroup that packs nodes, eight for each node.
pub(in crate::plan) const NODE_LANES: u32 = 128;

/// Cells of more parts are packed by all invocations of a workgroup: eight have memory for a node of four runs.
const MANY: u32 = 4 * tree::WIDTH as u32;

/// What packs a node.
pub(super) const PACKING: [&str; 4] =
    [shader!("dice"), shader!("node_store"), shader!("pack_merge"), shader!("top_pack")];

/// The text of a stage: the records, the shared functions, and the stage's own files.
pub(super) fn text(own: &[&str]) -> String {
    let words = |bytes: usize| (bytes / 4) as u32;
    let whole = [
        ("TOP_LANES", LANES),
        ("TOP_NO_KEY", u32::MAX),
        ("TOP_NODE_LANES", NODE_LANES),
        ("TOP_HELD", BLOCK as u32),
        ("TOP_MANY", MANY),
        ("TOP_PARTS_PER_RUN", top::PARTS_PER_RUN as u32),
        ("TOP_PLANES_WORDS", words(size_of::<PlanesRecord>())),
        ("TOP_PLANE_PLACES", words(offset_of!(PlanesRecord, at))),
        ("TOP_PLANE_SECTORS", words(offset_of!(PlanesRecord, sectors))),
        ("TOP_PLANE_CODES", words(offset_of!(PlanesRecord, codes))),
        ("TOP_PLANE_CHILDREN", words(offset_of!(PlanesRecord, children))),
        ("TOP_BY_IDENTITY", tree::BY_IDENTITY.into()),
        ("TOP_EXIT", tree::EXIT.into()),
        ("TOP_MASK_ROUNDED", top::masks::ROUNDED),
    ];
    let real = [
        ("CAP_PADDING", cone::CAP_PADDING),
        ("MIN_AXIS", cluster::MIN_AXIS),
        ("TRANSFORM_PADDING", bounds::TRANSFORM_PADDING),
    ];
    let shared = [shader!("types"), shader!("instance"), shader!("node"), shader!("top_types"), shader!("cluster")];
    wgsl_of_kernel(&[&sort::CONSTANTS[..], &whole].concat(), &real, &[&shared[..], own].concat())
}
