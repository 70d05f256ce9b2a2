//! Rebuilds keep to the budget, go where they gain most, leave nobody waiting for ever, and repeat.

mod background;
mod clocks;
mod fairness;
mod policies;

use std::sync::Arc;
use std::time::Duration;

use girandole::glam::{DVec3, Vec3};
use girandole::scheduler::{VirtualClock, Work, WorkKind};
use girandole::{FrameBudget, JobReport, Light, LightWorld, Placement, Policy, TreeKey};

use crate::support::Rng;

/// A tenth of a microsecond a light for builds, a tenth of that for copies.
pub fn cost(work: Work) -> Duration {
    Duration::from_nanos(match work.kind {
        WorkKind::Snapshot => 10 * work.lights as u64,
        WorkKind::Refit | WorkKind::Probe => 0,
        _ => 100 * work.lights as u64,
    })
}

/// A world on virtual time.
pub struct Theater {
    pub world: LightWorld,
    pub clock: Arc<VirtualClock>,
    pub rng: Rng,
}

/// A small light somewhere in a cube.
pub fn spark(rng: &mut Rng, size: f32) -> Light {
    Light::point(rng.place(size), Vec3::ONE)
}

impl Theater {
    pub fn new(seed: u64) -> Self {
        let clock = Arc::new(VirtualClock::new(cost));
        Self { world: LightWorld::with_clock(clock.clone()), clock, rng: Rng(seed) }
    }

    /// A tree of so many lights in a cube of ten metres, with one instance.
    pub fn tree(&mut self, lights: usize, policy: Policy) -> TreeKey {
        let sparks = (0..lights).map(|_| spark(&mut self.rng, 10.0)).collect();
        let tree = self.world.add_tree(sparks).expect("valid");
        let place = self.rng.place(100.0).as_dvec3();
        self.world.add_instance(tree, Placement::at(place), policy).expect("valid");
        tree
    }

    /// Puts every light of a tree anywhere: as bad for its shape as can be.
    pub fn scatter(&mut self, tree: TreeKey) {
        let count = self.world.tree(tree).expect("it lives").lights().len() as u32;
        let changes: Vec<_> = (0..count).map(|i| (i, spark(&mut self.rng, 10.0))).collect();
        self.world.set_lights(tree, &changes).expect("valid");
    }

    /// A sixtieth of a second passes, then an update with so many microseconds.
    pub fn frame(&mut self, micros: u64) -> girandole::FrameReport {
        self.clock.advance(Duration::from_micros(16_667));
        self.world.update(FrameBudget::new(Duration::from_micros(micros)))
    }

    /// Teaches what rebuilds take, so that tests need not reckon with first guesses.
    pub fn calibrate(&mut self) {
        let trees: Vec<_> =
            [20, 50, 100, 300, 1000, 3000].map(|lights| self.tree(lights, Policy::AlwaysRebuild)).into();
        for _ in 0..60 {
            trees.iter().for_each(|tree| self.scatter(*tree));
            self.clock.advance(Duration::from_micros(16_667));
            self.world.update(FrameBudget::UNLIMITED);
        }
        let instances: Vec<_> = self.world.instances().collect();
        instances.into_iter().for_each(|instance| self.world.remove_instance(instance).expect("it lives"));
        trees.into_iter().for_each(|tree| self.world.remove_tree(tree).expect("unused"));
        // What the first guesses were off by is forgotten.
        (0..3000).for_each(|_| {
            self.world.update(FrameBudget::NONE);
        });
        self.world.take_delta();
    }
}

/// The jobs of the last update that built something.
pub fn builds(world: &LightWorld) -> Vec<JobReport> {
    let is_build = |job: &&JobReport| matches!(job.work.kind, WorkKind::Rebuild | WorkKind::RebuildPart);
    world.jobs().iter().filter(is_build).copied().collect()
}

/// Of a world's trees, in the order of their keys.
pub fn fingerprint(world: &LightWorld) -> Vec<(Vec<u32>, Vec<girandole::tree::Node>)> {
    let tree = |key| world.tree(key).expect("it lives");
    world.trees().map(|key| (tree(key).leaves().to_vec(), tree(key).nodes().to_vec())).collect()
}

/// Where nobody is.
pub fn far() -> Placement {
    Placement::at(DVec3::new(1.0e5, 0.0, 0.0))
}
