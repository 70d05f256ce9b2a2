//! The queue of trees that wait for a rebuild.

use super::lists::Lists;
use crate::keys::TreeKey;

/// A tree that waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Entry {
    pub tree: TreeKey,
    /// The frame in which the tree began to wait.
    pub since_frame: u64,
    /// The predicted time of its rebuild.
    pub nanos: u64,
}

/// Lists by rank. The ranks of all trees at one time lie within a range of this length; ranks beyond
/// it count as its ends. A tree would have to wait for more than 100 rounds to need more.
const RANKS: i64 = 2048;

/// Bits of a word of [`Queue::is_filled`].
const WORD: usize = u64::BITS as usize;
const WORDS: usize = RANKS as usize / WORD;

/// Lists by arrival: each place of the queue is in one of them.
const WAITING: usize = 0;
const FREE: usize = 1;

/// Trees in the order of their ranks, and in the order in which they came.
///
/// The caller keeps the index of each tree. All operations are O(1), on average for
/// [`Queue::push`].
#[derive(Debug)]
pub(super) struct Queue {
    by_arrival: Lists<()>,
    len: usize,
    /// One list per rank, at its remainder by [`RANKS`].
    by_rank: Lists<Place>,
    /// A bit per list of `by_rank`: whether it has any tree.
    is_filled: [u64; WORDS],
    /// The greatest rank of all trees in `by_rank`, and a rank that none of them is below.
    top: i64,
    bottom: i64,
    /// The trees that are passed over, in the order in which that happened.
    passed_over: Vec<TreeKey>,
    /// The tree whose turn it is.
    turn: Option<usize>,
}

/// A place for a tree.
#[derive(Clone, Copy, Debug)]
struct Place {
    entry: Entry,
    rank: i64,
    /// The tree is not in the list of its rank.
    is_hidden: bool,
}

impl Default for Queue {
    fn default() -> Self {
        Self {
            by_arrival: Lists::new(2),
            len: 0,
            by_rank: Lists::new(RANKS as usize),
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

    pub fn entry(&self, index: usize) -> Entry {
        self.by_rank[index].entry
    }

    pub fn rank(&self, index: usize) -> i64 {
        self.by_rank[index].rank
    }

    /// Adds a tree that comes after all others, and returns its index. It is hidden until it gets a
    /// rank.
    pub fn push(&mut self, entry: Entry) -> usize {
        let place = Place { entry, rank: 0, is_hidden: true };
        let index = if let Some(free) = self.by_arrival.first(FREE) {
            self.by_arrival.remove(FREE, free);
            self.by_rank[free] = place;
            free
        } else {
            self.by_arrival.add(());
            self.by_rank.add(place)
        };
        self.by_arrival.push_back(WAITING, index);
        self.len += 1;
        index
    }

    /// Changes the rank and the predicted time of a tree.
    pub fn set(&mut self, index: usize, rank: i64, nanos: u64) {
        self.by_rank[index].entry.nanos = nanos;
        let Place { rank: former, is_hidden, .. } = self.by_rank[index];
        if is_hidden || rank != former {
            self.hide(index);
            self.show(index, rank);
        }
    }

    /// Removes a tree.
    pub fn remove(&mut self, index: usize) {
        self.hide(index);
        if self.turn == Some(index) {
            self.turn = self.by_arrival.after(index);
        }
        self.by_arrival.remove(WAITING, index);
        self.by_arrival.push_front(FREE, index);
        self.len -= 1;
    }

    /// The index of the tree with the greatest rank, and of those the one that has had it longest;
    /// `None` if all trees are hidden.
    pub fn best(&self) -> Option<usize> {
        self.by_rank.first(list_of(self.top))
    }

    /// The tree that has waited longest.
    pub fn oldest(&self) -> Option<Entry> {
        self.by_arrival.first(WAITING).map(|index| self.entry(index))
    }

    /// One of the trees, another one with each call.
    pub fn next_in_turn(&mut self) -> Option<TreeKey> {
        let index = self.turn.or_else(|| self.by_arrival.first(WAITING))?;
        self.turn = self.by_arrival.after(index);
        Some(self.entry(index).tree)
    }

    /// Hides a tree from [`Queue::best`] until it gets a rank.
    pub fn hide(&mut self, index: usize) {
        let Place { rank, is_hidden, .. } = &mut self.by_rank[index];
        if std::mem::replace(is_hidden, true) {
            return;
        }
        let (rank, list) = (*rank, list_of(*rank));
        self.by_rank.remove(list, index);
        if self.by_rank.first(list).is_none() {
            self.is_filled[list / WORD] &= !(1 << (list % WORD));
            if rank == self.top {
                self.lower_top();
            }
        }
    }

    /// Adds a hidden tree to the list of a rank.
    fn show(&mut self, index: usize, rank: i64) {
        let is_first = self.best().is_none();
        let rank = if is_first { rank } else { rank.clamp(self.top - (RANKS - 1), self.bottom + (RANKS - 1)) };
        let list = list_of(rank);
        self.by_rank.push_back(list, index);
        self.is_filled[list / WORD] |= 1 << (list % WORD);
        self.top = if is_first { rank } else { self.top.max(rank) };
        self.bottom = if is_first { rank } else { self.bottom.min(rank) };
        self.by_rank[index] = Place { rank, is_hidden: false, ..self.by_rank[index] };
    }

    /// Lowers `top`, whose list has become empty, to the greatest rank below. It stays if there is
    /// none.
    fn lower_top(&mut self) {
        let list = list_of(self.top);
        let (word, bit) = (list / WORD, list % WORD);
        // The lists in this word that come before, then all other words, then the rest of this word.
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
    pub fn pass_over(&mut self, index: usize) {
        self.passed_over.push(self.entry(index).tree);
        self.hide(index);
    }

    /// The number of trees that are passed over.
    pub fn passed_over(&self) -> usize {
        self.passed_over.len()
    }

    /// Gives the trees that were passed over their ranks again, and returns the index of the first
    /// of them that is still in the queue. `index_of` returns the index of a tree, or `None` if the
    /// tree has left the queue.
    pub fn restore(&mut self, index_of: impl Fn(TreeKey) -> Option<usize>) -> Option<usize> {
        let mut first = None;
        for position in 0..self.passed_over.len() {
            let Some(index) = index_of(self.passed_over[position]) else { continue };
            let Place { rank, is_hidden, .. } = self.by_rank[index];
            if is_hidden {
                self.show(index, rank);
            }
            first = first.or(Some(index));
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
            let index = queue.push(Entry { tree: *tree, since_frame, nanos: 0 });
            queue.set(index, *rank, 0);
        }
        queue
    }

    #[test]
    fn the_best_is_that_of_a_plain_list_after_random_operations() {
        const PLACES: usize = 300;
        let trees = trees(PLACES);
        let mut queue = Queue::default();
        // The rank of each tree by its index, and the number of the tree in the order of arrival.
        let mut plain = vec![None::<(i64, u64)>; PLACES];
        let mut rng = Rng(8);
        // Ranks fall, as those of a scheduler do, through the whole range and more.
        for step in 0..40_000_u64 {
            let rank = 900 - step as i64 / 8 - rng.below(1800) as i64;
            let index = rng.below(PLACES);
            match plain.get_mut(index) {
                Some(place @ Some(_)) if rng.below(4) == 0 => {
                    queue.remove(index);
                    *place = None;
                }
                Some(Some(place)) => {
                    queue.set(index, rank, step);
                    place.0 = rank;
                    assert_eq!(queue.entry(index).nanos, step);
                }
                _ => {
                    let index = queue.push(Entry { tree: trees[index], since_frame: step, nanos: 0 });
                    queue.set(index, rank, 0);
                    assert_eq!(plain[index], None);
                    plain[index] = Some((rank, step));
                }
            }
            // The scheduler takes the best, so the ranks that are left stay within the range.
            while let Some(best) = queue.best().filter(|best| queue.rank(*best) > 900 - step as i64 / 8 - 600) {
                let greatest = plain.iter().flatten().map(|place| place.0).max();
                assert_eq!(Some(queue.rank(best)), greatest);
                queue.remove(best);
                plain[best] = None;
            }
            let waiting = || plain.iter().flatten();
            assert_eq!(queue.len(), waiting().count());
            assert_eq!(queue.oldest().map(|entry| entry.since_frame), waiting().map(|place| place.1).min());
            assert_eq!(queue.best().map(|best| queue.rank(best)), waiting().map(|place| place.0).max());
        }
    }

    #[test]
    fn ranks_beyond_the_range_count_as_its_ends() {
        let trees = trees(4);
        let mut queue = queue(&trees, &[0, -5000, 5000, i64::MIN / 2]);
        let order: Vec<(usize, i64)> = std::iter::from_fn(|| {
            let best = queue.best()?;
            queue.hide(best);
            Some((best, queue.rank(best)))
        })
        .collect();
        assert_eq!(order, [(0, 0), (2, 0), (1, 1 - RANKS), (3, 1 - RANKS)]);
    }

    #[test]
    fn trees_that_are_passed_over_come_back_unless_they_have_left() {
        let trees = trees(3);
        let mut queue = queue(&trees, &[5, -3, 9]);
        for (index, next) in [(2, Some(0)), (0, Some(1)), (1, None)] {
            queue.pass_over(index);
            assert_eq!(queue.best(), next);
        }
        assert_eq!(queue.passed_over(), 3);
        queue.remove(2);
        let index_of = |tree| trees[..2].iter().position(|other| *other == tree);
        assert_eq!(queue.restore(index_of), Some(0));
        assert_eq!((queue.best(), queue.rank(0), queue.rank(1), queue.passed_over()), (Some(0), 5, -3, 0));
    }

    #[test]
    fn each_tree_has_its_turn() {
        let trees = trees(4);
        let mut queue = queue(&trees, &[1, 2, 3, 4]);
        assert_eq!([(); 2].map(|()| queue.next_in_turn()), [Some(trees[0]), Some(trees[1])]);
        // The next one leaves.
        queue.remove(2);
        assert_eq!([(); 3].map(|()| queue.next_in_turn()), [3, 0, 1].map(|tree| Some(trees[tree])));
        (0..4).filter(|index| *index != 2).for_each(|index| queue.remove(index));
        assert_eq!(queue.next_in_turn(), None);
    }
}
