//! The build of a tree that does not fit into one frame. It goes on in slices, or in the background
//! once all lights are copied.

use std::time::Duration;

use super::rebuilds::{LongBuildState, LongBuilder, Rebuilds};
use super::reports::FrameReport;
use super::scene::{Scene, TreeEntry};
use crate::keys::TreeKey;
use crate::tree::TreeBuild;

impl Rebuilds {
    /// Does a slice of the long build, and begins it if need be. Returns the time at the end. The
    /// entry has a successor once the build is done.
    pub fn go_on(
        &mut self,
        tree: TreeKey,
        entry: &mut TreeEntry,
        units: usize,
        begin: Duration,
        report: &mut FrameReport,
    ) -> Duration {
        let mut build = match std::mem::take(&mut self.long_builder.state) {
            LongBuildState::InFrames(of, build) if of == tree => build,
            _ => {
                entry.build_since = entry.log.revision();
                Box::new(TreeBuild::new(entry.tree.lights().len(), entry.tree.reference()))
            }
        };
        let LongBuilder { state, thread, is_kept_in_frames } = &mut self.long_builder;
        let goes_to_background = !*is_kept_in_frames && thread.is_available();
        let lights = entry.tree.lights();
        let units = if goes_to_background { build.copy_lights(lights, units) } else { build.step(lights, units) };
        let units_left = build.units_left();
        self.clock.worked(self.scheduler.work_of_slice(units));
        let mut end = self.clock.now();
        if build.is_done() {
            entry.successor = Some(Box::new(build.finish()));
        } else if goes_to_background && build.has_all_lights() {
            let work = self.scheduler.go_on_in_background();
            *state = LongBuildState::InBackground(Some(tree), thread.start(*build, work, end));
            report.background.started += 1;
            end = self.clock.now();
        } else {
            *state = LongBuildState::InFrames(tree, build);
        }
        let took = end.saturating_sub(begin);
        let done = self.scheduler.finish_slice(units, units_left, took);
        report.add_job(&mut self.jobs, tree, done);
        end
    }

    /// Passes a build that has ended in the background to its tree, if the clock allows it. Returns
    /// the tree.
    pub fn take_finished_build(&mut self, scene: &mut Scene, report: &mut FrameReport) -> Option<TreeKey> {
        let (tree, running) = match std::mem::take(&mut self.long_builder.state) {
            LongBuildState::InBackground(tree, running) => (tree, running),
            other => {
                self.long_builder.state = other;
                return None;
            }
        };
        let Some(took) = self.clock.background(running.started, running.work, running.done()) else {
            self.long_builder.state = LongBuildState::InBackground(tree, running);
            return None;
        };
        report.longest_wait = report.longest_wait.max(self.scheduler.long_build_wait());
        report.background.spent = took;
        self.scheduler.finish_background(running.work, took);
        match (tree, running.wait()) {
            (Some(tree), Some(built)) => {
                scene.trees[tree].successor = Some(Box::new(built));
                report.background.taken += 1;
                Some(tree)
            }
            (tree, _) => {
                report.background.dropped += 1;
                // A build that has failed leaves the tree as it is.
                if let Some(tree) = tree {
                    self.update_request(tree, scene);
                }
                None
            }
        }
    }

    /// Forgets the long build of a tree, and returns what frames have done of it.
    pub fn take_long_build(&mut self, tree: TreeKey) -> Option<Box<TreeBuild>> {
        self.scheduler.cancel(tree);
        match &mut self.long_builder.state {
            LongBuildState::InFrames(of, _) if *of == tree => match std::mem::take(&mut self.long_builder.state) {
                LongBuildState::InFrames(_, build) => return Some(build),
                other => self.long_builder.state = other,
            },
            LongBuildState::InBackground(of, _) if *of == Some(tree) => *of = None,
            _ => {}
        }
        None
    }
}
