//! The set of nodes that the next refit has to visit.

use std::collections::BinaryHeap;

/// A set of node indices. Indices are taken out in descending order, so children come before their
/// parents.
#[derive(Debug, Default)]
pub(super) struct DirtyNodes {
    /// For each node, whether it is in the set.
    flags: Vec<bool>,
    heap: BinaryHeap<u32>,
}

impl DirtyNodes {
    /// The set of a tree without nodes.
    pub const EMPTY: Self = Self { flags: Vec::new(), heap: BinaryHeap::new() };

    /// An empty set for a tree of `count` nodes.
    pub fn empty(count: usize) -> Self {
        Self { flags: vec![false; count], heap: BinaryHeap::with_capacity(count) }
    }

    /// Reserves memory for a tree of `count` nodes, to which [`DirtyNodes::grow`] grows the set.
    pub fn reserve(&mut self, count: usize) {
        self.flags.reserve_exact(count);
        self.heap.reserve_exact(count);
    }

    /// Grows the tree to `count` nodes. The new ones are not in the set.
    pub fn grow(&mut self, count: usize) {
        self.flags.resize(count, false);
    }

    /// The size of all arrays in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.flags.capacity() + size_of::<u32>() * self.heap.capacity()
    }

    /// The number of nodes in the set, and of nodes that were removed from it.
    pub fn len(&self) -> usize {
        self.heap.len()
    }

    /// Adds a node.
    pub fn insert(&mut self, node: usize) {
        if !std::mem::replace(&mut self.flags[node], true) {
            self.heap.push(node as u32);
        }
    }

    /// Removes a node that is not part of the tree any more.
    pub fn remove(&mut self, node: usize) {
        // Its entry in the heap is skipped.
        self.flags[node] = false;
    }

    /// Takes out the greatest index. `None` if the set is empty.
    pub fn pop(&mut self) -> Option<usize> {
        loop {
            let node = self.heap.pop()? as usize;
            if std::mem::take(&mut self.flags[node]) {
                return Some(node);
            }
        }
    }

    /// Drops the order and keeps the flags, for a sweep that visits all nodes and clears the flags
    /// itself.
    pub fn drop_order(&mut self) {
        self.heap.clear();
    }

    /// For each node, whether it is in the set.
    pub fn flags_mut(&mut self) -> &mut [bool] {
        &mut self.flags
    }
}

impl Clone for DirtyNodes {
    /// Keeps room for all nodes, so that refits of the clone do not allocate either. A derived
    /// clone would drop the spare capacity.
    fn clone(&self) -> Self {
        let mut heap = BinaryHeap::with_capacity(self.flags.len());
        heap.extend(&self.heap);
        Self { flags: self.flags.clone(), heap }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_node_is_taken_out_once_and_the_greatest_index_first() {
        let mut dirty = DirtyNodes::empty(3);
        [0, 2, 1, 1].into_iter().for_each(|node| dirty.insert(node));
        assert_eq!([dirty.pop(), dirty.pop()], [Some(2), Some(1)]);
        dirty.insert(2);
        assert_eq!([dirty.pop(), dirty.pop(), dirty.pop()], [Some(2), Some(0), None]);
        dirty.insert(1);
        dirty.remove(1);
        assert_eq!(dirty.pop(), None);
        dirty.insert(1);
        dirty.remove(1);
        dirty.insert(1);
        assert_eq!([dirty.pop(), dirty.pop()], [Some(1), None]);
    }
}
