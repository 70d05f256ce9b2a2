//! Measures all strategies and budgets on a scene in a motion.

use super::costs::Costs;
use super::motion::Motion;
use super::player::Player;
use super::reference::Reference;
use super::report::{Row, SceneRow};
use super::stage::{SceneKind, StageOptions};
use super::strategies::Strategy;
use girandole::FrameBudget;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use testbed::scene::SceneError;

/// What is measured, and how closely.
#[derive(Clone, Debug)]
pub struct Plan {
    pub strategies: Vec<Strategy>,
    /// Budgets as shares of the mean time per frame of always rebuilding.
    pub shares: Vec<f64>,
    /// The same for the algorithms of [SS].
    pub ss_shares: Vec<f64>,
    pub frames: u32,
    /// Noise is measured every n-th frame.
    pub every: u32,
    pub shading_points: usize,
    /// Seeds the stage ([`StageOptions::seed`]).
    pub seed: u64,
}

/// The results of one run, in absolute numbers.
struct Played {
    /// The mean over measured frames and shading points.
    sigma: f64,
    spent: Duration,
    background: Duration,
    /// The number of frames that kept the budget.
    within: u32,
    worst_overrun: Duration,
    longest_wait: u32,
    lights: usize,
    instances: usize,
}

/// Measures all strategies and budgets, in the order of the plan.
pub fn measure(
    kind: SceneKind,
    motion: Motion,
    plan: &Plan,
    costs: &Arc<Costs>,
) -> Result<(SceneRow, Vec<Row>), SceneError> {
    let has_oracle = plan.strategies.contains(&Strategy::Oracle);
    let options = StageOptions { kind, motion, seed: plan.seed, shading_points: plan.shading_points };
    let reference = Reference::new(&options, (plan.frames, plan.every), has_oracle)?;
    let play = |(strategy, time): &(Strategy, Duration)| {
        let budget = FrameBudget::new(*time);
        let player = Player::new(&options, (*strategy, budget), costs, &reference)?;
        play(player, plan, *time)
    };
    let ends = in_parallel(&[(Strategy::UpdateOnly, Duration::ZERO), (Strategy::AlwaysRebuild, Duration::MAX)], play)?;
    let [updated, rebuilt] = &ends[..] else { return Err(SceneError("two runs have two results".into())) };
    let always = rebuilt.spent.as_secs_f64() / f64::from(plan.frames);
    if always <= 0.0 {
        return Err(SceneError(format!("{} {}: nothing changes, so nothing is rebuilt", kind.name(), motion.name())));
    }
    let mut jobs = Vec::new();
    for strategy in plan.strategies.iter().filter(|strategy| !strategy.ignores_budget()) {
        let budget = |share: &f64| (*strategy, *share, Duration::from_secs_f64(always * share));
        jobs.extend(strategy.is_of_ss().then_some((*strategy, f64::INFINITY, Duration::MAX)));
        jobs.extend(if strategy.is_of_ss() { &plan.ss_shares } else { &plan.shares }.iter().map(budget));
    }
    let work: Vec<(Strategy, Duration)> = jobs.iter().map(|(strategy, _, time)| (*strategy, *time)).collect();
    let all = in_parallel(&work, play)?;
    let row = |strategy: Strategy, share: f64, played: &Played| Row {
        scene: kind.name().to_owned(),
        motion: motion.name().to_owned(),
        strategy: strategy.name(),
        budget_share: share,
        gap_recovered: (updated.sigma - played.sigma) / (updated.sigma - rebuilt.sigma),
        cost_share: (played.spent + played.background).as_secs_f64() / rebuilt.spent.as_secs_f64(),
        within_budget: f64::from(played.within) / f64::from(plan.frames),
        worst_overrun_us: played.worst_overrun.as_secs_f64() * 1.0e6,
        longest_wait_frames: played.longest_wait,
    };
    let mut rows = vec![row(Strategy::UpdateOnly, 0.0, updated), row(Strategy::AlwaysRebuild, f64::INFINITY, rebuilt)];
    rows.extend(jobs.iter().zip(&all).map(|((strategy, share, _), played)| row(*strategy, *share, played)));
    let smallest = reference.sizes.iter().map(|lights| costs.rebuild(*lights)).min().unwrap_or_default();
    let scene = SceneRow {
        scene: kind.name().to_owned(),
        motion: motion.name().to_owned(),
        lights: updated.lights,
        instances: updated.instances,
        deforming_trees: reference.sizes.len(),
        deforming_lights: reference.sizes.iter().sum(),
        sigma_update: updated.sigma,
        sigma_rebuild: rebuilt.sigma,
        always_rebuild_us: always * 1.0e6,
        smallest_job_us: smallest.as_secs_f64() * 1.0e6,
    };
    Ok((scene, rows))
}

/// Plays all frames of one run.
fn play(mut player: Player<'_>, plan: &Plan, budget: Duration) -> Result<Played, SceneError> {
    let mut played = Played {
        sigma: 0.0,
        spent: Duration::ZERO,
        background: Duration::ZERO,
        within: 0,
        worst_overrun: Duration::ZERO,
        longest_wait: 0,
        lights: player.stage.world.light_count(),
        instances: player.stage.world.instances().len(),
    };
    let (mut sigma, mut measured) = (0.0, 0.0);
    for frame in 1..=plan.frames {
        let spent = player.play(frame)?;
        played.spent += spent.in_frame;
        played.background += spent.background;
        played.within += u32::from(spent.in_frame <= budget);
        played.worst_overrun = played.worst_overrun.max(spent.in_frame.saturating_sub(budget));
        played.longest_wait = played.longest_wait.max(spent.longest_wait);
        if frame % plan.every == 0 {
            let lit = &player.reference.lit[(frame / plan.every - 1) as usize];
            sigma += lit.sigma(&player.stage.world, &player.stage.shading_points);
            measured += 1.0;
        }
    }
    played.sigma = sigma / f64::max(measured, 1.0);
    Ok(played)
}

/// Works on all jobs with one thread per core. These are not rayon's threads, because jobs wait for
/// rayon's tasks.
pub fn in_parallel<J: Sync, T: Send>(
    jobs: &[J],
    work: impl Fn(&J) -> Result<T, SceneError> + Sync,
) -> Result<Vec<T>, SceneError> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<Option<Result<T, SceneError>>>> = Mutex::new(jobs.iter().map(|_| None).collect());
    let threads = std::thread::available_parallelism().map_or(1, |count| count.get()).min(jobs.len());
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(index) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|index| *index < jobs.len()) {
                    let result = work(&jobs[index]);
                    done.lock().unwrap_or_else(PoisonError::into_inner)[index] = Some(result);
                }
            });
        }
    });
    let done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.into_iter().map(|result| result.unwrap_or_else(|| Err(SceneError("a run did not finish".into())))).collect()
}
