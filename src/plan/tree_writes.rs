//! What a plan writes of trees: runs of their nodes and lights, and the records of their parts.

use std::ops::Range;

use crate::tree::{LightTree, Opening, WIDTH};

/// What is written of one tree.
#[derive(Debug)]
pub(super) struct TreeWrite {
    pub slot: u32,
    pub source: Source,
    /// Shaders see the openings of the tree, unless they see stand-ins.
    pub is_opened: bool,
    /// The places in the pools of the first node and the first light of the tree.
    pub bases: [u32; 2],
    /// The records of all parts are written, and not only those that change with the nodes and lights.
    pub has_new_records: bool,
    /// Runs of its nodes and lights.
    pub runs: [Vec<Range<u32>>; 2],
}

#[derive(Debug)]
pub(super) enum Source {
    /// The tree, which is then up to date.
    Tree,
    /// Some of the tree.
    Piece,
    /// Stand-ins of the tree.
    StandIns(Box<LightTree>),
}

/// The runs of records that are written along with runs of nodes. They are relative to the first of the tree's `count`
/// records.
///
/// What the record of an opening says is in the node above it. The record of a tree without openings
/// says something of the whole tree.
pub(super) fn written_records<'a>(
    write: &'a TreeWrite,
    openings: &'a [Opening],
    count: usize,
) -> impl Iterator<Item = Range<u32>> + 'a {
    let none: &[Range<u32>] = &[];
    let (all, below) = match openings {
        _ if matches!(write.source, Source::Piece) => (0, none),
        [_, ..] if !write.has_new_records => (0, &write.runs[0][..]),
        _ => (count as u32, none),
    };
    let first_below = |node: u32| openings.partition_point(|opening| opening.place / (WIDTH as u32) < node) as u32;
    let below = below.iter().map(move |run| first_below(run.start)..first_below(run.end));
    std::iter::once(0..all).chain(below).filter(|run| !run.is_empty())
}
