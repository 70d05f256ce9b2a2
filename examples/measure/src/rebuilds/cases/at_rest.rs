//! At rest: trees whose noise rose, partly without their splitting cost, and whose lights then
//! stand still. There is always time to rebuild every tree in every frame, so that all of them
//! should soon be as good as new.

use super::Extent;
use super::lights::{Turners, Walkers, without_indices};
use super::outcome::Outcome;
use super::play::{FRAME, add, clock, world_on};
use super::tree_noise::{TreeNoise, measure_trees};
use girandole::{FrameBudget, Light, LightWorld, Policy, TreeKey};
use std::time::Duration;
use testbed::scene::SceneError;
use testbed::scene::rng::Rng;

/// The time to rebuild one light.
const NANOS_PER_LIGHT: u64 = 100;
/// Five times the time to rebuild all trees.
const BUDGET: Duration = Duration::from_millis(4);
/// The number of lights of a tree.
const LIGHTS: usize = 128;
/// The half angle of the beams of spots, in radians.
const HALF_ANGLE: f32 = 0.3;
/// The greatest speed of a walking light along each axis, in metres per second.
const WALKING_SPEED: f32 = 1.0;
/// The lights move up to this frame.
const RESTS_AT: u32 = 80;
/// Frames at rest after which noise is measured.
const RESTED: [u32; 3] = [0, 30, 120];
/// Seeds the lights.
const SEED: u64 = 4;

/// What lights do before they rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Spots turn in their places: half of those that shine up come to shine down, and vice versa.
    Turning,
    /// Point lights move a little, by less than the distance to their neighbours.
    Walking,
}

/// The results of one variant.
#[derive(Clone, Debug, PartialEq)]
pub struct AtRest {
    pub change: Change,
    /// By how much sigma of trees that are only refitted exceeds that of new trees, relative to the
    /// latter: the mean over all trees.
    pub gap: f64,
    /// The share of this gap that was recovered 0, 30 and 120 frames after the lights came to rest.
    pub recovered: [f64; 3],
    /// Trees that waited for a rebuild in the last frame.
    pub waiting: usize,
}

impl Outcome for AtRest {
    const SCENE: &'static str = "at rest";

    fn variant(&self) -> String {
        match self.change {
            Change::Turning => "spots that turned",
            Change::Walking => "lights that moved a little",
        }
        .into()
    }

    fn values(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("sigma of refitted trees over that of new trees (%)", 100.0 * self.gap),
            ("gap recovered after 0 frames", self.recovered[0]),
            ("after 30 frames", self.recovered[1]),
            ("after 120 frames", self.recovered[2]),
            ("waiting trees", self.waiting as f64),
        ]
    }
}

/// Plays all variants.
pub fn measure(extent: Extent) -> Result<Vec<AtRest>, SceneError> {
    let trees = extent.select(60, 24);
    [Change::Turning, Change::Walking].into_iter().map(|change| play(change, trees)).collect()
}

/// The lights of one tree.
enum Lights {
    Turners(Turners),
    Walkers(Walkers),
}

impl Lights {
    fn new(change: Change, rng: &mut Rng) -> Self {
        match change {
            Change::Turning => Self::Turners(Turners::new(LIGHTS, HALF_ANGLE, RESTS_AT as f32 / 60.0, rng)),
            Change::Walking => Self::Walkers(Walkers::new(LIGHTS, WALKING_SPEED, rng)),
        }
    }

    fn at(&self, frame: u32) -> Vec<(u32, Light)> {
        let time = frame as f32 / 60.0;
        match self {
            Self::Turners(turners) => turners.lights(time),
            Self::Walkers(walkers) => walkers.lights(time),
        }
    }
}

fn play(change: Change, count: usize) -> Result<AtRest, SceneError> {
    let clocks = [clock(NANOS_PER_LIGHT), clock(NANOS_PER_LIGHT)];
    let [mut world, mut refitted] = clocks.each_ref().map(world_on);
    let mut rng = Rng::new(SEED, 0);
    let lights: Vec<Lights> = (0..count).map(|_| Lights::new(change, &mut rng)).collect();
    let add_all = |world: &mut LightWorld, policy: Policy| -> Result<Vec<TreeKey>, SceneError> {
        lights.iter().map(|lights| add(world, without_indices(&lights.at(0)), policy)).collect()
    };
    // Both worlds give the same keys to their trees.
    let trees = add_all(&mut world, Policy::Budgeted)?;
    add_all(&mut refitted, Policy::RefitOnly)?;
    let mut outcome = AtRest { change, gap: 0.0, recovered: [0.0; 3], waiting: 0 };
    for frame in 1..=RESTS_AT + RESTED[2] {
        if frame <= RESTS_AT {
            for (lights, tree) in lights.iter().zip(&trees) {
                let lights = lights.at(frame);
                world.set_lights(*tree, &lights)?;
                refitted.set_lights(*tree, &lights)?;
            }
        }
        clocks.iter().for_each(|clock| clock.advance(FRAME));
        refitted.update(FrameBudget::NONE);
        outcome.waiting = world.update(FrameBudget::new(BUDGET)).waiting_trees;
        if let Some(index) = RESTED.iter().position(|rested| frame == RESTS_AT + rested) {
            let noises = measure_trees(&world, Some(&refitted), &trees)?;
            let mean = |ratio: fn(&TreeNoise) -> f64| noises.iter().map(ratio).sum::<f64>() / noises.len() as f64;
            let (now, refit) = (mean(TreeNoise::ratio), mean(TreeNoise::refitted_ratio));
            // A new tree has the ratio 1.
            outcome.gap = refit - 1.0;
            outcome.recovered[index] = (refit - now) / (refit - 1.0);
        }
    }
    Ok(outcome)
}
