//! Planners as objects: what the GPU holds of a world, and reservations of buffers.

use std::ptr::NonNull;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use girandole::CutOptions;
use girandole::glam::DVec3;
use girandole::plan::{Commands, LightPlanner, NewBuffer, PlanLimits, Reservation};

use crate::buffers::{GirandoleNewBuffer, new_buffers};
use crate::plan::GirandolePlan;
use crate::status::{
    Failure, GIRANDOLE_ERROR_BROKEN, GIRANDOLE_ERROR_NOT_RESERVED, GIRANDOLE_ERROR_OTHER_WORLD,
    GIRANDOLE_ERROR_RESERVED,
};
use crate::world::GirandoleWorld;

/// No limit.
pub const GIRANDOLE_NO_LIMIT: u64 = u64::MAX;

/// The limits of a planner.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleLimits {
    /// Bytes of the largest storage buffer that the device can make and bind whole. Values below 131,072
    /// count as 131,072, and values above 16 GiB as 16 GiB.
    pub largest_buffer: u64,
    /// The most bytes that the buffers of nodes and lights may take together, or GIRANDOLE_NO_LIMIT.
    pub tree_memory: u64,
    /// The most bytes of new trees that one frame may send, or GIRANDOLE_NO_LIMIT.
    pub frame_bytes: u64,
}

pub(crate) fn limit(bytes: u64) -> Option<u64> {
    (bytes != GIRANDOLE_NO_LIMIT).then_some(bytes)
}

/// Tracks what the GPU holds of one world, and plans the work that brings it up to date. Keep one for each
/// world and device. It owns no GPU objects.
///
/// Threads: one thread at a time.
#[derive(Debug)]
pub struct GirandolePlanner {
    /// From `Box::into_raw`. Not a box, since the reservation borrows it while calls have references to this.
    planner: NonNull<LightPlanner>,
    pub(crate) held: Option<Held>,
    /// The buffers of the cells, until the first plan.
    cut_buffers: Vec<NewBuffer>,
    /// What the next plan uploads first: the cells, and cameras.
    ahead: Vec<Commands>,
    /// The world that it follows, from the first reservation on.
    world: Option<u64>,
    /// False during a call that changes it, and for ever if it panics.
    is_whole: bool,
}

/// A reservation with what it borrows. Fields are dropped in their order.
#[derive(Debug)]
pub(crate) struct Held {
    /// Borrows the planner, which `GirandolePlanner` keeps until this is dropped, and the world, which
    /// refuses changes and its end until `borrow` is dropped.
    pub reservation: Reservation<'static>,
    pub new_buffers: Vec<GirandoleNewBuffer>,
    pub borrow: Borrow,
}

/// Counts a reservation of a world.
#[derive(Debug)]
pub(crate) struct Borrow(Arc<AtomicUsize>);

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
    pub(crate) fn new(limits: PlanLimits, cuts: CutOptions) -> Self {
        let mut planner = LightPlanner::new(limits);
        let cells = planner.reserve_cells(cuts, None).plan();
        let planner = NonNull::from(Box::leak(Box::new(planner)));
        let (cut_buffers, ahead) = (cells.new_buffers, vec![cells.upload]);
        Self { planner, held: None, cut_buffers, ahead, world: None, is_whole: true }
    }

    fn check_whole(&self) -> Result<(), Failure> {
        if self.is_whole {
            return Ok(());
        }
        Err(Failure::new(GIRANDOLE_ERROR_BROKEN, "the planner is broken: an earlier call panicked"))
    }

    /// The planner, which no reservation borrows.
    pub(crate) fn free(&mut self) -> Result<&mut LightPlanner, Failure> {
        if self.held.is_some() {
            let message = "the planner has a reservation: plan or cancel it first";
            return Err(Failure::new(GIRANDOLE_ERROR_RESERVED, message));
        }
        // SAFETY: from a box, and there is no reservation.
        Ok(unsafe { self.planner.as_mut() })
    }

    /// The world that it follows, after the first reservation.
    pub(crate) fn world(&self) -> Option<u64> {
        self.world
    }

    /// Changes the planner.
    pub(crate) fn edit<R>(&mut self, change: impl FnOnce(&mut Self) -> Result<R, Failure>) -> Result<R, Failure> {
        self.check_whole()?;
        self.is_whole = false;
        let result = change(self);
        // Not reached by a panic.
        self.is_whole = true;
        result
    }

    pub(crate) fn reserve(&mut self, world: &GirandoleWorld, exactly: bool) -> Result<(), Failure> {
        self.free()?;
        if self.world.is_some_and(|follows| follows != world.id) {
            return Err(Failure::new(GIRANDOLE_ERROR_OTHER_WORLD, "the planner follows another world"));
        }
        let borrow = Borrow::new(&world.reservations);
        // SAFETY: `borrow` counts the reservation, and is dropped after it.
        let lights = unsafe { world.read_while_reserved()? };
        self.world = Some(world.id);
        // SAFETY: from a box that is dropped after `held`; `free` gives out no reference while it is set.
        let planner: &'static mut LightPlanner = unsafe { &mut *self.planner.as_ptr() };
        let reservation = match exactly {
            false => planner.reserve(lights)?,
            true => planner.reserve_exactly(lights)?,
        };
        let new_buffers = new_buffers(self.cut_buffers.iter().chain(reservation.new_buffers()))?;
        self.held = Some(Held { reservation, new_buffers, borrow });
        Ok(())
    }

    pub(crate) fn set_cut_view(&mut self, eye: DVec3, pixel: f32) -> Result<(), Failure> {
        let moved = self.free()?.set_cut_view(eye, pixel);
        self.ahead.push(moved);
        Ok(())
    }

    /// Ends the reservation with a plan.
    pub(crate) fn plan(&mut self) -> Result<GirandolePlan, Failure> {
        let Held { reservation, new_buffers, borrow } = self.take()?;
        let mut frame = reservation.plan();
        drop(borrow);
        // The plan of the cells, which this one contains, has the number 1.
        frame.number -= 1;
        self.cut_buffers.clear();
        let ahead = std::mem::take(&mut self.ahead);
        let cuts = self.free()?.build_cuts();
        GirandolePlan::new(frame, new_buffers, ahead, cuts)
    }

    pub(crate) fn take(&mut self) -> Result<Held, Failure> {
        let none = || Failure::new(GIRANDOLE_ERROR_NOT_RESERVED, "the planner has no reservation");
        self.held.take().ok_or_else(none)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status::{GIRANDOLE_ERROR_PANIC, GIRANDOLE_OK, call};

    fn planner() -> GirandolePlanner {
        GirandolePlanner::new(PlanLimits::default(), CutOptions::default())
    }

    #[test]
    fn a_panic_breaks_the_planner_and_frees_the_world() {
        let (world, mut planner) = (GirandoleWorld::new(), planner());
        assert_eq!(call(|| planner.edit(|planner| planner.reserve(&world, false))), GIRANDOLE_OK);
        assert_eq!(call(|| world.edit(|_| Ok(()))), GIRANDOLE_ERROR_RESERVED);
        let dies = call(|| {
            planner.edit(|planner| {
                let _held = planner.take()?;
                panic!("a test")
            })
        });
        assert_eq!(dies, GIRANDOLE_ERROR_PANIC);
        assert_eq!(call(|| planner.edit(|planner| planner.free().map(drop))), GIRANDOLE_ERROR_BROKEN);
        assert_eq!(call(|| world.edit(|_| Ok(()))), GIRANDOLE_OK);
    }

    #[test]
    fn a_planner_follows_the_world_of_its_first_reservation() {
        let (world, other) = (GirandoleWorld::new(), GirandoleWorld::new());
        let mut planner = planner();
        assert_eq!(planner.reserve(&world, false).map_err(|failure| failure.code), Ok(()));
        planner.take().map(drop).expect("it has a reservation");
        let refused = planner.reserve(&other, false).map_err(|failure| failure.code);
        assert_eq!(refused, Err(GIRANDOLE_ERROR_OTHER_WORLD));
        assert_eq!(planner.reserve(&world, false).map_err(|failure| failure.code), Ok(()));
    }

    #[test]
    fn a_planner_that_is_dropped_ends_its_reservation() {
        let (world, mut planner) = (GirandoleWorld::new(), planner());
        planner.reserve(&world, true).expect("it fits");
        assert_eq!(world.reservations.load(Ordering::Acquire), 1);
        drop(planner);
        assert_eq!(world.reservations.load(Ordering::Acquire), 0);
    }
}
