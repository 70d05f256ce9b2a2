//! Adds regions to a world, shows them, and removes them.

use super::region::{Region, RegionSource};
use super::region_view::RegionView;
use super::{Instance, LightWorld};
use crate::error::WorldError;
use crate::keys::{InstanceKey, RegionKey, TreeKey};
use crate::tree::LightTree;

impl LightWorld {
    /// Adds all trees and instances of a region, which is empty then. They take effect at once, as if each were added by
    /// itself.
    ///
    /// O(trees + instances): nothing is built or refitted, and no light is copied or read. But a tree of
    /// the world whose first instance is in the region, and is stretched or scaled, may be built again,
    /// as by [`LightWorld::add_instance`]; [`LightTree::new_for`] makes trees for which that is not so.
    ///
    /// # Errors
    /// [`WorldError::Entry`] for the first tree of the world whose key is stale, by its index in the region. The region
    /// stays as it was, and the world does not change.
    pub fn add_region(&mut self, region: &mut Region) -> Result<RegionKey, WorldError> {
        for (index, source) in region.trees.iter().enumerate() {
            if let RegionSource::OfWorld(tree) = source {
                self.entry(*tree).map_err(|source| WorldError::entry("tree", index, source))?;
            }
        }
        let mut view = RegionView::default();
        for source in region.trees.drain(..) {
            let tree = match source {
                RegionSource::Own { tree, .. } => {
                    let tree = self.add_tree(*tree);
                    view.own_trees.push(tree);
                    tree
                }
                RegionSource::OfWorld(tree) => tree,
            };
            view.trees.push(tree);
        }
        let key = self.regions.insert(RegionView::default());
        for (tree, instance) in region.instances.drain(..) {
            let instance = Instance { tree: view.trees[tree], region: Some(key), ..instance };
            view.instances.push(self.insert_instance(instance));
        }
        self.regions[key] = view;
        Ok(key)
    }

    /// The keys of all regions.
    pub fn regions(&self) -> impl ExactSizeIterator<Item = RegionKey> {
        self.regions.keys()
    }

    /// The trees and instances of a region; `None` for a stale key. O(1).
    pub fn region(&self, region: RegionKey) -> Option<&RegionView> {
        self.regions.get(region)
    }

    /// Removes what is left of a region: its instances, the trees that it brought, and the copies
    /// that [`LightWorld::make_unique`] made for its instances. Returns these trees.
    ///
    /// | before the call | outcome |
    /// |---|---|
    /// | an instance or a tree of the region was removed | it is skipped |
    /// | an instance of the region got a tree of its own by [`LightWorld::make_unique`] | the copy is removed too, even if that instance was removed |
    /// | instances outside the region use one of these trees | the call is refused |
    /// | the region uses a tree of the world | the tree stays |
    /// | edits wait for the next update, or a build is under way | they are dropped |
    ///
    /// O(instances and trees of the region), whatever the number of lights. Frees no tree: dropping
    /// the returned trees does, which takes milliseconds for large ones, on any thread. Each is as of the last update. A
    /// background build runs to its end, and its result is dropped.
    ///
    /// # Errors
    /// [`WorldError::NoSuchRegion`] for a region that was removed before or never existed;
    /// [`WorldError::RegionInUse`] if an instance outside the region uses one of its trees.
    pub fn remove_region(&mut self, region: RegionKey) -> Result<Vec<LightTree>, WorldError> {
        let view = self.regions.get(region).ok_or(WorldError::NoSuchRegion(region))?;
        let is_outside = |key: &&InstanceKey| self.scene.instances[**key].region != Some(region);
        for key in &view.own_trees {
            let Some(entry) = self.scene.trees.get(*key) else { continue };
            // Stops at the first one outside, so it costs no more than the instances of the region.
            if entry.instances.iter().any(|key| is_outside(&key)) {
                let instances = entry.instances.iter().filter(is_outside).count();
                return Err(WorldError::RegionInUse { region, tree: *key, instances });
            }
        }
        let view = self.regions.remove(region).expect("a live region");
        for key in &view.instances {
            // Those that were removed before are skipped.
            let _ = self.remove_instance(*key);
        }
        let left: Vec<TreeKey> = view.own_trees.into_iter().filter(|key| self.scene.trees.contains_key(*key)).collect();
        Ok(left.into_iter().map(|key| self.take_tree(key)).collect())
    }
}
