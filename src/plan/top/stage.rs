//! The WGSL texts of the build's stages.

use std::fmt::Write;
use std::mem::offset_of;

use super::super::sort;
use super::super::text::{Extras, constants, variant};
use super::partition::PlanesRecord;
use crate::cluster;
use crate::cluster::bounds;
use crate::cluster::cone;
use crate::effects::Effects;
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

/// One stage of the build.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stage {
    /// The name of the entry point.
    pub entry: &'static str,
    /// The texts of the files that only some stages have.
    sources: &'static [&'static str],
}

macro_rules! shader {
    ($name:literal) => {
        include_str!(concat!("../../../shaders/", $name, ".wgsl"))
    };
}

pub(super) const LEAVES: Stage = Stage { entry: "top_leaves", sources: &[shader!("top_leaves")] };
pub(super) const KEYS: Stage = Stage { entry: "top_keys", sources: &[sort::HISTOGRAM, shader!("top_keys")] };
pub(super) const CELLS: Stage = Stage { entry: "top_cells", sources: &[PACKING, shader!("top_cells")] };
pub(super) const BLOCKS: Stage = Stage { entry: "top_blocks", sources: &[PACKING, shader!("top_blocks")] };

/// What packs a node.
const PACKING: &str = concat!(
    include_str!("../../../shaders/dice.wgsl"),
    include_str!("../../../shaders/node_store.wgsl"),
    include_str!("../../../shaders/pack_merge.wgsl"),
    include_str!("../../../shaders/top_pack.wgsl")
);

impl Stage {
    /// The whole text: the constants, the records, the shared functions, and the stage's own files.
    pub(super) fn text(&self) -> String {
        let words = |bytes: usize| (bytes / 4) as u32;
        let mut text = constants() + &sort::constants();
        for (name, value) in [
            ("LANES", LANES),
            ("NO_KEY", u32::MAX),
            ("NODE_LANES", NODE_LANES),
            ("HELD", BLOCK as u32),
            ("MANY", MANY),
            ("PARTS_PER_RUN", top::PARTS_PER_RUN as u32),
            ("PLANES_WORDS", words(size_of::<PlanesRecord>())),
            ("PLANE_PLACES", words(offset_of!(PlanesRecord, at))),
            ("PLANE_SECTORS", words(offset_of!(PlanesRecord, sectors))),
            ("PLANE_CODES", words(offset_of!(PlanesRecord, codes))),
            ("PLANE_CHILDREN", words(offset_of!(PlanesRecord, children))),
            ("BY_IDENTITY", tree::BY_IDENTITY.into()),
            ("EXIT", tree::EXIT.into()),
            ("MASK_ROUNDED", top::masks::ROUNDED),
        ] {
            let _ = writeln!(text, "const TOP_{name}: u32 = {value}u;");
        }
        for (name, value) in [
            ("CAP_PADDING", cone::CAP_PADDING),
            ("MIN_AXIS", cluster::MIN_AXIS),
            ("TRANSFORM_PADDING", bounds::TRANSFORM_PADDING),
        ] {
            let _ = writeln!(text, "const {name}: f32 = {:e};", f64::from(value));
        }
        for part in [shader!("types"), shader!("instance"), shader!("node"), shader!("top_types"), shader!("cluster")] {
            text += part;
        }
        text += &self.sources.concat();
        variant(&text, Effects::all(), Extras::default())
    }
}
