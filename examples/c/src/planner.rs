//! Planners as objects: what the GPU holds of a world, and reservations of buffers.

use std::ffi::c_char;
use std::ptr::NonNull;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use girandole::SplitCount;
use girandole::plan::{BufferId, BufferKind, FramePlan, LightPlanner, NewBuffer, PlanLimits, Reservation};

use crate::delta::GirandoleDelta;
use crate::memory::{object, object_mut, result};
use crate::names::c_name;
use crate::plan::GirandolePlan;
use crate::status::{
    Failure, GIRANDOLE_ERROR_BROKEN, GIRANDOLE_ERROR_NOT_RESERVED, GIRANDOLE_ERROR_OTHER_WORLD,
    GIRANDOLE_ERROR_RESERVED, GirandoleStatus, call,
};
use crate::vectors::flag;
use crate::world::GirandoleWorld;

/// No limit.
pub const GIRANDOLE_NO_LIMIT: u64 = u64::MAX;

/// The limits of a planner.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleLimits {
    /// Bytes of the largest storage buffer that the device can make and bind whole. Less than 131,072 counts
    /// as 131,072, and more than 16 GiB as 16 GiB.
    pub largest_buffer: u64,
    /// Bytes of the buffers of nodes and lights, or GIRANDOLE_NO_LIMIT.
    pub tree_memory: u64,
    /// Bytes of new trees that one frame sends, or GIRANDOLE_NO_LIMIT.
    pub frame_bytes: u64,
}

fn limit(bytes: u64) -> Option<u64> {
    (bytes != GIRANDOLE_NO_LIMIT).then_some(bytes)
}

/// What the GPU holds of one world, and what it has to do to follow the world. Keep one for each world and
/// device. It holds no GPU object.
///
/// Threads: one thread at a time.
#[derive(Debug)]
pub struct GirandolePlanner {
    /// From `Box::into_raw`. Not a box, since the reservation borrows it while calls have references to this.
    planner: NonNull<LightPlanner>,
    held: Option<Held>,
    /// The world that it follows, from the first reservation on.
    world: Option<u64>,
    /// False during a call that changes it, and for ever if it panics.
    is_whole: bool,
}

/// A reservation with what it borrows. Fields are dropped in their order.
#[derive(Debug)]
struct Held {
    /// Borrows the planner, which `GirandolePlanner` keeps until this is dropped, and the world, which
    /// refuses changes and its end until `borrow` is dropped.
    reservation: Reservation<'static>,
    new_buffers: Vec<GirandoleNewBuffer>,
    borrow: Borrow,
}

/// Counts a reservation of a world.
#[derive(Debug)]
struct Borrow(Arc<AtomicUsize>);

impl Borrow {
    fn new(count: &Arc<AtomicUsize>) -> Self {
        count.fetch_add(1, Ordering::AcqRel);
        Self(Arc::clone(count))
    }
}

impl Drop for Borrow {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

impl Drop for GirandolePlanner {
    fn drop(&mut self) {
        self.held = None;
        // SAFETY: from `Box::into_raw`, and no reservation borrows it any more.
        drop(unsafe { Box::from_raw(self.planner.as_ptr()) });
    }
}

impl GirandolePlanner {
    fn new(limits: PlanLimits) -> Self {
        let planner = NonNull::from(Box::leak(Box::new(LightPlanner::new(limits))));
        Self { planner, held: None, world: None, is_whole: true }
    }

    fn check_whole(&self) -> Result<(), Failure> {
        if self.is_whole {
            return Ok(());
        }
        Err(Failure::new(GIRANDOLE_ERROR_BROKEN, "the planner is broken: an earlier call panicked"))
    }

    /// The planner, which no reservation borrows.
    fn free(&mut self) -> Result<&mut LightPlanner, Failure> {
        if self.held.is_some() {
            let message = "the planner has a reservation: plan or cancel it first";
            return Err(Failure::new(GIRANDOLE_ERROR_RESERVED, message));
        }
        // SAFETY: from a box, and there is no reservation.
        Ok(unsafe { self.planner.as_mut() })
    }

    /// Changes the planner.
    fn edit<R>(&mut self, change: impl FnOnce(&mut Self) -> Result<R, Failure>) -> Result<R, Failure> {
        self.check_whole()?;
        self.is_whole = false;
        let result = change(self);
        // Not reached by a panic.
        self.is_whole = true;
        result
    }

    fn reserve(&mut self, world: &GirandoleWorld, delta: &GirandoleDelta, exactly: bool) -> Result<(), Failure> {
        self.free()?;
        let follows = *self.world.get_or_insert(world.id);
        if follows != world.id || delta.world != world.id {
            let message = "the planner or the delta belongs to another world";
            return Err(Failure::new(GIRANDOLE_ERROR_OTHER_WORLD, message));
        }
        let borrow = Borrow::new(&world.reservations);
        // SAFETY: `borrow` counts the reservation, and is dropped after it.
        let lights = unsafe { world.read_while_reserved()? };
        // SAFETY: from a box that is dropped after `held`; `free` gives out no reference while it is set.
        let planner: &'static mut LightPlanner = unsafe { &mut *self.planner.as_ptr() };
        let reservation = match exactly {
            false => planner.reserve(lights, &delta.delta)?,
            true => planner.reserve_exactly(lights, &delta.delta)?,
        };
        let new_buffers = new_buffers(reservation.new_buffers())?;
        self.held = Some(Held { reservation, new_buffers, borrow });
        Ok(())
    }

    fn take(&mut self) -> Result<Held, Failure> {
        let none = || Failure::new(GIRANDOLE_ERROR_NOT_RESERVED, "the planner has no reservation");
        self.held.take().ok_or_else(none)
    }
}

/// What a buffer is bound as: one of GIRANDOLE_BUFFER_*.
pub type GirandoleBufferUsage = u32;
/// A uniform buffer that plans also write. Vulkan: UNIFORM_BUFFER, TRANSFER_DST.
pub const GIRANDOLE_BUFFER_UNIFORM: GirandoleBufferUsage = 0;
/// A storage buffer that plans also write, copy from, copy to and clear. Vulkan: STORAGE_BUFFER,
/// TRANSFER_SRC, TRANSFER_DST.
pub const GIRANDOLE_BUFFER_STORAGE: GirandoleBufferUsage = 1;

/// A buffer that the engine has to make.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleNewBuffer {
    /// Its number in all later plans. A planner uses no number twice.
    pub id: u32,
    /// One of GIRANDOLE_BUFFER_*.
    pub usage: GirandoleBufferUsage,
    /// Bytes, a multiple of 4. The content may be undefined at first.
    pub size: u64,
    /// What it holds, for graphics debuggers. Valid as long as the process.
    pub what: *const c_char,
}

pub(crate) fn new_buffers(buffers: &[NewBuffer]) -> Result<Vec<GirandoleNewBuffer>, Failure> {
    let buffer = |buffer: &NewBuffer| {
        let usage = match buffer.kind {
            BufferKind::Uniform => GIRANDOLE_BUFFER_UNIFORM,
            BufferKind::Storage => GIRANDOLE_BUFFER_STORAGE,
            _ => return Err(Failure::bad_value("usage of a buffer", format!("{:?}", buffer.kind))),
        };
        Ok(GirandoleNewBuffer { id: buffer.id.get(), usage, size: buffer.bytes, what: c_name(buffer.what) })
    };
    buffers.iter().map(buffer).collect()
}

/// Runs a call that changes a planner without a reservation.
unsafe fn change<R>(
    planner: *mut GirandolePlanner,
    change: impl FnOnce(&mut LightPlanner) -> Result<R, Failure>,
) -> Result<R, Failure> {
    // SAFETY: see the crate's documentation.
    unsafe { object_mut(planner, "planner")? }.edit(|planner| change(planner.free()?))
}

/// Creates a planner for a device that holds nothing yet. limits may be NULL for a largest buffer of 128 MiB
/// and no other limits. Destroy it with girandole_planner_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_create(
    limits: *const GirandoleLimits,
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
        out.set(Box::into_raw(Box::new(GirandolePlanner::new(given))));
        Ok(())
    })
}

/// Destroys a planner, and its reservation if it has one. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_destroy(planner: *mut GirandolePlanner) {
    if !planner.is_null() {
        // The status is of no use: a panic here is a bug that leaks memory.
        let _ = call(|| {
            // SAFETY: made by `Box::into_raw`, and see the crate's documentation.
            drop(unsafe { Box::from_raw(planner) });
            Ok(())
        });
    }
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

/// Sets the number of splits of shaders from the next plan on: 0 to 7.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_set_splits(planner: *mut GirandolePlanner, splits: u32) -> GirandoleStatus {
    call(|| {
        let splits = SplitCount::new(splits as usize)?;
        let set = |planner: &mut LightPlanner| {
            planner.set_splits(splits);
            Ok(())
        };
        // SAFETY: see the crate's documentation.
        unsafe { change(planner, set) }
    })
}

/// Keeps the buffers of the last frame from the next plan on (1), or drops them (0), for light_pmf_previous.
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

/// Finds out which buffers the GPU needs to follow the world. Changes nothing that shaders read.
///
/// exactly: 0 for buffers with room to grow, 1 for buffers no larger than needed. new_buffers and count get
/// the buffers to make; the array belongs to the planner and is valid until the reservation ends.
///
/// The reservation ends with girandole_planner_plan, or, if there is no memory for a buffer, with
/// girandole_planner_cancel. Until then calls that change the world or use the planner otherwise are refused
/// with GIRANDOLE_ERROR_RESERVED; calls for a const world work. The delta may be destroyed at once.
///
/// On GIRANDOLE_ERROR_FULL the changes are kept for the next call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_reserve(
    planner: *mut GirandolePlanner,
    world: *const GirandoleWorld,
    delta: *const GirandoleDelta,
    exactly: u32,
    new_buffers: *mut *const GirandoleNewBuffer,
    count: *mut usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (planner, world) = unsafe { (object_mut(planner, "planner")?, object(world, "world")?) };
        // SAFETY: see the crate's documentation.
        let (delta, exactly) = (unsafe { object(delta, "delta")? }, flag(exactly, "exactly")?);
        // SAFETY: see the crate's documentation.
        let (array, count) = unsafe { (result(new_buffers, "new_buffers")?, result(count, "count")?) };
        planner.edit(|planner| planner.reserve(world, delta, exactly))?;
        let made: &[_] = planner.held.as_ref().map_or(&[], |held| &held.new_buffers);
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
        let frame = planner.edit(|planner| {
            let Held { reservation, borrow, .. } = planner.take()?;
            let frame = reservation.plan();
            drop(borrow);
            Ok(frame)
        })?;
        out.set(Box::into_raw(Box::new(GirandolePlan::new(frame)?)));
        Ok(())
    })
}

/// Ends the reservation without a plan. Its changes belong to the next reservation.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_cancel(planner: *mut GirandolePlanner) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let planner = unsafe { object_mut(planner, "planner")? };
        planner.edit(|planner| planner.take().map(drop))
    })
}

/// Makes a plan that only brings girandole_planner_set_splits to the device before the next frame, often an
/// empty one. Its number is 0, and cursors do not count it. Play it before the next plan.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_settings(
    planner: *mut GirandolePlanner,
    plan: *mut *mut GirandolePlan,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let out = unsafe { result(plan, "plan")? };
        let mut frame = FramePlan::default();
        // SAFETY: see the crate's documentation.
        frame.upload = unsafe { change(planner, |planner| Ok(planner.settings()))? };
        out.set(Box::into_raw(Box::new(GirandolePlan::new(frame)?)));
        Ok(())
    })
}

/// Tells that the device may lack some of what was planned: a plan was not played, or not to its end. The
/// next plan sends everything again, into the same buffers; skip to it with girandole_cursor_skip_to.
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

/// Tells that the part "top" of the last plan alone was not played, so that the next plan has another one.
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
pub const GIRANDOLE_SHADER_BUFFERS: usize = 5;

unsafe fn bindings(
    planner: *mut GirandolePlanner,
    buffers: *mut u32,
    get: impl FnOnce(&LightPlanner) -> Option<[BufferId; GIRANDOLE_SHADER_BUFFERS]>,
) -> Result<(), Failure> {
    // SAFETY: see the crate's documentation.
    let out = unsafe { result(buffers.cast::<[u32; GIRANDOLE_SHADER_BUFFERS]>(), "buffers")? };
    // SAFETY: see the crate's documentation.
    let ids = unsafe { change(planner, |planner| Ok(get(planner)))? };
    out.set(ids.map_or([u32::MAX; GIRANDOLE_SHADER_BUFFERS], |ids| ids.map(BufferId::get)));
    Ok(())
}

/// Stores the numbers of the buffers that the engine's shaders bind after the last plan, at the bindings 0 to
/// 4 of their group: a uniform buffer of 64 bytes, and four storage buffers that are only read, each bound
/// whole. UINT32_MAX before the first plan. buffers has room for GIRANDOLE_SHADER_BUFFERS numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_bindings(
    planner: *mut GirandolePlanner,
    buffers: *mut u32,
) -> GirandoleStatus {
    // SAFETY: see the crate's documentation.
    call(|| unsafe { bindings(planner, buffers, LightPlanner::bindings) })
}

/// As girandole_planner_bindings, for the buffers of the last frame, if they are kept.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_previous_bindings(
    planner: *mut GirandolePlanner,
    buffers: *mut u32,
) -> GirandoleStatus {
    // SAFETY: see the crate's documentation.
    call(|| unsafe { bindings(planner, buffers, LightPlanner::previous_bindings) })
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
        out.set(unsafe { change(planner, |planner| Ok(planner.effects().bits().into()))? });
        Ok(())
    })
}

/// Stores the bytes of all buffers.
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
