//! Placeholders: trees of the world that have yet to be built.
//!
//! A placeholder is a sound tree that was made fast. Until it has been built, it requests its build
//! from the scheduler, like a tree that must be rebuilt, whatever the policies of its instances.

use super::LightWorld;
use crate::error::WorldError;
use crate::keys::TreeKey;
use crate::light::Light;
use crate::scheduler::TreeFeatures;
use crate::tree::LightTree;

impl LightWorld {
    /// Adds a tree whose lights shine at once and which later updates build within their budgets: a
    /// [placeholder](LightTree::new_placeholder). It contributes nothing until it has an instance.
    ///
    /// The tree requests its build until it has been built, with or without instances, whatever
    /// their policies, [`Policy::Static`](crate::Policy::Static) and
    /// [`Policy::RefitOnly`](crate::Policy::RefitOnly) included.
    /// [`LightTree::is_placeholder`] tells whether it still waits, and
    /// [`FrameReport::placeholder_trees`](crate::FrameReport::placeholder_trees) how many trees do.
    /// The built tree has the same bits as one from [`LightWorld::add_tree`]. If the first instance
    /// is stretched, the tree is built for that instance, and adding the instance builds nothing.
    ///
    /// O(lights) on the calling thread, about half of the time of a build. To spend that time on
    /// another thread, make the tree there and pass it to [`LightWorld::insert_tree`], or fill a
    /// [`Region`](crate::Region) there.
    ///
    /// | before the tree is built | outcome |
    /// |---|---|
    /// | lights are changed, added or removed | the placeholder is refitted. Lights that change during the build are set again in the built tree. It is built at once where [`LightWorld::add_lights`] would rebuild any tree. |
    /// | [`LightWorld::replace_lights`], [`LightWorld::rebuild_tree`] | the tree is built at once |
    /// | [`LightWorld::replace_tree`] | the build is for the new tree, if that is a placeholder |
    /// | [`LightWorld::make_unique`] | the copy is a placeholder too |
    /// | instances come, go, move or change | nothing |
    /// | the tree does not change for some time | it is frozen, and still built later |
    /// | [`LightWorld::remove_tree`] | nothing is built |
    ///
    /// # Errors
    /// As [`LightWorld::add_tree`].
    pub fn add_placeholder(&mut self, lights: Vec<Light>) -> Result<TreeKey, WorldError> {
        let tree = LightTree::new_placeholder(lights)?;
        Ok(self.insert_tree(tree))
    }

    /// Lets a tree request its build at the next update, if it is a placeholder. O(1).
    pub(super) fn await_first_build(&mut self, key: TreeKey) {
        let tree = &self.trees[key].tree;
        if tree.is_placeholder() {
            self.scheduler.start_placeholder(key, TreeFeatures::of(tree));
            self.new_placeholders.push(key);
        }
    }

    /// Requests the builds of the placeholders that came since the last update.
    pub(super) fn request_first_builds(&mut self) {
        let mut new = std::mem::take(&mut self.new_placeholders);
        for key in new.drain(..) {
            let is_placeholder = self.trees.get(key).is_some_and(|entry| entry.tree.is_placeholder());
            if is_placeholder && !self.scheduler.waits(key) {
                self.update_request(key);
            }
        }
        self.new_placeholders = new;
    }
}
