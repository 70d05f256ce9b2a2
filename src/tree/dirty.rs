//! The set of nodes that the next refit has to visit.

/// Nodes of a word of a [`DirtyNodes`].
pub(super) const WORD: usize = u32::BITS as usize;

/// Nodes of a word of [`DirtyNodes::filled`].
pub(super) const BLOCK: usize = WORD * WORD;

/// A set of nodes: a bit for each of them.
#[derive(Clone, Debug)]
pub(super) struct DirtyNodes {
    pub words: Vec<u32>,
    /// A bit for each word, set if the word has any. So few nodes of a large tree are found at once.
    pub filled: Vec<u32>,
    len: usize,
}

impl DirtyNodes {
    /// An empty set for a tree of `count` nodes.
    pub fn empty(count: usize) -> Self {
        Self { words: vec![0; count.div_ceil(WORD)], filled: vec![0; count.div_ceil(BLOCK)], len: 0 }
    }

    /// Grows the tree to `count` nodes. The new ones are not in the set.
    pub fn grow(&mut self, count: usize) {
        self.words.resize(count.div_ceil(WORD), 0);
        self.filled.resize(count.div_ceil(BLOCK), 0);
    }

    /// The size of all arrays in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of::<u32>() * (self.words.capacity() + self.filled.capacity())
    }

    /// The number of nodes in the set.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Adds a node.
    pub fn insert(&mut self, node: usize) {
        let (word, bit) = (&mut self.words[node / WORD], 1 << (node % WORD));
        self.len += usize::from(*word & bit == 0);
        *word |= bit;
        self.filled[node / BLOCK] |= 1 << (node / WORD % WORD);
    }

    /// Removes a node.
    pub fn remove(&mut self, node: usize) {
        let (word, bit) = (&mut self.words[node / WORD], 1 << (node % WORD));
        self.len -= usize::from(*word & bit != 0);
        *word &= !bit;
    }

    /// Records that a refit has taken out all nodes.
    pub fn were_taken(&mut self) {
        self.len = 0;
    }
}
