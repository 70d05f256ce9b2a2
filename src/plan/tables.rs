//! Reservations of the table of cells.

use std::fmt;

use super::LightPlanner;
use super::buffers::NewBuffer;
use super::cuts;
use super::frame::FramePlan;

/// The room for a table of cells. Make [`TableReservation::new_buffers`], then call
/// [`TableReservation::plan`]. Dropped without that, it changes nothing.
pub struct TableReservation<'a> {
    planner: &'a mut LightPlanner,
    table: cuts::Table,
    new_buffers: Vec<NewBuffer>,
}

impl<'a> TableReservation<'a> {
    pub(super) fn new(planner: &'a mut LightPlanner, table: cuts::Table, new_buffers: Vec<NewBuffer>) -> Self {
        Self { planner, table, new_buffers }
    }

    /// The buffers that the table needs. The present table stays in use.
    pub fn new_buffers(&self) -> &[NewBuffer] {
        &self.new_buffers
    }

    /// Returns the plan that replaces the table, without a build of the top level. The buffers that were
    /// reserved must exist.
    pub fn plan(self) -> FramePlan {
        let Self { planner, table, new_buffers } = self;
        planner.number += 1;
        let mut plan = FramePlan { number: planner.number, new_buffers, ..FramePlan::default() };
        planner.cuts.adopt(table, &mut plan.upload, &mut plan.freed);
        planner.buffers.change(&plan.new_buffers, &plan.freed);
        plan.report = planner.report_of(&plan.upload);
        plan
    }
}

impl fmt::Debug for TableReservation<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TableReservation").field("new_buffers", &self.new_buffers).finish_non_exhaustive()
    }
}
