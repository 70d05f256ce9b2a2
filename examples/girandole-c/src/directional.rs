//! Directional lights of a world.

use girandole::DirectionalKey;

use crate::light::GirandoleDirectionalLight;
use crate::memory::{object, result};
use crate::status::{GirandoleStatus, call};
use crate::world::GirandoleWorld;

/// Adds a directional light and stores its key.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_add_directional(
    world: *mut GirandoleWorld,
    light: *const GirandoleDirectionalLight,
    directional: *mut u64,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, light) = unsafe { (object(world, "world")?, object(light, "light")?) };
        // SAFETY: see the crate's documentation.
        let key = unsafe { result(directional, "directional")? };
        key.set(world.edit(|world| Ok(world.add_directional(light.into())?))?.into());
        Ok(())
    })
}

/// Changes a directional light.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_directional(
    world: *mut GirandoleWorld,
    directional: u64,
    light: *const GirandoleDirectionalLight,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, light) = unsafe { (object(world, "world")?, object(light, "light")?) };
        world.edit(|world| Ok(world.set_directional(DirectionalKey::from(directional), light.into())?))
    })
}

/// Removes a directional light.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_remove_directional(
    world: *mut GirandoleWorld,
    directional: u64,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")? };
        world.edit(|world| Ok(world.remove_directional(DirectionalKey::from(directional))?))
    })
}
