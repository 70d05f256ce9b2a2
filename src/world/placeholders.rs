//! Placeholders: trees of the world that have yet to be built.
//!
//! A placeholder is a sound tree that was made fast. Until it has been built, it requests its build
//! from the scheduler, like a tree that must be rebuilt, whatever the policies of its instances.

use super::rebuilds::Rebuilds;
use super::scene::Scene;
use crate::keys::TreeKey;
use crate::scheduler::TreeFeatures;
use crate::tree::LightTree;

impl Rebuilds {
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
