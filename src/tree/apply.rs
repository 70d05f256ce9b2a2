//! Applies changes of lights to a tree: values, additions and removals.

use std::collections::BTreeMap;

use super::edited::make_room;
use super::node::{NO_LEAF, WIDTH};
use super::state::TreeState;
use super::{LightTree, check_indices, check_lights};
use crate::error::WorldError;
use crate::light::Light;

/// One addition or removal costs as much as building a tree of this many lights: 8 to 11 in trees of 100 to
/// 100,000 lights (2 cores of an AMD EPYC, 2026-11-26).
const LIGHTS_PER_EDIT: usize = 10;

/// If more lights than one of so many move far, none gets another place: that would cost a build, and
/// whether it is worth while is for policies to decide. Lights that move far together stay together.
const LIGHTS_PER_JUMP: usize = 2 * LIGHTS_PER_EDIT;

/// A light jumps if it leaves its node by more than this share of the diagonal of the tree's box, and by this
/// many diagonals of its node's box. Nodes of swarms grow by little in a frame.
const LEAST_JUMP: f32 = 1.0 / 8.0;
const LEAST_JUMP_OF_NODE: f32 = 4.0;

impl LightTree {
    /// Replaces lights. `changes` are pairs of a light's index and its new value; of several
    /// values for one light the last one counts. The nodes change at the next [`LightTree::refit`].
    ///
    /// A light jumps if it leaves the box of its node by more than an eighth of the tree's diagonal and
    /// four diagonals of the node. It gets another place in the tree. All lights keep their places if
    /// more than one of twenty moves by an eighth of the tree's diagonal. O(changes); in a frozen tree O(lights), with
    /// allocations.
    ///
    /// # Errors
    /// [`WorldError::NoSuchLight`] for an index outside the tree, [`WorldError::RemovedLight`] for
    /// that of a light that was removed, [`WorldError::Entry`] for an invalid light. No light has
    /// then changed.
    pub fn set_lights(&mut self, changes: &[(u32, Light)]) -> Result<(), WorldError> {
        check_indices(changes.iter().map(|(index, _)| *index), self.lights.len(), |index| self.lights.get(index))?;
        check_lights(changes.iter().map(|(index, light)| (*index as usize, light)))?;
        self.apply(changes);
        // Only a world asks which leaves have moved.
        self.forget_moved();
        Ok(())
    }

    /// Applies changes that have been checked. A light at the index of a removed one, or beyond the
    /// last index, is added; [`Light::REMOVED`] removes a light. Each added or removed light occurs
    /// once. Returns whether the tree was built again for that, with all nodes up to date.
    pub(crate) fn apply(&mut self, changes: &[(u32, Light)]) -> bool {
        let is_vacant = |index: u32| self.lights.get(index as usize).is_none_or(Light::is_removed);
        let [mut added, mut removed] = [0, 0];
        for (index, light) in changes {
            added += usize::from(is_vacant(*index) && !light.is_removed());
            removed += usize::from(!is_vacant(*index) && light.is_removed());
        }
        if added + removed > 0 && self.is_built_for(added, removed) {
            self.edit_list(changes);
            self.rebuild();
            return true;
        }
        if !changes.is_empty() {
            self.thaw();
        }
        let jumping = self.jumping(changes);
        // Removals make room for additions.
        for (index, light) in changes {
            let is_removed = light.is_removed() || jumping.contains_key(index);
            match (self.lights.get(*index as usize).is_none_or(Light::is_removed), is_removed) {
                (false, false) => self.set(*index, light),
                (false, true) => self.remove(*index),
                (true, _) => {}
            }
        }
        if added + jumping.len() == 0 {
            return false;
        }
        let before = self.builds;
        for (index, light) in changes.iter().filter(|(_, light)| !light.is_removed()) {
            if self.lights.get(*index as usize).is_none_or(Light::is_removed) {
                self.insert(*index, jumping.get(index).unwrap_or(light));
            }
        }
        if !self.sides.is_empty() {
            // A build on the way has divided the tree into sides, and lights that came later have not
            // been considered.
            self.rebuild();
        }
        self.builds != before
    }

    /// Whether a tree is built again for additions and removals: if it is divided into sides, which
    /// builds choose, if they cost more than a build, and if no lights are left.
    fn is_built_for(&self, added: usize, removed: usize) -> bool {
        let present = self.light_count();
        let build_is_cheaper = (added + removed) * LIGHTS_PER_EDIT > present + added - removed;
        !self.sides.is_empty() || build_is_cheaper || added + present == removed
    }

    /// The lights that get other places in the tree, with their last values: few move far, and leave their
    /// nodes by far.
    fn jumping(&self, changes: &[(u32, Light)]) -> BTreeMap<u32, Light> {
        let least = self.root.aabb.extent().length() * LEAST_JUMP;
        let moves_far = |index: u32, light: &Light| {
            let Some(former) = self.lights.get(index as usize) else { return false };
            let (from, to) = (former.aabb().center(), light.aabb().center());
            !former.is_removed() && !light.is_removed() && from.distance_squared(to) > least * least
        };
        let leaves_node = |index: u32, light: &Light| {
            let node = self.state.data().wide[self.leaves[index as usize] as usize / WIDTH].merged().cluster.aabb;
            let to = light.aabb().center();
            // A dark node has no box.
            let away = if node.is_empty() { 0.0 } else { to.distance(to.clamp(node.min, node.max)) };
            away > least && away > node.extent().length() * LEAST_JUMP_OF_NODE
        };
        let mut last = BTreeMap::new();
        if self.sides.is_empty() {
            for (index, light) in changes {
                if moves_far(*index, light) || last.contains_key(index) {
                    last.insert(*index, *light);
                }
            }
        }
        last.retain(|index, light| moves_far(*index, light));
        if last.len() * LIGHTS_PER_JUMP > self.light_count() {
            return BTreeMap::new();
        }
        last.retain(|index, light| leaves_node(*index, light));
        last
    }

    /// Writes changes to the list of lights only, before a build.
    fn edit_list(&mut self, changes: &[(u32, Light)]) {
        for (index, light) in changes {
            self.hold_index(*index);
            self.lights[*index as usize] = *light;
            if light.is_removed() || !self.edited.vacant().is_empty() {
                self.edited.set_vacant(*index, light.is_removed());
            }
        }
    }

    /// Lengthens the list of lights so that it has an index. The new indices are vacant.
    pub(super) fn hold_index(&mut self, index: u32) {
        for vacant in self.lights.len() as u32..=index {
            make_room(&mut self.lights);
            self.lights.push(Light::REMOVED);
            self.leaves.push(NO_LEAF);
            self.edited.set_vacant(vacant, true);
        }
    }

    /// Replaces one light.
    fn set(&mut self, index: u32, light: &Light) {
        let former = std::mem::replace(&mut self.lights[index as usize], *light);
        if former.effects() != light.effects() {
            self.effects.remove(former.effects());
            self.effects.add(light.effects());
        }
        let place = self.leaves[index as usize] as usize;
        if let TreeState::Small { is_dirty, .. } = &mut self.state {
            *is_dirty = true;
            return;
        }
        self.state.data_mut().wide[place / WIDTH].set(place % WIDTH, &light.cluster());
        self.state.data_mut().dirty.insert(place / WIDTH);
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use glam::Vec3;

    use super::*;
    use crate::tree::testing::Rng;

    /// Lamps at random places in a square of one kilometre.
    fn lamps(rng: &mut Rng, count: usize) -> Vec<Light> {
        let lamp = |rng: &mut Rng| Light::point(Vec3::new(rng.unit(), 0.01, rng.unit()) * 1000.0, Vec3::ONE);
        (0..count).map(|_| lamp(rng)).collect()
    }

    #[test]
    fn additions_and_removals_that_cost_more_than_a_build_are_a_build() {
        let mut rng = Rng(5);
        let count = 1000;
        for (added, removed) in [(100, 0), (101, 0), (112, 0), (0, 90), (0, 91), (50, 50), (51, 50), (500, 500)] {
            let mut tree = LightTree::build(lamps(&mut rng, count));
            let new = (count as u32..).zip(lamps(&mut rng, added));
            let changes: Vec<_> =
                new.chain((0..removed as u32).map(|light| (3 * light % 1000, Light::REMOVED))).collect();
            let is_built = (added + removed) * LIGHTS_PER_EDIT > count + added - removed;
            assert_eq!(tree.apply(&changes), is_built, "{added} {removed}");
            tree.refit();
            assert_eq!(tree.light_count(), count + added - removed);
            assert!(tree.check().is_ok());
            assert!(!is_built || tree.cost_rise() == 0.0, "{added} {removed}");
        }
    }

    #[test]
    fn lights_that_jump_get_other_places_up_to_one_of_twenty() {
        let mut rng = Rng(6);
        let built = LightTree::build(lamps(&mut rng, 20_000));
        let mut rises = Vec::new();
        for (jumping, are_moved) in [(20, true), (1000, true), (1001, false), (10_000, false)] {
            let mut tree = built.clone();
            let at = |light: &Light| light.aabb().center();
            let far =
                |i: usize| (at(&built.lights()[i]) + Vec3::new(500.0, 0.0, 250.0)) % Vec3::new(1000.0, 99.0, 1000.0);
            let changes: Vec<_> = (0..jumping).map(|i| (2 * i as u32, Light::point(far(2 * i), Vec3::ONE))).collect();
            tree.apply(&changes);
            let moved: BTreeSet<u32> = tree.moved_leaves().iter().copied().collect();
            assert_eq!(changes.iter().all(|(light, _)| moved.contains(light)), are_moved, "{jumping}");
            assert_eq!(moved.is_empty(), !are_moved, "{jumping}");
            tree.refit();
            assert!(
                tree.check().is_ok() && changes.iter().all(|(light, value)| tree.lights()[*light as usize] == *value)
            );
            rises.push(tree.cost_rise());
        }
        assert!(rises[0] < 0.01 && rises[1] < 0.1 && rises[2] > 5.0, "{rises:?}");
        // Lights that move within reach of their nodes keep their places, and so does a tree that moves.
        let mut tree = built.clone();
        let moved = |way: Vec3| -> Vec<_> {
            let light = |light: &Light| Light::point(light.aabb().center() + way, Vec3::ONE);
            (0..).zip(built.lights().iter().map(light)).collect()
        };
        tree.apply(&moved(Vec3::X * 100.0)[..30]);
        tree.apply(&moved(Vec3::X * 900.0));
        assert!(tree.moved_leaves().is_empty());
    }

    #[test]
    fn the_last_of_several_values_counts_also_for_lights_that_jump() {
        let mut rng = Rng(7);
        let mut tree = LightTree::build(lamps(&mut rng, 2000));
        let lamp = |x: f32| Light::point(Vec3::new(x, 10.0, 999.0), Vec3::splat(x + 1.0));
        let near = tree.lights()[3];
        tree.apply(&[(3, lamp(5.0)), (9, lamp(990.0)), (3, lamp(995.0)), (9, lamp(7.0)), (11, lamp(2.0)), (11, near)]);
        tree.refit();
        assert_eq!([3, 9, 11].map(|light| tree.lights()[light]), [lamp(995.0), lamp(7.0), near]);
        assert!(tree.check().is_ok() && tree.cost_rise() < 0.01, "{}", tree.cost_rise());
    }
}
