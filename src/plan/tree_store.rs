//! What the GPU holds of trees.

use std::collections::BTreeMap;
use std::ops::Range;

use super::PlanLimits;
use super::layout::{LightRecord, TreeRecord};
use super::node_record::NodeRecord;
use super::opened::Opened;
use super::pool::Pool;
use super::residency::{Incoming, Residency, TreeState};
use super::room::RestartedTrees;
use crate::world::LightWorld;

/// Records that the first buffer of each pool has room for.
const FIRST_RECORDS: u32 = 64;

/// The least memory of trees, in bytes: enough for the pools of an empty world.
const MIN_TREE_MEMORY: u64 = 128 * 1024;

/// Each of the two pools of trees gets at least one part in this many of the memory.
const LEAST_SHARE: u64 = 8;

/// About how many trees are looked at to divide the memory between nodes and lights.
const SAMPLED_TREES: u32 = 256;

/// The pools of trees, and where each tree is in them.
pub(super) struct TreeStore {
    pub limits: PlanLimits,
    pub nodes: Pool<NodeRecord>,
    pub lights: Pool<LightRecord>,
    /// The parts of trees.
    pub records: Pool<TreeRecord>,
    /// A range of the light pool.
    pub directionals: Range<u32>,
    pub residency: Residency,
    pub opened: Opened,
    /// The bytes of a limited memory that nodes and lights may take.
    pub shares: Option<[u64; 2]>,
    /// The limit of memory has changed since the last plan.
    pub is_resized: bool,
}

impl TreeStore {
    /// Nothing yet.
    pub fn new(limits: PlanLimits) -> Self {
        let limit = limits.largest_buffer;
        Self {
            limits,
            nodes: Pool::new("light tree nodes", FIRST_RECORDS, limit),
            lights: Pool::new("lights", FIRST_RECORDS, limit),
            records: Pool::new("light trees", FIRST_RECORDS / 4, limit),
            directionals: 0..0,
            residency: Residency::new(limits.tree_memory.is_some()),
            opened: Opened::ALL,
            shares: None,
            is_resized: false,
        }
    }

    /// Divides a limited memory between nodes and lights, in the ratio of their bytes in the world.
    /// The division stays the same once a pool has grown to its whole share.
    pub fn divide_memory(&mut self, world: &LightWorld) {
        let Some(memory) = self.limits.tree_memory.map(|memory| memory.max(MIN_TREE_MEMORY)) else {
            self.nodes.set_share(None);
            self.lights.set_share(None);
            return;
        };
        if let Some([nodes, lights]) = self.shares
            && (self.nodes.bytes() > nodes / 8 || self.lights.bytes() > lights / 8)
        {
            return;
        }
        let (mut nodes, mut lights) = (1, 1);
        let slots = self.residency.slots().max(world.tree_slot_count());
        for slot in (0..slots).step_by(slots.div_ceil(SAMPLED_TREES).max(1) as usize) {
            if let Some(tree) = world.tree_at(slot).and_then(|key| world.tree(key)) {
                nodes += (tree.nodes().len() * size_of::<NodeRecord>()) as u64;
                lights += (tree.lights().len() * size_of::<LightRecord>()) as u64;
            }
        }
        let least = memory / LEAST_SHARE;
        let share = (u128::from(memory) * u128::from(nodes) / u128::from(nodes + lights)) as u64;
        let share = share.clamp(least, memory - least);
        self.shares = Some([share, memory - share]);
        self.nodes.set_share(Some(share));
        self.lights.set_share(Some(memory - share));
    }

    /// Forgets where trees are, so that all of them are placed anew.
    pub fn restart(&mut self, world: &LightWorld) -> Box<RestartedTrees> {
        let restarted = RestartedTrees {
            nodes: self.nodes.restart(),
            lights: self.lights.restart(),
            records: self.records.restart(),
            residency: self.residency.restart(),
            directionals: std::mem::take(&mut self.directionals),
        };
        self.shares = None;
        self.divide_memory(world);
        Box::new(restarted)
    }

    /// Takes a restart back, after the pools were undone.
    pub fn restore(&mut self, former: RestartedTrees) {
        self.nodes.restore(former.nodes);
        self.lights.restore(former.lights);
        self.records.restore(former.records);
        self.residency = former.residency;
        self.directionals = former.directionals;
    }

    /// The state of a tree once those in `placed` replace the present ones.
    pub fn state_after<'a>(&'a self, slot: u32, placed: &'a BTreeMap<u32, TreeState>) -> &'a TreeState {
        placed.get(&slot).unwrap_or_else(|| self.residency.get(slot))
    }

    /// Frees the ranges of one state of a tree that another state of it does not have, and that are
    /// not those of a tree that is sent in pieces.
    pub fn release_others(&mut self, state: &TreeState, kept: &TreeState) {
        let incoming = self.residency.incoming.clone();
        let is_incoming = |nodes: &Range<u32>, of: fn(&Incoming) -> &Range<u32>| {
            incoming.as_ref().is_some_and(|incoming| of(incoming) == nodes)
        };
        if state.nodes != kept.nodes && !is_incoming(&state.nodes, |incoming| &incoming.nodes) {
            self.nodes.free(state.nodes.clone());
        }
        if state.lights != kept.lights && !is_incoming(&state.lights, |incoming| &incoming.lights) {
            self.lights.free(state.lights.clone());
        }
        if state.records != kept.records {
            self.records.free(state.records.clone());
        }
    }

    /// Frees the ranges of a tree that is sent in pieces, but for those of another one and those that
    /// shaders see.
    pub fn release_incoming(&mut self, incoming: Option<Incoming>, kept: Option<&Incoming>, seen: Option<&TreeState>) {
        let Some(incoming) = incoming else { return };
        let is_kept = |range: &Range<u32>, of: [Option<&Range<u32>>; 2]| of.contains(&Some(range));
        if !is_kept(&incoming.nodes, [kept.map(|kept| &kept.nodes), seen.map(|seen| &seen.nodes)]) {
            self.nodes.free(incoming.nodes);
        }
        if !is_kept(&incoming.lights, [kept.map(|kept| &kept.lights), seen.map(|seen| &seen.lights)]) {
            self.lights.free(incoming.lights);
        }
    }
}
