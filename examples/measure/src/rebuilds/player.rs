//! Plays one stage under one strategy and budget, frame by frame.

use super::costs::{Costs, PlayedClock};
use super::reference::{Reference, instances, set_policies};
use super::stage::{Stage, StageOptions};
use super::strategies::Strategy;
use girandole::FrameBudget;
use std::sync::Arc;
use std::time::Duration;
use testbed::scene::SceneError;

/// The time from one frame to the next.
pub const FRAME: Duration = Duration::from_nanos(16_666_667);

/// The time that a frame spent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spent {
    /// Rebuilds within the frame, which the budget bounds.
    pub in_frame: Duration,
    /// Rebuilds on other threads.
    pub background: Duration,
    /// The longest time that a tree has waited for its rebuild, in frames.
    pub longest_wait: u32,
}

/// A stage under a strategy and a budget.
pub struct Player<'a> {
    pub stage: Stage,
    strategy: Strategy,
    budget: FrameBudget,
    clock: PlayedClock,
    costs: &'a Costs,
    /// What this player shares with the other players of its stage.
    pub reference: &'a Reference,
    external: External,
}

/// The state of a strategy that does not use the library's scheduler.
struct External {
    /// For each tree, the frame of its first change since its last rebuild.
    stale_since: Vec<Option<u32>>,
    /// For each tree, the frame of its last rebuild.
    rebuilt_at: Vec<Option<u32>>,
    /// For each tree, as of its last change: by how much a rebuild lowers the mean of sigma.
    gains: Vec<f64>,
    /// The tree whose turn it is.
    next: usize,
    /// The time that may be spent, in nanoseconds; negative after a rebuild that is longer than a
    /// frame's budget, until later budgets have paid for it.
    credit: f64,
}

impl<'a> Player<'a> {
    /// Starts before the first frame, with new trees.
    pub fn new(
        options: &StageOptions,
        (strategy, budget): (Strategy, FrameBudget),
        costs: &'a Arc<Costs>,
        reference: &'a Reference,
    ) -> Result<Self, SceneError> {
        let clock = PlayedClock::new(costs);
        let mut stage = Stage::new(options, clock.clock.clone())?;
        stage.world.set_background_builds(strategy != Strategy::GirandoleInFrames);
        let instances = instances(&stage);
        set_policies(&mut stage.world, &instances, |tree| strategy.policy(&reference.deviations[tree]))?;
        let count = stage.trees.len();
        let external = External {
            stale_since: vec![None; count],
            rebuilt_at: vec![None; count],
            gains: vec![0.0; count],
            next: 0,
            credit: 0.0,
        };
        Ok(Self { stage, strategy, budget, clock, costs, reference, external })
    }

    /// Plays the next frame. The first frame is 1.
    pub fn play(&mut self, frame: u32) -> Result<Spent, SceneError> {
        self.clock.advance(FRAME);
        self.stage.advance(frame)?;
        if matches!(self.strategy, Strategy::Girandole | Strategy::GirandoleInFrames) {
            self.stage.world.set_viewpoint(self.stage.eye).expect("a finite eye");
        }
        let background = self.clock.background_time();
        let report = self.stage.world.update(if self.strategy.is_external() { FrameBudget::NONE } else { self.budget });
        let mut spent = Spent {
            in_frame: report.spent,
            background: self.clock.background_time() - background,
            longest_wait: report.longest_wait as u32,
        };
        if self.strategy.is_external() {
            spent = self.rebuild(frame)?;
        }
        Ok(spent)
    }

    /// Rebuilds trees in the order of the strategy, as far as the time goes. A tree that takes
    /// longer than a whole frame's budget is built in the background, and the budgets of the
    /// following frames pay for it.
    fn rebuild(&mut self, frame: u32) -> Result<Spent, SceneError> {
        let count = self.stage.trees.len();
        for tree in (0..count).filter(|tree| self.reference.changed[frame as usize - 1][*tree]) {
            self.external.stale_since[tree].get_or_insert(frame);
            if let (Strategy::Oracle, Some(gains)) = (self.strategy, &self.reference.gains) {
                let built = self.external.rebuilt_at[tree].unwrap_or(0);
                self.external.gains[tree] = gains.loss(tree, built, frame)?;
            }
        }
        let cost = |tree: usize| self.costs.rebuild(self.reference.sizes[tree]).as_nanos() as f64;
        let budget = self.budget.time().as_nanos() as f64;
        let state = &mut self.external;
        state.credit = (state.credit + budget).min(budget);
        let mut left = budget;
        let mut spent = Spent::default();
        for tree in order(self.strategy, state, cost) {
            let cost = cost(tree);
            let is_small = cost <= budget;
            if state.credit < 0.0 || budget <= 0.0 {
                break;
            }
            if is_small && cost > left {
                // A tree that does not fit holds up all later ones; only the oracle skips it and
                // fills the frame.
                if self.strategy == Strategy::Oracle {
                    continue;
                }
                break;
            }
            let took = self.stage.world.rebuild_tree(self.stage.trees[tree])?;
            state.credit -= took.as_nanos() as f64;
            if is_small {
                left -= took.as_nanos() as f64;
                spent.in_frame += took;
            } else {
                spent.background += took;
            }
            let since = state.stale_since[tree].take();
            spent.longest_wait = spent.longest_wait.max(since.map_or(0, |since| frame - since));
            state.rebuilt_at[tree] = Some(frame);
            state.next = (tree + 1) % count;
        }
        let waiting = state.stale_since.iter().flatten().map(|since| frame - since).max();
        spent.longest_wait = spent.longest_wait.max(waiting.unwrap_or(0));
        Ok(spent)
    }
}

/// The trees that changed since their last rebuild, in the order of the strategy.
fn order(strategy: Strategy, state: &External, cost: impl Fn(usize) -> f64) -> Vec<usize> {
    let count = state.stale_since.len();
    let mut trees: Vec<usize> = (0..count).filter(|tree| state.stale_since[*tree].is_some()).collect();
    match strategy {
        Strategy::RoundRobin => trees.sort_by_key(|tree| (tree + count - state.next) % count),
        Strategy::Oracle => {
            trees.retain(|tree| state.gains[*tree] > 0.0);
            let value = |tree: usize| state.gains[tree] / cost(tree).max(1.0);
            trees.sort_by(|a, b| value(*b).total_cmp(&value(*a)));
        }
        // A tree that was never rebuilt comes before all others.
        _ => trees.sort_by_key(|tree| state.rebuilt_at[*tree]),
    }
    trees
}
