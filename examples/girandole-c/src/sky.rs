//! The sky of a world.

use girandole::glam::Vec3;
use girandole::{Portal, Sky};

use crate::memory::{array, object, result};
use crate::place::GirandolePlacement;
use crate::status::{Failure, GIRANDOLE_ERROR_BAD_LENGTH, GirandoleStatus, call};
use crate::vectors::{GirandoleDVec3, GirandoleVec3};
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

/// As girandole_world_set_sky, but from the bytes of a Radiance HDR file, whose numbers count as nits. Bytes of any
/// origin are safe: damaged ones are refused with 700. Takes at most some 400 bytes of memory for each byte of
/// the file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_sky_hdr(
    world: *mut GirandoleWorld,
    bytes: *const u8,
    size: usize,
    instance: *mut u64,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, file) = unsafe { (object(world, "world")?, array(bytes, size, "bytes")?) };
        // SAFETY: see the crate's documentation.
        let key = unsafe { result(instance, "instance")? };
        let sky = girandole_assets::sky::hdr(file)?;
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

/// A window or another opening of a room.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandolePortal {
    /// The middle of a parallelogram, in metres.
    pub center: GirandoleDVec3,
    /// From the middle to that of one edge.
    pub half_u: GirandoleVec3,
    /// From the middle to that of the next edge.
    pub half_v: GirandoleVec3,
    /// The room: what the placement makes of the cube from -1 to 1 along each axis. Let it reach into the walls.
    pub room: GirandolePlacement,
}

/// Sets the openings through which alone the sky reaches the points of their rooms, in place of those that were set
/// before. At most 32; 0 removes them. Returns 1304 for more, and 1305 for a portal that is refused.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_portals(
    world: *mut GirandoleWorld,
    portals: *const GirandolePortal,
    count: usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, portals) = unsafe { (object(world, "world")?, array(portals, count, "portals")?) };
        let portal = |portal: &GirandolePortal| Portal {
            center: portal.center.into(),
            half_u: portal.half_u.into(),
            half_v: portal.half_v.into(),
            room: (&portal.room).into(),
        };
        let portals: Vec<Portal> = portals.iter().map(portal).collect();
        world.edit(|world| Ok(world.set_portals(&portals)?))
    })
}
