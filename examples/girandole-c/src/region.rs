//! Regions: trees and instances that are filled on any thread, and added and removed as a whole.

use girandole::{Appearance, LightTree, Region, RegionInstance, RegionKey, RegionTree, WorldError};

use crate::light::{GirandoleLight, lights};
use crate::memory::{array, destroy, list, object, object_mut, result};
use crate::place::{GirandolePlacement, GirandolePolicy, policy};
use crate::status::{GirandoleStatus, call};
use crate::vectors::{GirandoleVec3, flag};
use crate::world::GirandoleWorld;

/// Trees and instances that are to be added to a world as a whole, for example a block of houses.
///
/// Threads: one thread at a time, which need not be the thread that uses the world. After
/// GIRANDOLE_ERROR_PANIC, destroy it.
#[derive(Debug, Default)]
pub struct GirandoleRegion {
    region: Region,
    /// By the indices that callers use.
    trees: Vec<RegionTree>,
}

/// An instance of a region. girandole_region_instance makes one.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleRegionInstance {
    /// Where it is.
    pub placement: GirandolePlacement,
    /// When it requests rebuilds of its tree.
    pub policy: GirandolePolicy,
    /// The index of its tree in the region.
    pub tree: u32,
    /// See girandole_world_set_enabled.
    pub is_enabled: u32,
    /// See girandole_world_set_factor.
    pub factor: GirandoleVec3,
    /// See girandole_world_set_mask.
    pub mask: u32,
    /// See girandole_world_set_user_data.
    pub user_data: u32,
}

/// Returns an instance of the tree with this index in a region. The instance is enabled and has a factor of
/// 1, all bits of the mask, and GIRANDOLE_POLICY_BUDGETED. Checks nothing.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_region_instance(tree: u32, placement: GirandolePlacement) -> GirandoleRegionInstance {
    GirandoleRegionInstance {
        placement,
        policy: GirandolePolicy { kind: crate::place::GIRANDOLE_POLICY_BUDGETED, a: 0.0, b: 0.0 },
        tree,
        is_enabled: 1,
        factor: GirandoleVec3 { x: 1.0, y: 1.0, z: 1.0 },
        mask: u32::MAX,
        user_data: 0,
    }
}

/// Creates an empty region. Destroy it with girandole_region_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_region_create(region: *mut *mut GirandoleRegion) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        unsafe { result(region, "region")? }.set(Box::into_raw(Box::default()));
        Ok(())
    })
}

impl GirandoleRegion {
    fn keep(&mut self, tree: RegionTree) -> u32 {
        self.trees.push(tree);
        self.trees.len() as u32 - 1
    }
}

/// Builds a tree on the calling thread, adds it to the region, and stores its index there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_region_add_tree(
    region: *mut GirandoleRegion,
    light_list: *const GirandoleLight,
    count: usize,
    tree: *mut u32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (region, given) = unsafe { (object_mut(region, "region")?, array(light_list, count, "light_list")?) };
        // SAFETY: see the crate's documentation.
        let index = unsafe { result(tree, "tree")? };
        let tree = region.region.add_tree(LightTree::new(lights(given)?)?);
        index.set(region.keep(tree));
        Ok(())
    })
}

/// As girandole_region_add_tree, but from the bytes of girandole_world_bake_tree and without a build.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_region_add_baked(
    region: *mut GirandoleRegion,
    bytes: *const u8,
    size: usize,
    tree: *mut u32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (region, bytes) = unsafe { (object_mut(region, "region")?, array(bytes, size, "bytes")?) };
        // SAFETY: see the crate's documentation.
        let index = unsafe { result(tree, "tree")? };
        let tree = region.region.add_tree(LightTree::from_baked(bytes)?);
        index.set(region.keep(tree));
        Ok(())
    })
}

/// Adds a tree that is in the world already, by its key, and stores its index in the region. The key is
/// checked when the region is added.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_region_add_world_tree(
    region: *mut GirandoleRegion,
    key: u64,
    tree: *mut u32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (region, index) = unsafe { (object_mut(region, "region")?, result(tree, "tree")?) };
        let tree = region.region.add_world_tree(key.into());
        index.set(region.keep(tree));
        Ok(())
    })
}

/// Adds an instance to a region.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_region_add_instance(
    region: *mut GirandoleRegion,
    instance: *const GirandoleRegionInstance,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (region, given) = unsafe { (object_mut(region, "region")?, object(instance, "instance")?) };
        let count = region.trees.len();
        let no_tree = WorldError::NoSuchRegionTree { index: given.tree as usize, count };
        let tree = *region.trees.get(given.tree as usize).ok_or(no_tree)?;
        let mut instance = RegionInstance::new(tree, &given.placement, policy(&given.policy)?);
        instance.appearance = Appearance {
            is_enabled: flag(given.is_enabled, "is_enabled")?,
            factor: given.factor.into(),
            mask: given.mask,
            user_data: given.user_data,
        };
        region.region.add_instance(instance)?;
        Ok(())
    })
}

/// Adds everything in a region to a world, and stores the key that the region has in the world. The region
/// object is empty afterwards, and may be filled again. If the call is refused, it keeps its content.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_add_region(
    world: *mut GirandoleWorld,
    region: *mut GirandoleRegion,
    key: *mut u64,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, region) = unsafe { (object(world, "world")?, object_mut(region, "region")?) };
        // SAFETY: see the crate's documentation.
        let stored = unsafe { result(key, "key")? };
        let key = world.edit(|world| Ok(world.add_region(&mut region.region)?))?;
        region.trees.clear();
        stored.set(key.into());
        Ok(())
    })
}

/// Removes all trees and instances that were added with a region, except any that were removed earlier.
/// Refused if an instance outside of the region uses one of its trees.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_remove_region(world: *mut GirandoleWorld, region: u64) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")? };
        world.edit(|world| Ok(world.remove_region(RegionKey::from(region)).map(drop)?))
    })
}

/// Lists the keys of the trees of a region, in the order of their indices.
///
/// keys has room for capacity elements, and may be NULL if capacity is 0. count gets the number of elements; if
/// it is above capacity, the call stores nothing else and returns GIRANDOLE_ERROR_NO_SPACE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_region_trees(
    world: *const GirandoleWorld,
    region: u64,
    keys: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")?.read()? };
        let key = RegionKey::from(region);
        let view = world.region(key).ok_or(WorldError::NoSuchRegion(key))?;
        // SAFETY: see the crate's documentation.
        unsafe { list(view.trees.iter().map(|key| u64::from(*key)), keys, capacity, count) }
    })
}

/// Lists the keys of the instances of a region, in the order in which they were added to it. The arguments
/// are as for girandole_world_region_trees.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_region_instances(
    world: *const GirandoleWorld,
    region: u64,
    keys: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")?.read()? };
        let key = RegionKey::from(region);
        let view = world.region(key).ok_or(WorldError::NoSuchRegion(key))?;
        // SAFETY: see the crate's documentation.
        unsafe { list(view.instances.iter().map(|key| u64::from(*key)), keys, capacity, count) }
    })
}

/// Frees a region object. What it has added to a world stays in the world. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_region_destroy(region: *mut GirandoleRegion) {
    // SAFETY: made by `Box::into_raw`, and see the crate's documentation.
    unsafe { destroy(region) }
}
