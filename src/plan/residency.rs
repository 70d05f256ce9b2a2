//! The residency of trees on the GPU: which it holds whole, and which as stand-ins.

use std::ops::Range;

use rpds::{RedBlackTreeMapSync, RedBlackTreeSetSync};

use super::shared_list::SharedList;
use crate::keys::TreeKey;
use crate::tree::Opening;
use crate::world::TreeEntry;

/// The usefulness of a tree that was not weighed yet, or is always whole: it is not evicted.
pub(super) const NOT_WEIGHED: u32 = u32::MAX;

/// What shaders see of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// Nothing was sent yet.
    Nothing,
    /// A few lights: see `stand_in.rs`.
    StandIns,
    Whole,
}

/// A tree on the GPU, and its ranges of the pools.
#[derive(Clone, Debug)]
pub(super) struct TreeState {
    pub key: Option<TreeKey>,
    pub form: Form,
    /// The tree is to be sent whole, and has not been yet: shaders see stand-ins or an older version.
    pub waits: bool,
    pub nodes: Range<u32>,
    pub lights: Range<u32>,
    /// One record for each part of an instance of the tree.
    pub records: Range<u32>,
    /// How many openings the tree has for shaders.
    pub openings: usize,
    /// The revision up to which the tree was written: see [`ChangeLog`](crate::world::ChangeLog).
    pub revision: u64,
    /// [`TreeEntry::replaced`](crate::world::TreeEntry::replaced) of the version that shaders see.
    pub replaced: u32,
    /// The error that stand-ins would make, per node and light of the tree, as the bits of a
    /// non-negative f32, which compare like the number. Or [`NOT_WEIGHED`].
    pub usefulness: u32,
    /// The bytes of the whole tree, if it waits.
    pub bytes: u64,
}

impl Default for TreeState {
    fn default() -> Self {
        Self::NONE
    }
}

impl TreeState {
    /// The openings of a tree for shaders, which see stand-ins of a tree as a whole.
    pub fn openings<'a>(&self, entry: &'a TreeEntry) -> &'a [Opening] {
        if self.openings > 0 { &entry.openings } else { &[] }
    }

    /// No tree.
    pub const NONE: Self = Self {
        key: None,
        form: Form::Nothing,
        waits: false,
        nodes: 0..0,
        lights: 0..0,
        records: 0..0,
        openings: 0,
        revision: 0,
        replaced: 0,
        usefulness: NOT_WEIGHED,
        bytes: 0,
    };

    /// A tree of which nothing was sent.
    pub fn new(key: TreeKey) -> Self {
        Self { key: Some(key), ..Self::NONE }
    }

    /// Whether shaders can read the whole tree, or an older version of it. Not if the device has lost it.
    pub fn is_readable(&self) -> bool {
        self.form == Form::Whole && self.revision > 0
    }

    /// The lengths of new ranges for these numbers of nodes and lights. If either number has grown,
    /// both ranges get a quarter more. So a tree to which lights are added one by one moves within
    /// the pools once for each quarter of its lights.
    pub fn room_for(&self, [nodes, lights]: [usize; 2]) -> [u32; 2] {
        let has_grown = self.form == Form::Whole && (nodes > self.nodes.len() || lights > self.lights.len());
        if has_grown { with_growth([nodes, lights]) } else { [nodes, lights].map(|count| count as u32) }
    }

    /// The ranges of nodes, lights and records.
    pub fn ranges(&self) -> [&Range<u32>; 3] {
        [&self.nodes, &self.lights, &self.records]
    }
}

/// The lengths of ranges for a tree that grows: a quarter more.
pub(super) fn with_growth(counts: [usize; 2]) -> [u32; 2] {
    counts.map(|count| (count + count / 4 + 16) as u32)
}

/// Whether a range has room for this many records, and not more than about twice as many.
pub(super) fn has_room(range: &Range<u32>, count: usize) -> bool {
    (count..=2 * count + 64).contains(&range.len())
}

/// A tree that is sent over several frames, into ranges that shaders do not read yet.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Incoming {
    pub slot: u32,
    pub key: TreeKey,
    pub nodes: Range<u32>,
    pub lights: Range<u32>,
    /// The tree is sent as an opened one.
    pub is_opened: bool,
    /// The numbers of nodes and lights that were sent.
    pub sent: [u32; 2],
    /// The revision of the tree when the first of them were sent.
    pub revision: u64,
    /// How often the tree changed as a whole meanwhile, so that it had to be sent again.
    pub restarts: u32,
}

/// The trees of a world as the GPU holds them, by slot.
#[derive(Clone, Debug, Default)]
pub(super) struct Residency {
    trees: SharedList<TreeState>,
    /// The trees that wait and may find room, the most useful last.
    waiting: RedBlackTreeSetSync<(u32, u32)>,
    /// The slots of trees that wait and for which there is no room until something changes.
    blocked: RedBlackTreeSetSync<u32>,
    /// How many of these are to be tried again.
    retries: usize,
    /// The slot after the one that was tried again last.
    next_retry: u32,
    /// Bytes of the trees that wait.
    waiting_bytes: u64,
    /// The number of trees of which shaders see stand-ins.
    stand_ins: usize,
    pub incoming: Option<Incoming>,
    /// The last search found no tree that can move to a gap before it.
    pub is_packed: bool,
    /// The trees by usefulness and by place, once that was asked for: see [`Residency::sort`].
    order: Option<Order>,
    /// The slot whose usefulness is computed next.
    next: u32,
}

/// The orders of trees that evictions and moves to gaps need.
#[derive(Clone, Debug, Default)]
struct Order {
    /// The trees that may be evicted, by usefulness and slot, the least useful first.
    whole: RedBlackTreeSetSync<(u32, u32)>,
    /// The slots of trees by the start of their nodes and of their lights.
    places: [RedBlackTreeMapSync<u32, u32>; 2],
}

impl Order {
    fn remove(&mut self, slot: u32, state: &TreeState) {
        self.whole.remove_mut(&(state.usefulness, slot));
        for (places, range) in self.places.iter_mut().zip([&state.nodes, &state.lights]) {
            if !range.is_empty() && places.get(&range.start) == Some(&slot) {
                places.remove_mut(&range.start);
            }
        }
    }

    fn insert(&mut self, slot: u32, state: &TreeState) {
        if state.form == Form::Whole {
            self.whole.insert_mut((state.usefulness, slot));
        }
        for (places, range) in self.places.iter_mut().zip([&state.nodes, &state.lights]) {
            if !range.is_empty() {
                places.insert_mut(range.start, slot);
            }
        }
    }
}

impl Residency {
    /// No trees. They are kept in order from the start if `is_sorted`.
    pub fn new(is_sorted: bool) -> Self {
        Self { order: is_sorted.then(Order::default), ..Self::default() }
    }

    /// The tree of a slot.
    pub fn get(&self, slot: u32) -> &TreeState {
        self.trees.get(slot as usize).unwrap_or(&TreeState::NONE)
    }

    /// The number of slots.
    pub fn slots(&self) -> u32 {
        self.trees.len() as u32
    }

    /// The trees that wait and may find room, the most useful first.
    pub fn waiting(&self) -> impl Iterator<Item = u32> + '_ {
        self.waiting.iter().rev().map(|(_, slot)| *slot)
    }

    /// The number of trees that wait.
    pub fn waiting_count(&self) -> usize {
        self.waiting.size() + self.blocked.size()
    }

    /// Notes that there is no room for a tree that waits.
    pub fn block(&mut self, slot: u32) {
        if self.waiting.remove_mut(&(self.get(slot).usefulness, slot)) {
            self.blocked.insert_mut(slot);
        }
    }

    /// Notes that trees for which there was no room may find some now.
    pub fn retry(&mut self) {
        self.retries = self.blocked.size();
    }

    /// Lets all trees that wait be tried again.
    pub fn unblock_all(&mut self) {
        self.retry();
        self.unblock(usize::MAX);
    }

    /// Lets some of the trees for which there was no room be tried again, in turn.
    pub fn unblock(&mut self, count: usize) {
        for _ in 0..count.min(self.retries) {
            let next = self.blocked.range(self.next_retry..).chain(self.blocked.iter()).next();
            let Some(slot) = next.copied() else { break };
            self.next_retry = slot + 1;
            self.retries -= 1;
            self.blocked.remove_mut(&slot);
            self.waiting.insert_mut((self.get(slot).usefulness, slot));
        }
    }

    /// Bytes of the trees that wait.
    pub fn waiting_bytes(&self) -> u64 {
        self.waiting_bytes
    }

    /// The number of trees of which shaders see stand-ins.
    pub fn stand_in_count(&self) -> usize {
        self.stand_ins
    }

    /// Puts a tree in place of the former one of its slot, which is returned.
    pub fn replace(&mut self, slot: u32, state: TreeState) -> TreeState {
        let former = self.trees.set(slot as usize, state.clone());
        let state = &state;
        self.is_packed &= former.ranges() == state.ranges();
        if former.waits {
            self.waiting.remove_mut(&(former.usefulness, slot));
            self.blocked.remove_mut(&slot);
            self.waiting_bytes -= former.bytes;
        }
        if state.waits {
            self.waiting_bytes += state.bytes;
            self.waiting.insert_mut((state.usefulness, slot));
        }
        self.stand_ins += usize::from(state.form == Form::StandIns);
        self.stand_ins -= usize::from(former.form == Form::StandIns);
        if let Some(order) = &mut self.order {
            order.remove(slot, &former);
            order.insert(slot, state);
        }
        former
    }

    /// Records that a tree was written up to a revision.
    pub fn was_written(&mut self, slot: u32, revision: u64) {
        let state = TreeState { revision, ..self.get(slot).clone() };
        self.trees.set(slot as usize, state);
    }

    /// Forgets the ranges of all trees.
    pub fn restart(&mut self) {
        let state =
            |former: &TreeState| TreeState { key: former.key, usefulness: former.usefulness, ..TreeState::NONE };
        let trees = self.trees.iter().map(state).collect();
        *self = Self { trees, next: self.next, ..Self::new(self.is_sorted()) };
    }

    /// Forgets what was written, so that the next frame writes everything.
    pub fn lose(&mut self) {
        self.trees = self.trees.iter().map(|state| TreeState { revision: 0, ..state.clone() }).collect();
        if let Some(incoming) = &mut self.incoming {
            incoming.sent = [0; 2];
        }
    }

    /// The next slots whose usefulness is to be computed again, at most `count`.
    pub fn next_slots(&mut self, count: u32) -> impl Iterator<Item = u32> + use<> {
        let slots = self.slots();
        let first = self.next;
        let count = count.min(slots);
        self.next = if slots == 0 { 0 } else { (first + count) % slots };
        (0..count).map(move |i| (first + i) % slots)
    }

    /// Sets how useful it is to hold a tree whole.
    pub fn set_usefulness(&mut self, slot: u32, usefulness: u32) {
        if self.get(slot).usefulness != usefulness {
            let state = TreeState { usefulness, ..self.get(slot).clone() };
            self.replace(slot, state);
            self.retry();
        }
    }

    /// Whether the trees are kept in order.
    pub fn is_sorted(&self) -> bool {
        self.order.is_some()
    }

    /// Begins to keep the trees in order of usefulness and of place. O(trees · log trees) the first
    /// time. Trees are evicted only once their usefulness was computed.
    pub fn sort(&mut self) {
        if self.order.is_none() {
            let mut order = Order::default();
            (0..).zip(self.trees.iter()).for_each(|(slot, state)| order.insert(slot, state));
            self.order = Some(order);
        }
    }

    /// The whole trees of less usefulness than this, the least useful first.
    pub fn less_useful(&self, than: u32) -> impl Iterator<Item = u32> + '_ {
        let whole = self.order.iter().flat_map(move |order| order.whole.range(..(than, 0)));
        whole.map(|(_, slot)| *slot)
    }

    /// The slots of trees by the place of their nodes (0) or of their lights (1), the last first.
    pub fn places_from_last(&self, pool: usize) -> impl Iterator<Item = u32> + '_ {
        self.order.iter().flat_map(move |order| order.places[pool].values().rev().copied())
    }
}
