//! The origin that shading points are relative to, and the camera.

use crate::memory::{object, result};
use crate::status::{GirandoleStatus, call};
use crate::vectors::GirandoleDVec3;
use crate::world::GirandoleWorld;

/// Keeps the origin, which shading points are relative to, near a position in metres: once it is more than 1024 m away
/// along an axis, the origin moves to the nearest multiple of 1024 m. Call it with the camera before the reservation of
/// each frame.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_origin_near(
    world: *mut GirandoleWorld,
    position: GirandoleDVec3,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")? };
        world.edit(|world| Ok(world.set_origin_near(position.into())?))
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
/// nearby trees get more weight.
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
