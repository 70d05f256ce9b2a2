//! Adds regions to a world, shows them, and removes them.

use std::fmt;

use super::edit::RemovedTree;
use super::region::{PlacedInstance, RefusedRegion, Region, RegionSource};
use super::region_table::{RegionEntry, RegionView};
use super::{Instance, LightWorld};
use crate::error::WorldError;
use crate::instance::placement::Placed;
use crate::keys::{InstanceKey, RegionKey, TreeKey};
use crate::tree::LightTree;

/// The trees of a region that was removed, with all that the world kept for them. Freeing the
/// memory of large trees takes milliseconds: drop it on another thread.
#[must_use = "dropping it frees the memory of its trees, which another thread may do"]
pub struct RemovedRegion {
    trees: Vec<RemovedTree>,
}

impl fmt::Debug for RemovedRegion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.trees()).finish()
    }
}

impl RemovedRegion {
    /// The trees of the region that were still in the world, in its order, then the copies that
    /// [`LightWorld::make_unique`] made for its instances. Each is as of the last update; edits
    /// that waited for the next one are dropped.
    pub fn trees(&self) -> impl ExactSizeIterator<Item = &LightTree> {
        self.trees.iter().map(|removed| &removed.entry.tree)
    }

    /// The same trees. Frees what the world kept besides them.
    pub fn into_trees(self) -> Vec<LightTree> {
        self.trees.into_iter().map(|removed| removed.entry.tree).collect()
    }
}

impl LightWorld {
    /// Adds all trees and instances of a region. They take effect at once, as if each were added by
    /// itself.
    ///
    /// O(trees + instances): nothing is built or refitted, and no light is copied or read. But a tree of
    /// the world whose first instance is in the region, and is stretched or scaled, may be built again,
    /// as by [`LightWorld::add_instance`]; [`LightTree::new_for`] makes trees for which that is not so.
    ///
    /// # Errors
    /// [`WorldError::RegionTree`] for a tree of the world whose key is stale,
    /// [`WorldError::RegionInstance`] for an instance that is too far from [`LightWorld::origin`].
    /// The error names the first invalid tree or, if all are valid, the first invalid instance, by
    /// its index in the region. The region is returned as it was, and the world does not change.
    pub fn add_region(&mut self, region: Region) -> Result<RegionKey, RefusedRegion> {
        match self.region_error(&region) {
            Some(error) => Err(RefusedRegion { region: Box::new(region), error }),
            None => Ok(self.insert_region(region)),
        }
    }

    /// Why a region cannot be added.
    fn region_error(&self, region: &Region) -> Option<WorldError> {
        let tree_error = |(index, tree): (usize, &RegionSource)| match tree {
            RegionSource::OfWorld(key) if !self.scene.trees.contains_key(*key) => {
                Some(WorldError::RegionTree { index, source: Box::new(WorldError::NoSuchTree(*key)) })
            }
            _ => None,
        };
        let instance_error = |(index, PlacedInstance { placement, .. }): (usize, &PlacedInstance)| {
            let error = Placed::check(placement, placement, self.scene.origin.anchor()).err()?;
            Some(WorldError::RegionInstance { index, source: Box::new(error.into()) })
        };
        let in_trees = region.trees.iter().enumerate().find_map(tree_error);
        in_trees.or_else(|| region.instances.iter().enumerate().find_map(instance_error))
    }

    /// Adds a region that has been checked.
    fn insert_region(&mut self, region: Region) -> RegionKey {
        let key = self.regions.by_key.insert(RegionEntry::default());
        let is_own = region.trees.iter().map(|tree| matches!(tree, RegionSource::Own { .. })).collect();
        let add_tree = |source| match source {
            RegionSource::Own { tree, .. } => self.add_tree(*tree),
            RegionSource::OfWorld(tree) => tree,
        };
        let trees: Vec<TreeKey> = region.trees.into_iter().map(add_tree).collect();
        let insert_instance = |instance: PlacedInstance| {
            let PlacedInstance { tree, placement, policy, appearance, mut placed } = instance;
            let (mut stood, anchor) = (placement, self.scene.origin.anchor());
            Placed::move_to(&mut placed, &mut stood, &placement, anchor).expect("checked before");
            let (tree, region) = (trees[tree], Some(key));
            let instance = Instance { appearance, region, ..Instance::new(tree, placement, policy, placed) };
            self.insert_instance(instance)
        };
        let instances = region.instances.into_iter().map(insert_instance).collect();
        let entry = RegionEntry { trees, is_own, instances, copies: Vec::new() };
        self.sums.change_lists(0, entry.memory_bytes());
        self.regions.by_key[key] = entry;
        key
    }

    /// The number of regions.
    pub fn region_count(&self) -> usize {
        self.regions.by_key.len()
    }

    /// The keys of all regions.
    pub fn regions(&self) -> impl Iterator<Item = RegionKey> {
        self.regions.by_key.keys()
    }

    /// The trees and instances of a region; `None` for a stale key. O(1).
    pub fn region(&self, region: RegionKey) -> Option<RegionView<'_>> {
        self.regions.by_key.get(region).map(|entry| RegionView { entry })
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
    /// the returned value does, on any thread. A background build runs to its end, and its result
    /// is dropped.
    ///
    /// # Errors
    /// [`WorldError::NoSuchRegion`] for a region that was removed before or never existed;
    /// [`WorldError::RegionInUse`] if an instance outside the region uses one of its trees.
    pub fn remove_region(&mut self, region: RegionKey) -> Result<RemovedRegion, WorldError> {
        let entry = self.regions.by_key.get(region).ok_or(WorldError::NoSuchRegion(region))?;
        let is_outside = |key: &&InstanceKey| self.scene.instances[**key].region != Some(region);
        for tree in entry.own_trees() {
            let Some(entry) = self.scene.trees.get(tree) else { continue };
            // Stops at the first one outside, so it costs no more than the instances of the region.
            if entry.instances.iter().any(|key| is_outside(&key)) {
                let instances = entry.instances.iter().filter(is_outside).count();
                return Err(WorldError::RegionInUse { region, tree, instances });
            }
        }
        let entry = self.regions.by_key.remove(region).expect("a live region");
        self.sums.change_lists(entry.memory_bytes(), 0);
        for key in &entry.instances {
            // Those that were removed before are skipped.
            let _ = self.remove_instance(*key);
        }
        let mut trees = Vec::with_capacity(entry.trees.len() + entry.copies.len());
        for tree in entry.own_trees() {
            if self.scene.trees.contains_key(tree) {
                trees.push(self.take_tree(tree));
            }
        }
        Ok(RemovedRegion { trees })
    }

    /// Records that an instance got a copy of its tree, which belongs to the region of the
    /// instance.
    pub(super) fn was_copied(&mut self, instance: InstanceKey, copy: TreeKey) {
        let Some(region) = self.scene.instances[instance].region else { return };
        let entry = &mut self.regions.by_key[region];
        let former = entry.memory_bytes();
        entry.copies.push(copy);
        let present = entry.memory_bytes();
        self.sums.change_lists(former, present);
    }
}
