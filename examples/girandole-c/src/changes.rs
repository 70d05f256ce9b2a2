//! Readers: what changed in a world since they read it last.

use girandole::Revision;
use girandole::glam::DVec3;

use crate::memory::{destroy, object, object_mut, result};
use crate::status::{Failure, GIRANDOLE_ERROR_OTHER_WORLD, GirandoleStatus, call};
use crate::vectors::GirandoleDVec3;
use crate::world::GirandoleWorld;

/// Follows the changes of one world, for renderers that keep samples from frame to frame. Any number of readers
/// may follow a world. Planners follow it by themselves.
///
/// Threads: one thread at a time.
#[derive(Debug, Default)]
pub struct GirandoleReader {
    seen: Revision,
    /// The world that it follows, from the first call on.
    world: Option<u64>,
    moved: Vec<u32>,
    added: Vec<u32>,
    removed: Vec<u32>,
}

/// What changed in a world since a reader read it last. The arrays belong to the reader, and are valid until its
/// next call.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleChanges {
    /// By how much the origin moved, in metres: subtract it from positions that are kept relative to the
    /// origin. 0 if it did not move, and in the first call.
    pub origin_shift: GirandoleDVec3,
    /// Slots of instances that were moved, ascending.
    pub moved_instances: *const u32,
    /// The number of these slots.
    pub moved_count: usize,
    /// Slots of instances that were added, ascending.
    pub added_instances: *const u32,
    /// The number of these slots.
    pub added_count: usize,
    /// Slots that an instance was removed from, ascending.
    pub removed_instances: *const u32,
    /// The number of these slots.
    pub removed_count: usize,
    /// 1 if nothing changed, else 0.
    pub is_empty: u32,
}

/// Creates a reader that has seen nothing. Destroy it with girandole_reader_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_reader_create(reader: *mut *mut GirandoleReader) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let out = unsafe { result(reader, "reader")? };
        out.set(Box::into_raw(Box::default()));
        Ok(())
    })
}

/// Stores what changed in the world since the last call for this reader; in the first call, that all instances
/// were added. Once a frame, after girandole_world_update, or in any frames.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_reader_read(
    reader: *mut GirandoleReader,
    world: *const GirandoleWorld,
    changes: *mut GirandoleChanges,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (reader, world) = unsafe { (object_mut(reader, "reader")?, object(world, "world")?) };
        // SAFETY: see the crate's documentation.
        let out = unsafe { result(changes, "changes")? };
        if reader.world.is_some_and(|follows| follows != world.id) {
            return Err(Failure::new(GIRANDOLE_ERROR_OTHER_WORLD, "the reader follows another world"));
        }
        let lights = world.read()?;
        let changes = lights.changes_since(reader.seen);
        let GirandoleReader { seen, world: follows, moved, added, removed } = reader;
        *follows = Some(world.id);
        [&mut *moved, &mut *added, &mut *removed].into_iter().for_each(Vec::clear);
        moved.extend(changes.moved_instances());
        added.extend(changes.added_instances());
        removed.extend(changes.removed_instances());
        out.set(GirandoleChanges {
            origin_shift: changes.origin_shift().unwrap_or(DVec3::ZERO).into(),
            moved_instances: moved.as_ptr(),
            moved_count: moved.len(),
            added_instances: added.as_ptr(),
            added_count: added.len(),
            removed_instances: removed.as_ptr(),
            removed_count: removed.len(),
            is_empty: changes.is_empty().into(),
        });
        *seen = lights.revision();
        Ok(())
    })
}

/// Frees a reader. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_reader_destroy(reader: *mut GirandoleReader) {
    // SAFETY: made by `Box::into_raw`, and see the crate's documentation.
    unsafe { destroy(reader) }
}
