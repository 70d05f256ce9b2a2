//! The calls that create planners, set them up and ask them.

use girandole::plan::{LightPlanner, PlanLimits};

use crate::cuts::GirandoleCutOptions;
use crate::memory::{destroy, object, object_mut, result};
use crate::planner::{GirandoleLimits, GirandolePlanner, limit};
use crate::shader_text::effect_bits;
use crate::status::{Failure, GirandoleStatus, call};
use crate::vectors::flag;

/// Runs a call that changes a planner without a reservation.
pub(crate) unsafe fn change<R>(
    planner: *mut GirandolePlanner,
    change: impl FnOnce(&mut LightPlanner) -> Result<R, Failure>,
) -> Result<R, Failure> {
    // SAFETY: see the crate's documentation.
    unsafe { object_mut(planner, "planner")? }.edit(|planner| change(planner.free()?))
}

/// Creates a planner for a device that holds nothing yet. limits may be NULL for a largest buffer of 128 MiB
/// and no other limits. cuts may be NULL for 32,768 cells of 0.25 m that need 8 marks and learn nothing, which take 67 MB
/// of GPU memory. Returns 100 for a wrong edge or number of cells. Destroy it with girandole_planner_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_create(
    limits: *const GirandoleLimits,
    cuts: *const GirandoleCutOptions,
    planner: *mut *mut GirandolePlanner,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let out = unsafe { result(planner, "planner")? };
        let mut given = PlanLimits::default();
        if !limits.is_null() {
            // SAFETY: see the crate's documentation.
            let limits = unsafe { object(limits, "limits")? };
            given = PlanLimits::new(limits.largest_buffer);
            given.tree_memory = limit(limits.tree_memory);
            given.frame_bytes = limit(limits.frame_bytes);
        }
        let options = match cuts.is_null() {
            true => Default::default(),
            // SAFETY: see the crate's documentation.
            false => unsafe { object(cuts, "cuts")? }.options()?,
        };
        out.set(Box::into_raw(Box::new(GirandolePlanner::new(given, options))));
        Ok(())
    })
}

/// Destroys a planner, and its reservation if it has one. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_destroy(planner: *mut GirandolePlanner) {
    // SAFETY: made by `Box::into_raw`, and see the crate's documentation.
    unsafe { destroy(planner) }
}

/// Sets the limits of memory and of bytes per frame from the next plan on: bytes, or GIRANDOLE_NO_LIMIT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_set_limits(
    planner: *mut GirandolePlanner,
    tree_memory: u64,
    frame_bytes: u64,
) -> GirandoleStatus {
    call(|| {
        let set = |planner: &mut LightPlanner| {
            planner.set_tree_memory(limit(tree_memory));
            planner.set_frame_bytes(limit(frame_bytes));
            Ok(())
        };
        // SAFETY: see the crate's documentation.
        unsafe { change(planner, set) }
    })
}

/// Sets whether the buffers of the last frame are kept for light_reservoir_sample_previous (1) or dropped (0), from the
/// next plan on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_keep_previous(
    planner: *mut GirandolePlanner,
    is_kept: u32,
) -> GirandoleStatus {
    call(|| {
        let is_kept = flag(is_kept, "is_kept")?;
        let set = |planner: &mut LightPlanner| {
            planner.keep_previous(is_kept);
            Ok(())
        };
        // SAFETY: see the crate's documentation.
        unsafe { change(planner, set) }
    })
}

/// Reports that a plan was not played, or only in part, so that the device may lack some of what was planned.
/// The next plan sends everything again, into the same buffers; pass it to girandole_cursor_skip_to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_lose(planner: *mut GirandolePlanner) -> GirandoleStatus {
    call(|| {
        let lose = |planner: &mut LightPlanner| {
            planner.lose();
            Ok(())
        };
        // SAFETY: see the crate's documentation.
        unsafe { change(planner, lose) }
    })
}

/// Reports that of the last plan only the commands in top were not played. The next plan then builds the top
/// level again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_lose_top(planner: *mut GirandolePlanner) -> GirandoleStatus {
    call(|| {
        let lose = |planner: &mut LightPlanner| {
            planner.lose_top();
            Ok(())
        };
        // SAFETY: see the crate's documentation.
        unsafe { change(planner, lose) }
    })
}

/// The number of buffers that shaders bind.
pub const GIRANDOLE_SHADER_BUFFERS: usize = 8;

/// Stores the numbers of the buffers that the engine's shaders bind after the last plan, at the bindings 0 to
/// 7 of their group: a uniform buffer of 64 bytes, five storage buffers that are only read, one that is also
/// written, and the lights of the last frame, which are only read; each is bound whole. UINT32_MAX before the first plan,
/// and for a last frame that is not kept. buffers has room for GIRANDOLE_SHADER_BUFFERS numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_bindings(
    planner: *mut GirandolePlanner,
    buffers: *mut u32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let out = unsafe { result(buffers.cast::<[u32; GIRANDOLE_SHADER_BUFFERS]>(), "buffers")? };
        let all = |planner: &mut LightPlanner| {
            let mut ids = [u32::MAX; GIRANDOLE_SHADER_BUFFERS];
            let lights = planner.bindings();
            let cells = planner.cells().filter(|_| lights.is_some());
            let bound = lights.iter().flat_map(|lights| lights.iter().copied()).chain(cells.into_iter().flatten());
            ids.iter_mut().zip(bound).for_each(|(id, buffer)| *id = buffer.get());
            ids[GIRANDOLE_SHADER_BUFFERS - 1] = planner.previous().map_or(u32::MAX, |buffer| buffer.get());
            Ok(ids)
        };
        // SAFETY: see the crate's documentation.
        out.set(unsafe { change(planner, all)? });
        Ok(())
    })
}

/// Stores the effects that shaders must support to read the buffers of the last plan: bits of
/// GIRANDOLE_EFFECT_*. All before the first plan.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_effects(
    planner: *mut GirandolePlanner,
    effects: *mut u32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let out = unsafe { result(effects, "effects")? };
        // SAFETY: see the crate's documentation.
        out.set(unsafe { change(planner, |planner| Ok(effect_bits(planner.effects())))? });
        Ok(())
    })
}

/// Stores the total size of all buffers, in bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_memory(planner: *mut GirandolePlanner, bytes: *mut u64) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let out = unsafe { result(bytes, "bytes")? };
        // SAFETY: see the crate's documentation.
        out.set(unsafe { change(planner, |planner| Ok(planner.memory().buffers))? });
        Ok(())
    })
}
