//! Edits of lights that wait for the next update.

use crate::light::Light;

/// The staged lights of one tree: for each light that changes, its last value.
#[derive(Clone, Debug, Default)]
pub(super) struct StagedLights {
    changes: Vec<(u32, Light)>,
    /// For each light of the tree, 0 or one more than its index in `changes`. Empty before the
    /// first change.
    places: Vec<u32>,
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

    /// Stages a value of the light at `index`, in place of an earlier one. `present` are the lights
    /// of the tree; a value that equals the present one is not staged, and an earlier one is
    /// withdrawn. O(1), but for the first call.
    pub fn set(&mut self, index: u32, light: Light, present: &[Light]) {
        if self.places.is_empty() {
            self.places = vec![0; present.len()];
        }
        let place = self.places[index as usize];
        let is_present = light == present[index as usize];
        match (place.checked_sub(1), is_present) {
            (None, true) => {}
            (None, false) => {
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
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn lamp(intensity: usize) -> Light {
        Light::point(Vec3::ZERO, Vec3::splat(intensity as f32))
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
