//! What a planner does about learnt visibility.

use super::super::LightPlanner;
use super::super::buffers::BufferId;
use super::super::commands::Commands;
use super::super::error::PlanError;
use super::super::tables::{NewTable, TableReservation};
use crate::visibility::VisibilityOptions;

impl LightPlanner {
    /// Reserves a table of learnt visibility that knows nothing, which replaces the present one; `None` drops it. At
    /// first there is no table.
    ///
    /// Takes 7.5 kB of GPU memory for each cell. [`VisibilityTable`](crate::VisibilityTable) says when to use
    /// one, what it learns and how it forgets; the GPU does the same.
    ///
    /// # Errors
    /// [`PlanError::Full`] if the table would outgrow [`PlanLimits`](super::super::PlanLimits).
    pub fn reserve_visibility(
        &mut self,
        options: Option<VisibilityOptions>,
    ) -> Result<TableReservation<'_>, PlanError> {
        let mut new_buffers = Vec::new();
        let limit = self.trees.limits.largest_buffer;
        let reserve = |options| self.visibility.reserve(options, limit, (&mut self.buffers.ids, &mut new_buffers));
        let table = options.map(reserve).transpose()?;
        Ok(TableReservation::new(self, NewTable::Visibility(table), new_buffers))
    }

    /// The table and the records of a frame: what shaders that learn bind at 6, and write at 7. `None` without a
    /// table.
    pub fn visibility_table(&self) -> Option<[BufferId; 2]> {
        self.visibility.table().map(|table| [table.learnt, table.records])
    }

    /// What makes the records of a frame part of the table, and shared cuts void until the next build. Play it
    /// once a frame, behind the passes that record. There is nothing to do without a table, and before the first plan.
    ///
    /// Dispatches [`visibility_kernels`](super::super::visibility_kernels), with a workgroup for each cell of the
    /// table; most end at once. If nothing was recorded, nothing changes, and cuts stay.
    pub fn fold_visibility(&self) -> Commands {
        let mut commands = Commands::default();
        if let Some(bindings) = self.bindings() {
            let cuts = self.cuts.table().map(|table| table.cells);
            self.visibility.fold(&mut commands, bindings[0], cuts);
        }
        commands
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::plan::{Command, FramePlan, PlanLimits};
    use crate::sampling::cuts::CutOptions;
    use crate::world::LightWorld;

    fn frame(planner: &mut LightPlanner, world: &LightWorld) -> FramePlan {
        planner.reserve(world).expect("it fits").plan()
    }

    #[test]
    fn a_table_follows_the_origin_is_folded_and_makes_cuts_void() {
        let mut world = LightWorld::new();
        let mut planner = LightPlanner::new(PlanLimits::default());
        let options = VisibilityOptions::new(2.0, 64).expect("valid");
        let plan = planner.reserve_visibility(Some(options)).expect("it fits").plan();
        let sizes: Vec<u64> = plan.new_buffers.iter().map(|new| new.bytes).collect();
        // 64 rows of cells and eight of blocks.
        assert_eq!(sizes, [64 + 8 * 72 + 512 * 72, 8 * 72 + 8 * 512 * 72, 4 * 512 * 72]);
        assert!(planner.fold_visibility().is_empty(), "no lights are bound yet");
        frame(&mut planner, &world);
        let [learnt, _] = planner.visibility_table().expect("a table");
        let written = |commands: &Commands| {
            let bytes = |command| match command {
                Command::Write { buffer, bytes, .. } if buffer == learnt => bytes.len(),
                _ => 0,
            };
            commands.iter().map(bytes).sum::<usize>()
        };
        assert_eq!(frame(&mut planner, &world).report.bytes, 0);
        world.set_origin(DVec3::X).expect("finite");
        assert_eq!(written(&frame(&mut planner, &world).upload), 64);
        planner.lose();
        assert_eq!(written(&frame(&mut planner, &world).upload), 64);

        let dispatches = |commands: &Commands| {
            let dispatch = |command| match command {
                Command::Dispatch { kernel, workgroups, .. } => (kernel.entry(), workgroups[0]),
                _ => panic!("{command:?}"),
            };
            commands.iter().map(dispatch).collect::<Vec<_>>()
        };
        let fold = [("visibility_gather", 64), ("visibility_fold_blocks", 8), ("visibility_fold_cells", 64)];
        assert_eq!(dispatches(&planner.fold_visibility()), fold);
        drop(planner.reserve_cuts(Some(CutOptions::default())).expect("it fits").plan());
        assert_eq!(dispatches(&planner.fold_visibility())[3..], [("visibility_void", 1)]);
        assert_eq!(planner.build_cuts().len(), 5);
        // Cuts may know what a table knew that is dropped.
        let plan = planner.reserve_visibility(None).expect("nothing is made").plan();
        assert_eq!((plan.freed.len(), plan.report.bytes), (3, 4));
        assert!(planner.fold_visibility().is_empty() && planner.visibility_table().is_none());
    }

    #[test]
    fn a_table_beyond_the_largest_buffer_is_refused() {
        let options = VisibilityOptions::new(2.0, 2048).expect("valid");
        let needed = 8 * 2304 + 8 * 512 * 2304;
        for (limit, fits) in [(needed, true), (needed - 4, false), (needed / 10, false)] {
            let mut planner = LightPlanner::new(PlanLimits::new(limit));
            let result = planner.reserve_visibility(Some(options)).map(|_| ());
            let refused = PlanError::Full { what: "records of visibility", needed, limit };
            assert_eq!(result, if fits { Ok(()) } else { Err(refused) });
        }
    }
}
