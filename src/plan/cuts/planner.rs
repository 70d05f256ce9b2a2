//! What a planner does about shared cuts.

use glam::DVec3;

use super::super::LightPlanner;
use super::super::buffers::BufferId;
use super::super::commands::Commands;
use super::super::draft::{Draft, Growth};
use super::super::reserve::Reservation;
use crate::sampling::cuts::{CutOptions, camera};
use crate::visibility::VisibilityOptions;

impl LightPlanner {
    /// Reserves a table of cells, which replaces the present one. At first there is none, and shaders bind two buffers
    /// of 256 zeros in place of it. [`CutTable`](crate::CutTable) says what cuts are good for, and
    /// [`VisibilityTable`](crate::VisibilityTable) what cells learn with `learning`; the GPU does the same.
    ///
    /// Takes 1.7 kB of GPU memory for each cell that may have a cut, and 320 to 640 bytes for its places
    /// for marked cells; 7.5 kB for each cell that learns. Where a buffer would outgrow
    /// [`PlanLimits`](super::super::PlanLimits), the table has half as many cells, or a quarter and so on.
    pub fn reserve_cells(&mut self, cuts: CutOptions, learning: Option<VisibilityOptions>) -> Reservation<'_> {
        let (mut next, mut draft) = (self.held.clone(), Draft::new(self.held.ids, Growth::Exact));
        next.cuts.replace(cuts, learning, next.trees.limits.largest_buffer, &mut draft);
        draft.plan.report = next.report_of(&draft.plan.upload);
        Reservation::new(self, next, draft)
    }

    /// Makes cells follow the pixels of a camera, as [`CutTable::set_view`](crate::CutTable::set_view) does.
    /// Returns what to play ahead of the passes that mark: nothing without a table.
    #[must_use]
    pub fn set_cut_view(&mut self, eye: DVec3, pixel: f32) -> Commands {
        let mut commands = Commands::default();
        self.held.cuts.set_camera(&mut commands, camera(eye, pixel));
        commands
    }

    /// The table of cells: what shaders bind at 5, which they read, and at 6, where they mark and record. `None` without
    /// a table.
    pub fn cells(&self) -> Option<[BufferId; 2]> {
        self.held.cuts.table().map(|table| [table.cuts, table.marks])
    }

    /// Forgets what was learnt, as after a cut to another scene. Returns what to play between two frames: nothing
    /// if cells do not learn.
    #[must_use]
    pub fn forget_visibility(&self) -> Commands {
        let mut commands = Commands::default();
        self.held.cuts.forget(&mut commands);
        commands
    }

    /// A buffer of the counters of the last build, to be copied and read; `None` without a table.
    ///
    /// Words 4 to 9 are the fields of [`CutReport`](crate::CutReport) in their order; the others belong to the
    /// library.
    pub fn cut_report(&self) -> Option<BufferId> {
        self.held.cuts.table().map(|table| table.report)
    }

    /// What makes the records of shaders part of what cells have learnt, and builds the cuts of all cells that were
    /// marked since the last build. There is nothing to do before the first plan, and without a table.
    ///
    /// Play it in each frame behind [`FramePlan::top`](super::super::FramePlan::top). Shaders that draw samples mark
    /// the cells of their points too, and the next frame has cuts for these. An engine with a pass that knows the
    /// points of a frame marks them there, and plays this between that pass and those that draw: then new cells have
    /// cuts at once.
    ///
    /// Cuts suit glossy points if the world's lights are sampled for these: see
    /// [`LightWorld::set_glossy_sampling`](crate::LightWorld::set_glossy_sampling). Cells keep their cuts as
    /// those of [`CutTable::build`](crate::CutTable::build) do. Cells that learn choose lights by that too. Which cells are refused, if
    /// there are too many, depends on the order in which the GPU works.
    ///
    /// Five dispatches: one for the places of the table, two of a single invocation, and two of a workgroup
    /// for each cell that is looked at and for each that is built. Their kernels are [`cut_kernels`](super::super::cut_kernels).
    /// Where cells learn, [`visibility_kernels`](super::super::visibility_kernels) come first, with two workgroups for
    /// each cell that may learn; most end at once.
    pub fn build_cuts(&mut self) -> Commands {
        let mut commands = Commands::default();
        if let Some(lights) = self.bindings() {
            self.held.cuts.build(&mut commands, lights, self.held.effects);
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

    fn options(cells: usize) -> CutOptions {
        CutOptions::new(0.5, cells).expect("valid")
    }

    fn learning() -> Option<VisibilityOptions> {
        Some(VisibilityOptions::new(2.0, 64).expect("valid"))
    }

    #[test]
    fn a_table_is_emptied_once_made_void_by_changes_and_sent_again_when_it_is_lost() {
        let mut world = LightWorld::new();
        let mut planner = LightPlanner::new(PlanLimits::default());
        assert!(planner.build_cuts().is_empty() && planner.cells().is_none());
        let plan = planner.reserve_cells(options(100), learning()).plan();
        let [cuts, marks] = planner.cells().expect("a table");
        let bytes = [0, 1].map(|i| plan.new_buffers[i].bytes);
        use BufferKind::{Indirect, Storage};
        let kinds: Vec<_> = plan.new_buffers.iter().map(|new| new.kind).collect();
        assert_eq!(kinds, [Storage, Storage, Indirect, Storage]);
        // The 512 shares of 64 rows of cells and eight of blocks; their records; what the fold knows.
        let learnt = [64 + 8 * 72 + 512 * 72, 8 * 72 + 8 * 512 * 72, 4 * 512 * 72];
        assert_eq!(plan.new_buffers[3].bytes, learnt[2]);
        // The grid and the head of what is learnt; the head, and the numbers of free rows.
        let all = [[80 + 64, bytes[0] + learnt[0]], [68 + 400, bytes[1] + learnt[1]]];
        assert_eq!([cuts, marks].map(|buffer| changed(&plan.upload, buffer)), all);
        assert!(planner.build_cuts().is_empty(), "no lights are bound yet");

        let frame_of = |planner: &mut LightPlanner, world: &LightWorld| changed(&frame(planner, world).upload, cuts);
        assert_eq!(frame_of(&mut planner, &world), [0, 0]);
        let dispatches = |planner: &mut LightPlanner| {
            let dispatch = |command| match command {
                Command::Dispatch { kernel, workgroups, .. } => (kernel.entry(), workgroups[0]),
                Command::DispatchIndirect { kernel, .. } => (kernel.entry(), 0),
                _ => panic!("{command:?}"),
            };
            planner.build_cuts().iter().map(dispatch).collect::<Vec<_>>()
        };
        let fold = [("visibility_gather", 64), ("visibility_fold_blocks", 8), ("visibility_fold_cells", 64)];
        let build = [
            ("cut_list", 512 / 64),
            ("cut_looks", 1),
            ("cut_keep", 0),
            ("cut_dispatch", 1),
            ("cut_build_by_visibility", 0),
        ];
        assert_eq!(dispatches(&mut planner), [&fold[..], &build].concat());
        assert_eq!(frame_of(&mut planner, &world), [0, 0]);
        let lamp = LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).expect("valid");
        world.add_tree(lamp);
        assert_eq!(frame_of(&mut planner, &world), [4, 0]);
        // They are void already.
        world.add_tree(LightTree::new(vec![Light::point(Vec3::X, Vec3::ONE)]).expect("valid"));
        assert_eq!(frame_of(&mut planner, &world), [0, 0]);
        // No instance moves with the origin, so cuts stay valid.
        world.set_origin_near(DVec3::X * 2048.0).expect("finite");
        assert_eq!(frame_of(&mut planner, &world), [80 + 64, 0]);
        assert_eq!(changed(&planner.set_cut_view(DVec3::Y, 0.001), cuts), [80, 0]);
        assert!(planner.set_cut_view(DVec3::Y, 0.001).is_empty());
        let forgotten = planner.forget_visibility();
        assert_eq!([cuts, marks].map(|buffer| changed(&forgotten, buffer)), [[64, learnt[0]], [0, learnt[1]]]);
        planner.lose();
        let plan = frame(&mut planner, &world);
        assert_eq!([cuts, marks].map(|buffer| changed(&plan.upload, buffer)), all);
        assert_eq!(frame_of(&mut planner, &world), [0, 0]);
    }

    #[test]
    fn a_table_is_replaced_by_a_plan_and_a_reservation_alone_changes_nothing() {
        let mut planner = LightPlanner::new(PlanLimits::default());
        let first = frame(&mut planner, &LightWorld::new()).number;
        let before = planner.memory().buffers;
        drop(planner.reserve_cells(options(64), learning()));
        assert!(planner.cells().is_none() && planner.memory().buffers == before);
        let plan = planner.reserve_cells(options(64), learning()).plan();
        assert_eq!((plan.number, plan.freed.len()), (first + 1, 0));
        let former: Vec<_> = plan.new_buffers.iter().map(|new| new.id).collect();
        let bytes: u64 = plan.new_buffers.iter().map(|new| new.bytes).sum();
        assert_eq!(planner.memory().buffers, before + bytes);
        let plan = planner.reserve_cells(options(128), None).plan();
        assert_eq!((plan.number, &plan.freed[..]), (first + 2, &former[..]));
        assert!(planner.forget_visibility().is_empty() && planner.build_cuts().len() == 5);
    }

    #[test]
    fn a_table_beyond_the_largest_buffer_has_fewer_cells() {
        let sizes = |limit: u64, cells, learn| {
            let mut planner = LightPlanner::new(PlanLimits::new(limit));
            let learning = Some(VisibilityOptions::new(2.0, learn).expect("valid"));
            let reservation = planner.reserve_cells(options(cells), learning);
            reservation.new_buffers().iter().map(|new| new.bytes).collect::<Vec<_>>()
        };
        // With few cells that learn the cuts are the largest buffer, and with many the records.
        for (cells, learn) in [(4096, 64), (64, 2048)] {
            let all = sizes(1 << 27, cells, learn);
            let most = all.iter().copied().max().expect("some");
            assert_eq!(sizes(most, cells, learn), all);
            assert_eq!(sizes(most - 4, cells, learn), sizes(1 << 27, cells / 2, learn / 2));
            assert_eq!(sizes(most / 10, cells, learn), sizes(1 << 27, cells / 16, learn / 16));
        }
        assert!(sizes(0, 65_536, 16_384).iter().all(|bytes| *bytes < 1 << 17), "a limit has a least value");
    }
}
