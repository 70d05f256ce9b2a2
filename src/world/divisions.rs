//! Decides how trees are divided, by how their instances lie among others.

use super::division::DivisionEdit;
use super::neighbours::Neighbours;
use super::overlap::Overlaps;
use crate::keys::{InstanceKey, TreeKey};

/// What is known of how instances lie among others.
#[derive(Debug, Default)]
pub(super) struct Divisions {
    pub overlaps: Overlaps,
    pub neighbours: Neighbours,
}

impl Divisions {
    /// Notes an instance that was added or whose tree changed. The next update judges it.
    pub fn judge_later(&mut self, key: InstanceKey, edit: &mut DivisionEdit) {
        self.overlaps.file_new(key, edit);
        self.neighbours.judge_later(key);
        let tree = edit.scene.instances[key].tree;
        if !edit.scene.trees[tree].sections.is_empty() {
            // With more instances, each may have fewer sections.
            edit.update_sections(tree);
        }
    }

    /// [`Divisions::judge_later`] for all instances of a tree.
    pub fn judge_all_later(&mut self, tree: TreeKey, edit: &mut DivisionEdit) {
        for index in 0..edit.scene.trees[tree].instances.len() {
            self.judge_later(edit.scene.trees[tree].instances[index], edit);
        }
    }

    /// Forgets an instance that leaves a tree.
    pub fn forget(&mut self, key: InstanceKey, tree: TreeKey, edit: &mut DivisionEdit) {
        self.overlaps.forget(key, tree, edit);
        self.neighbours.forget(key, tree, edit);
    }

    /// Judges the instances that were added since the last update, and some others if anything has
    /// moved since all of them were judged. O(1) for each.
    pub fn judge_some(&mut self, has_moved: bool, edit: &mut DivisionEdit) {
        self.overlaps.judge_some(has_moved, edit);
        self.neighbours.judge_some(has_moved, edit);
    }
}
