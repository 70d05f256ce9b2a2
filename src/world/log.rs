//! What changed in a world, for readers that are behind by any number of changes.

use std::fmt;

use glam::DVec3;

use super::stamps::{Stamps, count_after, slots_after};

/// A point in the history of one [`LightWorld`](crate::LightWorld): how far a reader has followed
/// it.
///
/// Each reader keeps one: a GPU, a cache of an engine, a renderer that reuses samples. It passes it
/// to [`LightWorld::changes_since`](crate::LightWorld::changes_since), and takes
/// [`LightWorld::revision`](crate::LightWorld::revision) as its next one. A reader that skipped any
/// number of frames gets the changes of all of them. A reader that has seen nothing starts with
/// `Revision::default()`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Revision {
    /// Grows with each change; 0 before a world was seen.
    number: u64,
    /// The origin of the world at that point.
    origin: DVec3,
}

/// What changed in a world since a [`Revision`]: see
/// [`LightWorld::changes_since`](crate::LightWorld::changes_since).
///
/// Slots are the numbers that shaders know instances by
/// ([`LightWorld::slot`](crate::LightWorld::slot)). All lists are in ascending order, name each
/// slot once, and allocate nothing. Reading one is O(slots that it names), with up to 128
/// comparisons for each, and a look at 8 bytes for each 4096 slots.
#[derive(Clone, Copy)]
pub struct Changes<'w> {
    log: &'w WorldLog,
    since: Revision,
    present: Revision,
}

impl<'w> Changes<'w> {
    /// Whether nothing changed, so that an upload writes no byte. Edits of lights count from the
    /// next [`LightWorld::update`](crate::LightWorld::update) on. O(1).
    pub fn is_empty(&self) -> bool {
        self.since == self.present
    }

    /// By how much [`LightWorld::origin`](crate::LightWorld::origin) moved, in metres; `None` if it
    /// is where it was, or for a reader that had seen nothing. Exact.
    ///
    /// Subtract the shift from every position relative to the origin that was kept from earlier
    /// frames. To ask for lights of the last frame, add it to a present position.
    pub fn origin_shift(&self) -> Option<DVec3> {
        let shift = self.present.origin - self.since.origin;
        (self.since.number > 0 && shift != DVec3::ZERO).then_some(shift)
    }

    /// The slots that hold the same instance as before, in another place.
    ///
    /// An instance that was moved away and back may be among them. Instances that are hidden by
    /// their placement, or shown again, count as moved. Not listed are new instances, those whose
    /// appearance or lights changed, and the change of all positions by a new origin
    /// ([`Changes::origin_shift`]).
    pub fn moved_instances(&self) -> impl Iterator<Item = u32> + use<'w> {
        let [added, removed, moved, ..] = &self.log.instances;
        let number = self.since.number;
        let is_same = move |slot: &u32| added.get(*slot) <= number && removed.get(*slot) <= number;
        slots_after([moved], number).filter(is_same)
    }

    /// The slots whose instance was added.
    pub fn added_instances(&self) -> impl Iterator<Item = u32> + use<'w> {
        let [added, removed, ..] = &self.log.instances;
        slots_after([added], self.since.number).filter(|slot| removed.get(*slot) < added.get(*slot))
    }

    /// The slots that an instance was removed from. A sample that was kept from before and names
    /// such a slot means nothing any more: the slot is free, or holds another instance.
    ///
    /// Listed are also instances that were both added and removed.
    pub fn removed_instances(&self) -> impl Iterator<Item = u32> + use<'w> {
        let [_, removed, ..] = &self.log.instances;
        slots_after([removed], self.since.number)
    }

    /// The slots of trees that were added, edited, rebuilt or removed.
    pub(crate) fn trees(&self) -> impl Iterator<Item = u32> + use<'w> {
        slots_after([&self.log.trees], self.since.number)
    }

    /// The slots of instances whose record on a GPU changed.
    pub(crate) fn instance_records(&self) -> impl Iterator<Item = u32> + use<'w> {
        slots_after(self.log.instances.each_ref(), self.since.number)
    }

    /// The slots of instances that may have another tree, or none.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn instance_trees(&self) -> impl Iterator<Item = u32> + use<'w> {
        let [added, removed, _, _, altered, _] = &self.log.instances;
        slots_after([added, removed, altered], self.since.number)
    }

    /// Whether some directional light was added, changed or removed.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn directionals(&self) -> bool {
        self.log.directionals > self.since.number
    }

    /// Whether the map of the sky changed.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn sky(&self) -> bool {
        self.log.sky > self.since.number
    }

    /// Whether more changed than user data, which the top level does not depend on.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn concern_lights(&self) -> bool {
        self.log.lights > self.since.number
    }
}

impl fmt::Debug for Changes<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Changes")
            .field("since", &self.since)
            .field("origin_shift", &self.origin_shift())
            .field("moved_instances", &self.moved_instances().collect::<Vec<_>>())
            .field("added_instances", &self.added_instances().collect::<Vec<_>>())
            .field("removed_instances", &self.removed_instances().collect::<Vec<_>>())
            .finish_non_exhaustive()
    }
}

/// How an instance changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InstanceChange {
    Added,
    Removed,
    Moved,
    /// It was shown or hidden by its appearance, or got another tree.
    Shown,
    /// Its record is stale for another reason.
    Altered,
    UserData,
}

/// When each slot of a world changed last, and how.
///
/// A change is a number that is greater than those of all changes before. The log knows the last
/// one of each slot and kind, so it is as large as the world, whatever its readers do.
#[derive(Debug)]
pub(super) struct WorldLog {
    /// The number of the last change. 1 in a new world: readers of number 0 have seen nothing.
    number: u64,
    /// The number at the last update.
    updated: u64,
    /// The last change of more than user data.
    lights: u64,
    directionals: u64,
    /// The map of the sky.
    sky: u64,
    /// Trees that were added, edited, rebuilt or removed.
    trees: Stamps,
    /// By [`InstanceChange`].
    instances: [Stamps; 6],
}

impl Default for WorldLog {
    fn default() -> Self {
        let (trees, instances) = Default::default();
        Self { number: 1, updated: 1, lights: 1, directionals: 1, sky: 1, trees, instances }
    }
}

impl WorldLog {
    /// The present point in the history of a world with this origin.
    pub fn revision(&self, origin: DVec3) -> Revision {
        Revision { number: self.number, origin }
    }

    /// What changed in a world since a revision of it. `origin` is the present one.
    pub fn changes_since(&self, since: Revision, origin: DVec3) -> Changes<'_> {
        Changes { log: self, since, present: self.revision(origin) }
    }

    /// Records a change of lights that no list names, such as that the top level is divided otherwise. Returns its
    /// number.
    pub fn lights(&mut self) -> u64 {
        self.number += 1;
        self.lights = self.number;
        self.number
    }

    /// Records that the tree of a slot was added, edited, rebuilt or removed.
    pub fn tree(&mut self, slot: u32) {
        let number = self.lights();
        self.trees.set(slot, number);
    }

    /// Records that some directional light was added, changed or removed.
    pub fn directionals(&mut self) {
        self.directionals = self.lights();
    }

    /// Records that the map of the sky changed.
    pub fn sky(&mut self) {
        self.sky = self.lights();
    }

    /// Records that the instance of a slot changed.
    pub fn instance(&mut self, slot: u32, change: InstanceChange) {
        self.number += 1;
        if change != InstanceChange::UserData {
            self.lights = self.number;
        }
        self.instances[change as usize].set(slot, self.number);
    }

    /// Returns how many instances were added, moved, shown, hidden or removed since the last call.
    pub fn count_moved(&mut self) -> usize {
        let since = std::mem::replace(&mut self.updated, self.number);
        let [added, removed, moved, shown, ..] = &self.instances;
        count_after([added, removed, moved, shown], since)
    }

    /// The size in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.instances.iter().chain([&self.trees]).map(Stamps::memory_bytes).sum()
    }
}
