//! Trees: the lights of objects, in the space of the object.

use girandole::{LightTree, LightWorld, TreeKey, WorldError};

use crate::blob::GirandoleBlob;
use crate::light::{GirandoleLight, lights};
use crate::memory::{array, list, object, output, result, wanted};
use crate::status::{Failure, GirandoleStatus, call};
use crate::world::GirandoleWorld;

fn tree(world: &LightWorld, key: u64) -> Result<&LightTree, Failure> {
    let key = TreeKey::from(key);
    Ok(world.tree(key).ok_or(WorldError::NoSuchTree(key))?)
}

/// Builds a tree over lights, adds it and stores its key, which is never 0. The lights have the indices 0 to
/// count - 1. A tree without instances contributes no light. Takes O(n log n).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_add_tree(
    world: *mut GirandoleWorld,
    light_list: *const GirandoleLight,
    count: usize,
    tree: *mut u64,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, given) = unsafe { (object(world, "world")?, array(light_list, count, "light_list")?) };
        // SAFETY: see the crate's documentation.
        let key = unsafe { result(tree, "tree")? };
        let given = lights(given)?;
        key.set(world.edit(|world| Ok(world.add_tree(LightTree::new(given)?)))?.into());
        Ok(())
    })
}

/// Adds a tree from the bytes of girandole_world_bake_tree, without a build, and stores its key. Bytes of any
/// origin are safe: damaged ones are refused.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_add_baked(
    world: *mut GirandoleWorld,
    bytes: *const u8,
    size: usize,
    tree: *mut u64,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, bytes) = unsafe { (object(world, "world")?, array(bytes, size, "bytes")?) };
        // SAFETY: see the crate's documentation.
        let key = unsafe { result(tree, "tree")? };
        let baked = LightTree::from_baked(bytes)?;
        key.set(world.edit(|world| Ok(world.add_tree(baked)))?.into());
        Ok(())
    })
}

/// Stores a tree as bytes that girandole_world_add_baked reads, about 100 bytes per light. The bytes are the
/// same on every machine. Destroy the blob with girandole_blob_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_bake_tree(
    world: *const GirandoleWorld,
    tree_key: u64,
    blob: *mut *mut GirandoleBlob,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, blob) = unsafe { (object(world, "world")?.read()?, result(blob, "blob")?) };
        blob.set(Box::into_raw(Box::new(GirandoleBlob(tree(world, tree_key)?.bake()))));
        Ok(())
    })
}

/// Removes a tree that has no instances.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_remove_tree(world: *mut GirandoleWorld, tree: u64) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")? };
        world.edit(|world| Ok(world.remove_tree(TreeKey::from(tree))?))
    })
}

/// Builds a tree anew at once, regardless of budgets.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_rebuild_tree(world: *mut GirandoleWorld, tree: u64) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")? };
        world.edit(|world| Ok(world.rebuild_tree(TreeKey::from(tree)).map(drop)?))
    })
}

/// Stores two counts for a tree as of the last update: the lights that exist, and the indices, which include
/// the indices of removed lights. Either pointer may be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_tree_lights(
    world: *const GirandoleWorld,
    tree_key: u64,
    existing: *mut usize,
    indices: *mut usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")?.read()? };
        // SAFETY: see the crate's documentation.
        let (existing, indices) = unsafe { (wanted(existing, "existing")?, wanted(indices, "indices")?) };
        let tree = tree(world, tree_key)?;
        existing.set(tree.light_count());
        indices.set(tree.lights().len());
        Ok(())
    })
}

/// Changes lights of a tree in place, at the next update: light indices[i] becomes light_list[i], for i below
/// count. If a light is given twice, its last change counts. All instances of the tree change.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_lights(
    world: *mut GirandoleWorld,
    tree: u64,
    indices: *const u32,
    light_list: *const GirandoleLight,
    count: usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, indices) = unsafe { (object(world, "world")?, array(indices, count, "indices")?) };
        // SAFETY: see the crate's documentation.
        let given = lights(unsafe { array(light_list, count, "light_list")? })?;
        let changes: Vec<_> = indices.iter().copied().zip(given).collect();
        world.edit(|world| Ok(world.set_lights(TreeKey::from(tree), &changes)?))
    })
}

/// Adds lights to a tree at the next update, without a build, and stores their indices. The array has room
/// for count indices, which may be passed to girandole_world_set_lights immediately.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_add_lights(
    world: *mut GirandoleWorld,
    tree: u64,
    light_list: *const GirandoleLight,
    count: usize,
    indices: *mut u32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, given) = unsafe { (object(world, "world")?, array(light_list, count, "light_list")?) };
        // SAFETY: see the crate's documentation.
        let indices = unsafe { output(indices, count, "indices")? };
        let given = lights(given)?;
        indices.fill(world.edit(|world| Ok(world.add_lights(TreeKey::from(tree), &given)?))?);
        Ok(())
    })
}

/// Removes lights from a tree at the next update. The indices of other lights do not change. An index that
/// is given twice, or that has no light, is refused.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_remove_lights(
    world: *mut GirandoleWorld,
    tree: u64,
    indices: *const u32,
    count: usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, indices) = unsafe { (object(world, "world")?, array(indices, count, "indices")?) };
        world.edit(|world| Ok(world.remove_lights(TreeKey::from(tree), indices)?))
    })
}

/// Replaces all lights of a tree at once and builds it. Samples of the tree that were kept from earlier
/// frames become invalid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_replace_lights(
    world: *mut GirandoleWorld,
    tree: u64,
    light_list: *const GirandoleLight,
    count: usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, given) = unsafe { (object(world, "world")?, array(light_list, count, "light_list")?) };
        let given = lights(given)?;
        world.edit(|world| Ok(world.replace_lights(TreeKey::from(tree), given)?))
    })
}

/// A light of a tree.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleTreeLight {
    /// The key of the tree.
    pub tree: u64,
    /// The index of the light.
    pub light: u32,
}

/// Lists the lights that the last update removed from trees. Discard kept samples of these lights.
///
/// light_list has room for capacity elements, and may be NULL if capacity is 0. count gets the number of
/// elements; if it is above capacity, the call stores nothing else and returns GIRANDOLE_ERROR_NO_SPACE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_removed_lights(
    world: *const GirandoleWorld,
    light_list: *mut GirandoleTreeLight,
    capacity: usize,
    count: *mut usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")?.read()? };
        let removed = world.removed_lights().iter();
        let named = removed.map(|(tree, light)| GirandoleTreeLight { tree: (*tree).into(), light: *light });
        // SAFETY: see the crate's documentation.
        unsafe { list(named, light_list, capacity, count) }
    })
}
