//! Worlds as objects, and the calls that concern a whole world.

use std::cell::UnsafeCell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use girandole::{FrameBudget, LightWorld};

use crate::memory::{destroy, object, result, wanted};
use crate::shader_text::effect_bits;
use crate::status::{Failure, GIRANDOLE_ERROR_BAD_VALUE, GIRANDOLE_ERROR_BROKEN, GirandoleStatus, call};

/// The version of this header: major * 0x10000 + minor * 0x100 + patch.
pub const GIRANDOLE_VERSION: u32 = 0x000100;

/// Returns the version of the library. A program should compare it with GIRANDOLE_VERSION, the version of the
/// header that it was compiled with.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_version() -> u32 {
    GIRANDOLE_VERSION
}

/// All lights of a scene: trees, instances of them, and directional lights.
///
/// Threads: any number of threads may be in calls that take a const world, as long as no thread is in a call
/// that takes a world that is not const. Different worlds are independent of each other.
#[derive(Debug)]
pub struct GirandoleWorld {
    /// Shared references exist during calls for a const world, and a mutable one during other calls.
    world: UnsafeCell<LightWorld>,
    pub(crate) id: u64,
    /// False during a call that changes the world, and for ever if it panics.
    is_whole: AtomicBool,
}

// SAFETY: the `UnsafeCell` is the reason that this needs a statement. `LightWorld` is `Send` and `Sync`
// (checked below), and by the rules for threads no other thread is in a call during `edit`.
unsafe impl Sync for GirandoleWorld {}

const _: () = {
    const fn is_send_and_sync<T: Send + Sync>() {}
    is_send_and_sync::<LightWorld>();
};

/// Of the worlds that a process has made.
static WORLDS: AtomicU64 = AtomicU64::new(0);

impl GirandoleWorld {
    pub(crate) fn new() -> Self {
        Self {
            world: UnsafeCell::new(LightWorld::new()),
            id: WORLDS.fetch_add(1, Ordering::Relaxed),
            is_whole: AtomicBool::new(true),
        }
    }

    fn check_whole(&self) -> Result<(), Failure> {
        if self.is_whole.load(Ordering::Acquire) {
            return Ok(());
        }
        let message = "the world is broken: an earlier call panicked, or another thread is changing the world";
        Err(Failure::new(GIRANDOLE_ERROR_BROKEN, message))
    }

    /// The world, for calls that do not change it.
    pub(crate) fn read(&self) -> Result<&LightWorld, Failure> {
        self.check_whole()?;
        // SAFETY: no call that changes the world runs (the rules for threads), so there is no mutable
        // reference.
        Ok(unsafe { &*self.world.get() })
    }

    /// Changes the world.
    pub(crate) fn edit<R>(&self, change: impl FnOnce(&mut LightWorld) -> Result<R, Failure>) -> Result<R, Failure> {
        self.check_whole()?;
        self.is_whole.store(false, Ordering::Release);
        // SAFETY: no other call uses the world (the rules for threads).
        let result = change(unsafe { &mut *self.world.get() });
        // Not reached by a panic.
        self.is_whole.store(true, Ordering::Release);
        result
    }
}

/// Creates an empty world. Destroy it with girandole_world_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_create(world: *mut *mut GirandoleWorld) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { result(world, "world")? };
        world.set(Box::into_raw(Box::new(GirandoleWorld::new())));
        Ok(())
    })
}

/// Destroys a world and everything in it. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_destroy(world: *mut GirandoleWorld) {
    // SAFETY: made by `Box::into_raw`, and see the crate's documentation.
    unsafe { destroy(world) }
}

/// The sizes of a world.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct GirandoleCounts {
    /// Trees, with or without instances.
    pub trees: usize,
    /// Instances, hidden ones included.
    pub instances: usize,
    /// All lights: the lights of a tree count once for each of its instances, and directional lights count
    /// too.
    pub lights: usize,
    /// Directional lights.
    pub directionals: usize,
    /// The effects that shaders should be made for: bits of GIRANDOLE_EFFECT_*.
    pub effects: u32,
    /// Bytes of CPU memory that the world uses.
    pub memory: usize,
}

/// Stores the sizes of a world. Cheap.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_counts(
    world: *const GirandoleWorld,
    counts: *mut GirandoleCounts,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, counts) = unsafe { (object(world, "world")?.read()?, result(counts, "counts")?) };
        counts.set(GirandoleCounts {
            trees: world.trees().len(),
            instances: world.instances().len(),
            lights: world.light_count(),
            directionals: world.directionals().len(),
            effects: effect_bits(world.effects()),
            memory: world.memory().total(),
        });
        Ok(())
    })
}

/// What an update did.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct GirandoleUpdateReport {
    /// Instances that were added, moved, shown, hidden or removed since the last update.
    pub moved_instances: usize,
    /// Trees that were refitted because their lights changed.
    pub refit_trees: usize,
    /// Lights of these trees.
    pub refit_lights: usize,
    /// Trees that were rebuilt.
    pub rebuilt_trees: usize,
    /// Trees that wait for a rebuild in a later update.
    pub waiting_trees: usize,
    /// The longest wait of a tree, in updates.
    pub longest_wait: u64,
    /// The measured time of the rebuilds, in microseconds.
    pub spent_us: f64,
    /// The time by which rebuilds exceeded the budget, in microseconds.
    pub overrun_us: f64,
    /// The time of the refits, which are not part of the budget, in microseconds.
    pub refit_us: f64,
}

fn micros(time: Duration) -> f64 {
    time.as_secs_f64() * 1.0e6
}

/// Brings trees up to date with the edits since the last call, and rebuilds noisy trees within a time budget.
/// Call it once a frame.
///
/// budget_us: microseconds for rebuilds. 0 rebuilds nothing, INFINITY rebuilds every tree that would gain
/// from it; negative values and NaN are refused. report may be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_update(
    world: *mut GirandoleWorld,
    budget_us: f64,
    report: *mut GirandoleUpdateReport,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, report) = unsafe { (object(world, "world")?, wanted(report, "report")?) };
        let budget = FrameBudget::from_millis(budget_us * 1.0e-3)?;
        let done = world.edit(|world| Ok(world.update(budget)))?;
        report.set(GirandoleUpdateReport {
            moved_instances: done.moved_instances,
            refit_trees: done.refit_trees,
            refit_lights: done.refit_lights,
            rebuilt_trees: done.rebuilt_trees,
            waiting_trees: done.waiting_trees,
            longest_wait: done.longest_wait,
            spent_us: micros(done.spent),
            overrun_us: micros(done.overrun),
            refit_us: micros(done.refit_time),
        });
        Ok(())
    })
}

/// Sets whether trees that do not fit into a frame may be built on another thread: 1 for yes, 0 for no.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_background_builds(
    world: *mut GirandoleWorld,
    are_allowed: u32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")? };
        let are_allowed = crate::vectors::flag(are_allowed, "are_allowed")?;
        world.edit(|world| {
            world.set_background_builds(are_allowed);
            Ok(())
        })
    })
}

/// Sampling of large and near surfaces by solid angle, which has less noise and costs more.
pub const GIRANDOLE_SAMPLING_SOLID_ANGLE: u32 = 1;
/// Shaders that are made for the world's effects choose lights by the gloss of surfaces.
pub const GIRANDOLE_SAMPLING_GLOSSY: u32 = 2;
/// Shaders that are made for the world's effects choose lights for segments of rays.
pub const GIRANDOLE_SAMPLING_SEGMENTS: u32 = 4;

/// Sets the kinds of sampling that the world uses: bits of GIRANDOLE_SAMPLING_*. None at first.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_sampling(world: *mut GirandoleWorld, bits: u32) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")? };
        let all = GIRANDOLE_SAMPLING_SOLID_ANGLE | GIRANDOLE_SAMPLING_GLOSSY | GIRANDOLE_SAMPLING_SEGMENTS;
        if bits & !all != 0 {
            return Err(Failure::new(
                GIRANDOLE_ERROR_BAD_VALUE,
                format!("bits {bits:#x} have other bits than {all:#x}"),
            ));
        }
        world.edit(|world| {
            world.set_solid_angle_sampling(bits & GIRANDOLE_SAMPLING_SOLID_ANGLE != 0);
            world.set_glossy_sampling(bits & GIRANDOLE_SAMPLING_GLOSSY != 0);
            world.set_segment_sampling(bits & GIRANDOLE_SAMPLING_SEGMENTS != 0);
            Ok(())
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status::{GIRANDOLE_ERROR_PANIC, GIRANDOLE_OK};

    #[test]
    fn a_panic_during_an_edit_breaks_the_world_and_one_during_a_read_does_not() {
        let world = GirandoleWorld::new();
        let read_badly = call(|| {
            world.read()?;
            panic!("a test")
        });
        assert_eq!(read_badly, GIRANDOLE_ERROR_PANIC);
        assert_eq!(call(|| world.edit(|_| Ok(()))), GIRANDOLE_OK);
        assert_eq!(call(|| world.edit(|_| panic!("a test"))), GIRANDOLE_ERROR_PANIC);
        assert_eq!(call(|| world.edit(|_| Ok(()))), GIRANDOLE_ERROR_BROKEN);
        assert_eq!(call(|| world.read().map(drop)), GIRANDOLE_ERROR_BROKEN);
    }

    #[test]
    fn a_refused_edit_leaves_the_world_whole() {
        let world = GirandoleWorld::new();
        let refused = call(|| world.edit(|world| Ok(world.remove_tree(0.into())?)));
        assert_eq!(refused, 202);
        assert_eq!(call(|| world.edit(|_| Ok(()))), GIRANDOLE_OK);
    }
}
