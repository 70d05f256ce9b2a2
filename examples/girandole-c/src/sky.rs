//! The sky of a world.

use girandole::Sky;
use girandole::glam::Vec3;

use crate::memory::{array, object, result};
use crate::status::{Failure, GIRANDOLE_ERROR_BAD_LENGTH, GirandoleStatus, call};
use crate::vectors::GirandoleVec3;
use crate::world::GirandoleWorld;

/// The pixels of a map or of a part of one.
///
/// # Safety
/// As [`array`].
unsafe fn pixels(width: u32, height: u32, pixels: *const GirandoleVec3) -> Result<Vec<Vec3>, Failure> {
    let count = (width as usize).checked_mul(height as usize);
    let too_many = || Failure::new(GIRANDOLE_ERROR_BAD_LENGTH, format!("{width} x {height} pixels are too many"));
    // SAFETY: the caller's promise.
    let pixels = unsafe { array(pixels, count.ok_or_else(too_many)?, "pixels")? };
    Ok(pixels.iter().map(|pixel| (*pixel).into()).collect())
}

/// Makes an equirectangular map the sky of the world and stores the key of its instance, which stays the same when
/// another map comes. pixels: rows from the zenith (+Y) to the nadir, in nits; the middle of the map is at +X. The
/// placement of the instance turns the map, a factor makes it brighter or darker, a mask chooses who sees it, and
/// girandole_world_remove_instance removes it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_sky(
    world: *mut GirandoleWorld,
    width: u32,
    height: u32,
    map: *const GirandoleVec3,
    instance: *mut u64,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, map) = unsafe { (object(world, "world")?, pixels(width, height, map)?) };
        // SAFETY: see the crate's documentation.
        let key = unsafe { result(instance, "instance")? };
        let sky = Sky::equirectangular(width as usize, &map)?;
        key.set(world.edit(|world| Ok(world.set_sky(sky)))?.into());
        Ok(())
    })
}

/// Changes a part of the map: width columns from column on, and height rows from row on. part: its pixels in nits, in
/// rows from the top down. Returns 1301 for a pixel that is refused, 1302 for a part that leaves the map, and 1303 for
/// a world without a sky.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_sky_part(
    world: *mut GirandoleWorld,
    column: u32,
    row: u32,
    width: u32,
    height: u32,
    part: *const GirandoleVec3,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, part) = unsafe { (object(world, "world")?, pixels(width, height, part)?) };
        let [corner, size] = [[column, row], [width, height]].map(|pair| pair.map(|number| number as usize));
        world.edit(|world| Ok(world.set_sky_part(corner, size, &part)?))
    })
}
