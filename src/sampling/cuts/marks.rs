//! The cells that shading points need, and a few points of each.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use super::cell::{CutCell, POINTS, Place};

/// Parts of the marks that threads do not lock at the same time.
const SHARDS: usize = 64;

type Shard = HashMap<CutCell, Marked>;

/// The marks of a frame. Any threads may add to them.
#[derive(Default)]
pub(crate) struct Marks {
    shards: Vec<Mutex<Shard>>,
}

/// What is known of a marked cell.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Marked {
    /// How often the cell was marked.
    pub count: u32,
    /// The words of points; 0 for none.
    pub points: [u32; POINTS],
}

impl Marked {
    /// The words of points that there are.
    pub fn words(&self) -> impl Iterator<Item = u32> {
        self.points.into_iter().filter(|word| *word != 0)
    }
}

impl Marks {
    /// No marks.
    pub fn new() -> Self {
        Self { shards: (0..SHARDS).map(|_| Mutex::default()).collect() }
    }

    /// Marks the cell of a point.
    pub fn add(&self, cell: &CutCell, place: Place) {
        let [hash, _] = cell.keys();
        // A thread cannot panic while it holds the lock.
        let mut shard = self.shards[hash as usize % SHARDS].lock().unwrap_or_else(PoisonError::into_inner);
        let marked = shard.entry(*cell).or_default();
        marked.count = marked.count.saturating_add(1);
        let word = &mut marked.points[place.which];
        *word = place.word.max(*word);
    }

    /// All cells, in no order.
    pub fn cells(&mut self) -> impl Iterator<Item = (CutCell, Marked)> {
        self.shards().flat_map(|shard| shard.iter().map(|(cell, marked)| (*cell, *marked)))
    }

    /// The bytes of the marks on the heap.
    pub fn memory_bytes(&self) -> usize {
        let of_shard = |shard: &Mutex<Shard>| map_bytes(&shard.lock().unwrap_or_else(PoisonError::into_inner));
        size_of::<Mutex<Shard>>() * self.shards.capacity() + self.shards.iter().map(of_shard).sum::<usize>()
    }

    /// Removes all cells, and keeps the memory.
    pub fn clear(&mut self) {
        self.shards().for_each(Shard::clear);
    }

    fn shards(&mut self) -> impl Iterator<Item = &mut Shard> {
        self.shards.iter_mut().map(|shard| shard.get_mut().unwrap_or_else(PoisonError::into_inner))
    }
}

/// About the bytes of a map on the heap: an entry and a byte for each place, of which an eighth stays free.
pub(super) fn map_bytes<K, V>(map: &HashMap<K, V>) -> usize {
    map.capacity() / 7 * 8 * (size_of::<(K, V)>() + 1)
}
