//! Tables besides the lights: their buffers, and the bind groups with them.

use super::GpuLights;
use super::error::GpuError;
use super::table_groups::{Bound, TableBuffers, TableGroup, Tables};
use crate::plan::{LightPlanner, PlanError, TableReservation};

impl GpuLights {
    /// Makes the table that a planner reserves. The present one stays if there is no memory for it.
    pub(super) fn replace_table(
        &mut self,
        reserve: impl FnOnce(&mut LightPlanner) -> Result<TableReservation<'_>, PlanError>,
    ) -> Result<(), GpuError> {
        let reservation = reserve(&mut self.planner)?;
        self.player.create(reservation.new_buffers())?;
        let plan = reservation.plan();
        self.player.play(&plan.upload);
        self.rebind_tables();
        self.player.free(&plan.freed);
        Ok(())
    }

    /// The bind group of shaders that use these tables, made at first use.
    pub(super) fn table_group(&self, tables: Tables) -> &TableGroup {
        self.tables[tables as usize]
            .get_or_init(|| TableGroup::new(&self.device, tables, &self.table_buffers(), self.bound_tables()))
    }

    /// Replaces the bind groups of which a buffer was replaced.
    pub(super) fn rebind_tables(&mut self) {
        let mut groups = std::mem::take(&mut self.tables);
        let bound = self.bound_tables();
        for group in groups.iter_mut().filter_map(|group| group.get_mut()) {
            group.rebind(&self.device, &self.table_buffers(), bound);
        }
        self.tables = groups;
    }

    /// What shaders bind. There are no tables while an upload has failed, since cuts may name nodes that are not
    /// there.
    fn bound_tables(&self) -> Bound {
        let is_bound = self.bound.is_some();
        let (cuts, visibility) = (self.planner.cut_table(), self.planner.visibility_table());
        (self.bound, cuts.filter(|_| is_bound), visibility.filter(|_| is_bound))
    }

    fn table_buffers(&self) -> TableBuffers<'_> {
        let (_, cuts, visibility) = self.bound_tables();
        TableBuffers {
            lights: self.buffers(),
            // Shaders may write `dark.records`, but only read `dark.storage`.
            cuts: cuts.map_or(&self.dark.storage, |cuts| self.player.buffer(cuts)),
            marks: cuts.map_or(&self.dark.records, |cuts| self.player.buffer(cuts)),
            visibility: visibility
                .map_or([&self.dark.storage, &self.dark.records], |ids| ids.map(|id| self.player.buffer(id))),
        }
    }
}
