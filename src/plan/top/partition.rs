//! The partition of the top level on the GPU: the records of its divided nodes, and the blocks of each stage.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::super::buffers::BufferId;
use super::super::commands::Commands;
use super::super::runs::runs;
use crate::top::partition::{Divided, Partition, ROOT};
use crate::tree::{NO_PARENT, WIDTH};

/// Unchanged records between two changed ones that are sent with them, in place of a command more.
const GAP: u32 = 3;

/// A divided node. See `top_planes` in `shaders/top_types.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct PlanesRecord {
    bits: u32,
    parent: u32,
    pub at: [u32; WIDTH - 1],
    pub sectors: [i32; WIDTH - 1],
    pub codes: [u32; WIDTH / 2],
    pub children: [u32; WIDTH],
}

impl PlanesRecord {
    fn of(parent: u32, divided: &Divided) -> Self {
        let Divided { planes, sectors, children, stage, .. } = divided;
        let mut codes = [0; WIDTH / 2];
        for plane in 0..planes.count {
            let [below, above] = planes.ways[plane].map(u32::from);
            let code = u32::from(planes.axes[plane]) | below << 2 | above << 6;
            codes[plane / 2] |= code << (16 * (plane % 2));
        }
        let bits = u32::from(stage.same) | u32::from(stage.divided) << 8;
        Self { bits, parent, at: planes.at, sectors: *sectors, codes, children: *children }
    }
}

/// The roots of the blocks that a stage packs, as a range of all roots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct StageBlocks {
    pub first: u32,
    pub count: u32,
}

/// What the GPU has of a partition.
#[derive(Clone, Debug, Default)]
pub(super) struct SentPartition {
    /// The partition and the number of its last change that was sent; 0 for none.
    id: u64,
    number: u64,
    /// The roots of the blocks of all stages.
    roots: Arc<[u32]>,
    pub stages: Arc<[StageBlocks]>,
    pub nodes: u32,
    pub is_divided: bool,
}

impl SentPartition {
    /// The device may lack what was sent.
    pub fn lose(&mut self) {
        self.id = 0;
    }

    /// Sends what changed to a buffer of so many records, after which come the roots. O(nodes) if anything changed.
    pub fn send(&mut self, commands: &mut Commands, buffer: BufferId, capacity: u32, partition: &Partition) {
        if self.id != partition.id() {
            (self.id, self.number) = (partition.id(), 0);
        }
        if self.number == partition.number() {
            return;
        }
        const BYTES: u64 = size_of::<PlanesRecord>() as u64;
        let changed = partition.all_divided().filter(|(.., number, _)| *number > self.number);
        for run in runs(changed.map(|(node, ..)| node), GAP) {
            // Cells have no records.
            let record = |node| {
                let divided = partition.divided(node);
                divided.map_or_else(PlanesRecord::default, |divided| PlanesRecord::of(partition.parent(node), divided))
            };
            let records: Vec<PlanesRecord> = run.clone().map(record).collect();
            commands.write(buffer, BYTES * u64::from(run.start), bytemuck::cast_slice(&records));
        }
        let former = self.roots.clone();
        self.list_roots(partition);
        if self.roots != former || self.number == 0 {
            commands.write(buffer, BYTES * u64::from(capacity), bytemuck::cast_slice(&self.roots));
        }
        self.number = partition.number();
        self.nodes = partition.len() as u32;
        self.is_divided = partition.divided(ROOT).is_some();
    }

    fn list_roots(&mut self, partition: &Partition) {
        let mut roots: Vec<(u8, u32)> = Vec::new();
        for (node, parent, _, divided) in partition.all_divided() {
            let above = (parent != NO_PARENT).then(|| partition.divided(parent / WIDTH as u32)).flatten();
            if above.is_none_or(|above| above.stage.same >> (parent % WIDTH as u32) & 1 == 0) {
                roots.push((divided.stage.number, node));
            }
        }
        roots.sort_unstable();
        let mut stages: Vec<StageBlocks> = Vec::new();
        for (number, _) in &roots {
            let first = stages.iter().map(|stage| stage.count).sum();
            match stages.get_mut(usize::from(*number)) {
                Some(stage) => stage.count += 1,
                None => stages.push(StageBlocks { first, count: 1 }),
            }
        }
        self.stages = stages.into();
        self.roots = roots.into_iter().map(|(_, node)| node).collect();
    }
}
