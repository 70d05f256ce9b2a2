//! The buffers of the top level whose sizes follow the number of parts.

use super::super::buffers::BufferId;
use super::super::draft::Draft;
use super::super::error::PlanError;
use super::super::layout::{ClusterRecord, LeafRecord};
use super::super::node_record::NodeRecord;
use super::super::sort::SortBuffers;
use super::partition::PlanesRecord;
use crate::top::PARTS_PER_RUN;
use crate::top::masks::NodeMasks;

/// The bytes of a divided node, and of the root of a block.
const PARTITION_BYTES: u64 = size_of::<PlanesRecord>() as u64 + 4;

/// The bytes of the masks of one node.
const MASK_BYTES: u64 = size_of::<NodeMasks>() as u64;

/// The number of nodes of the partition that room is planned for where it is not known: one for so many parts. Cells
/// hold five parts or more in most worlds.
const PARTS_PER_NODE: u32 = 4;

/// The parameters of a dispatch. Twin of `TopPass` in `shaders/top_types.wgsl`, which explains the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct TopPass {
    pub count: u32,
    pub capacity: u32,
    pub parts: u32,
    pub nodes: u32,
    pub runs: u32,
    pub is_divided: u32,
    pub blocks: u32,
    pub block_count: u32,
    pub masks: u32,
    pub sort_block: u32,
    pub padding: [u32; 2],
    /// The sector whose centre the origin is.
    pub home: [i32; 3],
    pub padding_after: u32,
}

/// The numbers of parts and of nodes of the partition that there is room for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Capacity {
    pub parts: u32,
    pub nodes: u32,
}

impl Capacity {
    /// Room for so many parts in most worlds.
    fn of_parts(parts: u32) -> Self {
        Self { parts, nodes: parts.div_ceil(PARTS_PER_NODE) }
    }

    /// The nodes of the partition, and runs.
    fn all_nodes(self) -> u64 {
        u64::from(self.nodes) + u64::from(self.parts) / PARTS_PER_RUN as u64
    }
}

/// How many quads of maps there are beside the top level in its buffer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct MapQuads {
    /// Whether each node has masks.
    pub has_masks: bool,
    /// Of the portals.
    pub portals: u32,
    /// Of the tables of profiles.
    pub profiles: u32,
    /// Of the map of the sky.
    pub sky: u32,
}

impl MapQuads {
    /// Whether there is room in these for others.
    pub(super) fn hold(self, other: Self) -> bool {
        self.has_masks >= other.has_masks
            && self.portals >= other.portals
            && self.profiles >= other.profiles
            && self.sky >= other.sky
    }
}

#[derive(Clone, Debug)]
pub(super) struct TopBuffers {
    pub capacity: Capacity,
    pub sizes: Sizes,
    /// The nodes, portals, the parts, the masks of the nodes if they are stored, profiles, and the map of the sky.
    pub nodes: BufferId,
    /// How many quads of portals, of profiles and of the sky's map there is room for.
    pub map_quads: MapQuads,
    /// The clusters of all parts, then of all nodes.
    pub clusters: BufferId,
    /// The divided nodes of the partition, then the roots of blocks.
    pub partition: BufferId,
    /// What each node of the partition is as a child.
    pub units: BufferId,
    pub sort: SortBuffers,
}

impl TopBuffers {
    /// Fails with [`PlanError::Full`] if a buffer of so much room would be larger than `limit`.
    pub(super) fn fit(capacity: Capacity, maps: MapQuads, limit: u64) -> Result<(), PlanError> {
        Sizes::of(capacity, maps).check(limit)?;
        SortBuffers::fit(capacity.parts, limit)
    }

    /// Room for parts, nodes and maps; `partition` is the present one if it is large enough.
    pub(super) fn new(capacity: Capacity, partition: Option<BufferId>, maps: MapQuads, draft: &mut Draft) -> Self {
        let sizes = Sizes::of(capacity, maps);
        Self {
            capacity,
            sizes,
            map_quads: maps,
            sort: SortBuffers::new(capacity.parts, draft),
            nodes: draft.storage("top level nodes", sizes.nodes),
            clusters: draft.storage("top level clusters", sizes.clusters),
            partition: partition
                .unwrap_or_else(|| draft.storage("top level partition", u64::from(capacity.nodes) * PARTITION_BYTES)),
            units: draft.storage("top level units", 4 * u64::from(capacity.nodes)),
        }
    }

    /// All buffers.
    pub(super) fn ids(&self) -> impl Iterator<Item = BufferId> {
        [self.nodes, self.clusters, self.partition, self.units].into_iter().chain(self.sort.ids())
    }
}

/// The bytes of the buffers for a number of parts, and where the parts, the masks and the map of the sky, before which
/// profiles lie, begin in the buffer of the nodes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    pub parts: u64,
    pub masks: u64,
    pub sky_map: u64,
    pub nodes: u64,
    clusters: u64,
}

impl Sizes {
    fn of(capacity: Capacity, maps: MapQuads) -> Self {
        let count = capacity.all_nodes();
        let nodes = count * size_of::<NodeRecord>() as u64;
        let parts = nodes + 16 * u64::from(maps.portals);
        let masks = parts + u64::from(capacity.parts) * size_of::<LeafRecord>() as u64;
        let profiles = masks + if maps.has_masks { count * MASK_BYTES } else { 0 };
        let sky_map = profiles + 16 * u64::from(maps.profiles);
        Self {
            parts,
            masks,
            sky_map,
            nodes: sky_map + 16 * u64::from(maps.sky),
            clusters: (u64::from(capacity.parts) + count) * size_of::<ClusterRecord>() as u64,
        }
    }

    /// Fails if a buffer would be larger than `limit`. The others are smaller than these two.
    fn check(&self, limit: u64) -> Result<(), PlanError> {
        for (what, needed) in [("top-level clusters", self.clusters), ("top-level nodes", self.nodes)] {
            if needed > limit {
                return Err(PlanError::Full { what, needed, limit });
            }
        }
        Ok(())
    }
}

/// The greatest number of nodes of a partition for which all buffers stay within `limit` beside `parts` parts, at
/// least 1.
pub(super) fn most_nodes(parts: u32, maps: MapQuads, limit: u64) -> u32 {
    most(1, |nodes| Sizes::of(Capacity { parts, nodes }, maps).check(limit).is_ok())
}

/// The greatest number of parts for which all buffers of most worlds stay within `limit`; 0 if none do.
pub(super) fn most_parts(maps: MapQuads, limit: u64) -> u32 {
    most(0, |parts| TopBuffers::fit(Capacity::of_parts(parts), maps, limit).is_ok())
}

/// The greatest number that fits, at least `most`.
fn most(mut most: u32, fits: impl Fn(u32) -> bool) -> u32 {
    let mut too_many = u32::MAX;
    while too_many - most > 1 {
        let middle = most.midpoint(too_many);
        if fits(middle) { most = middle } else { too_many = middle }
    }
    most
}
