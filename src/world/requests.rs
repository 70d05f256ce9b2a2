//! Tells the scheduler what changed, and what the policies of trees request.

use super::rebuilds::Rebuilds;
use super::scene::{Scene, TreeEntry};
use crate::keys::TreeKey;
use crate::policy::{Excess, RebuildRequest};
use crate::tree::WIDTH;

impl TreeEntry {
    /// The most demanding request of the tree's policies. A placeholder requests its build whatever
    /// they are.
    fn rebuild_request(&self, excess: Excess) -> RebuildRequest {
        let request = self.policies.rebuild_request(&self.history, &self.tree.attributes(), excess);
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
}
