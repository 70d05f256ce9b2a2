//! All strategies of one kind of tree, played together.
//!
//! A tree that was last rebuilt in some frame is the same for every strategy, so each such tree
//! exists once: it is built, updated, measured and rendered once per frame.

use super::decisions::{Rule, Watcher};
use super::strategies::TreeKind;
use super::trees::{OneTree, build};
use girandole::{Attributes, Light};
use rayon::ThreadPool;
use std::collections::BTreeMap;
use std::time::Instant;
use testbed::scene::SceneError;

/// What a strategy did in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// Rebuilds in this frame.
    pub rebuilds: usize,
    /// Milliseconds.
    pub update_ms: f64,
    /// Milliseconds.
    pub rebuild_ms: f64,
    /// The attributes of the updated tree, which the decision is based on. Those of the new tree
    /// where the rule does not update.
    pub attributes: Attributes,
}

/// A strategy: its rule, and the frame in which its tree was built.
struct Player {
    rule: Rule,
    watcher: Watcher,
    built: u32,
}

/// The trees of one kind, by the frame in which they were built, and the strategies that use them.
pub struct Pool {
    kind: TreeKind,
    trees: BTreeMap<u32, Box<dyn OneTree>>,
    players: Vec<Player>,
}

/// Times some work on the threads of a pool, in milliseconds.
pub fn timed<T: Send>(threads: &ThreadPool, work: impl FnOnce() -> T + Send) -> (T, f64) {
    threads.install(|| {
        let start = Instant::now();
        let result = work();
        (result, start.elapsed().as_secs_f64() * 1.0e3)
    })
}

impl Pool {
    /// Builds the tree of frame 0, which all strategies begin with.
    pub fn new(
        kind: TreeKind,
        rules: &[Rule],
        lights: &[Light],
        threads: &ThreadPool,
    ) -> Result<(Self, Vec<Step>), SceneError> {
        let lights = lights.to_vec();
        let (tree, rebuild_ms) = timed(threads, || build(kind, lights));
        let tree = tree?;
        let attributes = tree.attributes();
        let player = |rule: &Rule| Player { rule: *rule, watcher: Watcher::new(*rule, &attributes), built: 0 };
        let players: Vec<Player> = rules.iter().map(player).collect();
        let step = Step { rebuilds: 1, update_ms: 0.0, rebuild_ms, attributes };
        let steps = vec![step; players.len()];
        Ok((Self { kind, trees: BTreeMap::from([(0, tree)]), players }, steps))
    }

    /// Plays the next frame and returns what each strategy did. Each tree is updated first; then
    /// its strategies decide. A rebuild is done in addition to the update that called for it.
    pub fn advance(
        &mut self,
        frame: u32,
        (lights, changes): (&[Light], &[(u32, Light)]),
        threads: &ThreadPool,
    ) -> Result<Vec<Step>, SceneError> {
        let mut update_ms = BTreeMap::new();
        for (built, tree) in &mut self.trees {
            let (result, ms) = timed(threads, || tree.refit(changes));
            result?;
            update_ms.insert(*built, ms);
        }
        let lights = lights.to_vec();
        let (tree, rebuild_ms) = timed(threads, || build(self.kind, lights));
        self.trees.insert(frame, tree?);
        let mut steps = Vec::with_capacity(self.players.len());
        for player in &mut self.players {
            let updated = self.trees[&player.built].attributes();
            let is_rebuilt = player.watcher.wants_rebuild(&updated);
            let is_updated = player.rule != Rule::Always;
            let mut step = Step { attributes: updated, ..Step::default() };
            if is_updated {
                step.update_ms = update_ms[&player.built];
            }
            if is_rebuilt {
                let new = self.trees[&frame].attributes();
                player.built = frame;
                player.watcher.restart(&new);
                step.rebuilds = 1;
                step.rebuild_ms = rebuild_ms;
                step.attributes = if is_updated { updated } else { new };
            }
            steps.push(step);
        }
        self.trees.retain(|built, _| self.players.iter().any(|player| player.built == *built));
        Ok(steps)
    }

    /// For each tree that is in use, the strategies that use it.
    pub fn in_use(&self) -> impl Iterator<Item = (&dyn OneTree, Vec<usize>)> {
        self.trees.iter().map(|(built, tree)| {
            let uses = |(_, player): &(usize, &Player)| player.built == *built;
            (tree.as_ref(), self.players.iter().enumerate().filter(uses).map(|(index, _)| index).collect())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use girandole::Attribute;
    use girandole::glam::{Vec3, vec3};

    #[test]
    fn strategies_with_the_same_last_rebuild_share_a_tree() {
        let threads = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
        // In frame 1, the lights of a grid have changed places.
        let lights = |frame: u32| -> Vec<Light> {
            let place = |i: u32| (i * (1 + 36 * frame)) % 64;
            let at = |place: u32| vec3((place % 8) as f32 * 4.0, 0.0, (place / 8) as f32 * 3.0);
            (0..64).map(|i| Light::sphere(at(place(i)), 0.1, Vec3::ONE)).collect()
        };
        let ratio = |factor| Rule::Ratio { attribute: Attribute::SplittingCost, factor };
        let rules = [Rule::Never, Rule::Always, ratio(1.0), ratio(1.0e6)];
        for kind in [TreeKind::Binary, TreeKind::Library] {
            let (mut pool, first) = Pool::new(kind, &rules, &lights(0), &threads).expect("valid lights");
            assert!(first.iter().all(|step| step.rebuilds == 1 && step.rebuild_ms > 0.0));
            let now = lights(1);
            let changes: Vec<(u32, Light)> = (0..).zip(now.iter().copied()).collect();
            let steps = pool.advance(1, (&now, &changes), &threads).expect("valid lights");
            assert_eq!(steps.iter().map(|step| step.rebuilds).collect::<Vec<_>>(), [0, 1, 1, 0]);
            assert!(steps[1].update_ms == 0.0 && steps[2].update_ms > 0.0 && steps[0].rebuild_ms == 0.0);
            assert!(steps[0].attributes.splitting_cost > steps[1].attributes.splitting_cost);
            let shared: Vec<Vec<usize>> = pool.in_use().map(|(_, players)| players).collect();
            assert_eq!(shared, [vec![0, 3], vec![1, 2]]);
        }
    }
}
