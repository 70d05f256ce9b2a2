//! Which parts each tree has: what the leaves of the top level are for its instances.
//!
//! A tree is *whole*, one leaf for each instance, or *opened*: its sides are leaves if it is divided by side, and all of
//! its lights are if it is *loose*. Kernels make a tree loose, and so does a *crowd*: the lights of others that lie
//! between its own. The top level then sorts its lights and theirs together, so the noise depends little on how a
//! world is cut into trees.
//!
//! Based on Benthin, Woop, Wald and Áfra, Improved Two-Level BVHs using Partial Re-Braiding (2017). Differs: a tree is
//! opened in the same way for all of its instances, because its nodes tell where a walk up leaves it; a crowd decides,
//! and not the surface area of instances; and it opens the tree to its lights (docs/decisions.md, 49).

use super::LightWorld;
use super::crowds;
use super::delta::Delta;
use super::scene::TreeEntry;
use super::source::TreeSource;
use crate::keys::TreeKey;
use crate::tree::{Opening, WIDTH};

/// A tree becomes loose once it has this many lights of others for each of its own, in the mean over its instances.
const CROWDED: f32 = 1.0 / 8.0;

/// A loose tree with fewer ceases to be loose.
const STILL_CROWDED: f32 = 0.5 * CROWDED;

/// No crowd makes the openings of a world more than that, so that the buffers of the top level stay below WebGPU's
/// default limit. Each takes 80 bytes on the GPU, and for each instance of its tree some 200 bytes and work in each build
/// of the top level.
pub(super) const MAX_OPENINGS: usize = 1 << 20;

impl TreeEntry {
    /// Whether kernels make the tree loose.
    fn has_particles(&self) -> bool {
        self.source.as_ref().is_some_and(|source| source.by == TreeSource::GpuParticles)
    }

    /// Whether a crowd can make the tree loose.
    pub(super) fn may_be_loose(&self) -> bool {
        self.tree.light_count() > 1 && !self.has_particles()
    }

    fn is_crowded(&self) -> bool {
        let least = if self.crowd.is_loose { STILL_CROWDED } else { CROWDED };
        self.may_be_loose() && self.crowd.lights > 0.0 && self.crowd.lights >= least * self.tree.light_count() as f32
    }

    /// The openings that the tree should have, in the order of their places. O(openings · log openings).
    pub(super) fn openings_due(&self) -> Box<[Opening]> {
        match () {
            () if self.crowd.is_loose || self.has_particles() => self.tree.all_lights(),
            () if self.tree.sides().is_empty() => Box::default(),
            () => self.tree.below_root(),
        }
    }
}

impl LightWorld {
    /// Looks at the crowds of trees that are due. Returns whether a tree became loose, or ceased to be.
    pub(super) fn look_at_crowds(&mut self, has_changed: bool) -> bool {
        let (due, mut may_close) = self.crowds.take_due(has_changed, &self.scene);
        // All of them before the first is opened, since its parts are not filed as it is then.
        for tree in &due {
            self.scene.trees[*tree].crowd.lights = crowds::crowd(&self.scene, &self.filing, *tree);
        }
        let (mut has_opened, mut has_closed) = (false, false);
        for tree in &due {
            if self.open_if_due(*tree, may_close) {
                let is_loose = self.scene.trees[*tree].crowd.is_loose;
                (has_opened, has_closed) = (has_opened | is_loose, has_closed | !is_loose);
                // One at a time, since the crowds of the others may be larger then.
                may_close &= is_loose;
            }
        }
        self.crowds.finish(due, (has_opened, has_closed), self.scene.trees.slot_count());
        has_opened || has_closed
    }

    /// Opens a tree anew, after its nodes were replaced.
    pub(super) fn open_replaced(&mut self, tree: TreeKey) {
        self.set_openings(tree, Box::default());
        self.open(tree);
    }

    /// Opens a tree anew if its nodes call for it. O(openings · log openings).
    pub(super) fn open(&mut self, tree: TreeKey) {
        self.decide(tree, false);
        let openings = self.scene.trees[tree].openings_due();
        self.set_openings(tree, openings);
    }

    /// Opens a tree if it becomes loose by its crowd and its instances, ceases to be, or was not opened yet. Returns
    /// whether it became loose or ceased to be, which a smaller crowd does only if it `may_close`. O(1) otherwise.
    pub(super) fn open_if_due(&mut self, tree: TreeKey, may_close: bool) -> bool {
        let has_changed = self.decide(tree, may_close);
        let entry = &self.scene.trees[tree];
        if has_changed || entry.openings.is_empty() && !entry.tree.sides().is_empty() {
            let openings = entry.openings_due();
            self.set_openings(tree, openings);
        }
        has_changed
    }

    /// Decides whether a tree is loose. Returns whether that is new.
    fn decide(&mut self, tree: TreeKey, may_close: bool) -> bool {
        let Self { scene, sums, .. } = self;
        let entry = &mut scene.trees[tree];
        let of_others = sums.openings() - entry.counted.openings as usize * entry.counted.instances as usize;
        let all = of_others + entry.tree.light_count() * entry.instances.len();
        let was_loose = entry.crowd.is_loose;
        let is_crowded = entry.is_crowded() || was_loose && entry.may_be_loose() && !may_close;
        entry.crowd.is_loose = is_crowded && all <= MAX_OPENINGS;
        entry.crowd.is_held_back = is_crowded && !entry.crowd.is_loose;
        let has_changed = entry.crowd.is_loose != was_loose;
        self.record(Delta::Counts(tree));
        has_changed
    }

    fn set_openings(&mut self, key: TreeKey, openings: Box<[Opening]>) {
        let entry = &mut self.scene.trees[key];
        if entry.openings == openings {
            return;
        }
        let former = std::mem::replace(&mut entry.openings, openings);
        // The nodes and lights of openings are uploaded with the number of the opening.
        let (tree, mut nodes, mut lights) = (&entry.tree, Vec::new(), Vec::new());
        for opening in former.iter().chain(&entry.openings) {
            match opening.light() {
                Some(light) if (light as usize) < tree.lights().len() => lights.push(light),
                None if (opening.child_bits as usize) < tree.nodes().len() => nodes.push(opening.child_bits),
                _ => {}
            }
        }
        // The record of an opening is sent with its parent node.
        nodes.extend(entry.openings.iter().map(|opening| opening.place / WIDTH as u32));
        nodes.dedup();
        let records = tree.nodes().len() + tree.lights().len();
        entry.log.add(&nodes, lights.into_iter(), records);
        let effects = *tree.effects();
        self.record(Delta::Tree(key, &effects));
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::documented::{assert_says, grouped};
    use crate::light::Light;
    use crate::policy::Policy;
    use crate::scheduler::FrameBudget;
    use crate::{InstanceKey, LightTree, LightWorld, Placement};

    #[test]
    fn the_documentation_of_a_report_names_the_bound() {
        let says = |sentence: &str| assert_says(include_str!("reports.rs"), sentence);
        says(&format!("of more than {} openings", grouped(MAX_OPENINGS)));
    }

    /// A world whose `instances` of one tree of `lights` lamps lie in each other.
    fn pile(lights: usize, instances: usize) -> LightWorld {
        let mut world = LightWorld::new();
        let at = |i: usize| Vec3::new((i * 37 % 101) as f32 - 50.0, 5.0, (i * 53 % 97) as f32 - 48.0);
        let lamps = (0..lights).map(|i| Light::point(at(i), Vec3::ONE)).collect();
        let tree = world.add_tree(LightTree::new(lamps).expect("valid"));
        for i in 0..instances {
            let place = Placement::at(DVec3::X * 0.001 * i as f64);
            world.add_instance(tree, place, Policy::Budgeted).expect("valid");
        }
        world
    }

    #[test]
    fn the_openings_of_a_pile_are_bounded() {
        // At the bound, one instance past it and ten times past it.
        for (instances, is_loose) in [(1024, true), (1025, false), (10_240, false)] {
            let mut world = pile(1024, instances);
            let report = world.update(FrameBudget::NONE);
            let openings = world.sums.parts;
            assert_eq!((report.parts, world.parts().len()), (openings, openings));
            assert_eq!(openings, if is_loose { MAX_OPENINGS } else { instances });
            let counted = [report.opened_instances, report.held_back_instances];
            assert_eq!(counted, if is_loose { [instances, 0] } else { [0, instances] });
        }
    }

    #[test]
    fn an_instance_too_many_makes_a_tree_whole_until_it_goes() {
        let mut world = pile(1024, 1024);
        world.update(FrameBudget::NONE);
        let tree = world.trees().next().expect("one");
        let more = world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted).expect("valid");
        assert_eq!(world.update(FrameBudget::NONE).held_back_instances, 1025);
        world.remove_instance(more).expect("it lives");
        let report = world.update(FrameBudget::NONE);
        assert_eq!((report.held_back_instances, report.parts), (0, MAX_OPENINGS));
    }

    #[test]
    fn a_tree_is_loose_from_an_eighth_of_its_lights_on_and_down_to_a_sixteenth() {
        let mut world = LightWorld::new();
        let lamp = |i: u32| Light::point(Vec3::new((i * 37 % 101) as f32, 0.0, (i * 53 % 97) as f32), Vec3::ONE);
        let tree = world.add_tree(LightTree::new((0..80).map(lamp).collect()).expect("valid"));
        world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted).expect("valid");
        let one = world.add_tree(LightTree::new(vec![lamp(0)]).expect("valid"));
        let at = |i: usize| Placement::at(DVec3::X * (30.0 + i as f64));
        let mut others: Vec<InstanceKey> = Vec::new();
        let parts_with = |count: usize| {
            others.drain(count.min(others.len())..).for_each(|key| world.remove_instance(key).expect("it lives"));
            while others.len() < count {
                others.push(world.add_instance(one, at(others.len()), Policy::Budgeted).expect("valid"));
            }
            for _ in 0..8 {
                world.update(FrameBudget::NONE);
            }
            world.part_count() - count
        };
        assert_eq!([9, 10, 5, 4, 9, 10].map(parts_with), [1, 80, 80, 1, 1, 80]);
    }
}
