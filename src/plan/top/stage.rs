//! The WGSL texts of the build's stages.

use std::fmt::Write;

use super::super::text::{Extras, constants, variant};
use super::rounds::{FIRST_ROUND, MAX_GROUPS, ROOT_PARTS};
use crate::bounds;
use crate::cluster;
use crate::cone;
use crate::curve;
use crate::effects::Effects;
use crate::top;
use crate::tree;

/// Invocations in a workgroup of the stages that split no units. Half of WebGPU's limit, because
/// merging clusters takes many registers.
pub(super) const LANES: u32 = 128;

/// Invocations in a workgroup that splits a piece.
pub(super) const SPLIT_LANES: u32 = 256;

/// One stage of the build.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stage {
    /// The name of the entry point.
    pub entry: &'static str,
    /// The largest number of units that one workgroup splits; 0 for stages that split none.
    pub piece: usize,
    /// The texts of the files that only some stages have.
    sources: &'static [&'static str],
}

macro_rules! shader {
    ($name:literal) => {
        include_str!(concat!("../../../shaders/", $name, ".wgsl"))
    };
}

pub(super) const LEAVES: Stage = Stage { entry: "top_leaves", piece: 0, sources: &[shader!("top_leaves")] };
pub(super) const KEYS: Stage =
    Stage { entry: "top_keys", piece: 0, sources: &[shader!("top_curve"), shader!("top_keys")] };
pub(super) const GROUP: Stage = Stage {
    entry: "top_group",
    piece: top::PIECE,
    sources: &[
        shader!("top_curve"),
        shader!("top_split"),
        shader!("top_gather"),
        shader!("top_store"),
        shader!("top_group"),
    ],
};
pub(super) const NODE: Stage =
    Stage { entry: "top_node", piece: 0, sources: &[shader!("top_store"), shader!("top_pack"), shader!("top_node")] };
pub(super) const ROOT_GROUP: Stage = Stage {
    entry: "top_root_group",
    piece: top::ROOT_UNITS,
    sources: &[shader!("top_split"), shader!("top_gather"), shader!("top_store"), shader!("top_root_group")],
};
pub(super) const ROOT: Stage =
    Stage { entry: "top_root", piece: 0, sources: &[shader!("top_store"), shader!("top_pack"), shader!("top_root")] };

impl Stage {
    /// The whole text: the constants, the records, the shared functions, and the stage's own files.
    pub(super) fn text(&self) -> String {
        let mut text = constants();
        for (name, value) in [
            ("LANES", LANES),
            ("KEY_BITS", curve::KEY_BITS),
            ("NO_KEY", curve::NO_KEY),
            ("SPLIT_LANES", SPLIT_LANES),
            ("PIECE", self.piece as u32),
            ("MAX_GROUPS", MAX_GROUPS),
            ("SHARE", top::SHARE as u32),
            ("WINDOW", top::WINDOW as u32),
            ("FIRST_ROUND", FIRST_ROUND),
            ("ROOT_UNITS", top::ROOT_UNITS as u32),
            ("ROOT_PARTS", ROOT_PARTS),
            ("CUTS", top::CUTS as u32),
            ("CUT_BITS", top::CUT_BITS),
            ("COST_SLACK", top::COST_SLACK),
            ("ROUNDS", top::ROUNDS as u32),
            ("LAST_CELL", top::LAST_CELL),
            ("SPARSE_COUNTS", tree::SPARSE_COUNTS),
            ("FULL", tree::FULL as u32),
        ] {
            let _ = writeln!(text, "const TOP_{name}: u32 = {value}u;");
        }
        for (name, value) in [
            ("TOP_AXIS_STEPS", top::AXIS_STEPS),
            ("TOP_MIN_ORIENTATION", tree::MIN_ORIENTATION),
            ("TOP_DIAGONAL_WEIGHT", tree::DIAGONAL_WEIGHT),
            ("CAP_PADDING", cone::CAP_PADDING),
            ("MIN_AXIS", cluster::MIN_AXIS),
            ("TRANSFORM_PADDING", bounds::TRANSFORM_PADDING),
        ] {
            let _ = writeln!(text, "const {name}: f32 = {value:e};");
        }
        for part in [shader!("types"), shader!("instance"), shader!("node"), shader!("top_types"), shader!("cluster")] {
            text += part;
        }
        text += &self.sources.concat();
        variant(&text, Effects::all(), Extras::default())
    }
}
