//! Which records of the parts of a tree a plan writes.

use std::ops::Range;

use super::reserve::{Source, TreeWrite};
use crate::part::Division;
use crate::tree::{Section, WIDTH};

/// The runs of records that are written along with these runs of nodes and lights. They are relative
/// to the first of the tree's `count` records.
///
/// What the record of a section says is in the node above it, and what that of a light says is in
/// the light. Other records say something of the whole tree.
pub(super) fn written_records(
    write: &TreeWrite,
    division: Division,
    sections: &[Section],
    count: usize,
    [nodes, lights]: [&[Range<u32>]; 2],
) -> impl Iterator<Item = Range<u32>> {
    let none: &[Range<u32>] = &[];
    let (all, of_nodes, of_lights) = match division {
        _ if matches!(write.source, Source::Piece) => (0, none, none),
        Division::Sections(_) if !write.has_new_records => (0, nodes, none),
        Division::Lights if !write.has_new_records => (0, none, lights),
        _ => (count as u32, none, none),
    };
    let first_below = |node: u32| sections.partition_point(|section| section.place / (WIDTH as u32) < node) as u32;
    let below = move |run: &Range<u32>| first_below(run.start)..first_below(run.end);
    let runs = std::iter::once(0..all).chain(of_nodes.iter().map(below)).chain(of_lights.iter().cloned());
    runs.filter(|run| !run.is_empty())
}
