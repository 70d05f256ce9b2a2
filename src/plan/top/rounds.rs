//! The rounds of a top-level build: how many, and where each reads and writes.

use super::super::layout::Strides;
use crate::top;

/// The largest number of units that a piece leaves.
pub(super) const MAX_GROUPS: u32 = top::most_units(top::PIECE) as u32;

/// The number of parts of the upper part of the tree: every split makes two parts of one.
pub(super) const ROOT_PARTS: u32 = 2 * top::ROOT_UNITS as u32 - 1;

/// The value of [`TopPass::units_before`] in the first round, whose units are the sorted parts.
pub(super) const FIRST_ROUND: u32 = u32::MAX;

/// The largest number of passes, the upper part included. Each round leaves hardly more than a
/// quarter of its units, so 16 passes are enough for any number of parts.
pub(super) const MAX_PASSES: u32 = 16;

/// Twin of `TopPass` in `shaders/top_types.wgsl`, which explains the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct TopPass {
    pub count: u32,
    pub capacity: u32,
    pub parts: u32,
    pub units_before: u32,
    pub pieces_before: u32,
    pub units_after: u32,
    pub pieces: u32,
    pub first_node: u32,
    pub strides: Strides,
    pub masks: u32,
    pub padding: [u32; 2],
    /// The sector whose centre the origin is; not set but in the first pass.
    pub home: [i32; 3],
    pub padding_after: u32,
}

/// Where the parts and the masks begin in the buffer of the nodes, in units of 16 bytes. `masks` is
/// 0 if they are not stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Places {
    pub parts: u32,
    pub masks: u32,
}

/// The rounds of a build.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Rounds {
    /// The rounds, and the upper part as the last.
    pub passes: Vec<TopPass>,
    /// The number of nodes that there is room for.
    pub nodes: u32,
    /// The number of words in the lists of units.
    pub words: u32,
}

impl Rounds {
    /// The passes for the first `count` parts in buffers for `capacity` parts. `places` is where the
    /// parts and the masks begin in the buffer of the nodes, in units of 16 bytes.
    pub(super) fn new(count: u32, capacity: u32, places: Places, strides: Strides) -> Self {
        let Places { parts, masks } = places;
        let mut pass =
            TopPass { count, capacity, parts, units_before: FIRST_ROUND, strides, masks, ..TopPass::default() };
        let mut rounds = Self { passes: Vec::new(), nodes: ROOT_PARTS + 1, words: 0 };
        let mut units = count;
        while units > top::ROOT_UNITS as u32 {
            pass.pieces = units.div_ceil(top::SHARE as u32);
            pass.units_after = rounds.words;
            pass.first_node = rounds.nodes;
            rounds.words += pass.pieces + (pass.pieces * MAX_GROUPS).max(top::ROOT_UNITS as u32);
            rounds.nodes += pass.pieces * MAX_GROUPS;
            rounds.passes.push(pass);
            // Each piece leaves a quarter of its units, rounded up.
            units = (units / 4 + pass.pieces).min(pass.pieces * MAX_GROUPS);
            (pass.units_before, pass.pieces_before) = (pass.units_after, pass.pieces);
        }
        rounds.passes.push(TopPass { units_after: rounds.words, pieces: 0, first_node: 0, ..pass });
        rounds.words += ROOT_PARTS;
        rounds
    }
}
