//! Varying budgets: many small trees and four large ones, all of which change in every frame.
//!
//! The longest job of a frame depends on the largest budgets, and the rounds on their mean. A
//! scheduler that compares a job with the budget of the present frame, or with the mean, starves
//! the large trees.

use super::Extent;
use super::lights::{Swarm, without_indices};
use super::outcome::Outcome;
use super::play::{FRAME, RebuildDetector, add, clock, world_on};
use girandole::glam::Vec3;
use girandole::{FrameBudget, Policy, TreeKey};
use std::time::Duration;
use testbed::scene::SceneError;
use testbed::scene::rng::Rng;

/// Trees of the same size.
#[derive(Clone, Copy)]
struct Group {
    trees: usize,
    /// The number of lights of each tree.
    lights: usize,
    /// Half of the size of the box of each tree, in metres.
    half: f32,
    /// The intensity of each tree, in candela.
    candela: f32,
}

/// The small trees: each takes 6.4 microseconds.
const SMALL: Group = Group { trees: 150, lights: 64, half: 5.0, candela: 6_400.0 };
/// The large trees: each takes 150 microseconds. They are so dim that their priority is the lowest,
/// and only the bound on waiting gets them rebuilt.
const LARGE: Group = Group { trees: 4, lights: 1_500, half: 15.0, candela: 0.064 };
/// The time to rebuild one light.
const NANOS_PER_LIGHT: u64 = 100;
/// The greatest random budget, in microseconds.
const MAX_RANDOM: f32 = 900.0;
/// Seeds the lights and the random budgets.
const SEED: u64 = 12;

/// A sequence of budgets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Budgets {
    /// These budgets in turn, in microseconds.
    Repeated(&'static [u64]),
    /// Random up to [`MAX_RANDOM`]: uniform.
    Random,
    /// Random up to [`MAX_RANDOM`]: uniform in the logarithm, so that most are small.
    MostlySmall,
}

const SEQUENCES: [Budgets; 6] = [
    Budgets::Repeated(&[300]),
    Budgets::Repeated(&[900, 3]),
    Budgets::Repeated(&[40, 900, 3]),
    Budgets::Repeated(&[5, 300, 17, 40, 900]),
    Budgets::Random,
    Budgets::MostlySmall,
];

impl Budgets {
    fn name(self) -> String {
        match self {
            Self::Repeated(micros) => {
                let micros: Vec<String> = micros.iter().map(u64::to_string).collect();
                format!("{} us", micros.join(", "))
            }
            Self::Random => format!("random, 1 to {MAX_RANDOM} us"),
            Self::MostlySmall => format!("random, 1 to {MAX_RANDOM} us, mostly small"),
        }
    }

    fn at(self, frame: usize) -> Duration {
        let random = Rng::new(SEED, 0x1000 + frame as u64).unit();
        Duration::from_micros(match self {
            Self::Repeated(micros) => micros[frame % micros.len()],
            Self::Random => 1 + (random * MAX_RANDOM) as u64,
            Self::MostlySmall => MAX_RANDOM.powf(random) as u64,
        })
    }
}

/// The results of one sequence of budgets.
#[derive(Clone, Debug, PartialEq)]
pub struct VaryingBudgets {
    pub budgets: String,
    /// The longest time between two rebuilds of a small tree, in frames. The start and the end of
    /// the run count as rebuilds.
    pub longest_wait_small: u32,
    /// The same of a large tree.
    pub longest_wait_large: u32,
    /// The longest wait in time granted, divided by the time to rebuild all trees once.
    pub longest_wait_rounds: f64,
    /// Trees that were never rebuilt.
    pub never_rebuilt: usize,
    /// The part of the granted time that was spent, within frames and in the background.
    pub spent_share: f64,
    /// By how much the time spent exceeds the time granted.
    pub overspent: Duration,
    /// The time to build a large tree.
    pub longest_build: Duration,
    /// The part of the frames that took longer than their budget.
    pub overrun_share: f64,
    pub worst_overrun: Duration,
}

impl Outcome for VaryingBudgets {
    const SCENE: &'static str = "varying budgets";

    fn variant(&self) -> String {
        self.budgets.clone()
    }

    fn values(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("longest wait of a small tree (frames)", f64::from(self.longest_wait_small)),
            ("longest wait of a large tree (frames)", f64::from(self.longest_wait_large)),
            ("longest wait (rounds of time granted)", self.longest_wait_rounds),
            ("trees never rebuilt", self.never_rebuilt as f64),
            ("time spent / time granted", self.spent_share),
            ("frames over budget / frames", self.overrun_share),
            ("worst overrun (us)", self.worst_overrun.as_secs_f64() * 1.0e6),
        ]
    }
}

/// Plays all sequences of budgets.
pub fn measure(extent: Extent) -> Result<Vec<VaryingBudgets>, SceneError> {
    SEQUENCES.into_iter().map(|budgets| play(budgets, extent.select(2_500, 300))).collect()
}

/// The last rebuild of a tree.
#[derive(Clone, Copy, Default)]
struct LastRebuild {
    frame: u32,
    /// The time that was granted until then.
    granted: Duration,
    /// The start of the run counts as a rebuild.
    is_start: bool,
}

fn play(budgets: Budgets, frames: u32) -> Result<VaryingBudgets, SceneError> {
    let mut rng = Rng::new(SEED, 0);
    let groups = || [SMALL, LARGE].into_iter().flat_map(|group| (0..group.trees).map(move |_| group));
    let swarm = |group: Group| Swarm::new(group.lights, Vec3::splat(group.half), group.candela, &mut rng);
    let swarms: Vec<Swarm> = groups().map(swarm).collect();
    let round = Duration::from_nanos(NANOS_PER_LIGHT * groups().map(|group| group.lights as u64).sum::<u64>());
    let clock = clock(NANOS_PER_LIGHT);
    let mut world = world_on(&clock);
    let add = |swarm: &Swarm| add(&mut world, without_indices(&swarm.lights(0.0)), Policy::Budgeted);
    let trees: Vec<TreeKey> = swarms.iter().map(add).collect::<Result<_, _>>()?;
    let mut detector = RebuildDetector::new(&world, &trees);
    let mut last = vec![LastRebuild { is_start: true, ..LastRebuild::default() }; trees.len()];
    let mut longest = vec![0; trees.len()];
    let (mut granted, mut spent, mut longest_granted) = (Duration::ZERO, Duration::ZERO, Duration::ZERO);
    let (mut overruns, mut worst_overrun) = (0, Duration::ZERO);
    for frame in 1..=frames {
        clock.advance(FRAME);
        for (swarm, tree) in swarms.iter().zip(&trees) {
            world.set_lights(*tree, &swarm.lights(frame as f32 / 60.0))?;
        }
        let budget = budgets.at(frame as usize - 1);
        let report = world.update(FrameBudget::new(budget));
        granted += budget;
        spent += report.spent + report.background.spent;
        overruns += u32::from(!report.overrun.is_zero());
        worst_overrun = worst_overrun.max(report.overrun);
        for (index, key) in trees.iter().enumerate() {
            let is_rebuilt = world.tree(*key).is_some_and(|tree| detector.was_rebuilt(index, tree));
            if is_rebuilt || frame == frames {
                longest[index] = longest[index].max(frame - last[index].frame);
                longest_granted = longest_granted.max(granted - last[index].granted);
            }
            if is_rebuilt {
                last[index] = LastRebuild { frame, granted, is_start: false };
            }
        }
    }
    let longest_of = |waits: &[u32]| waits.iter().copied().max().unwrap_or(0);
    Ok(VaryingBudgets {
        budgets: budgets.name(),
        longest_wait_small: longest_of(&longest[..SMALL.trees]),
        longest_wait_large: longest_of(&longest[SMALL.trees..]),
        longest_wait_rounds: longest_granted.as_secs_f64() / round.as_secs_f64(),
        never_rebuilt: last.iter().filter(|last| last.is_start).count(),
        spent_share: spent.as_secs_f64() / granted.as_secs_f64(),
        overspent: spent.saturating_sub(granted),
        longest_build: Duration::from_nanos(NANOS_PER_LIGHT * LARGE.lights as u64),
        overrun_share: f64::from(overruns) / f64::from(frames),
        worst_overrun,
    })
}
