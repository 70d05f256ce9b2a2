//! The origin that shading points are relative to, and the camera.

use crate::memory::{object, result};
use crate::place::{GirandoleOriginMode, origin_mode};
use crate::status::{GirandoleStatus, call};
use crate::vectors::GirandoleDVec3;
use crate::world::GirandoleWorld;

/// Sets how the origin moves: one of GIRANDOLE_ORIGIN_*. Best called before instances are added.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_origin_mode(
    world: *mut GirandoleWorld,
    mode: GirandoleOriginMode,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")? };
        let mode = origin_mode(mode)?;
        world.edit(|world| Ok(world.set_origin_mode(mode)?))
    })
}

/// Moves the origin, in metres. Shading points are relative to it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_origin(
    world: *mut GirandoleWorld,
    origin: GirandoleDVec3,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")? };
        world.edit(|world| Ok(world.set_origin(origin.into())?))
    })
}

/// Stores the origin, in metres.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_origin(
    world: *const GirandoleWorld,
    origin: *mut GirandoleDVec3,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, origin) = unsafe { (object(world, "world")?.read()?, result(origin, "origin")?) };
        origin.set(world.origin().into());
        Ok(())
    })
}

/// Sets the position of the camera, in metres. Call it before the reservation of a frame. Rebuilds of
/// nearby trees get more weight, and with GIRANDOLE_ORIGIN_FOLLOWING the origin may move.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_viewpoint(
    world: *mut GirandoleWorld,
    viewpoint: GirandoleDVec3,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")? };
        world.edit(|world| Ok(world.set_viewpoint(viewpoint.into())?))
    })
}
