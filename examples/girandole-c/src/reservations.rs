//! The calls of a frame: reserve, then plan or cancel.

use crate::buffers::GirandoleNewBuffer;
use crate::memory::{object, object_mut, result};
use crate::plan::GirandolePlan;
use crate::planner::GirandolePlanner;
use crate::status::{GirandoleStatus, call};
use crate::vectors::flag;
use crate::world::GirandoleWorld;

/// Determines which buffers the GPU needs for the current state of the world, however many frames lie between
/// this call and the last plan. Changes nothing that shaders read.
///
/// exactly: 0 for buffers with room to grow, 1 for buffers no larger than needed. new_buffers and count get
/// the buffers to make; the array belongs to the planner and is valid until the reservation ends.
///
/// The reservation ends with girandole_planner_plan, or, if there is no memory for a buffer, with
/// girandole_planner_cancel. Until then, other calls that use the planner are refused with
/// GIRANDOLE_ERROR_RESERVED. The world may change; the plan has it as it is now.
///
/// On GIRANDOLE_ERROR_FULL the next call has the changes too.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_reserve(
    planner: *mut GirandolePlanner,
    world: *const GirandoleWorld,
    exactly: u32,
    new_buffers: *mut *const GirandoleNewBuffer,
    count: *mut usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (planner, world) = unsafe { (object_mut(planner, "planner")?, object(world, "world")?) };
        let exactly = flag(exactly, "exactly")?;
        // SAFETY: see the crate's documentation.
        let (array, count) = unsafe { (result(new_buffers, "new_buffers")?, result(count, "count")?) };
        planner.edit(|planner| planner.reserve(world, exactly))?;
        let made: &[_] = planner.reserved.as_ref().map_or(&[], |reserved| &reserved.new_buffers);
        array.set(made.as_ptr());
        count.set(made.len());
        Ok(())
    })
}

/// Ends the reservation with a plan: the commands of the frame. Destroy it with girandole_plan_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_plan(
    planner: *mut GirandolePlanner,
    plan: *mut *mut GirandolePlan,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (planner, out) = unsafe { (object_mut(planner, "planner")?, result(plan, "plan")?) };
        out.set(Box::into_raw(Box::new(planner.edit(GirandolePlanner::plan)?)));
        Ok(())
    })
}

/// Ends the reservation without a plan. Its changes become part of the next reservation, which lists all buffers
/// again and may give their numbers to others: free the buffers of this reservation that were already made.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_cancel(planner: *mut GirandolePlanner) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let planner = unsafe { object_mut(planner, "planner")? };
        planner.edit(|planner| planner.take().map(drop))
    })
}
