//! Regions: trees and instances that enter a world together, and leave it together.
//!
//! A region is filled on any thread, which checks and computes all that does not depend on the
//! world.

use std::fmt;

use super::Instance;
use super::reference::reference_for;
use crate::error::WorldError;
use crate::instance::appearance::{Appearance, check_factor};
use crate::instance::placement::{Placed, Placement};
use crate::keys::TreeKey;
use crate::policy::Policy;
use crate::tree::LightTree;

/// Trees, and instances of them, that [`LightWorld::add_region`](crate::LightWorld::add_region)
/// adds to a world in one call, all or none.
///
/// A region is plain data that any thread may fill: a loader thread makes the trees, and the thread
/// of the world only moves them in. A call that returns an error leaves the region as it was.
///
/// | a tree | by | cost on the thread that fills the region |
/// |---|---|---|
/// | of the region, which any constructor of [`LightTree`] makes | [`Region::add_tree`] | that of the constructor |
/// | of the world, which the region does not own | [`Region::add_world_tree`] | none |
///
/// ```
/// use girandole::glam::{DVec3, Vec3};
/// use girandole::{Light, LightTree, LightWorld, Placement, Policy, Region, RegionInstance};
/// // On a loader thread.
/// let mut region = Region::new();
/// let lamps = (0..100).map(|i| Light::point(Vec3::X * i as f32, Vec3::ONE)).collect();
/// let street = region.add_tree(LightTree::new(lamps)?);
/// for i in 0..10 {
///     let placement = Placement::at(DVec3::Z * 20.0 * f64::from(i));
///     region.add_instance(RegionInstance::new(street, placement, Policy::Static))?;
/// }
/// // On the thread of the world.
/// let mut world = LightWorld::new();
/// let key = world.add_region(&mut region)?;
/// assert_eq!(world.light_count(), 1000);
/// assert_eq!(world.region(key).map(|region| region.instances.len()), Some(10));
/// // Dropping this frees the memory of the trees, on any thread.
/// let removed = world.remove_region(key)?;
/// assert_eq!((removed.len(), world.light_count()), (1, 0));
/// # Ok::<(), girandole::WorldError>(())
/// ```
#[derive(Default)]
pub struct Region {
    pub(super) trees: Vec<RegionSource>,
    /// With the index of the tree. Each is placed relative to an origin at its own position.
    pub(super) instances: Vec<(usize, Instance)>,
}

/// Names a tree of the [`Region`] that returned it, for instances of that tree.
///
/// In another region it names the tree of the same index, if there is one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RegionTree(usize);

impl RegionTree {
    /// The index of the tree in its region: trees are numbered in the order in which they were
    /// added.
    pub fn index(self) -> usize {
        self.0
    }
}

/// An instance of a tree of a [`Region`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionInstance {
    /// The tree.
    pub tree: RegionTree,
    /// As in [`LightWorld::add_instance`](crate::LightWorld::add_instance).
    pub placement: Placement,
    /// As in [`LightWorld::add_instance`](crate::LightWorld::add_instance).
    pub policy: Policy,
    /// As in [`LightWorld::set_appearance`](crate::LightWorld::set_appearance).
    pub appearance: Appearance,
}

impl RegionInstance {
    /// An instance whose lights are as the tree has them.
    pub fn new(tree: RegionTree, placement: impl Into<Placement>, policy: Policy) -> Self {
        Self { tree, placement: placement.into(), policy, appearance: Appearance::default() }
    }
}

/// Where a tree of a region comes from.
pub(super) enum RegionSource {
    /// The region brings the tree.
    Own { tree: Box<LightTree>, has_instance: bool },
    /// The world has it.
    OfWorld(TreeKey),
}

impl Region {
    /// An empty region.
    pub fn new() -> Self {
        Self::default()
    }

    /// The number of trees, those of the world included.
    pub fn tree_count(&self) -> usize {
        self.trees.len()
    }

    /// The number of instances.
    pub fn instance_count(&self) -> usize {
        self.instances.len()
    }

    /// Whether there are neither trees nor instances.
    pub fn is_empty(&self) -> bool {
        self.trees.is_empty() && self.instances.is_empty()
    }

    /// Adds a tree without a copy or a build, as
    /// [`LightWorld::add_tree`](crate::LightWorld::add_tree). If the tree's lights have changed since its
    /// last refit, it is refitted now. O(1), but for that refit.
    pub fn add_tree(&mut self, mut tree: LightTree) -> RegionTree {
        tree.refit_changes();
        self.add(RegionSource::Own { tree: Box::new(tree), has_instance: false })
    }

    /// Lets the region use a tree of the world, which stays when the region is removed. Whether the
    /// world has such a tree is checked when the region is added. O(1).
    pub fn add_world_tree(&mut self, tree: TreeKey) -> RegionTree {
        self.add(RegionSource::OfWorld(tree))
    }

    fn add(&mut self, tree: RegionSource) -> RegionTree {
        self.trees.push(tree);
        RegionTree(self.trees.len() - 1)
    }

    /// Adds an instance of a tree of this region. Returns its index: instances are numbered in the
    /// order in which they were added.
    ///
    /// O(1), unless it is the first instance of a tree of more than eight lights and is stretched or
    /// scaled, as in [`LightWorld::add_instance`](crate::LightWorld::add_instance). Then a tree that was
    /// not made for the instance is rebuilt now. A tree of the world is rebuilt when the region is added.
    ///
    /// # Errors
    /// [`WorldError::NoSuchRegionTree`], [`WorldError::Value`].
    pub fn add_instance(&mut self, instance: RegionInstance) -> Result<usize, WorldError> {
        let RegionInstance { tree: RegionTree(index), placement, policy, appearance } = instance;
        let count = self.trees.len();
        let source = self.trees.get_mut(index).ok_or(WorldError::NoSuchRegionTree { index, count })?;
        policy.validate()?;
        check_factor(appearance.factor)?;
        let placed = Placed::new(&placement)?;
        let instance = Instance { appearance, ..Instance::new(TreeKey::default(), placement, policy, placed) };
        if let RegionSource::Own { tree, has_instance } = source
            && !std::mem::replace(has_instance, true)
        {
            divide_for(tree, instance.shown());
        }
        self.instances.push((index, instance));
        Ok(self.instances.len() - 1)
    }
}

/// Lets builds divide a tree for its first instance, and builds it again if that changes it.
fn divide_for(tree: &mut LightTree, placed: Option<&Placed>) {
    let Some(map) = reference_for(placed, tree.lights()) else { return };
    if tree.reference().is_none_or(|reference| reference.linear != map.linear) {
        tree.set_reference(Some(map));
        tree.rebuild();
    }
}

impl fmt::Debug for Region {
    /// Counts, not contents.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Region")
            .field("trees", &self.trees.len())
            .field("instances", &self.instances.len())
            .finish_non_exhaustive()
    }
}
