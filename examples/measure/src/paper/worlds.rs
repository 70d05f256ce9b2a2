//! The library as it is meant to be used: light worlds that rebuild trees within a time budget.
//!
//! Worlds under a budget run on a virtual clock: a piece of work takes the time that the survey
//! measured, in proportion to its lights, and a frame lasts as long as in the animation. So the
//! scheduler decides the same on a busy machine. A tree that does not fit into the budget of a
//! frame is built in the background, and later budgets pay for it.

use super::decisions::Rule;
use super::pool::Step;
use super::strategies::{Strategy, TreeKind};
use girandole::glam::{Affine3A, Vec3};
use girandole::scheduler::{VirtualClock, WorkKind};
use girandole::{FrameBudget, InstanceKey, Light, LightSampler, LightTree, LightWorld, Policy, TreeKey};
use rayon::ThreadPool;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;
use testbed::scene::SceneError;

/// The times of work on the trees of a kind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Times {
    /// Rebuilding all changed trees, per frame, milliseconds.
    pub rebuild_ms: f64,
    /// Updating them, milliseconds.
    pub update_ms: f64,
    /// The lights of these trees.
    pub lights: f64,
}

impl Times {
    /// A clock by these times.
    fn clock(self) -> VirtualClock {
        let per_light = |ms: f64| if self.lights > 0.0 { ms * 1.0e-3 / self.lights } else { 0.0 };
        let [rebuild, update] = [self.rebuild_ms, self.update_ms].map(per_light);
        VirtualClock::new(move |work| {
            let per_light = if work.kind == WorkKind::Refit { update } else { rebuild };
            Duration::from_secs_f64(per_light * work.lights as f64)
        })
    }
}

/// A world under a strategy. It follows the world of the film.
pub struct Contender {
    pub kind: TreeKind,
    pub strategy: Strategy,
    world: LightWorld,
    /// The virtual clock; `None` for the machine's.
    clock: Option<Arc<VirtualClock>>,
    budget: FrameBudget,
    /// Pairs of a tree of the film's world and its copy; the tree of all lights has none.
    trees: Vec<(TreeKey, TreeKey)>,
    /// Pairs of an instance of the film's world and its copy.
    instances: Vec<(InstanceKey, InstanceKey)>,
    /// The tree of all lights.
    one_tree: Option<TreeKey>,
}

/// The policy of a strategy, and its share of the time of always rebuilding.
fn policy(strategy: Strategy) -> (Policy, f64) {
    match strategy {
        Strategy::Rule(Rule::Always) => (Policy::AlwaysRebuild, f64::INFINITY),
        Strategy::Rule(_) => (Policy::RefitOnly, 0.0),
        Strategy::Budget(share) => (Policy::Budgeted, share),
    }
}

impl Contender {
    /// A world with one tree over all lights.
    pub fn one_tree(strategy: Strategy, times: Times, lights: &[Light]) -> Result<Self, SceneError> {
        let mut contender = Self::new(TreeKind::Library, strategy, Some(times))?;
        let tree = contender.world.add_tree(LightTree::new(lights.to_vec())?);
        contender.world.add_instance(tree, Affine3A::IDENTITY, policy(strategy).0)?;
        contender.one_tree = Some(tree);
        contender.world.update(FrameBudget::UNLIMITED);
        Ok(contender)
    }

    /// A copy of a world with its two levels. Without times it runs on the machine's clock.
    pub fn two_levels(strategy: Strategy, times: Option<Times>, film: &LightWorld) -> Result<Self, SceneError> {
        let mut contender = Self::new(TreeKind::TwoLevels, strategy, times)?;
        let policy = policy(strategy).0;
        let Self { world, trees, instances, .. } = &mut contender;
        let mut copies = HashMap::new();
        for key in film.trees() {
            let lights = film.tree(key).map_or(Vec::new(), |tree| tree.lights().to_vec());
            let copy = world.add_tree(LightTree::new(lights)?);
            copies.insert(key, copy);
            trees.push((key, copy));
        }
        for key in film.instances() {
            let instance = film.instance(key);
            if let Some((tree, placement)) = instance.and_then(|i| Some((copies.get(&i.tree)?, i.placement))) {
                instances.push((key, world.add_instance(*tree, placement, policy)?));
            }
        }
        world.update(FrameBudget::UNLIMITED);
        Ok(contender)
    }

    /// An empty world.
    fn new(kind: TreeKind, strategy: Strategy, times: Option<Times>) -> Result<Self, SceneError> {
        let clock = times.map(|times| Arc::new(times.clock()));
        let world = clock.clone().map_or_else(LightWorld::new, |clock| LightWorld::with_clock(clock));
        let share = policy(strategy).1;
        let always_ms = times.map_or(f64::INFINITY, |times| times.rebuild_ms);
        // Of no time there is no infinite share.
        let budget = if share > 0.0 { share * always_ms.max(f64::MIN_POSITIVE) } else { 0.0 };
        let budget = FrameBudget::from_millis(budget).map_err(|error| SceneError(error.to_string()))?;
        let (trees, instances, one_tree) = (Vec::new(), Vec::new(), None);
        Ok(Self { kind, strategy, world, clock, budget, trees, instances, one_tree })
    }

    /// The tree of all lights, if the world has one. It is drawn from directly, so that it differs
    /// from the trees of the rules by its rebuilds alone.
    pub fn tree_of_all(&self) -> Option<&LightTree> {
        self.one_tree.and_then(|tree| self.world.tree(tree))
    }

    /// Draws lights from both levels.
    pub fn sampler(&self) -> LightSampler<'_> {
        self.world.sampler()
    }

    /// Tells the scheduler where the camera is.
    pub fn set_eye(&mut self, eye: Vec3) -> Result<(), SceneError> {
        Ok(self.world.set_viewpoint(eye.as_dvec3())?)
    }

    /// Follows the world of the film to its next frame, and updates and rebuilds trees on the
    /// threads of a pool. `changes` are the changed lights in world space, and `frame_time` the
    /// seconds of a frame. The lights of the updated trees come with what was done.
    pub fn advance(
        &mut self,
        (film, changes): (&LightWorld, &[(u32, Light)]),
        frame_time: f64,
        threads: &ThreadPool,
    ) -> Result<(Step, usize), SceneError> {
        if let Some(clock) = &self.clock {
            clock.advance(Duration::from_secs_f64(frame_time));
        }
        if let Some(tree) = self.one_tree {
            self.world.set_lights(tree, changes)?;
        }
        for (key, own) in &self.trees {
            if let Some((now, before)) = film.tree(*key).zip(self.world.tree(*own)) {
                let pairs = (0..).zip(now.lights().iter().zip(before.lights()));
                let changes: Vec<(u32, Light)> =
                    pairs.filter(|(_, (now, before))| now != before).map(|(index, (now, _))| (index, *now)).collect();
                if !changes.is_empty() {
                    self.world.set_lights(*own, &changes)?;
                }
            }
        }
        for (key, own) in &self.instances {
            let placement = film.instance(*key).map(|instance| instance.placement);
            if let Some(placement) = placement.filter(|_| placement != self.world.instance(*own).map(|i| i.placement)) {
                self.world.move_instance(*own, placement)?;
            }
        }
        let report = threads.install(|| self.world.update(self.budget));
        let ms = |time: Duration| time.as_secs_f64() * 1.0e3;
        let attributes = self.tree_of_all().map(LightTree::attributes);
        let step = Step {
            rebuilds: report.rebuilt_trees + report.background.taken,
            update_ms: ms(report.refit_time),
            rebuild_ms: ms(report.spent + report.background.spent),
            attributes: attributes.unwrap_or_default(),
        };
        Ok((step, report.refit_lights))
    }
}
