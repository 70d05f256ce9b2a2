//! Reservations of tables that planners have besides the lights.

use std::fmt;

use super::LightPlanner;
use super::buffers::NewBuffer;
use super::frame::FramePlan;
use super::{cuts, visibility};

/// A table that takes the place of the present one; `None` for no table.
pub(super) enum NewTable {
    Cuts(Option<cuts::Table>),
    Visibility(Option<visibility::Table>),
}

/// The room for a table of shared cuts or of learnt visibility. Make [`TableReservation::new_buffers`], then call
/// [`TableReservation::plan`]. Dropped without that, it changes nothing.
pub struct TableReservation<'a> {
    planner: &'a mut LightPlanner,
    table: NewTable,
    new_buffers: Vec<NewBuffer>,
}

impl<'a> TableReservation<'a> {
    pub(super) fn new(planner: &'a mut LightPlanner, table: NewTable, new_buffers: Vec<NewBuffer>) -> Self {
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
        let (upload, freed) = (&mut plan.upload, &mut plan.freed);
        match table {
            NewTable::Cuts(table) => planner.cuts.adopt(table, upload, freed),
            NewTable::Visibility(table) => {
                planner.visibility.adopt(table, upload, freed);
                // They may know what the former table knew.
                planner.cuts.make_void(upload);
            }
        }
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
