//! What a frame changes, found out before anything is written.

use std::collections::BTreeMap;
use std::ops::Range;

use super::changes::FrameChanges;
use super::draft::Growth;
use super::layout::{InstanceRecord, LightRecord, TreeRecord};
use super::node_record::NodeRecord;
use super::pool::Pool;
use super::residency::TreeState;
use super::scatter::{MAX_TARGETS, RunCount};
use super::tree_writes::TreeRuns;
use crate::world::LightWorld;

/// The bytes of a record of each pool that takes short runs from staged records: of nodes, lights, trees and
/// instances.
pub(super) const STRIDES: [u64; MAX_TARGETS] = [
    Pool::<NodeRecord>::STRIDE,
    Pool::<LightRecord>::STRIDE,
    Pool::<TreeRecord>::STRIDE,
    Pool::<InstanceRecord>::STRIDE,
];

/// What a frame changes, as far as it was found out before anything is written.
pub(super) struct Frame<'a> {
    pub world: &'a LightWorld,
    pub changes: FrameChanges,
    pub trees: TreeFrame,
    /// The runs of slots of the instances that are written.
    pub instance_runs: Vec<Range<u32>>,
    /// The runs of records that are written to the pools of nodes, lights, trees and instances, which ones of them
    /// take their short runs from staged records, and the bytes of these.
    pub counts: [RunCount; MAX_TARGETS],
    pub is_scattered: [bool; MAX_TARGETS],
    pub staged_bytes: u64,
}

/// The trees that a frame places, and what it writes of them.
#[derive(Debug)]
pub(super) struct TreeFrame {
    pub growth: Growth,
    /// The device lacks what it had, which is sent first.
    pub is_lost: bool,
    /// The former states of the trees whose place or form changes, by slot.
    pub placed: BTreeMap<u32, TreeState>,
    /// Bytes of new trees that may still be sent: none while all trees start anew as stand-ins, which leaves as much
    /// room as possible.
    pub left: u64,
    pub is_anew: bool,
    pub writes: TreeRuns,
}

impl TreeFrame {
    pub fn new(growth: Growth, is_lost: bool, is_anew: bool) -> Self {
        Self { growth, is_lost, placed: BTreeMap::new(), left: 0, is_anew, writes: TreeRuns::default() }
    }
}
