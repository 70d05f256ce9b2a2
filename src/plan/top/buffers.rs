//! The buffers of the top level whose sizes follow the number of parts.

use super::super::buffers::{BufferId, Ids, NewBuffer};
use super::super::error::PlanError;
use super::super::layout::{ClusterRecord, LeafRecord, Strides};
use super::super::node_record::NodeRecord;
use super::super::sort::SortBuffers;
use super::passes::{Passes, Places};
use crate::effects::Effects;
use crate::tree::WIDTH;

/// The bytes of the masks of one node: a word for each child.
pub(super) const MASK_BYTES: u64 = 4 * WIDTH as u64;

/// The extremes of all means, the number of parts that are not dark, and one unused word.
pub(super) const BOUNDS_BYTES: u64 = 32;

#[derive(Clone, Debug)]
pub(super) struct TopBuffers {
    /// The number of parts that there is room for.
    pub capacity: u32,
    pub places: Places,
    pub bounds: BufferId,
    /// The nodes, then the parts, then the masks of the nodes if they are stored.
    pub nodes: BufferId,
    pub nodes_bytes: u64,
    /// The clusters of all parts, then of all nodes.
    pub clusters: BufferId,
    /// The lists of units that the passes leave.
    pub units: BufferId,
    pub sort: SortBuffers,
}

impl TopBuffers {
    /// Room for `capacity` parts, and for masks if `has_masks`. Adds the buffers to `new`. Fails
    /// with [`PlanError::Full`] if a buffer would be larger than `limit`.
    pub(super) fn new(
        ids: &mut Ids,
        new: &mut Vec<NewBuffer>,
        capacity: u32,
        has_masks: bool,
        limit: u64,
    ) -> Result<Self, PlanError> {
        let passes = Passes::new(capacity, capacity, Places::default(), Strides::of(Effects::all()));
        let parts = u64::from(passes.nodes) * size_of::<NodeRecord>() as u64;
        let masks = parts + u64::from(capacity) * size_of::<LeafRecord>() as u64;
        let nodes_bytes = masks + if has_masks { u64::from(passes.nodes) * MASK_BYTES } else { 0 };
        let clusters = (u64::from(capacity) + u64::from(passes.nodes)) * size_of::<ClusterRecord>() as u64;
        for (what, needed) in [("top-level clusters", clusters), ("top-level nodes", nodes_bytes)] {
            if needed > limit {
                return Err(PlanError::Full { what, needed, limit });
            }
        }
        let sort = SortBuffers::new(ids, new, capacity, limit)?;
        let mut add = |what, bytes| {
            let buffer = ids.storage(what, bytes);
            new.push(buffer);
            buffer.id
        };
        Ok(Self {
            capacity,
            // Within the limit of the buffer.
            places: Places { parts: (parts / 16) as u32, masks: if has_masks { (masks / 16) as u32 } else { 0 } },
            sort,
            bounds: add("top level bounds", BOUNDS_BYTES),
            nodes: add("top level nodes", nodes_bytes),
            nodes_bytes,
            clusters: add("top level clusters", clusters),
            units: add("top level units", u64::from(passes.words) * 4),
        })
    }

    /// All buffers.
    pub(super) fn ids(&self) -> impl Iterator<Item = BufferId> {
        [self.bounds, self.nodes, self.clusters, self.units].into_iter().chain(self.sort.ids())
    }
}
