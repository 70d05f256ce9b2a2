//! The queue of trees that wait for a rebuild.

use super::max_tree::MaxTree;
use crate::keys::TreeKey;

/// The rank of a tree that is passed over.
const PASSED_OVER: i32 = i32::MIN;

/// Trees with ranks, in no order. The caller keeps the index of each tree, which changes when
/// another is removed. Costs are those of [`MaxTree`].
#[derive(Debug, Default)]
pub(super) struct Queue {
    trees: Vec<TreeKey>,
    ranks: MaxTree,
    /// The negative numbers of the frames in which the trees came.
    ages: MaxTree,
    /// The trees that are passed over, with their ranks, in the order in which that happened.
    passed_over: Vec<(TreeKey, i32)>,
}

impl Queue {
    pub fn len(&self) -> usize {
        self.trees.len()
    }

    pub fn is_empty(&self) -> bool {
        self.trees.is_empty()
    }

    /// The tree at an index.
    pub fn tree(&self, index: usize) -> TreeKey {
        self.trees[index]
    }

    pub fn rank(&self, index: usize) -> i32 {
        self.ranks.get(index)
    }

    /// Adds a tree that comes in a frame, and returns its index.
    pub fn push(&mut self, tree: TreeKey, rank: i32, frame: u64) -> usize {
        self.trees.push(tree);
        self.ranks.push(rank);
        // Negative, so that the greatest is the oldest. Frames beyond 2^31, a year, count as equal.
        self.ages.push(i32::try_from(frame).map_or(-i32::MAX, |frame| -frame));
        self.trees.len() - 1
    }

    /// Changes the rank of the tree at an index.
    pub fn set(&mut self, index: usize, rank: i32) {
        self.ranks.set(index, rank);
    }

    /// Removes the tree at an index. The last tree moves to this index; returns its key, or `None`
    /// if the removed tree was the last.
    pub fn remove(&mut self, index: usize) -> Option<TreeKey> {
        self.trees.swap_remove(index);
        self.ranks.swap_remove(index);
        self.ages.swap_remove(index);
        self.trees.get(index).copied()
    }

    /// The index of the tree with the greatest rank, the first of equal ones; `None` if there is no
    /// tree that is not passed over.
    pub fn best(&self) -> Option<usize> {
        self.ranks.max()
    }

    /// The tree that has waited longest.
    pub fn oldest(&self) -> Option<TreeKey> {
        self.ages.max().map(|index| self.trees[index])
    }

    /// Hides a tree from [`Queue::best`] until [`Queue::restore`].
    pub fn pass_over(&mut self, index: usize) {
        self.passed_over.push((self.trees[index], self.ranks.get(index)));
        self.ranks.set(index, PASSED_OVER);
    }

    /// The number of trees that are passed over.
    pub fn passed_over(&self) -> usize {
        self.passed_over.len()
    }

    /// Gives the trees that were passed over their ranks again, and returns the first of them that
    /// is still in the queue. `index_of` returns the index of a tree, or `None` if the tree has
    /// left the queue.
    pub fn restore(&mut self, index_of: impl Fn(TreeKey) -> Option<usize>) -> Option<TreeKey> {
        let mut first = None;
        while let Some((tree, rank)) = self.passed_over.pop() {
            if let Some(index) = index_of(tree) {
                self.ranks.set(index, rank);
                first = Some(tree);
            }
        }
        first
    }

    /// Adds to all ranks.
    pub fn shift(&mut self, by: i32) {
        self.ranks.shift(by);
    }
}

#[cfg(test)]
mod tests {
    use slotmap::SlotMap;

    use super::*;

    #[test]
    fn the_best_has_the_greatest_rank_and_the_oldest_came_first() {
        let mut keys = SlotMap::<TreeKey, ()>::with_key();
        let mut queue = Queue::default();
        assert_eq!((queue.best(), queue.oldest()), (None, None));
        let trees: Vec<TreeKey> = (0..3).map(|_| keys.insert(())).collect();
        for (tree, rank, frame) in [(trees[0], 5, 20), (trees[1], -3, 10), (trees[2], 9, u64::MAX)] {
            queue.push(tree, rank, frame);
        }
        assert_eq!((queue.best(), queue.oldest()), (Some(2), Some(trees[1])));
        queue.set(1, 10);
        assert_eq!(queue.best(), Some(1));
        assert_eq!(queue.remove(1), Some(trees[2]));
        assert_eq!((queue.best(), queue.oldest()), (Some(1), Some(trees[0])));
        assert_eq!(queue.remove(1), None);
        assert_eq!((queue.len(), queue.best()), (1, Some(0)));
    }

    #[test]
    fn trees_that_are_passed_over_come_back_unless_they_have_left() {
        let mut keys = SlotMap::<TreeKey, ()>::with_key();
        let mut queue = Queue::default();
        let trees: Vec<TreeKey> = (0..3).map(|_| keys.insert(())).collect();
        for (tree, rank) in trees.iter().zip([5, -3, 9]) {
            queue.push(*tree, rank, 0);
        }
        for (index, next) in [(2, Some(0)), (0, Some(1)), (1, None)] {
            queue.pass_over(index);
            assert_eq!(queue.best(), next);
        }
        assert_eq!(queue.passed_over(), 3);
        assert_eq!(queue.remove(0), Some(trees[2]));
        let index_of = |tree| [trees[2], trees[1]].iter().position(|other| *other == tree);
        assert_eq!(queue.restore(index_of), Some(trees[2]));
        assert_eq!((queue.best(), queue.rank(0), queue.rank(1), queue.passed_over()), (Some(0), 9, -3, 0));
    }
}
