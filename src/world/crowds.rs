//! Looks at trees: finds out how crowded they are, which decides whether they are loose (`opening.rs`).
//!
//! The crowd of an instance is the number of lights of others within its box, as the partition of the top level knows
//! it roughly. A tree is looked at once it was added, changed or got another instance, and once in each *round* over
//! all trees; two rounds follow any change of the world. The work in each update is bounded.

use super::filing::Filing;
use super::scene::Scene;
use crate::keys::{InstanceKey, TreeKey};

/// The instances of a tree that are looked at: all, or so many that are spread over their list.
const LOOKED_AT: usize = 8;

/// Trees and instances that a round looks at in one update.
pub(super) const LOOKS_PER_UPDATE: usize = 64;

/// Which trees are to be looked at.
#[derive(Debug, Default)]
pub(super) struct Crowds {
    /// They are looked at in the next update.
    new: Vec<TreeKey>,
    /// The slot of the tree that the round looks at next.
    next: usize,
    /// How many slots are still to be looked at.
    left: usize,
    /// In how many of these trees may cease to be loose.
    left_loose: usize,
    /// A tree became loose since the world changed.
    has_opened: bool,
}

impl Crowds {
    /// Has the next update look at a tree.
    pub fn look_at_soon(&mut self, tree: TreeKey) {
        if self.new.last() != Some(&tree) {
            self.new.push(tree);
        }
    }

    /// The trees to look at in this update: those that have changed, and some others until two rounds have ended since
    /// the last change. Also returns whether they may cease to be loose. Later they may not: the crowd of each of two
    /// trees depends on whether the other one is loose, so they might take turns for ever.
    pub fn take_due(&mut self, has_changed: bool, scene: &Scene) -> (Vec<TreeKey>, bool) {
        let slots = scene.trees.slot_count();
        let mut due = std::mem::take(&mut self.new);
        if has_changed || !due.is_empty() {
            (self.left, self.left_loose, self.has_opened) = (2 * slots, 2 * slots, false);
        }
        due.retain(|tree| scene.trees.contains_key(*tree));
        let (mut looks, may_close) = (0, self.left_loose > 0);
        while looks < LOOKS_PER_UPDATE && self.left > 0 {
            let tree = scene.trees.key_at((self.next % slots) as u32);
            looks += 1 + tree.map_or(0, |tree| scene.trees[tree].instances.len().min(LOOKED_AT));
            due.extend(tree);
            (self.next, self.left) = ((self.next + 1) % slots, self.left - 1);
            self.left_loose = self.left_loose.saturating_sub(1);
        }
        due.sort_unstable();
        due.dedup();
        (due, may_close)
    }

    /// Takes the memory of a list back. If trees became loose or ceased to be, another round follows; in it, others may
    /// cease to be loose unless one became so.
    pub fn finish(&mut self, mut due: Vec<TreeKey>, (has_opened, has_closed): (bool, bool), slots: usize) {
        due.clear();
        self.new = due;
        self.has_opened |= has_opened;
        if has_opened || has_closed {
            self.left = self.left.max(slots);
        }
        if has_closed && !self.has_opened {
            self.left_loose = self.left_loose.max(slots);
        }
    }
}

/// About how many lights of others lie within the box of an instance of a tree, in the mean.
pub(super) fn crowd(scene: &Scene, filing: &Filing, tree: TreeKey) -> f32 {
    let entry = &scene.trees[tree];
    let all = entry.instances.len();
    if all == 0 || !entry.may_be_loose() {
        return 0.0;
    }
    let looked_at = all.min(LOOKED_AT);
    let of_instance = |key: InstanceKey| filing.lights_within(scene, key);
    let sum: f64 = (0..looked_at).map(|i| of_instance(entry.instances[i * all / looked_at])).sum();
    (sum / looked_at as f64) as f32
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Mat3, Vec3};

    use super::super::LightWorld;
    use super::*;
    use crate::instance::placement::Placement;
    use crate::light::Light;
    use crate::policy::Policy;
    use crate::scheduler::FrameBudget;
    use crate::tree::LightTree;
    use crate::tree::testing::Rng;

    /// Lamps over a square of 100 m.
    fn lamps(count: usize) -> Vec<Light> {
        let at = |i: usize| Vec3::new((i * 37 % 101) as f32 - 50.0, 5.0, (i * 53 % 97) as f32 - 48.0);
        (0..count).map(|i| Light::point(at(i), Vec3::ONE)).collect()
    }

    fn string(lamps: usize) -> Vec<Light> {
        let at = |i: usize| Vec3::new(i as f32 - 0.5 * lamps as f32, 5.0, 0.0);
        (0..lamps).map(|i| Light::point(at(i), Vec3::ONE)).collect()
    }

    fn add(world: &mut LightWorld, lights: Vec<Light>, place: Placement) -> (TreeKey, InstanceKey) {
        let tree = world.add_tree(LightTree::new(lights).expect("valid"));
        (tree, world.add_instance(tree, place, Policy::Budgeted).expect("valid"))
    }

    /// Updates until no tree is to be looked at.
    fn settle(world: &mut LightWorld) {
        world.update(FrameBudget::NONE);
        while world.crowds.left > 0 {
            world.update(FrameBudget::NONE);
        }
    }

    fn crowd(world: &LightWorld, tree: TreeKey) -> f32 {
        world.scene.trees[tree].crowd.lights
    }

    const FAR: [DVec3; 2] = [DVec3::ZERO, DVec3::new(1.0e7, -9.0e6, 8.0e6)];

    #[test]
    fn a_crowd_counts_the_lights_of_others_within_the_box_and_the_share_of_those_across_its_border() {
        for far in FAR {
            let mut world = LightWorld::new();
            world.set_origin_near(far).expect("finite");
            let (tree, _) = add(&mut world, lamps(300), Placement::at(far));
            let at = |x: f64| Placement::at(far + DVec3::X * x);
            let (small, _) = add(&mut world, string(7), at(10.0));
            settle(&mut world);
            assert_eq!((crowd(&world, tree), crowd(&world, small)), (7.0, 0.0), "a small one in a large one");
            add(&mut world, string(7), at(20.0));
            add(&mut world, lamps(100), at(400.0));
            settle(&mut world);
            assert_eq!(crowd(&world, tree), 14.0, "those beside it do not count");
            assert!(world.openings(tree).is_empty());
            // Half of it is across the border.
            let (beside, _) = add(&mut world, lamps(200), at(50.0));
            settle(&mut world);
            assert!((crowd(&world, tree) - 114.0).abs() < 8.0, "{}", crowd(&world, tree));
            assert!((crowd(&world, beside) - 164.0).abs() < 10.0, "{}", crowd(&world, beside));
            assert_eq!((world.openings(tree).len(), world.openings(beside).len()), (300, 200));
        }
    }

    #[test]
    fn strings_that_cross_are_loose_and_strings_in_a_row_are_whole() {
        let crossing =
            |i: usize| Placement { linear: Mat3::from_rotation_y(i as f32), translation: DVec3::Y * 0.05 * i as f64 };
        for far in FAR {
            let mut world = LightWorld::new();
            world.set_origin_near(far).expect("finite");
            for i in 0..5 {
                let here = crossing(i);
                add(&mut world, string(40), Placement { translation: far + here.translation, ..here });
            }
            world.update(FrameBudget::NONE);
            assert_eq!(world.parts().len(), 5 * 40);
            // Side by side, ten metres apart or end to end.
            let mut world = LightWorld::new();
            world.set_origin_near(far).expect("finite");
            for i in 0..20 {
                add(&mut world, string(40), Placement::at(far + DVec3::Z * 10.0 * f64::from(i)));
                add(&mut world, string(40), Placement::at(far + DVec3::new(41.0 * f64::from(i), 50.0, 0.0)));
            }
            world.update(FrameBudget::NONE);
            assert_eq!(world.parts().len(), 40);
        }
    }

    #[test]
    fn crowds_follow_instances_that_come_go_and_move() {
        let mut world = LightWorld::new();
        let (tree, _) = add(&mut world, lamps(300), Placement::IDENTITY);
        let others: Vec<_> =
            (0..70).map(|i| add(&mut world, string(2), Placement::at(DVec3::X * f64::from(i % 40))).1).collect();
        settle(&mut world);
        assert_eq!((crowd(&world, tree), world.openings(tree).len()), (140.0, 300));
        world.remove_instance(others[0]).expect("it lives");
        world.move_instance(others[1], Placement::at(DVec3::X * 500.0)).expect("valid");
        world.move_instance(others[2], Placement { linear: Mat3::ZERO, ..Placement::IDENTITY }).expect("valid");
        settle(&mut world);
        assert_eq!(crowd(&world, tree), 134.0);
        world.move_instance(others[1], Placement::IDENTITY).expect("valid");
        add(&mut world, string(9), Placement::IDENTITY);
        settle(&mut world);
        assert_eq!(crowd(&world, tree), 145.0);
        for other in &others[1..] {
            world.move_instance(*other, Placement::at(DVec3::X * 500.0)).expect("valid");
        }
        settle(&mut world);
        assert_eq!((crowd(&world, tree), world.openings(tree).len()), (9.0, 0));
        // Everything was looked at, so updates do nothing more.
        world.update(FrameBudget::NONE);
        assert_eq!((world.crowds.left, world.crowds.new.len()), (0, 0));
    }

    #[test]
    fn crowds_of_any_size_are_counted_about() {
        for count in [200, 3_000, 40_000] {
            let mut world = LightWorld::new();
            let (tree, _) = add(&mut world, lamps(500), Placement::IDENTITY);
            let lamp = world.add_tree(LightTree::new(string(1)).expect("valid"));
            for i in 0..count {
                // Half of them are beside it.
                let share = |multiplier: f64| (f64::from(i) * multiplier).fract();
                let at = DVec3::new(200.0 * share(0.819_172_5) - 50.0, 0.0, 94.0 * share(0.671_043_6) - 47.0);
                world.add_instance(lamp, Placement::at(at), Policy::Budgeted).expect("valid");
            }
            settle(&mut world);
            let ratio = crowd(&world, tree) / (0.5 * count as f32);
            assert!((0.8..1.25).contains(&ratio), "{count}: {ratio}");
        }
    }

    #[test]
    fn trees_that_are_copied_replaced_and_removed_are_looked_at() {
        let mut world = LightWorld::new();
        let (tree, first) = add(&mut world, lamps(300), Placement::IDENTITY);
        let at = |i: usize| Placement::at(DVec3::X * i as f64);
        let keys: Vec<_> = (0..9).map(|i| world.add_instance(tree, at(i), Policy::Budgeted).expect("valid")).collect();
        world.update(FrameBudget::NONE);
        assert_eq!(world.parts().len(), 3_000);
        let own = world.make_unique(keys[1]).expect("it lives");
        world.remove_instance(keys[0]).expect("it lives");
        settle(&mut world);
        assert_eq!((world.openings(own).len(), world.parts().len()), (300, 2_700));
        // A single light cannot be loose, and makes the others so no more.
        world.replace_lights(tree, lamps(1)).expect("valid");
        settle(&mut world);
        assert_eq!((world.openings(own).len(), world.parts().len()), (0, 9));
        world.replace_lights(tree, lamps(200)).expect("valid");
        settle(&mut world);
        assert_eq!(world.parts().len(), 8 * 200 + 300);
        for key in keys[2..].iter().chain([&first]) {
            world.remove_instance(*key).expect("it lives");
        }
        settle(&mut world);
        world.remove_tree(tree).expect("no instances");
        settle(&mut world);
        assert_eq!((world.openings(own).len(), world.parts().len()), (0, 1));
    }

    #[test]
    fn which_trees_are_loose_settles_while_instances_tremble() {
        for seed in 0..12 {
            let (mut world, mut rng) = (LightWorld::new(), Rng(seed));
            for _ in 0..30 {
                // Most of them small, gathered at one side, and some lights dark.
                let count = 2 + (800.0 * rng.between(0.0, 1.0).powi(4)) as usize;
                let extent = Vec3::new(rng.between(0.1, 60.0), rng.between(0.1, 10.0), rng.between(0.1, 60.0));
                let mut lamp = || {
                    let at = Vec3::new(rng.between(0.0, 1.0).powi(3), rng.between(-1.0, 1.0), rng.between(-1.0, 1.0));
                    Light::point(extent * at, Vec3::splat(rng.between(-0.2, 1.0).max(0.0)))
                };
                let lights = (0..count).map(|_| lamp()).collect();
                let mut coordinate = || f64::from(rng.between(-80.0, 80.0));
                let translation = DVec3::new(coordinate(), 0.0, coordinate());
                let linear = Mat3::from_rotation_y(rng.between(0.0, 6.0)) * rng.between(0.3, 2.0);
                add(&mut world, lights, Placement { linear, translation });
            }
            let keys: Vec<InstanceKey> = world.instances().collect();
            let mut before = Vec::new();
            for step in 0..120 {
                let (key, way) = (keys[step % keys.len()], if step % 2 == 0 { DVec3::X } else { DVec3::NEG_X });
                let place = world.instance(key).expect("it lives").placement;
                let translation = place.translation + 1.0e-3 * way;
                world.move_instance(key, Placement { translation, ..place }).expect("valid");
                world.update(FrameBudget::NONE);
                let loose: Vec<bool> = world.scene.trees.values().map(|entry| entry.crowd.is_loose).collect();
                assert!(step < 60 || loose == before, "seed {seed}, step {step}");
                before = loose;
            }
            let loose = before.iter().filter(|is_loose| **is_loose).count();
            assert!((5..30).contains(&loose), "{loose} trees are loose");
        }
    }
}
