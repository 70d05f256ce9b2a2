//! Divides the nodes of a tree among threads for refits.

use crate::cluster::Cluster;

/// Subtrees of up to this many nodes are refitted by one thread. That takes some hundred
/// microseconds; waking a thread takes several.
const MAX_TASK_NODES: u32 = 1024;

/// The subtrees that threads refit independently, and the nodes above them. They follow from the
/// shape of the tree.
#[derive(Clone, Debug, Default)]
pub(super) struct RefitTasks {
    /// In ascending order of nodes.
    pub subtrees: Vec<RefitTask>,
    /// The nodes above all of these subtrees, in ascending order.
    pub upper: Vec<u32>,
}

/// A subtree that one thread refits.
#[derive(Clone, Debug)]
pub(super) struct RefitTask {
    pub root: usize,
    /// The number of nodes, from `root` on.
    pub nodes: usize,
    /// The root's cluster if the refit changed it. The root's parent belongs to no task.
    pub changed: Option<Cluster>,
}

impl RefitTasks {
    /// The tasks of a tree without nodes.
    pub const EMPTY: Self = Self { subtrees: Vec::new(), upper: Vec::new() };

    /// The tasks of a tree. `spans` has the number of nodes in each subtree.
    pub fn new(spans: &[u32]) -> Self {
        let mut tasks = Self::default();
        let mut node = 0;
        while node < spans.len() {
            node = tasks.add(node, spans);
        }
        tasks
    }

    /// Adds a node, or the subtree below it. The nodes before it have been added. Returns the first
    /// node after the added ones.
    pub fn add(&mut self, node: usize, spans: &[u32]) -> usize {
        if spans[node] > MAX_TASK_NODES {
            self.upper.push(node as u32);
            return node + 1;
        }
        let nodes = spans[node].max(1) as usize;
        if self.subtrees.is_empty() {
            // Most trees are one subtree.
            self.subtrees.reserve_exact(1);
        }
        self.subtrees.push(RefitTask { root: node, nodes, changed: None });
        node + nodes
    }

    /// The size of all arrays in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of::<RefitTask>() * self.subtrees.capacity() + size_of::<u32>() * self.upper.capacity()
    }
}
