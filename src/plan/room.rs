//! What a frame needs before it changes anything: room in pools and buffers, and what will be
//! written.

use std::collections::BTreeMap;
use std::ops::Range;

use super::buffers::NewBuffer;
use super::opened::Opened;
use super::parts::{NewParts, RestartedParts};
use super::pool::{Growth, RestartedPool};
use super::previous::Copies;
use super::residency::{Incoming, Residency, TreeState};
use super::scatter::{self, RunCount};
use super::sources::NewSources;
use super::tree_writes::TreeRuns;
use super::uniforms::NewUniforms;

/// What a frame needs before it changes anything.
#[derive(Debug, Default)]
pub(super) struct Room {
    /// Nothing has changed in what shaders read.
    pub is_idle: bool,
    pub new_buffers: Vec<NewBuffer>,
    pub trees: TreeRoom,
    /// New ranges for the parts of instances.
    pub parts: NewParts,
    /// The ranges of parts before they were begun anew.
    pub restarted_parts: Option<RestartedParts>,
    /// The continuation of the table of instances.
    pub slots: Range<u32>,
    pub directionals: Option<Range<u32>>,
    pub sources: NewSources,
    pub runs: RecordRuns,
    pub uniforms: NewUniforms,
    /// Copies of the present buffers, for shaders that read those of the last frame.
    pub copies: Copies,
}

/// The places that trees get, and what is written of them.
#[derive(Debug, Default)]
pub(super) struct TreeRoom {
    pub growth: Growth,
    /// The device lacks what it had, which is sent first.
    pub is_lost: bool,
    /// The trees whose place or form changes, by slot.
    pub placed: BTreeMap<u32, TreeState>,
    /// The tree that is sent in pieces, after this frame.
    pub incoming: Option<Incoming>,
    /// Bytes of new trees that may still be sent.
    pub left: u64,
    /// No tree was found that can move to a gap.
    pub is_packed: bool,
    pub writes: TreeRuns,
    /// What was in the pools of trees before they were begun anew.
    pub restarted: Option<Box<RestartedTrees>>,
    /// Which trees were opened before, if that changes.
    pub formerly_opened: Option<Opened>,
}

/// The runs of records that are written, and which of them are staged.
#[derive(Debug, Default)]
pub(super) struct RecordRuns {
    /// The runs of slots of the instances that are written.
    pub instances: Vec<Range<u32>>,
    /// The runs of records that are written to these pools: nodes, lights, trees, instances.
    pub counts: [RunCount; scatter::MAX_TARGETS],
    /// Which of these pools take their short runs from staged records.
    pub is_scattered: [bool; scatter::MAX_TARGETS],
    pub staged_bytes: u64,
}

/// The most items of a list whose memory is kept for the next frame.
const KEPT: usize = 4096;

/// Lists that each frame fills anew. Their memory is kept: lists that grow are copied, and large
/// requests take the allocator longer than small ones.
#[derive(Debug, Default)]
pub(super) struct ReusedLists {
    pub trees: TreeRuns,
    pub instance_runs: Vec<Range<u32>>,
}

impl ReusedLists {
    /// Keeps the memory of the lists of a frame for the next one.
    pub fn keep(&mut self, mut trees: TreeRuns, mut instance_runs: Vec<Range<u32>>) {
        trees.runs.clear();
        trees.writes.clear();
        instance_runs.clear();
        trees.runs.shrink_to(KEPT);
        trees.writes.shrink_to(KEPT);
        instance_runs.shrink_to(KEPT);
        *self = Self { trees, instance_runs };
    }
}

/// The trees and their pools before a restart.
#[derive(Debug)]
pub(super) struct RestartedTrees {
    pub nodes: RestartedPool,
    pub lights: RestartedPool,
    pub records: RestartedPool,
    pub residency: Residency,
    pub directionals: Range<u32>,
}
