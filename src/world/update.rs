//! The update of a world, once a frame: refits the trees that were edited, then rebuilds trees
//! within the budget.

use std::time::Duration;

use super::LightWorld;
use super::reports::FrameReport;
use crate::error::WorldError;
use crate::keys::TreeKey;
use crate::scheduler::FrameBudget;
use crate::span::span;
use crate::top::partition::ROOT;

impl LightWorld {
    /// Brings trees up to date with the edits since the last call, and rebuilds trees within a time
    /// budget. Call it once a frame.
    ///
    /// 1. Edited trees are refitted, in parallel.
    /// 2. Trees whose policies request a rebuild are rebuilt, those whose rebuild removes the most
    ///    noise per millisecond first. The noise is estimated from the tree's attributes, and
    ///    weighted by the tree's share of the illuminance at the viewpoint
    ///    ([`LightWorld::set_viewpoint`]). A rebuild starts only if it will probably end within the
    ///    budget.
    /// 3. A tree that does not fit into the budget of a frame is built in slices over several
    ///    frames, or on another thread ([`LightWorld::set_background_builds`]).
    /// 4. The longer a tree waits, the higher its priority. A *round* is the time granted in which
    ///    all trees that wait could be rebuilt once. Once a tree that gains something has waited
    ///    for nine rounds, only trees that already wait are rebuilt before it. This holds for any
    ///    sequence of budgets; `docs/math.md` has the exact statement.
    /// 5. A tree becomes *loose* once it has an eighth as many lights of other instances between its own as of its
    ///    own, in the mean over its instances: each of its lights is a leaf of the top level, which sorts the lights of
    ///    all by position. It remains so down to a sixteenth. An instance counts the lights of others within its box,
    ///    unless they are in parts more than twice as large. Trees that changed or got an instance are looked at in the
    ///    same call, and 64 others in each call while anything changes. The leaves are bounded:
    ///    [`FrameReport::held_back_instances`].
    /// 6. Effects that nothing in the world had for
    ///    [`EFFECT_HOLD_UPDATES`](crate::effects::EFFECT_HOLD_UPDATES) calls leave
    ///    [`LightWorld::effects`], and trees at rest are frozen
    ///    ([`LightTree::freeze`](crate::LightTree::freeze)).
    ///
    /// The space of the top level is divided anew where parts of instances have become too many for a cell, or are
    /// distributed otherwise than when it was divided. This takes no part of the budget: a call divides about 16,384
    /// parts, and where it is about more than 4,096 parts at once, as many by one level. Later calls go on.
    ///
    /// Cost besides rebuilds: O(lights of edited trees), O(1) for each tree that comes to rest, O(depth) for each
    /// part of an instance that was added or moved, and O(n log n) in the parts that are added to a cell or divided
    /// anew.
    pub fn update(&mut self, budget: FrameBudget) -> FrameReport {
        span!("update");
        let moved_instances = self.log.count_moved();
        let mut report = FrameReport { moved_instances, budget: budget.time(), ..FrameReport::default() };
        self.rebuilds.scheduler.start_frame(budget.time());
        self.take_finished_build(&mut report);
        self.refit_edited(&mut report);
        self.do_jobs(&mut report);
        let is_new = self.filing.partition.divided(ROOT).is_none();
        self.renew_partition();
        if self.look_at_crowds(report.moved_instances + report.refit_trees > 0) {
            // Otherwise planes for whole trees would last for several updates.
            if is_new {
                self.filing.partition.restart();
            }
            self.renew_partition();
        }
        self.effects.count_update();
        self.let_rest();
        report.opened_instances = self.sums.opened;
        report.held_back_instances = self.sums.held_back;
        report.parts = self.sums.parts;
        report
    }

    /// Rebuilds a tree at once, regardless of its policies and of any budget, for example at a cut
    /// between scenes. Changes of its lights still wait for the next [`LightWorld::update`].
    /// Returns the time that the rebuild took. O(n log n).
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`].
    pub fn rebuild_tree(&mut self, tree: TreeKey) -> Result<Duration, WorldError> {
        self.entry(tree)?;
        Ok(self.rebuild_now(tree))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::time::Duration;

    use glam::Vec3;

    use super::super::crowds;
    use crate::documented::{assert_says, grouped};
    use crate::scheduler::{Clock, FrameBudget, sealed};
    use crate::top::partition::MOST_AT_ONCE;
    use crate::top::partition::renewal::RENEWED_PARTS;
    use crate::tree::testing::Rng;
    use crate::{Light, LightTree, LightWorld, Placement, Policy};

    #[test]
    fn the_documentation_of_an_update_names_its_limits() {
        let says = |sentence: &str| assert_says(include_str!("update.rs"), sentence);
        says(&format!("and {} others", crowds::LOOKS_PER_UPDATE));
        let [at_once, renewed] = [MOST_AT_ONCE as usize, RENEWED_PARTS].map(grouped);
        says(&format!("a call divides about {renewed}"));
        says(&format!("more than {at_once} parts at once, as many by one level"));
    }

    /// A clock whose time is a function of the number of calls so far.
    struct CallClock {
        calls: AtomicU64,
        time: fn(u64) -> Duration,
    }

    impl sealed::Sealed for CallClock {}

    impl Clock for CallClock {
        fn now(&self) -> Duration {
            (self.time)(self.calls.fetch_add(1, Ordering::Relaxed))
        }
    }

    #[test]
    fn frames_stay_bounded_on_clocks_that_stand_still_or_jump() {
        type Time = fn(u64) -> Duration;
        let clocks: [(&str, Time, usize); 4] = [
            ("stands still", |_| Duration::ZERO, 1),
            ("an hour per call", |call| Duration::from_secs(3600 * call), 0),
            ("back and forth", |call| Duration::from_secs(if call % 2 == 0 { 1000 } else { 0 }), 0),
            ("the greatest time", |_| Duration::MAX, 1),
        ];
        for (name, time, min_rebuilt) in clocks {
            let mut world = LightWorld::with_clock(Arc::new(CallClock { calls: AtomicU64::new(0), time }));
            let mut rng = Rng(30);
            let mut lights =
                || -> Vec<Light> { (0..100).map(|_| Light::point(rng.position(10.0), Vec3::ONE)).collect() };
            let trees: Vec<_> = (0..200)
                .map(|_| {
                    let tree = world.add_tree(LightTree::new(lights()).expect("valid lights"));
                    world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted).expect("a valid instance");
                    tree
                })
                .collect();
            let mut rebuilt = 0;
            for frame in 0..200 {
                for tree in &trees {
                    let changes: Vec<_> = (0..).zip(lights()).collect();
                    world.set_lights(*tree, &changes).expect("valid lights");
                }
                let report = world.update(FrameBudget::new(Duration::from_micros(100)));
                // A rebuild of a hundred lights counts as at least 1.5 µs, and a slice as at least
                // 45 ns.
                assert!(report.rebuilt_trees <= 67, "{name}, frame {frame}: {report:?}");
                assert!(world.jobs().len() <= 2222, "{name}, frame {frame}: {} jobs", world.jobs().len());
                rebuilt += report.rebuilt_trees;
            }
            assert!(rebuilt >= min_rebuilt, "{name}: {rebuilt}");
        }
    }
}
