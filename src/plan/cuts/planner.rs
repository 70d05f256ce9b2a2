//! What a planner does about shared cuts.

use glam::DVec3;

use super::super::LightPlanner;
use super::super::buffers::BufferId;
use super::super::commands::Commands;
use super::super::error::PlanError;
use super::super::tables::{NewTable, TableReservation};
use crate::sampling::cuts::{CutOptions, camera};

impl LightPlanner {
    /// Reserves a table of cuts that neighbours share, which replaces the present one; `None` drops it. At first
    /// there is no table. [`CutTable`](crate::CutTable) says what cuts are good for; the GPU does the same.
    ///
    /// Takes 1.7 kB of GPU memory for each cell that may have a cut, and 256 to 512 bytes for its places
    /// for marked cells. A frame has these steps:
    ///
    /// 1. The plan of the frame, and the commands of [`LightPlanner::set_cut_view`].
    /// 2. A pass of the engine that knows the frame's shading points calls `light_mark` for each of them: see
    ///    [`wgsl_of_marks`](super::super::wgsl_of_marks).
    /// 3. The commands of [`LightPlanner::build_cuts`].
    /// 4. The engine's other shaders choose lights: see
    ///    [`ShaderParts::cuts`](super::super::ShaderParts::cuts).
    ///
    /// # Errors
    /// [`PlanError::Full`] if the table would outgrow [`PlanLimits`](super::super::PlanLimits).
    pub fn reserve_cuts(&mut self, options: Option<CutOptions>) -> Result<TableReservation<'_>, PlanError> {
        let mut new_buffers = Vec::new();
        let limit = self.trees.limits.largest_buffer;
        let reserve = |options| self.cuts.reserve(options, limit, (&mut self.buffers.ids, &mut new_buffers));
        let table = options.map(reserve).transpose()?;
        Ok(TableReservation::new(self, NewTable::Cuts(table), new_buffers))
    }

    /// Makes cells follow the pixels of a camera, as [`CutTable::set_view`](crate::CutTable::set_view) does.
    /// Returns what to play ahead of the passes that mark: nothing without a table.
    #[must_use]
    pub fn set_cut_view(&mut self, eye: DVec3, pixel: f32) -> Commands {
        let mut commands = Commands::default();
        self.cuts.set_camera(&mut commands, camera(eye, pixel));
        commands
    }

    /// The table of cuts: what shaders bind at 5 that choose lights from it, and at 0 that mark. `None` without a
    /// table.
    pub fn cut_table(&self) -> Option<BufferId> {
        self.cuts.table().map(|table| table.cells)
    }

    /// A buffer of the counters of the last build, to be copied and read; `None` without a table.
    ///
    /// Words 4 to 9 are the fields of [`CutReport`](crate::CutReport) in their order; the others belong to the
    /// library.
    pub fn cut_report(&self) -> Option<BufferId> {
        self.cuts.table().map(|table| table.report)
    }

    /// The build of the cuts of all cells that were marked, which forgets the marks. Play it behind the
    /// passes that mark, and ahead of those that choose lights. There is nothing to do without a table, and before the
    /// first plan.
    ///
    /// Cuts suit glossy points if the world's lights are sampled for these: see
    /// [`LightWorld::set_glossy_sampling`](crate::LightWorld::set_glossy_sampling). Cells keep their cuts as
    /// those of [`CutTable::build`](crate::CutTable::build) do. With [learnt
    /// visibility](LightPlanner::reserve_visibility), cells choose lights by that too. Which cells are refused, if
    /// there are too many, depends on the order in which the GPU works.
    ///
    /// Five dispatches: one for the places of the table, two of a single invocation, and two of a workgroup
    /// for each cell that is looked at and for each that is built. Their kernels are [`cut_kernels`](super::super::cut_kernels).
    pub fn build_cuts(&self) -> Commands {
        let mut commands = Commands::default();
        if let Some(lights) = self.bindings() {
            let learnt = self.visibility_table().map(|[learnt, _]| learnt);
            self.cuts.build(&mut commands, lights, learnt, self.effects);
        }
        commands
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;
    use crate::plan::{BufferKind, Command, FramePlan, PlanLimits};
    use crate::tree::LightTree;
    use crate::world::LightWorld;

    fn frame(planner: &mut LightPlanner, world: &LightWorld) -> FramePlan {
        planner.reserve(world).expect("it fits").plan()
    }

    /// The bytes that a plan writes to a buffer, and those that it clears of it.
    fn changed(commands: &Commands, id: BufferId) -> [u64; 2] {
        commands.iter().fold([0; 2], |[written, cleared], command| match command {
            Command::Write { buffer, bytes, .. } if buffer == id => [written + bytes.len() as u64, cleared],
            Command::Clear { buffer, bytes, .. } if buffer == id => [written, cleared + bytes],
            _ => [written, cleared],
        })
    }

    #[test]
    fn a_table_is_emptied_once_made_void_by_changes_and_sent_again_when_it_is_lost() {
        let mut world = LightWorld::new();
        let mut planner = LightPlanner::new(PlanLimits::default());
        assert!(planner.build_cuts().is_empty() && planner.cut_table().is_none());
        let options = CutOptions::new(0.5, 100).expect("valid");
        let plan = planner.reserve_cuts(Some(options)).expect("it fits").plan();
        let table = planner.cut_table().expect("a table");
        let bytes = plan.new_buffers[0].bytes;
        assert_eq!(
            plan.new_buffers.iter().map(|new| new.kind).collect::<Vec<_>>(),
            [BufferKind::Storage, BufferKind::Indirect]
        );
        // The grid, the head, and the numbers of free rows.
        assert_eq!(changed(&plan.upload, table), [80 + 80 + 400, bytes]);
        assert!(planner.build_cuts().is_empty(), "no lights are bound yet");

        let frame_of = |planner: &mut LightPlanner, world: &LightWorld| changed(&frame(planner, world).upload, table);
        assert_eq!(frame_of(&mut planner, &world), [4, 0]);
        assert_eq!(planner.build_cuts().iter().filter(|c| matches!(c, Command::DispatchIndirect { .. })).count(), 2);
        assert_eq!(planner.build_cuts().len(), 5);
        assert_eq!(frame_of(&mut planner, &world), [0, 0]);
        let lamp = LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).expect("valid");
        world.add_tree(lamp);
        assert_eq!(frame_of(&mut planner, &world), [4, 0]);
        // No instance moves with the origin, so cuts stay valid.
        world.set_origin(DVec3::X).expect("finite");
        assert_eq!(frame_of(&mut planner, &world), [80, 0]);
        assert_eq!(changed(&planner.set_cut_view(DVec3::Y, 0.001), table), [80, 0]);
        assert!(planner.set_cut_view(DVec3::Y, 0.001).is_empty());
        planner.lose();
        assert_eq!(frame_of(&mut planner, &world), [80 + 80 + 400, bytes]);
        assert_eq!(frame_of(&mut planner, &world), [0, 0]);
    }

    #[test]
    fn a_table_is_replaced_or_dropped_by_a_plan_and_a_reservation_alone_changes_nothing() {
        let mut planner = LightPlanner::new(PlanLimits::default());
        let first = frame(&mut planner, &LightWorld::new()).number;
        let before = planner.memory().buffers;
        let options = |cells| Some(CutOptions::new(0.5, cells).expect("valid"));
        drop(planner.reserve_cuts(options(64)).expect("it fits"));
        assert!(planner.cut_table().is_none() && planner.memory().buffers == before);
        let plan = planner.reserve_cuts(options(64)).expect("it fits").plan();
        assert_eq!((plan.number, plan.freed.len()), (first + 1, 0));
        let former = [planner.cut_table(), planner.cut_report()].map(|id| id.expect("a table"));
        let plan = planner.reserve_cuts(options(128)).expect("it fits").plan();
        assert_eq!((plan.number, &plan.freed[..]), (first + 2, &former[..]));
        let plan = planner.reserve_cuts(None).expect("nothing is made").plan();
        assert!(plan.new_buffers.is_empty() && plan.freed.len() == 2 && plan.upload.is_empty());
        assert!(planner.cut_table().is_none() && planner.memory().buffers == before);
    }

    #[test]
    fn a_table_beyond_the_largest_buffer_is_refused() {
        let options = CutOptions::new(0.5, 1280).expect("valid");
        let mut planner = LightPlanner::new(PlanLimits::default());
        let needed = planner.reserve_cuts(Some(options)).expect("it fits").new_buffers()[0].bytes;
        for (limit, fits) in [(needed, true), (needed - 4, false), (needed / 10, false)] {
            let mut planner = LightPlanner::new(PlanLimits::new(limit));
            let result = planner.reserve_cuts(Some(options)).map(|_| ());
            let refused = PlanError::Full { what: "shared cuts", needed, limit };
            assert_eq!(result, if fits { Ok(()) } else { Err(refused) });
        }
    }
}
