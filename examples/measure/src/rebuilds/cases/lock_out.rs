//! Lock-out: trees of narrow spots, for which predictions of noise mislead.
//!
//! The spots turn, then they trade places once and turn slowly, and at last they rest. There is
//! always time to rebuild every tree in every frame. Few beams meet a point near the tree, so that
//! the noise at a few points says little about the noise elsewhere. A scheduler that learns from
//! such measurements may conclude that rebuilds of a tree gain nothing. If it learns only from
//! rebuilds, it never finds out that this is wrong.

use super::super::run::in_parallel;
use super::Extent;
use super::lights::{Rig, scramble, without_indices};
use super::outcome::Outcome;
use super::play::{FRAME, add, clock, world_on};
use super::tree_noise::{TreeNoise, measure_trees};
use girandole::{FrameBudget, Policy, TreeKey};
use std::ops::Range;
use std::time::Duration;
use testbed::scene::SceneError;
use testbed::scene::rng::Rng;

/// The time to rebuild one light.
const NANOS_PER_LIGHT: u64 = 100;
/// More than ten times the time to rebuild all trees.
const BUDGET: Duration = Duration::from_millis(4);
/// The number of trees for each seed.
const TREES: usize = 25;
/// The least and the greatest number of spots of a tree.
const SPOTS: (usize, usize) = (64, 160);
/// The mean half angle of the beams, in radians.
const HALF_ANGLE: f32 = 0.15;
/// How far spots move from their places, in metres.
const DRIFT: f32 = 0.5;
/// In this frame the spots trade places, and from then on they turn slowly.
const SCRAMBLED_AT: u32 = 300;
/// In this frame the spots come to rest.
const RESTS_AT: u32 = 480;
/// Frames at rest.
const REST: u32 = 120;
/// The speed of spots that turn slowly, relative to their speed before.
const SLOW: f32 = 0.1;
/// A tree counts as locked out if its sigma is more than this many times that of a new tree.
const LOCKED_OUT: f64 = 1.5;

/// The noise of all trees in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct LockOut {
    /// When the noise was measured.
    pub moment: String,
    pub trees: usize,
    /// Trees whose sigma is more than 1.5 times that of a new tree.
    pub locked_out: usize,
    /// The tree with the greatest ratio of sigma to that of a new tree.
    pub worst: TreeNoise,
    /// Trees that waited for a rebuild at that moment.
    pub waiting: usize,
}

impl Outcome for LockOut {
    const SCENE: &'static str = "lock-out";

    fn variant(&self) -> String {
        self.moment.clone()
    }

    fn values(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("trees", self.trees as f64),
            ("trees above 1.5 times the sigma of a new tree (%)", 100.0 * self.locked_out as f64 / self.trees as f64),
            ("greatest ratio of sigma to that of a new tree", self.worst.ratio()),
            ("sigma of that tree", self.worst.now),
            ("sigma of a new tree in its place", self.worst.new),
            ("waiting trees", self.waiting as f64),
        ]
    }
}

/// The noise of the trees of one seed at one moment, and the number of waiting trees.
type Moment = (Vec<TreeNoise>, usize);

/// Plays all seeds.
pub fn measure(extent: Extent) -> Result<Vec<LockOut>, SceneError> {
    let seeds: Vec<u64> = (0..extent.select(40, 4)).collect();
    let played = in_parallel(&seeds, |seed| play(*seed))?;
    let moments = ["turning slowly".to_owned(), format!("{REST} frames after they came to rest")];
    let outcome = |(index, moment): (usize, String)| {
        let at = |played: &[Moment; 2]| played[index].clone();
        let (trees, waiting): (Vec<_>, Vec<_>) = played.iter().map(at).unzip();
        let trees = trees.concat();
        let worst = trees.iter().max_by(|a, b| a.ratio().total_cmp(&b.ratio()));
        LockOut {
            moment,
            trees: trees.len(),
            locked_out: trees.iter().filter(|noise| noise.ratio() > LOCKED_OUT).count(),
            worst: worst.copied().unwrap_or_default(),
            waiting: waiting.iter().sum(),
        }
    };
    Ok(moments.into_iter().enumerate().map(outcome).collect())
}

/// Plays one seed: the trees in motion, and at rest.
fn play(seed: u64) -> Result<[Moment; 2], SceneError> {
    let mut rng = Rng::new(seed, 0x10c);
    let clock = clock(NANOS_PER_LIGHT);
    let mut world = world_on(&clock);
    let mut rigs: Vec<Rig> = (0..TREES)
        .map(|_| {
            let spots = SPOTS.0 + rng.below(SPOTS.1 - SPOTS.0 + 1);
            Rig::new(spots, HALF_ANGLE, DRIFT, &mut rng)
        })
        .collect();
    let add = |rig: &Rig| add(&mut world, without_indices(&rig.lights(0.0)), Policy::Budgeted);
    let trees: Vec<TreeKey> = rigs.iter().map(add).collect::<Result<_, _>>()?;
    let mut play_frames = |frames: Range<u32>| -> Result<Moment, SceneError> {
        let mut waiting = 0;
        for frame in frames {
            clock.advance(FRAME);
            if frame == SCRAMBLED_AT {
                rigs.iter_mut().for_each(|rig| scramble(&mut rig.places, &mut rng));
            }
            let fast = frame.min(SCRAMBLED_AT) as f32;
            let time = (fast + SLOW * (frame as f32 - fast)) / 60.0;
            if frame < RESTS_AT {
                for (rig, tree) in rigs.iter().zip(&trees) {
                    world.set_lights(*tree, &rig.lights(time))?;
                }
            }
            waiting = world.update(FrameBudget::new(BUDGET)).waiting_trees;
        }
        Ok((measure_trees(&world, None, &trees)?, waiting))
    };
    Ok([play_frames(1..RESTS_AT)?, play_frames(RESTS_AT..RESTS_AT + REST)?])
}
