//! What refits know about a tree besides what is sampled.

use super::attributes::AttributeSums;
use super::dirty::DirtyNodes;
use super::refitted::RefittedNodes;
use super::wide::WideCluster;
use crate::rare::HasEmpty;

/// The data that only refits need: one entry for each node in each list.
///
/// Empty in a frozen tree, and in a tree of at most one node: what refits need there follows from
/// eight lights at most (`LightTree::refit_only_node`).
#[derive(Clone, Debug, Default)]
pub(super) struct RefitData {
    /// The clusters that each node is packed from. Edits change the lanes of lights, refits the
    /// lanes of nodes.
    pub wide: Vec<WideCluster>,
    /// Each subtree's part of the attributes.
    pub attribute_sums: Vec<AttributeSums>,
    /// Nodes with lanes that changed since the last refit.
    pub dirty: DirtyNodes,
    pub refitted: RefittedNodes,
}

impl HasEmpty for RefitData {
    const EMPTY: &'static Self = &Self {
        wide: Vec::new(),
        attribute_sums: Vec::new(),
        dirty: DirtyNodes::EMPTY,
        refitted: RefittedNodes::EMPTY,
    };

    fn owned_bytes(&self) -> usize {
        let Self { wide, attribute_sums, dirty, refitted } = self;
        wide.owned_bytes() + attribute_sums.owned_bytes() + dirty.memory_bytes() + refitted.memory_bytes()
    }
}

impl RefitData {
    /// The data of a tree of `count` nodes, with room for what belongs to each node.
    pub fn with_room(count: usize) -> Self {
        Self {
            wide: Vec::with_capacity(count),
            attribute_sums: Vec::with_capacity(count),
            dirty: DirtyNodes::empty(count),
            refitted: RefittedNodes::empty(count),
        }
    }

    /// The data of a tree of `count` nodes, with dark clusters.
    pub fn new(count: usize) -> Self {
        let mut data = Self::with_room(count);
        data.wide.resize(count, WideCluster::EMPTY);
        data.attribute_sums.resize(count, AttributeSums::default());
        data
    }
}
