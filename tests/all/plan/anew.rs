//! After random edits of all kinds and rebuilds in budgets, shaders read the same bits as from the
//! records of a planner that starts anew on the same world.

use std::sync::Arc;
use std::time::Duration;

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::plan::{LightPlanner, PlanLimits};
use girandole::scheduler::{VirtualClock, WorkKind};
use girandole::{
    DirectionalLight, FrameBudget, InstanceKey, JobReport, Light, LightTree, LightWorld, Placement, Policy, Region,
    RegionInstance, RegionKey, TreeKey,
};
use testbed::testing::plan_device::{Device, Played};
use testbed::testing::plan_records::check_as_new;
use testbed::testing::support::Rng;

/// Kinds of edits.
const KINDS: u64 = 26;

/// Half the size of the cube in metres that the instances are in. It is small, so that many trees are opened.
const SIZE: f32 = 60.0;

struct Edited {
    world: LightWorld,
    rng: Rng,
    trees: Vec<TreeKey>,
    instances: Vec<InstanceKey>,
    region: Option<RegionKey>,
    clock: Arc<VirtualClock>,
    /// The sum over all frames of the instances whose trees are opened.
    opened: usize,
}

impl Edited {
    fn new(seed: u64) -> Self {
        // 100 ns for each light, so that the large trees do not fit into a frame.
        let clock = Arc::new(VirtualClock::new(|work| Duration::from_nanos(100 * work.lights as u64)));
        let world = LightWorld::with_clock(clock.clone());
        let (trees, instances) = (Vec::new(), Vec::new());
        let mut edited = Self { world, rng: Rng(seed), trees, instances, region: None, clock, opened: 0 };
        (0..12).for_each(|_| edited.add_tree());
        edited
    }

    fn below(&mut self, count: usize) -> usize {
        self.rng.bits() as usize % count
    }

    /// A list of lights; one of twelve is long.
    fn lights(&mut self) -> Vec<Light> {
        let most = if self.below(12) == 0 { 1200 } else { 40 };
        let count = self.below(most);
        self.rng.lights(count, 20.0)
    }

    fn tree(&mut self) -> LightTree {
        LightTree::new(self.lights()).expect("valid lights")
    }

    fn add_tree(&mut self) {
        let tree = self.tree();
        self.trees.push(self.world.add_tree(tree));
    }

    /// A placement that may be the present one, or hide, or have the other sign of zero.
    fn place(&mut self) -> Placement {
        let place = Placement::from(self.rng.affine(SIZE));
        match self.below(8) {
            0 => Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 0.0, 1.0)), ..place },
            1 => Placement::at(DVec3::new(0.0, -0.0, place.translation.z)),
            2 => Placement { linear: -Mat3::from_diagonal(Vec3::new(1.0, 1.0, -1.0)), ..place },
            3 => Placement { linear: Mat3::IDENTITY, ..place },
            _ => place,
        }
    }

    /// A light with a negative zero where some others have a zero.
    fn light(&mut self, size: f32) -> Light {
        match self.below(4) {
            0 => Light::point(Vec3::new(-0.0, 0.0, self.rng.between(-1.0, 1.0)), Vec3::new(1.0, -0.0, 0.0)),
            1 => Light::point(Vec3::new(0.0, -0.0, 1.0), Vec3::new(1.0, 0.0, -0.0)),
            _ => self.rng.light(size),
        }
    }

    /// Makes an edit. Returns whether it was accepted.
    fn edit(&mut self, kind: u64) -> bool {
        let index = self.below(self.trees.len());
        let tree = self.trees[index];
        let count = self.world.tree(tree).map_or(0, |tree| tree.lights().len());
        let light = self.below(count.max(1)) as u32;
        if let Some(key) = (!self.instances.is_empty()).then(|| self.below(self.instances.len())) {
            let instance = self.instances[key];
            let factor = Vec3::splat([0.0, 1.0, self.rng.unit()][self.below(3)]);
            let mask = [u32::MAX, 0, 1, 2][self.below(4)];
            let (place, bits) = (self.place(), self.below(8));
            return match kind {
                0 => self.world.set_appearance(instance, |a| a.is_enabled = bits > 1).is_ok(),
                1 => self.world.set_appearance(instance, |a| a.factor = factor).is_ok(),
                2 => self.world.set_appearance(instance, |a| a.mask = mask).is_ok(),
                3 => self.world.set_appearance(instance, |a| a.user_data = bits as u32).is_ok(),
                4..=6 => self.world.move_instance(instance, place).is_ok(),
                7 => match self.world.make_unique(instance) {
                    Ok(own) if !self.trees.contains(&own) && self.trees.len() < 20 => {
                        self.trees.push(own);
                        true
                    }
                    _ => false,
                },
                8 => {
                    self.instances.swap_remove(key);
                    self.world.remove_instance(instance).is_ok()
                }
                9 => {
                    let policies = [Policy::Static, Policy::Budgeted, Policy::RefitOnly, Policy::AlwaysRebuild];
                    // Few trees are static, which refuse edits.
                    let policy = policies[self.below(13).div_ceil(4)];
                    self.world.set_policy(instance, policy).is_ok()
                }
                _ => self.edit_tree(kind, (index, tree), (light, count)),
            };
        }
        self.edit_tree(kind, (index, tree), (light, count))
    }

    fn edit_tree(&mut self, kind: u64, (index, tree): (usize, TreeKey), (light, count): (u32, usize)) -> bool {
        match kind {
            10 | 11 => {
                let emission = [Vec3::ZERO, -Vec3::ZERO, Vec3::ONE, Vec3::splat(9.0)][self.below(4)];
                self.world.set_emission(tree, light, emission).is_ok()
            }
            12 | 13 => {
                let value = self.light(20.0);
                self.world.set_lights(tree, &[(light, value)]).is_ok()
            }
            // Far away, so that it gets another place in the tree.
            14 | 15 => {
                let value = self.light(400.0);
                self.world.set_lights(tree, &[(light, value)]).is_ok()
            }
            16 => {
                let first = light.min(count.saturating_sub(30) as u32);
                let lights: Vec<_> = (first..count as u32).take(30).map(|i| (i, self.rng.light(25.0))).collect();
                self.world.set_lights(tree, &lights).is_ok()
            }
            17 | 18 => {
                let new: Vec<_> = (0..=self.below(3)).map(|_| self.light(30.0)).collect();
                let added = self.world.add_lights(tree, &new);
                // Some are gone before the update.
                added.is_ok_and(|added| self.below(4) > 0 || self.world.remove_lights(tree, &added[..1]).is_ok())
            }
            19 | 20 => self.world.remove_lights(tree, &[light]).is_ok(),
            21 => {
                let lights = self.lights();
                self.world.replace_lights(tree, lights).is_ok()
            }
            22 => {
                let by = self.tree();
                self.world.replace_tree(tree, by).is_ok()
            }
            23 if self.below(2) == 0 && self.world.remove_tree(tree).is_ok() => {
                self.trees.swap_remove(index);
                // Copies fill the list again.
                (self.trees.len()..12).for_each(|_| self.add_tree());
                true
            }
            23 => self.world.rebuild_tree(tree).is_ok(),
            24 => self.change_world(),
            _ => {
                let place = self.place();
                let key = (self.instances.len() < 40).then(|| self.world.add_instance(tree, place, Policy::Budgeted));
                self.instances.extend(key.and_then(Result::ok));
                true
            }
        }
    }

    fn change_world(&mut self) -> bool {
        match self.below(4) {
            0 => {
                let to = self.rng.position(5000.0).as_dvec3() * self.below(2) as f64;
                self.world.set_origin_near(to).is_ok()
            }
            1 => {
                let first = self.world.directionals().next();
                if let Some(key) = first.filter(|_| self.below(2) == 0) {
                    return self.world.remove_directional(key).is_ok();
                }
                let light = DirectionalLight { direction: self.rng.direction(), illuminance: Vec3::ONE };
                self.world.directionals().len() > 3 || self.world.add_directional(light).is_ok()
            }
            2 => {
                let at = self.rng.position(500.0).as_dvec3();
                self.world.set_viewpoint(at).is_ok()
            }
            _ => self.change_region(),
        }
    }

    fn change_region(&mut self) -> bool {
        if let Some(region) = self.region.take() {
            return self.world.remove_region(region).is_ok();
        }
        let mut region = Region::new();
        for _ in 0..1 + self.below(3) {
            let tree = region.add_tree(self.tree());
            for _ in 0..self.below(4) {
                let instance = RegionInstance::new(tree, self.place(), Policy::Budgeted);
                region.add_instance(instance).expect("a valid placement");
            }
        }
        self.region = Some(self.world.add_region(&mut region).expect("a sound region"));
        true
    }

    /// Ends the frame with one of several budgets.
    fn update(&mut self) -> bool {
        let budget = [FrameBudget::NONE, FrameBudget::new(Duration::from_micros(25)), FrameBudget::UNLIMITED];
        let budget = budget[self.below(16).div_ceil(14)];
        self.clock.advance(Duration::from_millis(16));
        let report = self.world.update(budget);
        self.opened += report.opened_instances;
        let is_slice = |job: &JobReport| matches!(job.work.kind, WorkKind::Slice { .. });
        report.background.taken > 0 || self.world.jobs().iter().any(is_slice)
    }
}

/// Runs so many edits, and compares all records every few of them.
fn run(seed: u64, edits: u64) {
    let mut edited = Edited::new(seed);
    edited.world.set_background_builds(seed % 4 < 2);
    // One planner has all it wants, another one little memory and few bytes in each frame.
    let limited = PlanLimits::default().with_tree_memory(400_000).with_frame_bytes(20_000);
    let mut players = [PlanLimits::default(), limited]
        .map(|limits| Played { planner: LightPlanner::new(limits), device: Device::default() });
    // A reader that skips frames, drops reservations, and loses what its device has.
    let mut skipper = Played::new();
    let (mut accepted, mut built, mut stand_ins, mut made) = ([0; KINDS as usize], 0, 0, 0);
    while made < edits {
        for _ in 0..1 + edited.below(20) {
            let kind = edited.rng.bits() % KINDS;
            accepted[kind as usize] += u64::from(edited.edit(kind));
            made += 1;
        }
        built += u64::from(edited.update());
        if edited.below(50) == 0 {
            let bytes = [300_000, 600_000, 800_000][edited.below(3)];
            players[1].planner.set_tree_memory(Some(bytes));
        }
        for played in &mut players {
            played.frame(&edited.world);
            let found = check_as_new(played, &edited.world);
            stand_ins += found.stand_ins;
        }
        match edited.below(16) {
            0 => drop(skipper.planner.reserve(&edited.world).expect("room enough")),
            1 => {
                skipper.frame(&edited.world);
                skipper.planner.lose();
                skipper.device.forget();
            }
            2 => drop(skipper.frame(&edited.world)),
            _ => continue,
        }
        skipper.frame(&edited.world);
        check_as_new(&skipper, &edited.world);
        assert_eq!(skipper.planner.revision(), edited.world.revision());
    }
    // The rarest kind is a removal of a light among few, or the replacement of a static tree.
    let least = edits / KINDS / 8;
    assert!(accepted.iter().all(|count| *count > least), "{accepted:?}");
    let opened = edited.opened as u64;
    assert!(built > edits / 200 && stand_ins > 20 && opened > edits / 20, "{built} {stand_ins} {opened}");
}

#[test]
fn records_after_random_edits_are_those_of_a_new_planner() {
    (0..4).for_each(|seed| run(seed, 5_000));
}
