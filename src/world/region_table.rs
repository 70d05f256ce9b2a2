//! The regions of a world: keys of their trees and instances.

use slotmap::SlotMap;

use crate::keys::{InstanceKey, RegionKey, TreeKey};

/// The regions of a world by key.
#[derive(Debug, Default)]
pub(super) struct Regions {
    pub by_key: SlotMap<RegionKey, RegionEntry>,
}

/// The trees and instances of a region. Keys may be stale: trees and instances can be removed one
/// by one.
#[derive(Debug, Default)]
pub(super) struct RegionEntry {
    /// In the order of the region, as all lists here.
    pub trees: Vec<TreeKey>,
    /// For each tree, whether the region brought it.
    pub is_own: Vec<bool>,
    pub instances: Vec<InstanceKey>,
    /// The trees that `LightWorld::make_unique` made for these instances.
    pub copies: Vec<TreeKey>,
}

impl Regions {
    /// The size of the table in bytes.
    pub fn memory_bytes(&self) -> usize {
        // One slot is never used.
        (self.by_key.capacity() + 1) * size_of::<(u64, RegionEntry)>()
    }
}

impl RegionEntry {
    /// The trees that are removed with the region.
    pub fn own_trees(&self) -> impl Iterator<Item = TreeKey> {
        let own = self.trees.iter().zip(&self.is_own).filter(|(_, is_own)| **is_own).map(|(tree, _)| *tree);
        own.chain(self.copies.iter().copied())
    }

    /// The size of the lists in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of::<TreeKey>() * (self.trees.capacity() + self.copies.capacity())
            + self.is_own.capacity()
            + size_of::<InstanceKey>() * self.instances.capacity()
    }
}

/// The keys of the trees and instances of a region.
#[derive(Clone, Copy, Debug)]
pub struct RegionView<'a> {
    pub(super) entry: &'a RegionEntry,
}

impl<'a> RegionView<'a> {
    /// The trees of the region in its order, those of the world included. The keys of trees that
    /// were removed since are stale.
    pub fn trees(&self) -> &'a [TreeKey] {
        &self.entry.trees
    }

    /// The instances of the region in its order. The keys of instances that were removed since are
    /// stale.
    pub fn instances(&self) -> &'a [InstanceKey] {
        &self.entry.instances
    }

    /// The trees that [`LightWorld::make_unique`](crate::LightWorld::make_unique) made for
    /// instances of the region, in the order of the calls. The keys of trees that were removed
    /// since are stale.
    pub fn copies(&self) -> &'a [TreeKey] {
        &self.entry.copies
    }
}
