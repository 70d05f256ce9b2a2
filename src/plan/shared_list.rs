//! A list by slot, whose copies share what neither has changed.

use std::sync::Arc;

/// Items that are copied together.
const CHUNK: usize = 32;

/// A list by slot. A copy takes O(1). The first change after one copies 32 items, and a pointer for each 32 of the list.
#[derive(Clone, Debug)]
pub(super) struct SharedList<T> {
    chunks: Arc<Vec<Arc<[T; CHUNK]>>>,
    len: usize,
}

impl<T> Default for SharedList<T> {
    fn default() -> Self {
        Self { chunks: Arc::default(), len: 0 }
    }
}

impl<T: Clone + Default> SharedList<T> {
    pub fn len(&self) -> usize {
        self.len
    }

    pub fn get(&self, index: usize) -> Option<&T> {
        (index < self.len).then(|| &self.chunks[index / CHUNK][index % CHUNK])
    }

    /// Replaces an item, which is returned. The list grows by default items up to a place beyond its end.
    pub fn set(&mut self, index: usize, item: T) -> T {
        let chunks = Arc::make_mut(&mut self.chunks);
        while chunks.len() <= index / CHUNK {
            chunks.push(Arc::new(std::array::from_fn(|_| T::default())));
        }
        self.len = self.len.max(index + 1);
        std::mem::replace(&mut Arc::make_mut(&mut chunks[index / CHUNK])[index % CHUNK], item)
    }

    pub fn iter(&self) -> impl Iterator<Item = &T> {
        self.chunks.iter().flat_map(|chunk| chunk.iter()).take(self.len)
    }
}

impl<T: Clone + Default> FromIterator<T> for SharedList<T> {
    fn from_iter<I: IntoIterator<Item = T>>(items: I) -> Self {
        let mut list = Self::default();
        items.into_iter().enumerate().for_each(|(index, item)| drop(list.set(index, item)));
        list
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_keeps_its_items_and_shares_all_chunks_but_those_that_changed() {
        let mut list: SharedList<u32> = (0..200).collect();
        let copy = list.clone();
        assert_eq!((list.set(70, 7), list.set(300, 9)), (70, 0));
        assert!(copy.iter().copied().eq(0..200) && copy.get(200).is_none());
        assert_eq!((list.len(), list.get(70), list.get(299), list.get(300)), (301, Some(&7), Some(&0), Some(&9)));
        let shared: Vec<bool> = copy.chunks.iter().zip(&*list.chunks).map(|(a, b)| Arc::ptr_eq(a, b)).collect();
        assert_eq!(shared, [true, true, false, true, true, true, true]);
    }
}
