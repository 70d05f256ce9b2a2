//! The state of a tree: what refits know about it besides what is sampled.

use super::attributes::AttributeSums;
use super::dirty::DirtyNodes;
use super::refitted::{Refitted, RefittedNodes};
use super::wide::WideCluster;
use crate::rare::HasEmpty;

/// What a tree has for refits.
#[derive(Clone, Debug)]
pub(super) enum TreeState {
    /// The lights have not changed since [`LightTree::freeze`](super::LightTree::freeze), which dropped
    /// what only refits need. The tree has nodes.
    Frozen,
    /// At most one node: what refits need follows from its lights, eight at most.
    Small {
        /// Lights have changed since the last refit.
        is_dirty: bool,
        /// A refit has written the node since [`TreeState::forget_refitted`].
        is_refitted: bool,
    },
    /// Several nodes.
    Live(Box<RefitData>),
}

impl Default for TreeState {
    fn default() -> Self {
        Self::Small { is_dirty: false, is_refitted: false }
    }
}

impl TreeState {
    /// The data of a tree of several nodes that is not frozen.
    #[inline(always)]
    pub fn data(&self) -> &RefitData {
        let Self::Live(data) = self else { unreachable!("the tree was thawed") };
        data
    }

    /// The same, to be changed.
    #[inline(always)]
    pub fn data_mut(&mut self) -> &mut RefitData {
        let Self::Live(data) = self else { unreachable!("the tree was thawed") };
        data
    }

    /// The clusters of all nodes, if the tree has them.
    pub fn wide(&self) -> &[WideCluster] {
        if let Self::Live(data) = self { &data.wide } else { &[] }
    }

    /// Whether lights have changed since the last refit.
    pub fn is_dirty(&self) -> bool {
        match self {
            Self::Frozen => false,
            Self::Small { is_dirty, .. } => *is_dirty,
            Self::Live(data) => data.dirty.len() > 0,
        }
    }

    /// The nodes that refits have written since [`TreeState::forget_refitted`] was last called.
    pub fn refitted(&self) -> Refitted<'_> {
        match self {
            Self::Small { is_refitted: true, .. } => Refitted::All,
            Self::Live(data) => data.refitted.get(),
            _ => Refitted::Some(&[]),
        }
    }

    /// Empties the list of refitted nodes.
    pub fn forget_refitted(&mut self) {
        match self {
            Self::Frozen => {}
            Self::Small { is_refitted, .. } => *is_refitted = false,
            Self::Live(data) => data.refitted.clear(),
        }
    }

    /// The bytes of the data on the heap.
    pub fn memory_bytes(&self) -> usize {
        let Self::Live(data) = self else { return 0 };
        let RefitData { wide, attribute_sums, dirty, refitted } = &**data;
        size_of::<RefitData>()
            + wide.owned_bytes()
            + attribute_sums.owned_bytes()
            + dirty.memory_bytes()
            + refitted.memory_bytes()
    }
}

/// The data that only refits need: one entry for each node in each list.
#[derive(Clone, Debug)]
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
