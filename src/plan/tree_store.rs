//! What the GPU holds of trees.

use std::ops::Range;

use super::PlanLimits;
use super::layout::{LightRecord, TreeRecord};
use super::node_record::NodeRecord;
use super::opened::Opened;
use super::pool::Pool;
use super::residency::Residency;
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
#[derive(Clone)]
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
    pub fn restart(&mut self, world: &LightWorld) {
        self.nodes.restart();
        self.lights.restart();
        self.records.restart();
        self.residency.restart();
        self.directionals = 0..0;
        self.shares = None;
        self.divide_memory(world);
    }
}
