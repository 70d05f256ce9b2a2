//! The WGSL texts of the build's stages.

use std::fmt::Write;

use super::super::sort;
use super::super::text::{Extras, constants, variant};
use super::buffers::{BOX_AT, LENS_AT, LISTS_AT, PLANES_AT, SPACE_WORDS};
use super::passes::{FIRST_PASS, MAX_NODES};
use crate::cluster;
use crate::cluster::bounds;
use crate::cluster::cone;
use crate::effects::Effects;
use crate::top;
use crate::tree;
use crate::tree::space_order;

/// Invocations in a workgroup of the stages that take parts one by one. Half of WebGPU's limit,
/// because merging clusters takes many registers.
pub(super) const LANES: u32 = 128;

/// Invocations in a workgroup that splits a piece.
pub(super) const SPLIT_LANES: u32 = 256;

/// Invocations in a workgroup that packs the nodes of a piece, eight for each node. The deepest nodes
/// of a piece are about fifty.
pub(in crate::plan) const NODE_LANES: u32 = 128;

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
pub(super) const PLANES: Stage = Stage { entry: "top_planes", sources: &[shader!("top_space"), shader!("top_planes")] };
pub(super) const KEYS: Stage =
    Stage { entry: "top_keys", sources: &[sort::HISTOGRAM, shader!("top_space"), shader!("top_keys")] };
pub(super) const GROUP: Stage = Stage {
    entry: "top_group",
    sources: &[
        shader!("top_space"),
        shader!("top_split"),
        shader!("top_gather"),
        shader!("top_children"),
        shader!("node_store"),
        shader!("top_layout"),
        shader!("top_group"),
    ],
};
pub(super) const NODE: Stage = Stage {
    entry: "top_node",
    sources: &[
        shader!("node_store"),
        shader!("top_layout"),
        shader!("pack_merge"),
        shader!("top_pack"),
        shader!("top_node"),
    ],
};

impl Stage {
    /// The whole text: the constants, the records, the shared functions, and the stage's own files.
    pub(super) fn text(&self) -> String {
        let mut text = constants() + &sort::constants();
        for (name, value) in [
            ("LANES", LANES),
            ("KEY_BITS", space_order::KEY_BITS),
            ("SAMPLES", space_order::SAMPLES as u32),
            ("LEVELS", space_order::LEVELS),
            ("LEVEL_SAMPLES", space_order::LEVEL_SAMPLES as u32),
            ("PLANE_BITS", space_order::PLANE_BITS),
            ("PLANES", 1 << space_order::PLANE_BITS),
            ("NO_AXIS", space_order::NO_AXIS as u32),
            ("BOX_AT", BOX_AT),
            ("LENS_AT", LENS_AT),
            ("LEAST_LENGTH", (space_order::LEAST_LENGTH + 127) as u32),
            ("PLANES_AT", PLANES_AT),
            ("LISTS_AT", LISTS_AT),
            ("SPACE_WORDS", SPACE_WORDS),
            ("NO_KEY", space_order::NO_KEY),
            ("SPLIT_LANES", SPLIT_LANES),
            ("NODE_LANES", NODE_LANES),
            ("PIECE", top::PIECE as u32),
            ("SHARE", top::SHARE as u32),
            ("LEFT", top::LEFT as u32),
            ("FIRST_PASS", FIRST_PASS),
            ("UNITS_PER_NODE", top::UNITS_PER_NODE as u32),
            ("MAX_NODES", MAX_NODES),
            ("BINS", top::BINS as u32),
            ("SMALL", top::SMALL as u32),
            ("LARGE_ROUNDS", top::LARGE_ROUNDS as u32),
            ("SMALL_ROUNDS", top::SMALL_ROUNDS as u32),
            ("LARGE_HALVINGS", top::LARGE_HALVINGS as u32),
            ("SMALL_HALVINGS", top::SMALL_HALVINGS as u32),
            ("MAX_CUTS", top::MAX_CUTS as u32),
            ("CELL_BITS", top::CELL_BITS),
            ("FLUX_BITS", top::FLUX_BITS),
            ("COST_SLACK", top::COST_SLACK),
            ("DIAGONAL_SHARE", top::DIAGONAL_SHARE),
            ("MAX_ZOOM", top::MAX_ZOOM as u32),
            ("TINY_SHARE", top::TINY_SHARE as u32),
            ("MASK_ROUNDED", top::masks::ROUNDED),
            ("SPARSE_COUNTS", tree::SPARSE_COUNTS),
            ("FULL", tree::FULL as u32),
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
