//! A large tree whose lights trade places, beside small deforming trees.
//!
//! Its rebuild takes longer than a frame's whole budget. It should be as good as new within about
//! its build time divided by the budget, with threads and without.

use super::Extent;
use super::lights::{Swarm, in_box, scramble, without_indices};
use super::outcome::Outcome;
use super::play::{FRAME, RebuildDetector, add, clock, leaves, world_on};
use girandole::glam::{Vec3, vec3};
use girandole::{FrameBudget, Light, LightTree, LightWorld, Policy, TreeKey};
use std::time::Duration;
use testbed::scene::SceneError;
use testbed::scene::rng::Rng;

/// The time to rebuild one light: 30,000 lights take 22 ms.
const NANOS_PER_LIGHT: u64 = 730;
/// The number of lights of a small tree.
const SMALL_LIGHTS: usize = 64;
/// Half of the size of the box of the large tree, in metres.
const HALF: Vec3 = vec3(20.0, 4.0, 20.0);
/// How far swaying lights move from their places along each axis, in metres.
const SWAY: f32 = 0.05;
/// A tree whose splitting cost is at most this many times that of a new tree is as good as new.
const AS_NEW: f32 = 1.01;
/// A rebuild that changes the places of this part of the leaves counts as one of the whole tree.
const WHOLE_SHARE: f64 = 0.9;
/// Seeds the lights.
const SEED: u64 = 30;

/// What the lights of the large tree do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// They trade places once and then stand still.
    Once,
    /// They trade places once and then sway a little in every frame.
    OnceThenSwaying,
    /// They trade places in every frame. No tree that takes several frames can be as good as new.
    EveryFrame,
}

/// The results of one variant.
#[derive(Clone, Debug, PartialEq)]
pub struct LargeTree {
    pub change: Change,
    pub has_threads: bool,
    pub budget: Duration,
    /// The build time of the tree divided by the budget.
    pub ideal_frames: f64,
    /// Frames until the tree is as good as a new one; infinite if it never is.
    pub frames: f64,
    /// The time granted until then, divided by the build time of the tree.
    pub granted_builds: f64,
    /// Rebuilds of the whole tree.
    pub whole_rebuilds: usize,
    /// The splitting cost in the last frame, divided by that of a new tree.
    pub final_cost: f64,
    /// The longest wait of a small tree, in frames.
    pub longest_wait_small: u32,
    pub worst_overrun: Duration,
}

impl LargeTree {
    /// Whether the tree can be as good as new: its lights stay near their places for long enough.
    pub fn can_be_new(&self) -> bool {
        self.change != Change::EveryFrame
    }
}

impl Outcome for LargeTree {
    const SCENE: &'static str = "large tree";

    fn variant(&self) -> String {
        let change = match self.change {
            Change::Once => "scrambled once",
            Change::OnceThenSwaying => "scrambled once, then swaying",
            Change::EveryFrame => "scrambled every frame",
        };
        let threads = if self.has_threads { "with threads" } else { "without threads" };
        format!("{change}, {threads}, {} ms", self.budget.as_secs_f64() * 1.0e3)
    }

    fn values(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("build time / budget (frames)", self.ideal_frames),
            ("as good as new after (frames)", self.frames),
            ("time granted until then / build time", self.granted_builds),
            ("whole rebuilds", self.whole_rebuilds as f64),
            ("splitting cost at the end / new", self.final_cost),
            ("longest wait of a small tree (frames)", f64::from(self.longest_wait_small)),
            ("worst overrun (us)", self.worst_overrun.as_secs_f64() * 1.0e6),
        ]
    }
}

/// Plays all variants.
pub fn measure(extent: Extent) -> Result<Vec<LargeTree>, SceneError> {
    let mut outcomes = Vec::new();
    for change in [Change::Once, Change::OnceThenSwaying, Change::EveryFrame] {
        for has_threads in [true, false] {
            for micros in [2_000, 300] {
                outcomes.push(play(change, has_threads, Duration::from_micros(micros), extent)?);
            }
        }
    }
    Ok(outcomes)
}

/// Plays one variant.
fn play(change: Change, has_threads: bool, budget: Duration, extent: Extent) -> Result<LargeTree, SceneError> {
    let (count, small_trees, frames) = extent.select((30_000, 50, 600), (6_000, 10, 200));
    let build = Duration::from_nanos(NANOS_PER_LIGHT * count as u64);
    let clock = clock(NANOS_PER_LIGHT);
    let mut world = world_on(&clock);
    world.set_background_builds(has_threads);
    let mut rng = Rng::new(SEED, 0);
    let mut places: Vec<Vec3> = (0..count).map(|_| in_box(HALF, &mut rng)).collect();
    let lights = |places: &[Vec3], sway: Vec3| -> Vec<(u32, Light)> {
        // Every other light sways to the other side.
        let side = |index: u32| if index.is_multiple_of(2) { sway } else { -sway };
        (0..).zip(places).map(|(i, place)| (i, Light::point(*place + side(i), Vec3::splat(100.0)))).collect()
    };
    let large = add(&mut world, without_indices(&lights(&places, Vec3::ZERO)), Policy::Budgeted)?;
    let swarms: Vec<Swarm> =
        (0..small_trees).map(|_| Swarm::new(SMALL_LIGHTS, Vec3::splat(5.0), 6_400.0, &mut rng)).collect();
    let add = |swarm: &Swarm| add(&mut world, without_indices(&swarm.lights(0.0)), Policy::Budgeted);
    let small: Vec<TreeKey> = swarms.iter().map(add).collect::<Result<_, _>>()?;
    let mut detector = RebuildDetector::new(&world, &small);
    let mut rebuilt_at = vec![0; small.len()];
    let mut outcome = LargeTree {
        change,
        has_threads,
        budget,
        ideal_frames: build.as_secs_f64() / budget.as_secs_f64(),
        frames: f64::INFINITY,
        granted_builds: f64::INFINITY,
        whole_rebuilds: 0,
        final_cost: 0.0,
        longest_wait_small: 0,
        worst_overrun: Duration::ZERO,
    };
    let mut before = leaves(&world, large).to_vec();
    for frame in 1..=frames {
        clock.advance(FRAME);
        let is_scrambled = frame == 1 || change == Change::EveryFrame;
        if is_scrambled {
            scramble(&mut places, &mut rng);
        }
        if is_scrambled || change == Change::OnceThenSwaying {
            let sway = SWAY * Vec3::splat((0.1 * frame as f32).sin());
            world.set_lights(large, &lights(&places, sway))?;
        }
        for (swarm, tree) in swarms.iter().zip(&small) {
            world.set_lights(*tree, &swarm.lights(frame as f32 / 60.0))?;
        }
        let report = world.update(FrameBudget::new(budget));
        outcome.worst_overrun = outcome.worst_overrun.max(report.overrun);
        for (index, key) in small.iter().enumerate() {
            let is_rebuilt = world.tree(*key).is_some_and(|tree| detector.was_rebuilt(index, tree));
            if is_rebuilt || frame == frames {
                outcome.longest_wait_small = outcome.longest_wait_small.max(frame - rebuilt_at[index]);
                rebuilt_at[index] = frame;
            }
        }
        let now = leaves(&world, large);
        if now == before {
            continue;
        }
        let differing = now.iter().zip(&before).filter(|(now, before)| now != before).count();
        outcome.whole_rebuilds += usize::from(differing as f64 > WHOLE_SHARE * count as f64);
        before = now.to_vec();
        if outcome.frames.is_infinite() && cost_ratio(&world, large)? <= AS_NEW {
            outcome.frames = f64::from(frame);
            outcome.granted_builds = f64::from(frame) / outcome.ideal_frames;
        }
    }
    outcome.final_cost = f64::from(cost_ratio(&world, large)?);
    Ok(outcome)
}

/// The splitting cost of a tree divided by that of a new tree over the same lights; 1 if both have
/// the same leaves.
fn cost_ratio(world: &LightWorld, tree: TreeKey) -> Result<f32, SceneError> {
    let Some(tree) = world.tree(tree) else { return Ok(f32::INFINITY) };
    let fresh = LightTree::new(tree.lights().to_vec())?;
    let is_equal = fresh.leaves() == tree.leaves();
    Ok(if is_equal { 1.0 } else { tree.attributes().splitting_cost / fresh.attributes().splitting_cost })
}
