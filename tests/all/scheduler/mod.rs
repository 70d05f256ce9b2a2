//! Rebuilds keep to the budget, trees that gain most come first, the wait of every tree has a
//! bound, and runs repeat exactly on a virtual or replayed clock.

#[cfg(feature = "parallel")]
mod background;
mod clocks;
mod fairness;
mod in_frames;
mod policies;

use std::sync::Arc;
use std::time::Duration;

use girandole::glam::{DVec3, Vec3};
use girandole::scheduler::{VirtualClock, Work, WorkKind};
use girandole::tree::Node;
use girandole::{
    FrameBudget, FrameReport, InstanceKey, JobReport, Light, LightTree, LightWorld, Placement, Policy, TreeKey,
};

use testbed::testing::support::Rng;

/// The time between two frames, at sixty frames per second.
const FRAME_INTERVAL: Duration = Duration::from_micros(16_667);

/// The cost of work on the virtual clock: 0.1 µs per light for builds and slices of builds, and
/// nothing for refits.
pub fn cost(work: Work) -> Duration {
    Duration::from_nanos(match work.kind {
        WorkKind::Refit => 0,
        _ => 100 * work.lights as u64,
    })
}

/// A world on a virtual clock, with random numbers to fill it.
pub struct TestWorld {
    pub world: LightWorld,
    pub clock: Arc<VirtualClock>,
    pub rng: Rng,
}

/// A point light somewhere in the cube from `-size` to `size`.
pub fn random_light(rng: &mut Rng, size: f32) -> Light {
    Light::point(rng.position(size), Vec3::ONE)
}

impl TestWorld {
    pub fn new(seed: u64) -> Self {
        Self::with_cost(seed, cost)
    }

    pub fn with_cost(seed: u64, cost: impl Fn(Work) -> Duration + Send + Sync + 'static) -> Self {
        let clock = Arc::new(VirtualClock::new(cost));
        Self { world: LightWorld::with_clock(clock.clone()), clock, rng: Rng(seed) }
    }

    /// Adds a tree of random lights within ten metres, with one instance.
    pub fn add_tree(&mut self, lights: usize, policy: Policy) -> TreeKey {
        let lights = (0..lights).map(|_| random_light(&mut self.rng, 10.0)).collect();
        let tree = self.world.add_tree(LightTree::new(lights).expect("valid lights"));
        let translation = self.rng.position(100.0).as_dvec3();
        self.world.add_instance(tree, Placement::at(translation), policy).expect("a valid instance");
        tree
    }

    /// Moves every light of a tree to a random position, which makes the present shape of the tree
    /// as bad as it can be.
    pub fn scatter(&mut self, tree: TreeKey) {
        scatter(&mut self.world, &mut self.rng, tree);
    }

    /// Advances the clock by the time between two frames, and updates with a budget in
    /// microseconds.
    pub fn frame(&mut self, micros: u64) -> FrameReport {
        self.clock.advance(FRAME_INTERVAL);
        self.world.update(FrameBudget::new(Duration::from_micros(micros)))
    }

    /// Teaches the world's cost model the costs of the clock, so that tests do not depend on its
    /// initial values.
    pub fn calibrate(&mut self) {
        let trees: Vec<_> =
            [20, 50, 100, 300, 1000, 3000].map(|lights| self.add_tree(lights, Policy::AlwaysRebuild)).into();
        for _ in 0..60 {
            trees.iter().for_each(|tree| self.scatter(*tree));
            self.clock.advance(FRAME_INTERVAL);
            self.world.update(FrameBudget::UNLIMITED);
        }
        trees.into_iter().for_each(|tree| self.remove(tree));
        // The margin for the errors of the initial costs fades.
        (0..3000).for_each(|_| {
            self.world.update(FrameBudget::NONE);
        });
    }

    /// The first instance of a tree.
    pub fn instance_of(&self, tree: TreeKey) -> InstanceKey {
        let has_tree = |instance: &InstanceKey| self.world.instance(*instance).map(|i| i.tree) == Some(tree);
        self.world.instances().find(has_tree).expect("the tree has an instance")
    }

    /// Removes a tree with one instance.
    pub fn remove(&mut self, tree: TreeKey) {
        self.world.remove_instance(self.instance_of(tree)).expect("the instance exists");
        self.world.remove_tree(tree).expect("the tree has no instances");
    }

    /// The shape of a tree as of the last update equals that of a new tree over the same lights.
    pub fn is_as_new(&self, tree: TreeKey) -> bool {
        let fresh = LightTree::new(self.lights(tree).to_vec()).expect("valid lights");
        self.world.tree(tree).expect("the tree exists").leaves() == fresh.leaves()
    }

    /// The lights of a tree as of the last update.
    pub fn lights(&self, tree: TreeKey) -> &[Light] {
        self.world.tree(tree).expect("the tree exists").lights()
    }
}

/// Moves every light of a tree to a random position within ten metres.
pub fn scatter(world: &mut LightWorld, rng: &mut Rng, tree: TreeKey) {
    let count = world.tree(tree).expect("the tree exists").lights().len() as u32;
    let changes: Vec<_> = (0..count).map(|i| (i, random_light(rng, 10.0))).collect();
    world.set_lights(tree, &changes).expect("valid lights");
}

/// Checks that every tree of a world is sound.
pub fn check_trees(world: &LightWorld) {
    world.trees().for_each(|tree| world.tree(tree).expect("the tree exists").check().expect("a sound tree"));
}

/// The jobs of the last update that rebuilt a tree at once.
pub fn rebuild_jobs(world: &LightWorld) -> Vec<JobReport> {
    let is_rebuild = |job: &&JobReport| job.work.kind == WorkKind::Rebuild;
    world.jobs().iter().filter(is_rebuild).copied().collect()
}

/// The contents of a world's trees, in the order of their keys.
pub fn tree_contents(world: &LightWorld) -> Vec<(Vec<u32>, Vec<Node>)> {
    let tree = |key| world.tree(key).expect("the tree exists");
    world.trees().map(|key| (tree(key).leaves().to_vec(), tree(key).nodes().to_vec())).collect()
}

/// A placement that is far from all viewpoints and all other instances.
pub fn far_placement() -> Placement {
    Placement::at(DVec3::new(9.0e8, 0.0, 0.0))
}

/// Changes after which a tree of 20,000 lights does not need the build that is open, and the lights that it has then.
type Change = fn(&mut TestWorld, TreeKey);
const CHANGES: [(&str, Change, usize); 4] = [
    ("removed", |test, tree| test.remove(tree), 0),
    (
        "lights replaced",
        |test, tree| {
            let lights = (0..50).map(|_| random_light(&mut test.rng, 5.0)).collect();
            test.world.replace_lights(tree, lights).expect("valid lights");
        },
        50,
    ),
    (
        "policy changed",
        |test, tree| {
            test.world.set_policy(test.instance_of(tree), Policy::RefitOnly).expect("a valid policy");
        },
        20_000,
    ),
    (
        "rebuilt by the engine",
        |test, tree| {
            test.world.rebuild_tree(tree).expect("the tree exists");
        },
        20_000,
    ),
];
