//! The nodes that refits have written.

/// The nodes of a tree that refits have written since the last call of [`RefittedNodes::take`].
///
/// A refit of few lights lists its nodes. One that sweeps over all nodes, or a list that outgrows
/// its memory, counts as a refit of all.
#[derive(Debug)]
pub(crate) struct RefittedNodes {
    /// In no order; a node may occur several times.
    nodes: Vec<u32>,
    are_all: bool,
}

/// The nodes of a tree that were written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refitted<'a> {
    All,
    Some(&'a [u32]),
}

/// A tree of this many nodes lists one of them.
const NODES_PER_LISTED: usize = 4;
/// Besides, it lists this many, or all of its nodes.
const LEAST_LISTED: usize = 16;

impl RefittedNodes {
    /// An empty list for a tree of `count` nodes, with memory for all that it may hold.
    pub fn empty(count: usize) -> Self {
        Self { nodes: Vec::with_capacity(count.min(LEAST_LISTED + count / NODES_PER_LISTED)), are_all: false }
    }

    /// The size of the list in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of::<u32>() * self.nodes.capacity()
    }

    /// Adds a node. Never allocates.
    pub fn add(&mut self, node: usize) {
        if self.nodes.len() < self.nodes.capacity() {
            self.nodes.push(node as u32);
        } else {
            self.are_all = true;
        }
    }

    /// Adds all nodes.
    pub fn add_all(&mut self) {
        self.are_all = true;
    }

    /// The nodes since the last call of [`RefittedNodes::clear`].
    pub fn get(&self) -> Refitted<'_> {
        if self.are_all { Refitted::All } else { Refitted::Some(&self.nodes) }
    }

    /// Empties the list and keeps its memory.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.are_all = false;
    }
}

impl Clone for RefittedNodes {
    /// Keeps room for as many nodes; a derived clone would drop the spare capacity.
    fn clone(&self) -> Self {
        let mut nodes = Vec::with_capacity(self.nodes.capacity());
        nodes.extend(&self.nodes);
        Self { nodes, are_all: self.are_all }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_that_is_full_stands_for_all_nodes() {
        let mut refitted = RefittedNodes::empty(8);
        let room = refitted.clone().nodes.capacity();
        (0..room).for_each(|node| refitted.add(node));
        assert!(matches!(refitted.get(), Refitted::Some(nodes) if nodes.len() == room));
        refitted.add(0);
        assert_eq!((refitted.get(), refitted.nodes.capacity()), (Refitted::All, room));
        refitted.clear();
        assert_eq!(refitted.get(), Refitted::Some(&[]));
        refitted.add_all();
        assert_eq!(refitted.get(), Refitted::All);
    }
}
