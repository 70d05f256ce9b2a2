//! Edits of lights that wait for the next update.

use crate::error::WorldError;
use crate::keys::TreeKey;
use crate::light::Light;
use crate::rare::HasEmpty;
use crate::tree::{LightTree, check_indices};

/// The staged lights of one tree: for each light that changes, its last value. A light that will be
/// removed has the value [`Light::REMOVED`].
#[derive(Clone, Debug, Default)]
pub(super) struct StagedLights {
    changes: Vec<(u32, Light)>,
    /// For each light of the tree, 0 or one more than its index in `changes`. Empty before the
    /// first change.
    places: Vec<u32>,
    /// Vacant indices of the tree below this one are not given to lights any more before the next
    /// update.
    next_vacant: u32,
    /// The number of vacant indices that were given to lights since the last update.
    used_vacant: usize,
    /// The number of indices behind the last that were given to lights since the last update.
    appended: usize,
}

impl HasEmpty for StagedLights {
    const EMPTY: &'static Self =
        &Self { changes: Vec::new(), places: Vec::new(), next_vacant: 0, used_vacant: 0, appended: 0 };

    fn owned_bytes(&self) -> usize {
        self.changes.owned_bytes() + self.places.owned_bytes()
    }
}

impl StagedLights {
    pub fn is_empty(&self) -> bool {
        self.changes.is_empty()
    }

    /// The changes: each light of the tree at most once, with a value that differs from its present
    /// one.
    pub fn changes(&self) -> &[(u32, Light)] {
        &self.changes
    }

    /// The value that a light will have; `None` if it does not change.
    pub fn get(&self, index: u32) -> Option<&Light> {
        let place = self.places.get(index as usize)?.checked_sub(1)?;
        self.changes.get(place as usize).map(|(_, light)| light)
    }

    /// The number of indices of a tree with those that were given to lights since the last update.
    fn index_count(&self, tree: &LightTree) -> usize {
        tree.lights().len() + self.appended
    }

    /// That number once `count` more lights are added.
    pub fn index_count_with(&self, count: usize, tree: &LightTree) -> usize {
        let vacant = tree.vacant_indices().len() - self.used_vacant;
        self.index_count(tree) + count.saturating_sub(vacant)
    }

    /// Checks that each of these indices is that of a light that the tree will have.
    pub fn check_indices(&self, indices: impl Iterator<Item = u32>, tree: &LightTree) -> Result<(), WorldError> {
        let light = |index: usize| self.get(index as u32).or(tree.lights().get(index));
        check_indices(indices, self.index_count(tree), light)
    }

    /// Stages a new light, and returns its index: the least one of a light that was removed in an
    /// earlier update, or one behind the last. No index is returned twice between two updates, also
    /// if the light is removed again.
    pub fn add(&mut self, light: Light, tree: &LightTree) -> u32 {
        let index = match tree.vacant_indices().range(self.next_vacant..).next() {
            Some(index) => {
                self.next_vacant = index + 1;
                self.used_vacant += 1;
                *index
            }
            None => {
                self.appended += 1;
                self.index_count(tree) as u32 - 1
            }
        };
        self.set(index, light, tree.lights());
        index
    }

    /// Stages a value of the light at `index`, in place of an earlier one. `present` are the lights
    /// of the tree; a value that equals the present one is not staged, and an earlier one is
    /// withdrawn. O(1), but for the first call.
    pub fn set(&mut self, index: u32, light: Light, present: &[Light]) {
        let count = present.len().max(index as usize + 1);
        if self.places.len() < count {
            if self.places.is_empty() {
                self.places.reserve_exact(count);
            }
            self.places.resize(count, 0);
        }
        let place = self.places[index as usize];
        let is_present = light == *present.get(index as usize).unwrap_or(&Light::REMOVED);
        match (place.checked_sub(1), is_present) {
            (None, true) => {}
            (None, false) => {
                let staged = self.changes.len();
                if staged == self.changes.capacity() {
                    // Twice as many, and never more than there are places.
                    self.changes.reserve_exact(staged.max(4).min(self.places.len() - staged));
                }
                self.changes.push((index, light));
                self.places[index as usize] = self.changes.len() as u32;
            }
            (Some(staged), false) => self.changes[staged as usize].1 = light,
            (Some(staged), true) => {
                self.changes.swap_remove(staged as usize);
                self.places[index as usize] = 0;
                if let Some((moved, _)) = self.changes.get(staged as usize) {
                    self.places[*moved as usize] = place;
                }
            }
        }
    }

    /// Drops all changes and keeps the memory for the next ones. O(changes).
    pub fn clear(&mut self) {
        self.changes.drain(..).for_each(|(index, _)| self.places[index as usize] = 0);
        (self.next_vacant, self.used_vacant, self.appended) = (0, 0, 0);
    }
}

/// What edits of lights have asked for, and what the last update did of it.
#[derive(Debug, Default)]
pub(super) struct Edits {
    /// Trees that the next update refits, or whose rebuild request it updates: see [`TreeEntry::is_pending`]. Some may
    /// be gone.
    ///
    /// [`TreeEntry::is_pending`]: super::TreeEntry
    pub pending: Vec<TreeKey>,
    /// The lights that the last update added to trees.
    pub added: Vec<(TreeKey, u32)>,
    /// The lights that the last update removed from trees.
    pub removed: Vec<(TreeKey, u32)>,
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::tree::{MAX_LIGHTS, check_light_count};

    fn lamp(intensity: usize) -> Light {
        Light::point(Vec3::ZERO, Vec3::splat(intensity as f32))
    }

    #[test]
    fn indices_of_new_lights_are_counted_before_they_are_given() {
        let mut tree = LightTree::new((0..5).map(lamp).collect()).expect("valid");
        tree.remove_lights(&[1, 3]).expect("it has the lights");
        let mut staged = StagedLights::default();
        for (given, index) in [1, 3, 5, 6].into_iter().enumerate() {
            let counts = [0, 1, 2, 9].map(|count| staged.index_count_with(count, &tree));
            let vacant = 2_usize.saturating_sub(given);
            let present = 5 + given.saturating_sub(2);
            assert_eq!(counts, [0, 1, 2, 9].map(|count| present + usize::saturating_sub(count, vacant)));
            assert_eq!(staged.add(lamp(7), &tree), index);
        }
        let room = MAX_LIGHTS - 7;
        assert!(check_light_count(staged.index_count_with(room, &tree)).is_ok());
        assert!(check_light_count(staged.index_count_with(room + 1, &tree)).is_err());
        staged.clear();
        assert_eq!(staged.add(lamp(7), &tree), 1);
    }

    #[test]
    fn the_last_value_of_each_light_is_staged_and_no_value_that_is_there_already() {
        let present: Vec<Light> = (0..20).map(lamp).collect();
        let mut staged = StagedLights::default();
        let mut expected = present.clone();
        for step in 0..5000_usize {
            let (index, value) = (step * step % 20, step * 7 % 23);
            staged.set(index as u32, lamp(value), &present);
            expected[index] = lamp(value);
            assert!(staged.changes().len() <= present.len());
            let mut lights = present.clone();
            for (index, light) in staged.changes() {
                assert_ne!(*light, present[*index as usize]);
                assert_eq!(lights[*index as usize], present[*index as usize], "each light once");
                lights[*index as usize] = *light;
            }
            assert_eq!(lights, expected);
            if step % 1000 == 999 {
                staged.clear();
                assert!(staged.is_empty() && staged.places.iter().all(|place| *place == 0));
                expected.clone_from(&present);
            }
        }
        (0..20).for_each(|index| staged.set(index, present[index as usize], &present));
        assert!(staged.is_empty());
    }
}
