//! Planners as objects: what the GPU holds of a world, and reservations of buffers.

use girandole::glam::DVec3;
use girandole::plan::{Commands, FramePlan, LightPlanner, NewBuffer, PlanLimits};
use girandole::{CutOptions, VisibilityOptions};

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
    planner: LightPlanner,
    pub(crate) reserved: Option<Reserved>,
    /// The buffers of the cells, until the first plan.
    cut_buffers: Vec<NewBuffer>,
    /// What the next plan uploads first: the cells, and cameras.
    ahead: Vec<Commands>,
    /// The world that it follows, from the first reservation on.
    world: Option<u64>,
    /// False during a call that changes it, and for ever if it panics.
    is_whole: bool,
}

/// A frame that is planned, and not yet taken.
#[derive(Debug)]
pub(crate) struct Reserved {
    /// The planner after the frame.
    planner: LightPlanner,
    frame: FramePlan,
    pub new_buffers: Vec<GirandoleNewBuffer>,
}

impl GirandolePlanner {
    pub(crate) fn new(limits: PlanLimits, (cuts, learning): (CutOptions, Option<VisibilityOptions>)) -> Self {
        let mut planner = LightPlanner::new(limits);
        let cells = planner.reserve_cells(cuts, learning).plan();
        let (cut_buffers, ahead) = (cells.new_buffers, vec![cells.upload]);
        Self { planner, reserved: None, cut_buffers, ahead, world: None, is_whole: true }
    }

    fn check_whole(&self) -> Result<(), Failure> {
        if self.is_whole {
            return Ok(());
        }
        Err(Failure::new(GIRANDOLE_ERROR_BROKEN, "the planner is broken: an earlier call panicked"))
    }

    /// The planner, which has no reservation.
    pub(crate) fn free(&mut self) -> Result<&mut LightPlanner, Failure> {
        if self.reserved.is_some() {
            let message = "the planner has a reservation: plan or cancel it first";
            return Err(Failure::new(GIRANDOLE_ERROR_RESERVED, message));
        }
        Ok(&mut self.planner)
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
        let mut planner = self.free()?.clone();
        if self.world.is_some_and(|follows| follows != world.id) {
            return Err(Failure::new(GIRANDOLE_ERROR_OTHER_WORLD, "the planner follows another world"));
        }
        let lights = world.read()?;
        self.world = Some(world.id);
        let reservation = if exactly { planner.reserve_exactly(lights)? } else { planner.reserve(lights)? };
        let new_buffers = new_buffers(self.cut_buffers.iter().chain(reservation.new_buffers()))?;
        let frame = reservation.plan();
        self.reserved = Some(Reserved { planner, frame, new_buffers });
        Ok(())
    }

    pub(crate) fn set_cut_view(&mut self, eye: DVec3, pixel: f32) -> Result<(), Failure> {
        let moved = self.free()?.set_cut_view(eye, pixel);
        self.ahead.push(moved);
        Ok(())
    }

    pub(crate) fn forget_visibility(&mut self) -> Result<(), Failure> {
        let cleared = self.free()?.forget_visibility();
        self.ahead.push(cleared);
        Ok(())
    }

    /// Ends the reservation with a plan.
    pub(crate) fn plan(&mut self) -> Result<GirandolePlan, Failure> {
        let Reserved { planner, mut frame, new_buffers } = self.take()?;
        self.planner = planner;
        // The plan of the cells, which this one contains, has the number 1.
        frame.number -= 1;
        self.cut_buffers.clear();
        let ahead = std::mem::take(&mut self.ahead);
        let cuts = self.planner.build_cuts();
        GirandolePlan::new(frame, new_buffers, ahead, cuts)
    }

    pub(crate) fn take(&mut self) -> Result<Reserved, Failure> {
        let none = || Failure::new(GIRANDOLE_ERROR_NOT_RESERVED, "the planner has no reservation");
        self.reserved.take().ok_or_else(none)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status::{GIRANDOLE_ERROR_PANIC, GIRANDOLE_OK, call};

    fn planner() -> GirandolePlanner {
        GirandolePlanner::new(PlanLimits::default(), Default::default())
    }

    #[test]
    fn a_panic_breaks_the_planner_and_not_the_world() {
        let (world, mut planner) = (GirandoleWorld::new(), planner());
        assert_eq!(call(|| planner.edit(|planner| planner.reserve(&world, false))), GIRANDOLE_OK);
        let dies = call(|| {
            planner.edit(|planner| {
                let _reserved = planner.take()?;
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
    fn a_world_may_change_and_end_during_a_reservation() {
        let (world, mut planner) = (GirandoleWorld::new(), planner());
        planner.reserve(&world, true).expect("it fits");
        assert_eq!(call(|| world.edit(|_| Ok(()))), GIRANDOLE_OK);
        drop(world);
        assert!(planner.plan().is_ok());
    }
}
