//! The build of a tree that does not fit into one frame. It goes on in slices, or in the background
//! once all lights are copied.

use super::rebuilds::{LongBuildState, LongBuilder, Rebuilds};
use super::reports::FrameReport;
use super::scene::{Scene, Successor, TreeEntry};
use crate::keys::TreeKey;
use crate::scheduler::BuildStep;
use crate::tree::TreeBuild;

impl Rebuilds {
    /// Does a slice of the long build, and begins it if need be. The entry has a successor once the
    /// build is done.
    pub fn go_on(&mut self, step: &BuildStep, entry: &mut TreeEntry, report: &mut FrameReport) {
        let tree = step.tree;
        let (mut build, since) = match std::mem::take(&mut self.long_builder.state) {
            LongBuildState::InFrames(of, build, since) if of == tree => (build, since),
            _ => {
                let build = TreeBuild::new(entry.tree.lights().len(), entry.tree.reference());
                (Box::new(build), entry.log.revision())
            }
        };
        let LongBuilder { state, thread, is_kept_in_frames } = &mut self.long_builder;
        let goes_to_background = !*is_kept_in_frames && thread.is_available();
        let (lights, units) = (entry.tree.lights(), step.units as usize);
        let units = if goes_to_background { build.copy_lights(lights, units) } else { build.step(lights, units) };
        self.clock.worked(self.scheduler.did_slice(units, build.units_left()));
        if build.is_done() {
            entry.successor = Some(Successor { tree: Box::new(build.finish()), since });
        } else if goes_to_background && build.has_all_lights() {
            let work = self.scheduler.go_on_in_background();
            let running = thread.start(*build, work, self.clock.now());
            *state = LongBuildState::InBackground(Some(tree), running, since);
            report.background.started += 1;
        } else {
            *state = LongBuildState::InFrames(tree, build, since);
        }
    }

    /// Passes a build that has ended in the background to its tree, if the clock allows it. Returns
    /// the tree.
    pub fn take_finished_build(&mut self, scene: &mut Scene, report: &mut FrameReport) -> Option<TreeKey> {
        let (tree, running, since) = match std::mem::take(&mut self.long_builder.state) {
            LongBuildState::InBackground(tree, running, since) => (tree, running, since),
            other => {
                self.long_builder.state = other;
                return None;
            }
        };
        let Some(took) = self.clock.background(running.started, running.work, running.done()) else {
            self.long_builder.state = LongBuildState::InBackground(tree, running, since);
            return None;
        };
        report.longest_wait = report.longest_wait.max(self.scheduler.long_build_wait());
        report.background.spent = took;
        self.scheduler.finish_background(running.work, took);
        match (tree, running.wait()) {
            (Some(tree), Some(built)) => {
                scene.trees[tree].successor = Some(Successor { tree: Box::new(built), since });
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
            LongBuildState::InFrames(of, ..) if *of == tree => match std::mem::take(&mut self.long_builder.state) {
                LongBuildState::InFrames(_, build, _) => return Some(build),
                other => self.long_builder.state = other,
            },
            LongBuildState::InBackground(of, ..) if *of == Some(tree) => *of = None,
            _ => {}
        }
        None
    }
}
