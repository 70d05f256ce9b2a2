//! Instances: where trees are in the world.

use girandole::{InstanceKey, LightWorld, Placement, Policy, TreeKey, WorldError};

use crate::memory::{array, object, result};
use crate::place::{GirandolePlacement, GirandolePolicy};
use crate::status::{Failure, GirandoleStatus, call};
use crate::vectors::{GirandoleVec3, flag};
use crate::world::GirandoleWorld;

/// Adds an instance of a tree and stores its key, which is never 0. policy may be NULL for
/// GIRANDOLE_POLICY_BUDGETED.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_add_instance(
    world: *mut GirandoleWorld,
    tree: u64,
    placement: *const GirandolePlacement,
    policy: *const GirandolePolicy,
    instance: *mut u64,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, placement) = unsafe { (object(world, "world")?, object(placement, "placement")?) };
        // SAFETY: see the crate's documentation.
        let key = unsafe { result(instance, "instance")? };
        let policy = match policy.is_null() {
            true => Policy::default(),
            // SAFETY: see the crate's documentation.
            false => crate::place::policy(unsafe { object(policy, "policy")? })?,
        };
        let (tree, placement) = (TreeKey::from(tree), Placement::from(placement));
        key.set(world.edit(|world| Ok(world.add_instance(tree, placement, policy)?))?.into());
        Ok(())
    })
}

/// Runs a call that changes one instance.
unsafe fn change(
    world: *mut GirandoleWorld,
    instance: u64,
    change: impl FnOnce(&mut LightWorld, InstanceKey) -> Result<(), Failure>,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")? };
        world.edit(|world| change(world, InstanceKey::from(instance)))
    })
}

/// Removes an instance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_remove_instance(world: *mut GirandoleWorld, instance: u64) -> GirandoleStatus {
    // SAFETY: see the crate's documentation.
    unsafe { change(world, instance, |world, key| Ok(world.remove_instance(key)?)) }
}

/// Moves an instance, at once. Axes that are all 0 hide it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_move_instance(
    world: *mut GirandoleWorld,
    instance: u64,
    placement: *const GirandolePlacement,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, placement) = unsafe { (object(world, "world")?, object(placement, "placement")?) };
        world.edit(|world| Ok(world.move_instance(InstanceKey::from(instance), placement)?))
    })
}

/// Moves instances[i] to placements[i], for i below count: all of them or, if one move is refused, none. If
/// an instance is given several times, its last move counts. Large batches are moved by several threads.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_move_instances(
    world: *mut GirandoleWorld,
    instances: *const u64,
    placements: *const GirandolePlacement,
    count: usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, keys) = unsafe { (object(world, "world")?, array(instances, count, "instances")?) };
        // SAFETY: see the crate's documentation.
        let placements = unsafe { array(placements, count, "placements")? };
        let keys = keys.iter().map(|key| InstanceKey::from(*key));
        let moves: Vec<_> = keys.zip(placements.iter().map(Placement::from)).collect();
        world.edit(|world| Ok(world.move_instances(&moves)?))
    })
}

/// Switches all lights of an instance on (1) or off (0).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_enabled(
    world: *mut GirandoleWorld,
    instance: u64,
    is_enabled: u32,
) -> GirandoleStatus {
    // SAFETY: see the crate's documentation.
    unsafe {
        change(world, instance, |world, key| {
            let is_enabled = flag(is_enabled, "is_enabled")?;
            Ok(world.set_appearance(key, |appearance| appearance.is_enabled = is_enabled)?)
        })
    }
}

/// Multiplies the emission of an instance by a linear colour: 0 to 10,000 per channel.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_factor(
    world: *mut GirandoleWorld,
    instance: u64,
    factor: GirandoleVec3,
) -> GirandoleStatus {
    // SAFETY: see the crate's documentation.
    unsafe { change(world, instance, |world, key| Ok(world.set_appearance(key, |a| a.factor = factor.into())?)) }
}

/// Limits the lights of an instance to shading points whose mask shares a bit with this mask.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_mask(
    world: *mut GirandoleWorld,
    instance: u64,
    mask: u32,
) -> GirandoleStatus {
    // SAFETY: see the crate's documentation.
    unsafe { change(world, instance, |world, key| Ok(world.set_appearance(key, |a| a.mask = mask)?)) }
}

/// Sets the number that light_user_data returns in shaders, and that samples have as user_data.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_user_data(
    world: *mut GirandoleWorld,
    instance: u64,
    user_data: u32,
) -> GirandoleStatus {
    // SAFETY: see the crate's documentation.
    unsafe { change(world, instance, |world, key| Ok(world.set_appearance(key, |a| a.user_data = user_data)?)) }
}

/// Sets when an instance requests a rebuild of its tree.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_policy(
    world: *mut GirandoleWorld,
    instance: u64,
    policy: *const GirandolePolicy,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, policy) = unsafe { (object(world, "world")?, object(policy, "policy")?) };
        let policy = crate::place::policy(policy)?;
        world.edit(|world| Ok(world.set_policy(InstanceKey::from(instance), policy)?))
    })
}

/// Stores the slot of an instance, which is its number in shaders.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_instance_slot(
    world: *const GirandoleWorld,
    instance: u64,
    slot: *mut u32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, slot) = unsafe { (object(world, "world")?.read()?, result(slot, "slot")?) };
        let key = InstanceKey::from(instance);
        slot.set(world.slot(key).ok_or(WorldError::NoSuchInstance(key))?);
        Ok(())
    })
}

/// Stores the key of the instance in a slot; 0 if there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_instance_at(
    world: *const GirandoleWorld,
    slot: u32,
    instance: *mut u64,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, instance) = unsafe { (object(world, "world")?.read()?, result(instance, "instance")?) };
        instance.set(world.instance_at(slot).map_or(0, u64::from));
        Ok(())
    })
}
