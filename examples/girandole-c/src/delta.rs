//! Deltas: what changed in a world since the last one.

use girandole::FrameDelta;
use girandole::glam::DVec3;

use crate::memory::{destroy, object, result};
use crate::status::{GirandoleStatus, call};
use crate::vectors::GirandoleDVec3;
use crate::world::GirandoleWorld;

/// The changes of a world since the last delta. Belongs to one world.
#[derive(Debug)]
pub struct GirandoleDelta {
    pub(crate) delta: FrameDelta,
    pub(crate) world: u64,
}

/// Takes the changes since the last call. Once a frame, after girandole_world_update. Pass every delta to
/// the planner, in order, and destroy it with girandole_delta_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_take_delta(
    world: *mut GirandoleWorld,
    delta: *mut *mut GirandoleDelta,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, out) = unsafe { (object(world, "world")?, result(delta, "delta")?) };
        let delta = world.edit(|world| Ok(world.take_delta()))?;
        out.set(Box::into_raw(Box::new(GirandoleDelta { delta, world: world.id })));
        Ok(())
    })
}

/// Makes a delta that contains the whole world: for a new planner of a world that was used before, or after a
/// delta was lost. The changes remain for girandole_world_take_delta.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_whole_delta(
    world: *const GirandoleWorld,
    delta: *mut *mut GirandoleDelta,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, out) = unsafe { (object(world, "world")?, result(delta, "delta")?) };
        let delta = FrameDelta::everything(world.read()?);
        out.set(Box::into_raw(Box::new(GirandoleDelta { delta, world: world.id })));
        Ok(())
    })
}

/// What renderers that keep samples from frame to frame need to know of a delta.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleDeltaView {
    /// By how much the origin moved, in metres: subtract it from positions that are kept relative to the
    /// origin. 0 if it did not move.
    pub origin_shift: GirandoleDVec3,
    /// Slots of instances that were moved, ascending. Belongs to the delta.
    pub moved_instances: *const u32,
    /// The number of these slots.
    pub moved_count: usize,
    /// Slots of instances that were removed, ascending. Belongs to the delta.
    pub removed_instances: *const u32,
    /// The number of these slots.
    pub removed_count: usize,
    /// 1 if nothing changed, else 0.
    pub is_empty: u32,
}

/// Stores a view of a delta. The arrays are valid until the delta is destroyed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_delta_view(
    delta: *const GirandoleDelta,
    view: *mut GirandoleDeltaView,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (delta, view) = unsafe { (&object(delta, "delta")?.delta, result(view, "view")?) };
        view.set(GirandoleDeltaView {
            origin_shift: delta.origin_shift().unwrap_or(DVec3::ZERO).into(),
            moved_instances: delta.moved_instances().as_ptr(),
            moved_count: delta.moved_instances().len(),
            removed_instances: delta.removed_instances().as_ptr(),
            removed_count: delta.removed_instances().len(),
            is_empty: delta.is_empty().into(),
        });
        Ok(())
    })
}

/// Frees a delta. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_delta_destroy(delta: *mut GirandoleDelta) {
    // SAFETY: made by `Box::into_raw`, and see the crate's documentation.
    unsafe { destroy(delta) }
}
