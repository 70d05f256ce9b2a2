//! The buffers of a table of cuts, and what plans write to them.

use glam::DVec3;

use super::super::buffers::{BufferId, ShaderBuffers};
use super::super::commands::Commands;
use super::super::draft::Draft;
use super::kernels::{DISPATCH, KEEP, LANES, LIST, LOOKS, build, build_by_visibility};
use super::layout::{CutPlaces, GridRecord, STATE_AT};
use super::learning::{Learning, known_bytes};
use crate::effects::Effects;
use crate::sampling::cuts::{Camera, CutOptions};
use crate::visibility::VisibilityOptions;

/// The bytes of the report.
const REPORT_BYTES: u64 = 64;

/// A table of cuts, if there is one, and the grid that its cells are in.
#[derive(Clone, Default)]
pub(in crate::plan) struct CutStore {
    table: Option<Table>,
    /// The camera of the marks to come.
    camera: Option<Camera>,
    /// The world's origin at the last plan.
    origin: DVec3,
    /// Cuts were built since they were last void.
    is_built: bool,
}

/// A table.
#[derive(Clone)]
pub(in crate::plan) struct Table {
    options: CutOptions,
    places: CutPlaces,
    /// What shaders read.
    pub cuts: BufferId,
    /// What they write.
    pub marks: BufferId,
    pub report: BufferId,
    learning: Option<Learning>,
    /// The grid that `cuts` holds.
    sent: GridRecord,
}

impl CutStore {
    pub fn table(&self) -> Option<&Table> {
        self.table.as_ref()
    }

    /// Replaces the table by one with fewer cells where its buffers would outgrow the limit.
    pub fn replace(
        &mut self,
        mut options: CutOptions,
        mut learning: Option<VisibilityOptions>,
        limit: u64,
        draft: &mut Draft,
    ) {
        let mut places = CutPlaces::new(options, learning);
        while places.bytes().iter().any(|bytes| *bytes > limit) {
            (options, learning) = (options.halved(), learning.map(VisibilityOptions::halved));
            let fewer = CutPlaces::new(options, learning);
            if fewer == places {
                break;
            }
            places = fewer;
        }
        let [cuts, marks] = places.bytes();
        let cuts = draft.storage("shared cuts", cuts);
        let marks = draft.storage("marks of cells", marks);
        let report = draft.indirect("report of shared cuts", REPORT_BYTES);
        let learning = learning.map(|options| {
            let known = draft.storage("known visibility", known_bytes(options));
            Learning::new(options, known, self.origin)
        });
        let sent = GridRecord::new(options, &options.grid(self.camera, self.origin), &places);
        let table = Table { options, places, cuts, marks, report, learning, sent };
        table.empty(&mut draft.plan.upload);
        self.is_built = false;
        if let Some(former) = self.table.replace(table) {
            draft.plan.freed.extend([former.cuts, former.marks, former.report]);
            draft.plan.freed.extend(former.learning.map(|learning| learning.known));
        }
    }

    /// Makes cells follow another camera.
    pub fn set_camera(&mut self, commands: &mut Commands, camera: Option<Camera>) {
        self.camera = camera;
        self.send_grid(commands);
    }

    /// Follows the origin, and makes cuts void until they are built again if the lights have changed. `is_lost` is
    /// whether the device may lack what the buffers should hold.
    pub fn follow(&mut self, commands: &mut Commands, origin: DVec3, has_changed: bool, is_lost: bool) {
        self.origin = origin;
        self.send_grid(commands);
        let Some(Table { places, cuts, learning, .. }) = &mut self.table else { return };
        if let Some(learning) = learning {
            learning.follow(commands, *cuts, places, origin);
        }
        if let Some(table) = &self.table
            && is_lost
        {
            table.empty(commands);
        } else if let Some(table) = &self.table
            && has_changed
            && self.is_built
        {
            commands.write(table.cuts, STATE_AT, &[0; 4]);
        }
        self.is_built &= !is_lost && !has_changed;
    }

    /// Forgets what was learnt.
    pub fn forget(&self, commands: &mut Commands) {
        if let Some(Table { places, cuts, marks, learning: Some(learning), .. }) = &self.table {
            learning.forget(commands, [*cuts, *marks], places);
        }
    }

    /// Writes the grid, if it has changed.
    fn send_grid(&mut self, commands: &mut Commands) {
        let Some(table) = &mut self.table else { return };
        let grid = GridRecord::new(table.options, &table.options.grid(self.camera, self.origin), &table.places);
        if table.sent != grid {
            table.sent = grid;
            commands.write(table.cuts, 0, bytemuck::bytes_of(&grid));
        }
    }

    /// Adds the fold of what was recorded about visibility, and the build of the cuts of marked cells. `lights` are the
    /// buffers that shaders bind.
    pub fn build(&mut self, commands: &mut Commands, lights: ShaderBuffers, effects: Effects) {
        let Some(table) = &self.table else { return };
        self.is_built = true;
        let [params, top, nodes, instances, lights] = lights.0;
        if let Some(learning) = &table.learning {
            learning.fold(commands, [params, table.cuts, table.marks]);
        }
        let own = [params, table.cuts, table.marks, table.report];
        let all = [params, top, nodes, instances, lights, table.cuts, table.marks];
        commands.dispatch(LIST, &own, 0, table.places.slots.div_ceil(LANES));
        commands.dispatch(LOOKS, &own, 0, 1);
        commands.dispatch_indirect(KEEP, &all, 0, table.report);
        commands.dispatch(DISPATCH, &own, 0, 1);
        let kernel = if table.learning.is_some() { build_by_visibility(effects) } else { build(effects) };
        commands.dispatch_indirect(kernel, &all, 0, table.report);
    }
}

impl Table {
    /// Makes it a table without cells that knows nothing, whatever its buffers hold.
    fn empty(&self, commands: &mut Commands) {
        let [cuts, marks] = self.places.bytes();
        commands.zero(self.cuts, 0..cuts);
        commands.zero(self.marks, 0..marks);
        commands.write(self.cuts, 0, bytemuck::bytes_of(&self.sent));
        commands.write(self.marks, 0, bytemuck::cast_slice(&self.places.head()));
        commands.write_with(self.marks, 4 * u64::from(self.places.free_rows), |bytes| {
            (1..=self.places.rows).for_each(|row| bytes.extend_from_slice(&row.to_ne_bytes()));
        });
        if let Some(learning) = &self.learning {
            learning.forget(commands, [self.cuts, self.marks], &self.places);
        }
    }
}
