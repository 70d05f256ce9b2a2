//! Plays one stage under one strategy and budget, frame by frame.

use super::costs::{Costs, PlayedClock};
use super::motion::Motion;
use super::reference::{Reference, instances, set_policies};
use super::scene::SceneError;
use super::scene::rng::Rng;
use super::stage::{SceneKind, Stage};
use super::strategies::Strategy;
use girandole::{FrameBudget, InstanceKey, LightId};
use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

/// From one frame to the next.
const FRAME: Duration = Duration::from_nanos(16_666_667);

/// UsageCounters that are read back, for the strategy that is told of them.
const PICKS: u32 = 2_000;
/// Frames from one reading to the next: the CPU builds a top level for each.
const PICK_EVERY: u32 = 4;
/// Frames from picks to the scheduler that hears of them, as a GPU's come.
const DELAY: u32 = 3;
/// Seeds the picks.
const SEED: u64 = 0x61c8_8647;

/// What a frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spent {
    /// Rebuilding within the frame: what the budget is for.
    pub in_frame: Duration,
    /// Rebuilding on other threads.
    pub background: Duration,
    /// The longest that a tree has waited for the rebuild that it asked for, in frames.
    pub longest_wait: u32,
}

/// A stage that plays.
pub struct Player<'a> {
    pub stage: Stage,
    strategy: Strategy,
    budget: FrameBudget,
    clock: Arc<PlayedClock>,
    costs: &'a Costs,
    /// What the player shares with others of its stage.
    pub reference: &'a Reference,
    by_hand: ByHand,
    /// The frame in which the scheduler hears of them, and how many each instance got.
    picks: VecDeque<(u32, HashMap<InstanceKey, u32>)>,
}

/// What those that rebuild by hand remember.
struct ByHand {
    /// Of each tree, the frame of its first change since it was rebuilt.
    stale_since: Vec<Option<u32>>,
    /// Of each tree.
    rebuilt_at: Vec<Option<u32>>,
    /// Of each tree, as of its last change: what a rebuild takes off the mean of sigma.
    gains: Vec<f64>,
    /// Whose turn it is.
    next: usize,
    /// Time that may be spent, in nanoseconds; less than nothing while a tree is paid for that no single frame has the
    /// time for.
    credit: f64,
}

impl<'a> Player<'a> {
    /// Nothing has moved yet, and all trees are new.
    pub fn new(
        kind: SceneKind,
        motion: Motion,
        shading_points: usize,
        (strategy, budget): (Strategy, FrameBudget),
        costs: &'a Arc<Costs>,
        reference: &'a Reference,
    ) -> Result<Self, SceneError> {
        let clock = Arc::new(PlayedClock::new(costs));
        let mut stage = Stage::new(kind, motion, shading_points, Arc::<PlayedClock>::clone(&clock))?;
        let instances = instances(&stage);
        set_policies(&mut stage.world, &instances, |tree| strategy.policy(&reference.deviations[tree]))?;
        let count = stage.trees.len();
        let by_hand = ByHand {
            stale_since: vec![None; count],
            rebuilt_at: vec![None; count],
            gains: vec![0.0; count],
            next: 0,
            credit: 0.0,
        };
        let picks = VecDeque::new();
        Ok(Self { stage, strategy, budget, clock, costs, reference, by_hand, picks })
    }

    /// Plays the next frame; the first is 1.
    pub fn play(&mut self, frame: u32) -> Result<Spent, SceneError> {
        self.clock.advance(FRAME);
        self.stage.advance(frame)?;
        self.tell(frame);
        let background = self.clock.spent_beside();
        let report = self.stage.world.update(if self.strategy.is_by_hand() { FrameBudget::NONE } else { self.budget });
        let mut spent = Spent {
            in_frame: report.spent,
            background: self.clock.spent_beside() - background,
            longest_wait: report.longest_wait as u32,
        };
        if self.strategy.is_by_hand() {
            spent = self.rebuild_by_hand(frame)?;
        }
        if self.strategy == Strategy::GirandoleUsage && frame.is_multiple_of(PICK_EVERY) {
            self.pick(frame);
        }
        Ok(spent)
    }

    /// Tells the library's scheduler what its strategy may know.
    fn tell(&mut self, frame: u32) {
        if matches!(self.strategy, Strategy::Girandole | Strategy::GirandoleUsage) {
            self.stage.world.set_viewpoint(self.stage.eye).expect("a finite eye");
        }
        if self.picks.front().is_some_and(|(heard, _)| *heard <= frame) {
            let (_, picks) = self.picks.pop_front().unwrap_or_default();
            self.stage.world.record_usage(picks);
        }
    }

    /// Draws lights as a renderer would: one for each of some shading points, in turn.
    fn pick(&mut self, frame: u32) {
        let sampler = self.stage.world.sampler();
        let mut rng = Rng::new(SEED, u64::from(frame));
        let mut counts = HashMap::new();
        for i in 0..PICKS as usize {
            let at = &self.stage.shading_points[i % self.stage.shading_points.len()];
            let pick = sampler.pick(at, [rng.unit(), rng.unit()]);
            if let Some(LightId::Local { instance, .. }) = pick.map(|pick| pick.light) {
                *counts.entry(instance).or_default() += 1;
            }
        }
        self.picks.push_back((frame + DELAY, counts));
    }

    /// In the order of the strategy, as far as the time goes. A tree that takes longer than a whole frame's budget is
    /// built on the side, and the frames that follow pay for it, as for the library's builds in the background.
    fn rebuild_by_hand(&mut self, frame: u32) -> Result<Spent, SceneError> {
        let count = self.stage.trees.len();
        for tree in (0..count).filter(|tree| self.reference.changed[frame as usize - 1][*tree]) {
            self.by_hand.stale_since[tree].get_or_insert(frame);
            if let (Strategy::Oracle, Some(gains)) = (self.strategy, &self.reference.gains) {
                let built = self.by_hand.rebuilt_at[tree].unwrap_or(0);
                self.by_hand.gains[tree] = gains.loss(tree, built, frame)?;
            }
        }
        let cost = |tree: usize| self.costs.rebuild(self.reference.sizes[tree]).as_nanos() as f64;
        let budget = self.budget.time().as_nanos() as f64;
        let by_hand = &mut self.by_hand;
        by_hand.credit = (by_hand.credit + budget).min(budget);
        let mut left = budget;
        let mut spent = Spent::default();
        for tree in order(self.strategy, by_hand, cost) {
            let cost = cost(tree);
            let is_small = cost <= budget;
            if by_hand.credit < 0.0 || budget <= 0.0 {
                break;
            }
            if is_small && cost > left {
                // Who waits for a turn holds up all behind; an oracle fills every frame.
                if self.strategy == Strategy::Oracle {
                    continue;
                }
                break;
            }
            let took = self.stage.world.rebuild_tree(self.stage.trees[tree])?;
            by_hand.credit -= took.as_nanos() as f64;
            if is_small {
                left -= took.as_nanos() as f64;
                spent.in_frame += took;
            } else {
                spent.background += took;
            }
            let since = by_hand.stale_since[tree].take();
            spent.longest_wait = spent.longest_wait.max(since.map_or(0, |since| frame - since));
            by_hand.rebuilt_at[tree] = Some(frame);
            by_hand.next = (tree + 1) % count;
        }
        let waiting = by_hand.stale_since.iter().flatten().map(|since| frame - since).max();
        spent.longest_wait = spent.longest_wait.max(waiting.unwrap_or(0));
        Ok(spent)
    }
}

/// Trees that changed since they were rebuilt, whose turn it is first.
fn order(strategy: Strategy, by_hand: &ByHand, cost: impl Fn(usize) -> f64) -> Vec<usize> {
    let count = by_hand.stale_since.len();
    let mut trees: Vec<usize> = (0..count).filter(|tree| by_hand.stale_since[*tree].is_some()).collect();
    match strategy {
        Strategy::RoundRobin => trees.sort_by_key(|tree| (tree + count - by_hand.next) % count),
        Strategy::Oracle => {
            trees.retain(|tree| by_hand.gains[*tree] > 0.0);
            let value = |tree: usize| by_hand.gains[tree] / cost(tree).max(1.0);
            trees.sort_by(|a, b| value(*b).total_cmp(&value(*a)));
        }
        // A tree that was never rebuilt comes before all others.
        _ => trees.sort_by_key(|tree| by_hand.rebuilt_at[*tree]),
    }
    trees
}
