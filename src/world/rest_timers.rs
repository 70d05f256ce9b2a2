//! Timers of trees: how long a tree counts as moving after its last change, and when it is due to
//! be frozen. They know keys of trees only.
//!
//! A tree that is not frozen (an *awake* tree) is in one of a few linked lists. Within a list, all
//! trees have the same delay and are sorted by their last change, so the trees that are due next
//! are at its front. A change moves the tree to the back of the first list, in O(1) and without
//! allocation. An update looks at the front of each list and at the trees that are due. A removed
//! tree leaves its list at once.
//!
//! A heap of due times was not used: it costs O(log n) for each entry, and it either holds stale
//! entries for removed trees and outdated times or moves entries at each change.

use crate::effects::EFFECT_HOLD_UPDATES;
use crate::keys::TreeKey;
use crate::keys::linked_lists::LinkedLists;

/// The most trees that are frozen in one update: freeing their memory takes time, and many trees
/// may be due at once.
pub(super) const MAX_FREEZES: usize = 64;

/// The most trees that leave [`RECENT`] in one update, when many of them have changed in the same
/// update. The others count as moving for some updates longer.
///
/// Among 100,000 trees that changed in random order, 256 trees took 17 µs and 1,024 trees 90 µs.
/// The 64 freezes of such an update took 54 µs.
const MAX_SETTLED: usize = 256;

const _: () = assert!(MAX_SETTLED >= MAX_FREEZES, "leaving `RECENT` must not delay freezes");

/// The most doublings of the delay before a freeze.
///
/// The longest delay is 64 times the first one, two minutes at 60 frames a second. Without a limit,
/// a tree whose lamps flicker now and then would keep the memory that freezing frees for ever. At
/// the limit, a tree is thawed at most once in 7,680 updates. A thaw computes every node once, as a
/// refit of all lights does, which is then a small share of the time of those updates.
const MAX_DOUBLINGS: u8 = 6;

/// The list of awake trees that have changed within the last [`EFFECT_HOLD_UPDATES`] updates, and
/// of trees that have yet to leave this list because of [`MAX_SETTLED`].
const RECENT: usize = 0;

/// The list of all other awake trees whose delay has this number of doublings.
fn settled(doublings: u8) -> usize {
    1 + usize::from(doublings)
}

/// The number of updates without a change after which a tree is frozen.
fn freeze_delay(doublings: u8) -> u64 {
    u64::from(EFFECT_HOLD_UPDATES) << doublings
}

/// The timers of all trees of a world.
#[derive(Debug)]
pub(super) struct RestTimers {
    /// Each list is sorted by [`Timer::changed_at`].
    timers: LinkedLists<TreeKey, Timer>,
    /// The number of updates so far, as of [`RestTimers::count_update`].
    updates: u64,
    /// The number of times that the timer of some tree was accessed.
    #[cfg(test)]
    accesses: usize,
}

/// The timer of one tree.
#[derive(Clone, Copy, Debug, Default)]
struct Timer {
    /// [`RestTimers::updates`] when the lights changed last, or when the tree was added or became
    /// awake again if that was later.
    changed_at: u64,
    /// How often the delay before a freeze was doubled. Each edit of the frozen tree doubles it, so
    /// that a large tree with a lamp that flickers now and then is not thawed each time. At most
    /// [`MAX_DOUBLINGS`].
    doublings: u8,
    /// The tree counts as moving. It is in [`RECENT`].
    is_moving: bool,
    /// The list that the tree is in; `None` if it is frozen.
    list: Option<u8>,
}

impl Default for RestTimers {
    fn default() -> Self {
        Self {
            timers: LinkedLists::new(settled(MAX_DOUBLINGS) + 1),
            updates: 0,
            #[cfg(test)]
            accesses: 0,
        }
    }
}

impl RestTimers {
    /// Records that a tree is not frozen. If it is new or was frozen, its time at rest starts
    /// again. O(1).
    pub fn wake(&mut self, tree: TreeKey) {
        if !self.timers.contains(tree) {
            self.timers.insert(tree, Timer::default());
        }
        if self.timer(tree).list.is_none() {
            self.push_recent(tree);
        }
    }

    /// Records that the lights of a tree have changed, which thaws it. Returns whether it counts as
    /// moving only from now on. O(1).
    pub fn has_moved(&mut self, tree: TreeKey) -> bool {
        let timer = self.timer(tree);
        let was_moving = std::mem::replace(&mut timer.is_moving, true);
        if timer.list.is_none() {
            timer.doublings = (timer.doublings + 1).min(MAX_DOUBLINGS);
        } else {
            self.unlink(tree);
        }
        self.push_recent(tree);
        !was_moving
    }

    /// Forgets a tree. Returns whether it counted as moving. O(1).
    pub fn remove(&mut self, tree: TreeKey) -> bool {
        if self.timers.contains(tree) {
            self.unlink(tree);
        }
        self.timers.forget(tree).is_some_and(|timer| timer.is_moving)
    }

    /// Counts one update. Returns the number of trees that no longer count as moving.
    /// O(trees that come to rest), at most [`MAX_SETTLED`] of them.
    pub fn count_update(&mut self) -> usize {
        self.updates += 1;
        let mut stopped = 0;
        for _ in 0..MAX_SETTLED {
            let Some(tree) = self.timers.first(RECENT) else { break };
            let updates = self.updates;
            let timer = self.timer(tree);
            if updates - timer.changed_at <= u64::from(EFFECT_HOLD_UPDATES) {
                break;
            }
            stopped += usize::from(std::mem::take(&mut timer.is_moving));
            let list = settled(timer.doublings);
            self.unlink(tree);
            self.push_back(list, tree);
        }
        stopped
    }

    /// Takes the tree that has been due for a freeze for longest, and counts it as frozen. O(1).
    pub fn take_due(&mut self) -> Option<TreeKey> {
        let mut earliest: Option<(u64, TreeKey)> = None;
        for doublings in 0..=MAX_DOUBLINGS {
            let Some(tree) = self.timers.first(settled(doublings)) else { continue };
            let due = self.timer(tree).changed_at + freeze_delay(doublings);
            if due < self.updates && earliest.is_none_or(|(other, _)| due < other) {
                earliest = Some((due, tree));
            }
        }
        let (_, tree) = earliest?;
        self.unlink(tree);
        Some(tree)
    }

    /// All accesses to timers of trees that exist, so that tests can count them.
    fn timer(&mut self, tree: TreeKey) -> &mut Timer {
        #[cfg(test)]
        {
            self.accesses += 1;
        }
        &mut self.timers[tree]
    }

    /// Appends a tree that is in no list to the list of trees that have just changed.
    fn push_recent(&mut self, tree: TreeKey) {
        self.timer(tree).changed_at = self.updates;
        self.push_back(RECENT, tree);
    }

    /// Appends a tree that is in no list to a list.
    fn push_back(&mut self, list: usize, tree: TreeKey) {
        self.timers.push_back(list, tree);
        self.timer(tree).list = Some(list as u8);
    }

    /// Removes a tree from its list. A tree that is in no list stays as it is.
    fn unlink(&mut self, tree: TreeKey) {
        if let Some(list) = self.timer(tree).list.take() {
            self.timers.remove(usize::from(list), tree);
        }
    }
}

#[cfg(test)]
impl RestTimers {
    /// The number of accesses to timers since the last call.
    pub fn take_accesses(&mut self) -> usize {
        std::mem::take(&mut self.accesses)
    }

    /// The number of awake trees. O(trees).
    pub fn awake_count(&self) -> usize {
        self.timers.values().filter(|timer| timer.list.is_some()).count()
    }
}

#[cfg(test)]
mod tests {
    use slotmap::SlotMap;

    use super::*;
    use crate::tree::testing::Rng;

    /// The most accesses of an update in which no tree comes to rest: one for each list.
    const IDLE_ACCESSES: usize = 2 + MAX_DOUBLINGS as usize;

    /// The most accesses of any update: three for each tree that settles, and one for each list and
    /// one for the tree before each freeze.
    const MAX_ACCESSES: usize = 3 * MAX_SETTLED + 1 + (MAX_FREEZES + 1) * (IDLE_ACCESSES + 1);

    const HOLD: u64 = EFFECT_HOLD_UPDATES as u64;

    /// Counts one update and freezes trees, as the world does. Returns the number of trees that
    /// stopped moving and the frozen trees.
    fn update(timers: &mut RestTimers) -> (usize, Vec<TreeKey>) {
        let stopped = timers.count_update();
        (stopped, (0..MAX_FREEZES).map_while(|_| timers.take_due()).collect())
    }

    /// Timers of new trees, and their keys.
    fn awake_trees(count: usize) -> (RestTimers, SlotMap<TreeKey, ()>, Vec<TreeKey>) {
        let (mut timers, mut trees) = (RestTimers::default(), SlotMap::with_key());
        let keys: Vec<_> = (0..count).map(|_| trees.insert(())).collect();
        keys.iter().for_each(|key| timers.wake(*key));
        (timers, trees, keys)
    }

    /// Checks that the lists are sorted, and each awake tree is in exactly the list that its timer
    /// names.
    fn check(timers: &RestTimers) {
        let mut linked = 0;
        for list in RECENT..=settled(MAX_DOUBLINGS) {
            let trees = std::iter::successors(timers.timers.first(list), |tree| timers.timers.after(*tree));
            let mut changed_at = 0;
            for tree in trees {
                let timer = &timers.timers[tree];
                assert_eq!(timer.list, Some(list as u8));
                assert!(list == RECENT || (list == settled(timer.doublings) && !timer.is_moving));
                assert!(changed_at <= timer.changed_at && timer.changed_at <= timers.updates);
                changed_at = timer.changed_at;
                linked += 1;
            }
        }
        assert_eq!(linked, timers.awake_count());
        assert!(timers.timers.values().all(|timer| timer.list.is_some() || !timer.is_moving));
    }

    /// One tree of an algorithm that counts the updates of each awake tree.
    struct Counted {
        key: TreeKey,
        is_awake: bool,
        is_moving: bool,
        still_updates: u64,
        freeze_delay: u64,
    }

    impl Counted {
        fn wake(&mut self) {
            if !std::mem::replace(&mut self.is_awake, true) {
                self.still_updates = 0;
            }
        }

        fn has_moved(&mut self) {
            if !self.is_awake {
                self.freeze_delay = (2 * self.freeze_delay).min(64 * HOLD);
            }
            self.still_updates = 0;
            self.is_moving = true;
            self.wake();
        }

        fn count_update(&mut self) {
            if self.is_awake {
                self.still_updates += 1;
                self.is_moving &= self.still_updates <= HOLD;
                self.is_awake = self.still_updates <= self.freeze_delay;
            }
        }
    }

    /// Random changes, with too few trees for the limits of one update.
    #[test]
    fn timers_agree_with_an_algorithm_that_counts_the_updates_of_each_tree() {
        let mut rng = Rng(31);
        let mut any = |count: usize| (rng.bits() % count as u64) as usize;
        let (mut timers, mut trees, _) = awake_trees(0);
        let mut model: Vec<Counted> = Vec::new();
        let (mut moving, mut freezes, mut longest_delay) = (0, 0, 0);
        for _ in 0..6000 {
            let index = any(model.len().max(1));
            match any(10) {
                0 if model.len() < MAX_FREEZES => {
                    let key = trees.insert(());
                    timers.wake(key);
                    let (is_awake, is_moving, still_updates, freeze_delay) = (true, false, 0, HOLD);
                    model.push(Counted { key, is_awake, is_moving, still_updates, freeze_delay });
                }
                1 if any(4) == 0 && !model.is_empty() => {
                    let removed = model.swap_remove(index);
                    trees.remove(removed.key);
                    assert_eq!(timers.remove(removed.key), removed.is_moving);
                    moving -= usize::from(removed.is_moving);
                }
                2 if !model.is_empty() => {
                    timers.wake(model[index].key);
                    model[index].wake();
                }
                3..6 if !model.is_empty() => {
                    let starts = timers.has_moved(model[index].key);
                    assert_eq!(starts, !model[index].is_moving);
                    moving += usize::from(starts);
                    model[index].has_moved();
                }
                _ => {
                    let updates = if any(100) == 0 { 65 * HOLD as usize } else { [1, 3, any(150)][any(3)] };
                    for _ in 0..updates {
                        let awake: Vec<_> = model.iter().map(|tree| tree.is_awake).collect();
                        model.iter_mut().for_each(Counted::count_update);
                        let (stopped, mut frozen) = update(&mut timers);
                        moving -= stopped;
                        let was_frozen = |(tree, was_awake): (&Counted, bool)| was_awake && !tree.is_awake;
                        let expected = model.iter().zip(awake).filter(|(tree, awake)| was_frozen((tree, *awake)));
                        let mut expected: Vec<_> = expected.map(|(tree, _)| tree.key).collect();
                        frozen.sort_unstable();
                        expected.sort_unstable();
                        assert_eq!(frozen, expected);
                        freezes += frozen.len();
                        assert_eq!(moving, model.iter().filter(|tree| tree.is_moving).count());
                    }
                }
            }
            check(&timers);
            for tree in &model {
                let timer = &timers.timers[tree.key];
                assert_eq!((timer.list.is_some(), timer.is_moving), (tree.is_awake, tree.is_moving));
                assert_eq!(freeze_delay(timer.doublings), tree.freeze_delay);
                longest_delay = longest_delay.max(tree.freeze_delay);
            }
            assert_eq!(timers.timers.len(), model.len());
        }
        assert!(freezes > 500 && longest_delay == 64 * HOLD, "{freezes} freezes, {longest_delay}");
    }

    #[test]
    fn an_update_in_which_nothing_changed_looks_at_one_tree_per_list() {
        for count in [1, 100_000] {
            let (mut timers, _, keys) = awake_trees(count);
            // Half of the trees count as moving; they changed in different updates.
            for part in keys.chunks(count.div_ceil(10)) {
                part.iter().step_by(2).for_each(|key| assert!(timers.has_moved(*key)));
                update(&mut timers);
            }
            timers.take_accesses();
            for _ in 0..HOLD - 10 {
                assert_eq!(update(&mut timers), (0, Vec::new()));
                assert!(timers.take_accesses() <= IDLE_ACCESSES);
            }
            assert_eq!(timers.awake_count(), count);
        }
    }

    #[test]
    fn trees_that_come_to_rest_at_once_are_frozen_over_several_updates() {
        let count = 20_000;
        let (mut timers, _, keys) = awake_trees(count);
        keys.iter().for_each(|key| assert!(timers.has_moved(*key)));
        for _ in 0..HOLD {
            assert_eq!(update(&mut timers), (0, Vec::new()));
        }
        let (mut moving, mut frozen) = (count, Vec::new());
        for _ in 0..count.div_ceil(MAX_FREEZES) {
            timers.take_accesses();
            let (stopped, newly_frozen) = update(&mut timers);
            let accesses = timers.take_accesses();
            assert!(accesses <= MAX_ACCESSES, "{accesses}");
            assert_eq!(stopped, moving.min(MAX_SETTLED));
            moving -= stopped;
            assert!(newly_frozen.len() <= MAX_FREEZES);
            frozen.extend(newly_frozen);
        }
        assert_eq!(frozen, keys, "the trees are frozen in the order of their changes");
        check(&timers);
        timers.take_accesses();
        update(&mut timers);
        assert_eq!(timers.take_accesses(), 0, "no tree is awake");
    }

    #[test]
    fn the_tree_that_has_been_due_for_longest_is_frozen_first() {
        let (mut timers, _, keys) = awake_trees(2);
        for _ in 0..=HOLD {
            update(&mut timers);
        }
        // Both trees are frozen. The first one wakes earlier, with twice the delay of the second
        // one.
        timers.has_moved(keys[0]);
        for _ in 0..HOLD + 5 {
            timers.count_update();
        }
        timers.wake(keys[1]);
        for _ in 0..2 * HOLD {
            timers.count_update();
        }
        assert_eq!([timers.take_due(), timers.take_due(), timers.take_due()], [Some(keys[0]), Some(keys[1]), None]);
    }

    #[test]
    fn removed_trees_leave_nothing_behind() {
        let (mut timers, mut trees, mut keys) = awake_trees(100);
        let capacity = timers.timers.capacity();
        for step in 0..50_000 {
            let index = step * 31 % keys.len();
            let removed = keys.swap_remove(index);
            trees.remove(removed);
            timers.remove(removed);
            assert!(!timers.remove(removed), "the tree is unknown");
            let added = trees.insert(());
            timers.wake(added);
            keys.push(added);
            if step % 3 == 0 {
                timers.has_moved(keys[step * 17 % keys.len()]);
            }
            if step % 10 == 0 {
                update(&mut timers);
            }
            if step % 1000 == 0 {
                check(&timers);
            }
        }
        assert_eq!(timers.timers.len(), 100);
        assert_eq!(timers.timers.capacity(), capacity);
        keys.iter().for_each(|key| _ = timers.remove(*key));
        check(&timers);
        assert!((RECENT..=settled(MAX_DOUBLINGS)).all(|list| timers.timers.first(list).is_none()));
    }
}
