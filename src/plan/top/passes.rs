//! The passes of a top-level build: how many, and where each reads and writes.

use super::super::layout::Strides;
use super::super::sort::SortBuffers;
use crate::top;

/// The greatest number of nodes of a piece, and of the last one, which is the whole tree and whose
/// tiny parts have nodes of their own.
pub(super) const MAX_NODES: u32 = (top::most_nodes(top::PIECE) + 1 + top::MAX_TINY) as u32;

/// The value of [`TopPass::units_before`] in the first pass, whose units are the sorted parts.
pub(super) const FIRST_PASS: u32 = u32::MAX;

/// The largest number of passes. Each leaves one of 51 units, so six are enough for any number of
/// parts.
pub(super) const MAX_PASSES: u32 = 6;

/// The words in a list of units before its first entry, for `pieces` pieces.
const fn header_words(pieces: u32) -> u32 {
    1 + 3 * pieces
}

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
    pub sort_block: u32,
    pub padding: u32,
    /// The sector whose centre the origin is; not set but in the first pass.
    pub home: [i32; 3],
    pub padding_after: u32,
}

/// Where the parts, the masks and the map of the sky, before which profiles lie, begin in the buffer of the nodes, in units of 16 bytes. `masks`
/// is 0 if they are not stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Places {
    pub parts: u32,
    pub masks: u32,
    pub sky_map: u32,
}

/// The passes of a build.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Passes {
    /// The last makes the root.
    pub passes: Vec<TopPass>,
    /// The number of nodes that there is room for.
    pub nodes: u32,
    /// The number of words in the lists of units.
    pub words: u32,
}

impl Passes {
    /// The passes for the first `count` parts in buffers for `capacity` parts. `places` is where the
    /// parts and the masks begin in the buffer of the nodes, in units of 16 bytes.
    pub(super) fn new(count: u32, capacity: u32, places: Places, strides: Strides) -> Self {
        let Places { parts, masks, .. } = places;
        let mut pass =
            TopPass { count, capacity, parts, units_before: FIRST_PASS, strides, masks, ..TopPass::default() };
        pass.sort_block = SortBuffers::block_keys(count);
        let mut all = Self { passes: Vec::new(), nodes: MAX_NODES, words: 0 };
        let mut units = count;
        while units > top::PIECE as u32 {
            pass.pieces = units.div_ceil(top::SHARE as u32);
            pass.units_after = all.words;
            pass.first_node = all.nodes;
            // Fewer units than are expected make fewer pieces, of which each may leave more.
            let left = (top::LEFT as u32 * pass.pieces).max(top::PIECE as u32);
            all.words += header_words(pass.pieces) + left;
            all.nodes += top::most_nodes(units as usize) as u32;
            all.passes.push(pass);
            units = left;
            (pass.units_before, pass.pieces_before) = (pass.units_after, pass.pieces);
        }
        all.passes.push(TopPass { units_after: all.words, pieces: 0, first_node: 0, ..pass });
        all.words += header_words(1);
        all
    }
}
