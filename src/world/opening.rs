//! How far each tree is opened: which clusters of it are leaves of the top level.
//!
//! Based on Benthin, Woop, Wald and Áfra, Improved Two-Level BVHs using Partial Re-Braiding (2017).
//! Differs: a tree is opened in the same way for all of its instances, because its nodes tell where a walk
//! up leaves it; and crowds decide how far, and not the surface area of instances.
//!
//! A tree that has the lights of others between its own is opened until each of its openings has few of
//! those within it. Then the top level sorts its lights and theirs together, so the noise depends little
//! on how a world is cut into trees. Where openings of all such trees would be too many, all trees get
//! the same share of what they want (docs/decisions.md, 49).

use super::filing::TopCache;
use super::log::WorldLog;
use super::scene::{CROWD_UNIT, Scene, TreeEntry};
use super::sums::Sums;
use crate::keys::{TreeKey, slot_of};
use crate::tree::{Opening, WIDTH};

/// Openings that any world may have in addition to those for its trees' lights and instances. Each takes
/// 80 bytes on the GPU, and for each instance of its tree some 200 bytes and work in each build of the top
/// level.
const SPARE_OPENINGS: usize = 131_072;

/// Openings for each instance.
const OPENINGS_PER_INSTANCE: usize = 4;

/// No world has more openings, so that the buffers of the top level stay below WebGPU's default limit.
pub(super) const MAX_OPENINGS: usize = 1 << 20;

impl Sums {
    /// The largest number of openings of all instances together. While crowds and instances change, it
    /// may be exceeded by a factor of two.
    fn most_openings(&self) -> usize {
        (SPARE_OPENINGS + self.stored_lights + OPENINGS_PER_INSTANCE * self.instances).min(MAX_OPENINGS)
    }
}

impl TreeEntry {
    /// The number of children of the root.
    fn root_count(&self) -> usize {
        self.tree.nodes().first().map_or(0, |root| root.count())
    }

    /// The least number of openings: all lights of a loose tree, the sides of a tree that is divided by side,
    /// and 0 for others.
    fn least_openings(&self) -> usize {
        match () {
            () if self.is_loose => self.tree.light_count(),
            () if self.tree.sides().is_empty() => 0,
            () => self.root_count(),
        }
    }

    /// The number of openings that the tree should have. 0 for a whole tree. `share` is what each tree
    /// gets of what it wants.
    fn openings_due(&self, share: f64) -> usize {
        let (root, least) = (self.root_count(), self.least_openings());
        let due = (self.openings_wanted() as f64 * share) as usize;
        // A root is opened into all of its children, or not at all.
        if root > 1 && due >= root { due } else { least }
    }

    /// Whether the tree is opened where it is crowded.
    pub(super) fn may_open(&self) -> bool {
        self.tree.light_count() > 1 && !self.is_loose
    }

    /// Whether the tree is whole because all openings would be too many.
    pub(super) fn is_held_back(&self) -> bool {
        self.openings.is_empty() && self.openings_due(1.0) > 0
    }

    /// The number of openings that its crowd calls for: one for each light of others between its own, in
    /// the mean over its instances.
    pub(super) fn openings_wanted(&self) -> usize {
        let wanted = (self.crowd as f64 * CROWD_UNIT / self.instances.len().max(1) as f64) as usize;
        if self.may_open() { wanted.min(self.tree.light_count()) } else { 0 }
    }
}

/// The scene, and what has to follow when a tree is opened.
pub(super) struct OpeningEdit<'a> {
    pub scene: &'a mut Scene,
    pub sums: &'a mut Sums,
    pub log: &'a mut WorldLog,
    pub top: &'a mut TopCache,
}

impl OpeningEdit<'_> {
    /// Opens a tree anew, after its nodes were replaced.
    pub fn renew(&mut self, tree: TreeKey) {
        self.set(tree, Box::default());
        self.update(tree);
    }

    pub fn recount(&mut self, tree: TreeKey) {
        self.scene.trees[tree].recount(self.sums);
    }

    /// Opens a tree as far as its crowd calls for, unless it is opened about as far and its openings
    /// still are a cut through it. O(openings).
    pub fn update(&mut self, key: TreeKey) {
        let entry = &mut self.scene.trees[key];
        entry.recount(self.sums);
        let share = self.sums.most_openings() as f64 / self.sums.wanted_openings.max(1) as f64;
        let (present, due) = (entry.openings.len(), entry.openings_due(share.min(1.0)));
        if present == 0 && due == 0 {
            return;
        }
        // Hysteresis: crowds that change a little seldom change the openings. The clusters that are left
        // when almost all lights are openings make much of the noise.
        let is_about_due = if due == entry.tree.light_count() || !entry.may_open() {
            present == due
        } else {
            due <= present + present / 4 + WIDTH && present <= 2 * due && present >= entry.least_openings()
        };
        if is_about_due && entry.tree.has_openings(&entry.openings) {
            return;
        }
        let openings = if due > 0 { entry.tree.openings(due).into() } else { Box::default() };
        self.set(key, openings);
    }

    fn set(&mut self, key: TreeKey, openings: Box<[Opening]>) {
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
        entry.recount(self.sums);
        self.log.tree(slot_of(key));
        self.top.take();
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
    use crate::{LightTree, LightWorld, Placement};

    #[test]
    fn the_documentation_of_a_report_names_the_bounds() {
        let says = |sentence: &str| assert_says(include_str!("reports.rs"), sentence);
        says(&format!("{}, one for each light of its trees and four for each", grouped(SPARE_OPENINGS)));
        says(&format!("at most {}", grouped(MAX_OPENINGS)));
        assert_eq!(OPENINGS_PER_INSTANCE, 4);
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
    fn the_openings_of_a_pile_are_bounded_and_each_instance_has_its_share() {
        // Below the bound, above it, ten times above it, and so far above that no tree is opened.
        for (lights, instances) in [(400, 320), (400, 360), (4000, 400), (800, 40_000)] {
            let mut world = pile(lights, instances);
            let report = world.update(FrameBudget::NONE);
            let most = SPARE_OPENINGS + lights + OPENINGS_PER_INSTANCE * instances;
            let openings = world.sums.parts;
            assert_eq!((report.parts, world.parts().len()), (openings, openings));
            match instances {
                320 => assert_eq!(openings, lights * instances, "all lights"),
                40_000 => {
                    assert_eq!((openings, report.opened_instances, report.held_back_instances), (40_000, 0, 40_000));
                    continue;
                }
                // A cut of a tree may have up to seven clusters less than it should.
                _ => assert!(openings <= most && openings + 8 * instances > most, "{openings} of {most}"),
            }
            assert_eq!((report.opened_instances, report.held_back_instances), (instances, 0));
        }
    }

    #[test]
    fn what_all_trees_want_together_decides_what_each_of_them_gets() {
        let mut world = pile(400, 200);
        world.update(FrameBudget::NONE);
        assert_eq!(world.sums.parts, 400 * 200);
        // The bound is the same for many trees.
        let sums = Sums { stored_lights: 3_000_000, instances: 5, ..Sums::default() };
        assert_eq!(sums.most_openings(), MAX_OPENINGS);
    }
}
