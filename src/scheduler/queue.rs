//! The queue of trees that wait for a rebuild.

use crate::keys::TreeKey;
use crate::keys::linked_lists::LinkedLists;

/// Lists by rank. The ranks of all trees at one time lie within a range of this length; ranks
/// beyond it count as its ends. A tree would have to wait for more than 100 rounds to need more.
const RANKS: i64 = 2048;

/// Bits of a word of [`Queue::is_filled`].
const WORD: usize = u64::BITS as usize;
const WORDS: usize = RANKS as usize / WORD;

/// The list of [`Queue::by_arrival`].
const WAITING: usize = 0;

/// Trees in the order of their ranks, and in the order in which they came. All operations are O(1).
#[derive(Debug)]
pub(super) struct Queue {
    by_arrival: LinkedLists<TreeKey, ()>,
    len: usize,
    /// One list per rank, at its remainder by [`RANKS`].
    by_rank: LinkedLists<TreeKey, QueueEntry>,
    /// A bit per list of `by_rank`: whether it has any tree.
    is_filled: [u64; WORDS],
    /// The greatest rank of all trees in `by_rank`, and a rank that none of them is below.
    top: i64,
    bottom: i64,
    /// The trees that are passed over, in the order in which that happened.
    passed_over: Vec<TreeKey>,
    /// The tree whose turn it is.
    turn: Option<TreeKey>,
}

/// What the queue knows about a tree that waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct QueueEntry {
    /// The frame in which the tree began to wait.
    pub since_frame: u64,
    /// The number of lights. It stands here so that the choice reads no other memory.
    pub lights: usize,
    /// The time of its rebuild as it was predicted when the rank was set.
    pub nanos: u64,
    pub rank: i64,
    /// The tree is not in the list of its rank.
    is_hidden: bool,
}

impl Default for Queue {
    fn default() -> Self {
        Self {
            by_arrival: LinkedLists::new(1),
            len: 0,
            by_rank: LinkedLists::new(RANKS as usize),
            is_filled: [0; WORDS],
            top: 0,
            bottom: 0,
            passed_over: Vec::new(),
            turn: None,
        }
    }
}

/// The list of a rank.
fn list_of(rank: i64) -> usize {
    rank.rem_euclid(RANKS) as usize
}

impl Queue {
    pub fn len(&self) -> usize {
        self.len
    }

    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    pub fn contains(&self, tree: TreeKey) -> bool {
        self.by_rank.contains(tree)
    }

    /// What is known about a tree that waits.
    pub fn entry(&self, tree: TreeKey) -> QueueEntry {
        self.by_rank[tree]
    }

    /// Adds a tree that comes in a frame, after all others. It is hidden until it gets a rank.
    pub fn push(&mut self, tree: TreeKey, lights: usize, since_frame: u64) {
        self.by_rank.insert(tree, QueueEntry { since_frame, lights, nanos: 0, rank: 0, is_hidden: true });
        self.by_arrival.insert(tree, ());
        self.by_arrival.push_back(WAITING, tree);
        self.len += 1;
    }

    /// Changes the rank and the predicted time of a tree.
    pub fn set(&mut self, tree: TreeKey, rank: i64, nanos: u64) {
        let entry = &mut self.by_rank[tree];
        entry.nanos = nanos;
        if entry.is_hidden || rank != entry.rank {
            self.hide(tree);
            self.show(tree, rank);
        }
    }

    /// Removes a tree, and returns what was known about it.
    pub fn remove(&mut self, tree: TreeKey) -> Option<QueueEntry> {
        if !self.contains(tree) {
            return None;
        }
        self.hide(tree);
        if self.turn == Some(tree) {
            self.turn = self.by_arrival.after(tree);
        }
        self.by_arrival.remove(WAITING, tree);
        self.by_arrival.forget(tree);
        self.len -= 1;
        self.by_rank.forget(tree)
    }

    /// The tree with the greatest rank, and of those the one that has had it longest; `None` if all
    /// trees are hidden.
    pub fn best(&self) -> Option<TreeKey> {
        self.by_rank.first(list_of(self.top))
    }

    /// The tree that has waited longest.
    pub fn oldest(&self) -> Option<TreeKey> {
        self.by_arrival.first(WAITING)
    }

    /// One of the trees, another one with each call.
    pub fn next_in_turn(&mut self) -> Option<TreeKey> {
        let tree = self.turn.or_else(|| self.oldest())?;
        self.turn = self.by_arrival.after(tree);
        Some(tree)
    }

    /// Hides a tree from [`Queue::best`] until it gets a rank.
    pub fn hide(&mut self, tree: TreeKey) {
        let QueueEntry { rank, is_hidden, .. } = &mut self.by_rank[tree];
        if std::mem::replace(is_hidden, true) {
            return;
        }
        let (rank, list) = (*rank, list_of(*rank));
        self.by_rank.remove(list, tree);
        if self.by_rank.first(list).is_none() {
            self.is_filled[list / WORD] &= !(1 << (list % WORD));
            if rank == self.top {
                self.lower_top();
            }
        }
    }

    /// Adds a hidden tree to the list of a rank.
    fn show(&mut self, tree: TreeKey, rank: i64) {
        let is_first = self.best().is_none();
        let rank = if is_first { rank } else { rank.clamp(self.top - (RANKS - 1), self.bottom + (RANKS - 1)) };
        let list = list_of(rank);
        self.by_rank.push_back(list, tree);
        self.is_filled[list / WORD] |= 1 << (list % WORD);
        self.top = if is_first { rank } else { self.top.max(rank) };
        self.bottom = if is_first { rank } else { self.bottom.min(rank) };
        let entry = &mut self.by_rank[tree];
        (entry.rank, entry.is_hidden) = (rank, false);
    }

    /// Lowers `top`, whose list has become empty, to the greatest rank below. It stays if there is
    /// none.
    fn lower_top(&mut self) {
        let list = list_of(self.top);
        let (word, bit) = (list / WORD, list % WORD);
        // The lists in this word that come before, then all other words, then the rest of this
        // word.
        let found = (0..=WORDS).find_map(|step| {
            let word = (word + WORDS - step) % WORDS;
            let mask = if step == 0 { !(!0 << bit) } else { !0 };
            let filled = self.is_filled[word] & mask;
            (filled != 0).then(|| word * WORD + filled.ilog2() as usize)
        });
        if let Some(found) = found {
            self.top -= (list as i64 - found as i64).rem_euclid(RANKS);
        }
    }

    /// Hides a tree from [`Queue::best`] until [`Queue::restore`].
    pub fn pass_over(&mut self, tree: TreeKey) {
        self.passed_over.push(tree);
        self.hide(tree);
    }

    /// The number of trees that are passed over.
    pub fn passed_over(&self) -> usize {
        self.passed_over.len()
    }

    /// Shows the trees that were passed over and are still in the queue. Returns the first of them.
    pub fn restore(&mut self) -> Option<TreeKey> {
        let mut first = None;
        for position in 0..self.passed_over.len() {
            let tree = self.passed_over[position];
            if self.contains(tree) {
                let QueueEntry { rank, is_hidden, .. } = self.entry(tree);
                if is_hidden {
                    self.show(tree, rank);
                }
                first = first.or(Some(tree));
            }
        }
        self.passed_over.clear();
        first
    }
}

#[cfg(test)]
mod tests {
    use slotmap::SlotMap;

    use super::*;
    use crate::tree::testing::Rng;

    fn trees(count: usize) -> Vec<TreeKey> {
        let mut keys = SlotMap::<TreeKey, ()>::with_key();
        (0..count).map(|_| keys.insert(())).collect()
    }

    /// A queue of trees with these ranks.
    fn queue(trees: &[TreeKey], ranks: &[i64]) -> Queue {
        let mut queue = Queue::default();
        for ((tree, rank), since_frame) in trees.iter().zip(ranks).zip(0..) {
            queue.push(*tree, 1, since_frame);
            queue.set(*tree, *rank, 0);
        }
        queue
    }

    #[test]
    fn the_next_best_is_found_below_and_not_around_the_ring() {
        let trees = trees(3);
        // The list of the last rank is in the same word as that of the first, and comes after it.
        let top = 5;
        let mut queue = queue(&trees, &[top, top - 2, top + 3 - RANKS]);
        for tree in trees {
            assert_eq!(queue.best(), Some(tree));
            queue.remove(tree);
        }
        assert_eq!(queue.best(), None);
    }

    #[test]
    fn the_best_is_that_of_a_plain_list_after_random_operations() {
        let trees = trees(300);
        let mut queue = Queue::default();
        // The rank and the frame of arrival of each tree that waits.
        let mut plain = vec![None::<(i64, u64)>; trees.len()];
        let mut rng = Rng(8);
        // Ranks fall, as those of a scheduler do, through the whole range and more.
        for step in 0..40_000_u64 {
            let rank = 900 - step as i64 / 8 - rng.below(1800) as i64;
            let index = rng.below(trees.len());
            let tree = trees[index];
            match &mut plain[index] {
                Some(_) if rng.below(4) == 0 => {
                    queue.remove(tree);
                    plain[index] = None;
                }
                Some((own, _)) => {
                    queue.set(tree, rank, step);
                    *own = rank;
                    assert_eq!(queue.entry(tree).nanos, step);
                }
                None => {
                    queue.push(tree, 1, step);
                    queue.set(tree, rank, 0);
                    plain[index] = Some((rank, step));
                }
            }
            // The scheduler takes the best, so the ranks that are left stay within the range.
            while let Some(best) = queue.best().filter(|best| queue.entry(*best).rank > 900 - step as i64 / 8 - 600) {
                let greatest = plain.iter().flatten().map(|(rank, _)| *rank).max();
                assert_eq!(queue.remove(best).map(|entry| entry.rank), greatest);
                plain[trees.iter().position(|tree| *tree == best).expect("one of the trees")] = None;
            }
            let waiting = || plain.iter().flatten();
            assert_eq!(queue.len(), waiting().count());
            let oldest = queue.oldest().map(|tree| queue.entry(tree).since_frame);
            assert_eq!(oldest, waiting().map(|(_, since)| *since).min());
            assert_eq!(queue.best().map(|best| queue.entry(best).rank), waiting().map(|(rank, _)| *rank).max());
        }
    }

    #[test]
    fn ranks_beyond_the_range_count_as_its_ends() {
        let trees = trees(4);
        let mut queue = queue(&trees, &[0, -5000, 5000, i64::MIN / 2]);
        let order: Vec<(TreeKey, i64)> = std::iter::from_fn(|| {
            let best = queue.best()?;
            queue.hide(best);
            Some((best, queue.entry(best).rank))
        })
        .collect();
        assert_eq!(order, [(0, 0), (2, 0), (1, 1 - RANKS), (3, 1 - RANKS)].map(|(tree, rank)| (trees[tree], rank)));
    }

    #[test]
    fn trees_that_are_passed_over_come_back_unless_they_have_left() {
        let trees = trees(3);
        let mut queue = queue(&trees, &[5, -3, 9]);
        for (tree, next) in [(2, Some(0)), (0, Some(1)), (1, None)] {
            queue.pass_over(trees[tree]);
            assert_eq!(queue.best(), next.map(|next: usize| trees[next]));
        }
        assert_eq!(queue.passed_over(), 3);
        queue.remove(trees[2]);
        assert_eq!(queue.restore(), Some(trees[0]));
        let ranks = [trees[0], trees[1]].map(|tree| queue.entry(tree).rank);
        assert_eq!((queue.best(), ranks, queue.passed_over()), (Some(trees[0]), [5, -3], 0));
        assert_eq!(queue.remove(trees[2]), None);
    }

    #[test]
    fn each_tree_has_its_turn() {
        let trees = trees(4);
        let mut queue = queue(&trees, &[1, 2, 3, 4]);
        assert_eq!([(); 2].map(|()| queue.next_in_turn()), [Some(trees[0]), Some(trees[1])]);
        // The next one leaves.
        queue.remove(trees[2]);
        assert_eq!([(); 3].map(|()| queue.next_in_turn()), [3, 0, 1].map(|tree| Some(trees[tree])));
        trees.iter().for_each(|tree| {
            queue.remove(*tree);
        });
        assert_eq!(queue.next_in_turn(), None);
    }
}
