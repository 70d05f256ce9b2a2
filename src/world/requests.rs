//! Tells the scheduler what the policies of trees request, and which trees have yet to be built.
//!
//! A placeholder is a sound tree that was made fast. Until it has been built, it requests its build
//! from the scheduler, like a tree that must be rebuilt, whatever the policies of its instances.

use super::rebuilds::Rebuilds;
use super::scene::{Scene, TreeEntry};
use crate::keys::TreeKey;
use crate::policy::{Excess, RebuildRequest};
use crate::scheduler::TreeFeatures;
use crate::tree::{Attributes, LightTree, WIDTH};

impl TreeEntry {
    /// The most demanding request of the tree's policies. A placeholder requests its build whatever
    /// they are.
    fn rebuild_request(&self, excess: Excess) -> RebuildRequest {
        self.rebuild_request_at(&self.tree.attributes(), excess)
    }

    /// The same for a tree with these attributes.
    pub(super) fn rebuild_request_at(&self, attributes: &Attributes, excess: Excess) -> RebuildRequest {
        let request = self.policies.rebuild_request(&self.history, attributes, excess);
        if self.tree.is_placeholder() {
            return request.max(RebuildRequest::Required);
        }
        // There is only one tree over so few lights.
        let is_pointless = request <= RebuildRequest::Optional && self.tree.light_count() <= WIDTH;
        if is_pointless { RebuildRequest::None } else { request }
    }
}

impl Rebuilds {
    /// Re-evaluates whether a tree requests a rebuild, and with which priority: after a refit or a
    /// change of its weight.
    pub fn update_request(&mut self, key: TreeKey, scene: &mut Scene) {
        let entry = &scene.trees[key];
        if !entry.may_rebuild() {
            return self.scheduler.withdraw(key);
        }
        let request = entry.rebuild_request(self.scheduler.excess(key));
        let request = self.scheduler.standing_request(key, request);
        let share =
            if request > RebuildRequest::Doubtful { self.weights.of(key, self.scheduler.frame(), scene) } else { 0.0 };
        self.scheduler.set_request(key, request, share);
    }

    /// Lets a tree request its build at the next update, if it is a placeholder. O(1).
    pub fn await_first_build(&mut self, key: TreeKey, tree: &LightTree) {
        if tree.is_placeholder() {
            self.scheduler.start_placeholder(key, TreeFeatures::of(tree));
            self.new_placeholders.push(key);
        }
    }

    /// Requests the builds of the placeholders that came since the last update.
    pub fn request_first_builds(&mut self, scene: &mut Scene) {
        let mut new = std::mem::take(&mut self.new_placeholders);
        for key in new.drain(..) {
            let is_placeholder = scene.trees.get(key).is_some_and(|entry| entry.tree.is_placeholder());
            if is_placeholder && !self.scheduler.waits(key) {
                self.update_request(key, scene);
            }
        }
        self.new_placeholders = new;
    }
}
