//! Rebuilds of a whole tree, and how much a tree has degraded since its last one.

use super::LightTree;
use crate::light::Light;

impl LightTree {
    /// Rebuilds all nodes from the present lights. Lights keep their indices. O(n log n).
    pub fn rebuild(&mut self) {
        let vacant = self.edited.vacant().clone();
        let builds = self.builds;
        *self = Self::build_for(std::mem::take(&mut self.lights), self.maps.reference.take(), vacant);
        self.builds = builds.wrapping_add(1);
    }

    /// How much the tree's splitting cost has risen since its last build, relative to the spread of
    /// its lights: 0 if the cost is the same, 1 if it has doubled, negative if it has fallen. As
    /// of the last refit with attributes; 0 for a frozen tree. O(1).
    ///
    /// Unlike [`Attribute::SplittingCost`](super::Attribute) it does not depend on the box around
    /// all lights, which a single stray light stretches.
    pub fn cost_rise(&self) -> f32 {
        if self.is_frozen() || self.quality.built_cost <= 0.0 {
            return 0.0;
        }
        self.quality.cost / self.quality.built_cost.max(f32::MIN_POSITIVE) - 1.0
    }

    /// Replaces this tree by one that was built from an earlier state of its lights. Lights that
    /// have changed since are set again, and those that were added or removed are added and removed.
    /// Returns the former tree, and whether lights have changed; the tree then needs a refit, unless it
    /// was built again for lights that were added or removed.
    ///
    /// `changed` are all lights that may have changed. O(changed), but for such a build; O(lights) if they
    /// are not known: then all lights are compared.
    pub(crate) fn succeed(&mut self, mut built: Self, changed: Option<Vec<u32>>) -> (Self, bool) {
        let change = |index: u32| {
            let light = self.lights[index as usize];
            let differs = match built.lights.get(index as usize) {
                Some(then) => *then != light,
                None => !light.is_removed(),
            };
            differs.then_some((index, light))
        };
        let changes: Vec<(u32, Light)> = match changed {
            Some(changed) => changed.into_iter().filter_map(change).collect(),
            None => (0..self.lights.len() as u32).filter_map(change).collect(),
        };
        let is_built_again = built.apply(&changes);
        if let Some(last) = self.lights.len().checked_sub(1) {
            built.hold_index(last as u32);
        }
        let former = std::mem::replace(self, built);
        (former, self.is_dirty() || is_built_again)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::tree::testing::Rng;

    /// A position in a cube of edge `size`.
    fn position(rng: &mut Rng, size: f32) -> Vec3 {
        size * Vec3::new(rng.unit(), rng.unit(), rng.unit())
    }

    fn lamp(position: Vec3) -> Light {
        Light::point(position, Vec3::splat(1.0 + position.x))
    }

    fn random_tree(rng: &mut Rng, count: usize) -> LightTree {
        LightTree::build((0..count).map(|_| lamp(position(rng, 100.0))).collect())
    }

    #[test]
    fn a_successor_gets_the_lights_that_changed_whether_all_are_compared_or_those_alone() {
        let mut rng = Rng(4);
        let copy = random_tree(&mut rng, 500);
        let mut present = copy.clone();
        let lights: Vec<u32> = (0..40).map(|i| i * 12).collect();
        let light = |i: &u32| (*i, if i.is_multiple_of(5) { Light::REMOVED } else { lamp(position(&mut rng, 100.0)) });
        let mut changes: Vec<(u32, Light)> = lights.iter().map(light).collect();
        changes.extend((500..520).map(|i| (i, lamp(Vec3::splat(i as f32)))));
        present.apply(&changes);
        let changed: Vec<u32> = changes.iter().map(|(light, _)| *light).chain([7, 499]).collect();
        let results = [None, Some(changed), Some(vec![0])].map(|changed| {
            let (mut tree, built) = (present.clone(), LightTree::build(copy.lights.clone()));
            let (former, is_outdated) = tree.succeed(built, changed);
            tree.refit();
            assert!(is_outdated && former.lights == present.lights);
            tree
        });
        assert_eq!(results[0].lights, present.lights);
        assert!(results[0].nodes() == results[1].nodes() && results[0].nodes() != results[2].nodes());
    }

    #[test]
    fn the_cost_rises_as_lights_mix_and_not_as_they_move_together() {
        let mut rng = Rng(3);
        let mut tree = random_tree(&mut rng, 500);
        assert_eq!(tree.cost_rise(), 0.0);
        assert_eq!(LightTree::build(Vec::new()).cost_rise(), 0.0);
        let moved = |tree: &LightTree, to: &mut dyn FnMut(&Light) -> Vec3| -> Vec<(u32, Light)> {
            let light = |light: &Light| Light::point(to(light), light.emission);
            (0..).zip(tree.lights.iter().map(light)).collect()
        };
        // A translation by 64 m costs a few of the last digits.
        let together = moved(&tree, &mut |light| light.cluster().mean + 64.0 * Vec3::X);
        tree.apply(&together);
        tree.refit();
        assert!(tree.cost_rise().abs() < 1.0e-3, "{}", tree.cost_rise());
        let mixed = moved(&tree, &mut |_| position(&mut rng, 100.0));
        tree.apply(&mixed);
        tree.refit();
        assert!(tree.cost_rise() > 1.0, "{}", tree.cost_rise());
        tree.rebuild();
        assert_eq!(tree.cost_rise(), 0.0);
        tree.freeze();
        assert_eq!(tree.cost_rise(), 0.0);
    }
}
