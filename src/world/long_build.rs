//! The build of a tree that does not fit into one frame. It goes on in slices, or in the background
//! once all lights are copied.

use std::time::Duration;

use super::LightWorld;
use super::build_thread::{BuildThread, RunningBuild};
use super::rebuild::report_job;
use super::update::FrameReport;
use crate::keys::TreeKey;
use crate::tree::TreeBuild;

/// Does the long build that the scheduler has begun.
#[derive(Debug, Default)]
pub(super) struct LongBuilder {
    state: State,
    thread: BuildThread,
    /// Builds never go on in the background.
    is_kept_in_frames: bool,
}

#[derive(Debug, Default)]
enum State {
    #[default]
    None,
    InFrames(TreeKey, Box<TreeBuild>),
    /// No tree if the tree does not need the build any more.
    InBackground(Option<TreeKey>, RunningBuild),
}

impl LongBuilder {
    /// Whether a build runs in the background or waits to be installed.
    pub fn is_in_background(&self) -> bool {
        matches!(self.state, State::InBackground(..))
    }
}

impl LightWorld {
    /// Allows builds in the background, or forbids them. They are allowed at first.
    ///
    /// A tree that does not fit into the budget of one frame is built in slices over several
    /// frames. If builds in the background are allowed, the frames only copy its lights, and
    /// another thread does the rest. The result is the same tree, sooner; its time counts against
    /// the budgets of frames in either case. Without the feature `parallel`, and where no thread
    /// can be created, all builds stay in frames. A build that already runs goes on.
    pub fn set_background_builds(&mut self, are_allowed: bool) {
        self.long_builder.is_kept_in_frames = !are_allowed;
    }

    /// Does a slice of the long build, and begins it if need be. Returns the time at the end.
    pub(super) fn go_on(&mut self, tree: TreeKey, units: usize, begin: Duration, report: &mut FrameReport) -> Duration {
        let mut build = match std::mem::take(&mut self.long_builder.state) {
            State::InFrames(of, build) if of == tree => build,
            _ => {
                let tree = &self.trees[tree].tree;
                Box::new(TreeBuild::new(tree.lights().len(), tree.reference()))
            }
        };
        let LongBuilder { state, thread, is_kept_in_frames } = &mut self.long_builder;
        let goes_to_background = !*is_kept_in_frames && thread.is_available();
        let lights = self.trees[tree].tree.lights();
        let units = if goes_to_background { build.copy_lights(lights, units) } else { build.step(lights, units) };
        let units_left = build.units_left();
        self.clock.worked(self.scheduler.work_of_slice(units));
        let mut end = self.clock.now();
        if build.is_done() {
            let entry = &mut self.trees[tree];
            entry.successor = Some(Box::new(build.into_tree()));
            // The refit of the next update installs it.
            self.pending.insert(tree);
            self.recount(tree);
        } else if goes_to_background && build.has_all_lights() {
            let work = self.scheduler.go_on_in_background();
            *state = State::InBackground(Some(tree), thread.start(*build, work, end));
            report.background.started += 1;
            end = self.clock.now();
        } else {
            *state = State::InFrames(tree, build);
        }
        let took = end.saturating_sub(begin);
        let done = self.scheduler.finish_slice(units, units_left, took);
        report_job(&mut self.jobs, tree, done, report);
        end
    }

    /// Passes a build that has ended in the background to its tree, if the clock allows it. The
    /// refit that follows installs it.
    pub(super) fn take_finished_build(&mut self, report: &mut FrameReport) {
        let (tree, running) = match std::mem::take(&mut self.long_builder.state) {
            State::InBackground(tree, running) => (tree, running),
            other => return self.long_builder.state = other,
        };
        let Some(took) = self.clock.background(running.started, running.work, running.done()) else {
            self.long_builder.state = State::InBackground(tree, running);
            return;
        };
        report.longest_wait = report.longest_wait.max(self.scheduler.long_build_wait());
        report.background.spent = took;
        self.scheduler.finish_background(running.work, took);
        match (tree, running.wait()) {
            (Some(tree), Some(built)) => {
                self.trees[tree].successor = Some(Box::new(built));
                self.pending.insert(tree);
                self.recount(tree);
                report.background.taken += 1;
            }
            (tree, _) => {
                report.background.dropped += 1;
                // A build that has failed leaves the tree as it is.
                if let Some(tree) = tree {
                    self.update_request(tree);
                }
            }
        }
    }

    /// Forgets the long build of a tree, and its result.
    pub(super) fn cancel_build(&mut self, tree: TreeKey) {
        drop(self.take_long_build(tree));
        if self.trees[tree].successor.take().is_some() {
            self.recount(tree);
        }
    }

    /// Forgets the long build of a tree, and returns what frames have done of it.
    pub(super) fn take_long_build(&mut self, tree: TreeKey) -> Option<Box<TreeBuild>> {
        self.scheduler.cancel(tree);
        match &mut self.long_builder.state {
            State::InFrames(of, _) if *of == tree => match std::mem::take(&mut self.long_builder.state) {
                State::InFrames(_, build) => return Some(build),
                other => self.long_builder.state = other,
            },
            State::InBackground(of, _) if *of == Some(tree) => *of = None,
            _ => {}
        }
        None
    }
}
