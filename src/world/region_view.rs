//! What a world knows of a region: keys of its trees and instances.

use crate::keys::{InstanceKey, TreeKey};

/// The trees and instances of a region of a [`LightWorld`](crate::LightWorld). The keys of those that were removed since are stale.
#[derive(Debug, Default)]
#[non_exhaustive]
pub struct RegionView {
    /// The trees of the region in its order, those of the world included.
    pub trees: Vec<TreeKey>,
    /// The instances of the region in its order.
    pub instances: Vec<InstanceKey>,
    /// The trees that are removed with the region: those that it brought, in its order, and then the copies that
    /// [`LightWorld::make_unique`](crate::LightWorld::make_unique) made for its instances.
    pub own_trees: Vec<TreeKey>,
}

impl RegionView {
    /// The size of the lists in bytes.
    pub(super) fn memory_bytes(&self) -> usize {
        size_of::<TreeKey>() * (self.trees.capacity() + self.own_trees.capacity())
            + size_of::<InstanceKey>() * self.instances.capacity()
    }
}
