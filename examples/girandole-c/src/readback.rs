//! What an engine reads back of trees whose lights its kernels write.

use girandole::TreeKey;
use girandole::plan::{LightPlanner, Readback};

use crate::memory::{array, destroy, list, object, object_mut, result};
use crate::planner::GirandolePlanner;
use crate::status::{Failure, GIRANDOLE_ERROR_BAD_VALUE, GIRANDOLE_ERROR_OTHER_WORLD, GirandoleStatus, call};
use crate::world::GirandoleWorld;

/// A range of a buffer that the engine copies after a plan, and whose bytes it passes to the world once they are
/// there, some frames later. It does not depend on the planner.
#[derive(Debug)]
pub struct GirandoleReadback {
    range: Readback,
    /// The world that the planner follows.
    world: Option<u64>,
}

/// What a readback copies.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleReadbackView {
    /// The number of the buffer.
    pub buffer: u32,
    /// The first byte, a multiple of 4.
    pub offset: u64,
    /// How many bytes: more than 0, and a multiple of 4.
    pub size: u64,
    /// The most trees that girandole_readback_apply may store.
    pub most_trees: usize,
}

impl GirandoleReadback {
    fn view(&self) -> GirandoleReadbackView {
        let Readback { buffer, offset, bytes, .. } = self.range;
        GirandoleReadbackView { buffer: buffer.get(), offset, size: bytes, most_trees: self.range.most_trees() }
    }
}

fn store(range: Option<Readback>, world: Option<u64>) -> *mut GirandoleReadback {
    range.map_or(std::ptr::null_mut(), |range| Box::into_raw(Box::new(GirandoleReadback { range, world })))
}

/// Stores what a planner is to read back; NULL for nothing.
///
/// # Safety
/// See the crate's documentation.
unsafe fn make(
    planner: *mut GirandolePlanner,
    readback: *mut *mut GirandoleReadback,
    range: impl FnOnce(&mut LightPlanner) -> Option<Readback>,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let out = unsafe { result(readback, "readback")? };
        let get = |planner: &mut GirandolePlanner| {
            let range = range(planner.free()?);
            Ok(store(range, planner.world()))
        };
        // SAFETY: see the crate's documentation.
        out.set(unsafe { object_mut(planner, "planner")? }.edit(get)?);
        Ok(())
    })
}

/// Makes a readback of what the refit in the last plan finds out about trees with a source: the numbers from
/// first on, at most most of them, 32 bytes each. Stores NULL if there are none. Copy the range after the commands
/// in top. Destroy the readback with girandole_readback_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_measures(
    planner: *mut GirandolePlanner,
    first: u32,
    most: u32,
    readback: *mut *mut GirandoleReadback,
) -> GirandoleStatus {
    // SAFETY: see the crate's documentation.
    unsafe { make(planner, readback, |planner| planner.measures(first, most)) }
}

/// Makes a readback of where kernels have moved some parts of a tree with a source, at most most of them, 80 bytes each:
/// each time those that follow on the last ones, of all trees in turn. Stores NULL if the GPU holds no such tree. Copy
/// the range after the commands in top. Destroy the readback with girandole_readback_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_source_parts(
    planner: *mut GirandolePlanner,
    most: u32,
    readback: *mut *mut GirandoleReadback,
) -> GirandoleStatus {
    // SAFETY: see the crate's documentation.
    unsafe { make(planner, readback, |planner| planner.source_parts(most)) }
}

/// Makes a readback of the lights of a tree with a source, for a rebuild: of the trees that
/// girandole_readback_apply stores. Stores NULL if the tree has no source, or if the GPU does not hold it whole.
/// Copy the range after the kernel of the engine has run. Destroy the readback with girandole_readback_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_source_lights(
    planner: *mut GirandolePlanner,
    tree: u64,
    readback: *mut *mut GirandoleReadback,
) -> GirandoleStatus {
    // SAFETY: see the crate's documentation.
    unsafe { make(planner, readback, |planner| planner.source_lights(TreeKey::from(tree))) }
}

/// Stores the range that a readback copies.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_readback_view(
    readback: *const GirandoleReadback,
    view: *mut GirandoleReadbackView,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (readback, view) = unsafe { (object(readback, "readback")?, result(view, "view")?) };
        view.set(readback.view());
        Ok(())
    })
}

/// Tells the world what the bytes of a readback say, before girandole_world_update. What was removed or rebuilt
/// meanwhile is left out.
///
/// Measures: policies and the scheduler of the world learn how good the trees are. Stores the keys of trees whose
/// policies request a rebuild, and in count how many. Read the lights of these trees back too, unless such a
/// readback is under way. trees has room for capacity keys: at least most_trees of the view, or the call is
/// refused with GIRANDOLE_ERROR_NO_SPACE and stores this number in count.
///
/// Parts: the top level has nodes where they are from the next update on. Stores no tree.
///
/// Lights: the tree's lights are set as the bytes say, so that it is rebuilt from these. Stores no tree.
///
/// size is that of the view. Bytes that no GPU has written do no harm.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_readback_apply(
    readback: *const GirandoleReadback,
    world: *mut GirandoleWorld,
    bytes: *const u8,
    size: usize,
    trees: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (readback, world) = unsafe { (object(readback, "readback")?, object(world, "world")?) };
        // SAFETY: see the crate's documentation.
        let bytes = unsafe { array(bytes, size, "bytes")? };
        if readback.world != Some(world.id) {
            return Err(Failure::new(GIRANDOLE_ERROR_OTHER_WORLD, "the planner of the readback follows another world"));
        }
        let view = readback.view();
        if size as u64 != view.size {
            let message = format!("{size} bytes are given for a readback of {}", view.size);
            return Err(Failure::new(GIRANDOLE_ERROR_BAD_VALUE, message));
        }
        if capacity < view.most_trees {
            // SAFETY: see the crate's documentation. Stores the number, and refuses.
            return unsafe { list((0..view.most_trees).map(|_| 0), trees, capacity, count) };
        }
        // SAFETY: see the crate's documentation. Checks the pointers before the world is changed.
        unsafe { list(std::iter::empty::<u64>(), trees, capacity, count)? };
        let wanted = world.edit(|world| Ok(readback.range.apply(world, bytes)))?;
        // SAFETY: see the crate's documentation.
        unsafe { list(wanted.into_iter().map(u64::from), trees, capacity, count) }
    })
}

/// Frees a readback. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_readback_destroy(readback: *mut GirandoleReadback) {
    // SAFETY: made by `Box::into_raw`, and see the crate's documentation.
    unsafe { destroy(readback) }
}
