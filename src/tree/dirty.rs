//! Which nodes a refit must look at.

use std::collections::BinaryHeap;

/// A set of node indices, taken out from the last to the first: children before their parents.
#[derive(Debug, Default)]
pub(super) struct Dirty {
    /// For each node, whether it is in the set.
    flags: Vec<bool>,
    heap: BinaryHeap<u32>,
}

impl Dirty {
    /// None of `count`.
    pub fn none(count: usize) -> Self {
        Self { flags: vec![false; count], heap: BinaryHeap::with_capacity(count) }
    }

    /// Bytes.
    pub fn memory(&self) -> usize {
        self.flags.capacity() + size_of::<u32>() * self.heap.capacity()
    }

    /// How many are in the set.
    pub fn len(&self) -> usize {
        self.heap.len()
    }

    /// Adds a node.
    pub fn insert(&mut self, node: usize) {
        if !std::mem::replace(&mut self.flags[node], true) {
            self.heap.push(node as u32);
        }
    }

    /// Takes out the greatest, if there is one.
    pub fn pop(&mut self) -> Option<usize> {
        let node = self.heap.pop()? as usize;
        self.flags[node] = false;
        Some(node)
    }

    /// Forgets who comes first; the flags stay, for whoever looks at all of them and clears them.
    pub fn forget_order(&mut self) {
        self.heap.clear();
    }

    /// For each node, whether it is in the set.
    pub fn flags_mut(&mut self) -> &mut [bool] {
        &mut self.flags
    }
}

impl Clone for Dirty {
    /// With room for all nodes, which a derived clone would not keep: refits of a clone allocate no more than others.
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
    fn nodes_come_out_once_and_the_last_first() {
        let mut dirty = Dirty::none(3);
        [0, 2, 1, 1].into_iter().for_each(|node| dirty.insert(node));
        assert_eq!([dirty.pop(), dirty.pop()], [Some(2), Some(1)]);
        dirty.insert(2);
        assert_eq!([dirty.pop(), dirty.pop(), dirty.pop()], [Some(2), Some(0), None]);
    }
}
