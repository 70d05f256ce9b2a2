//! The buffers of a table of cuts, and what plans write to them.

use glam::DVec3;

use super::super::buffers::{BufferId, Ids, NewBuffer, ShaderBuffers};
use super::super::commands::Commands;
use super::super::error::PlanError;
use super::kernels::{DISPATCH, KEEP, LANES, LIST, LOOKS, build, build_by_visibility};
use super::layout::{CutPlaces, GridRecord, WORDS_AT};
use crate::effects::Effects;
use crate::sampling::cuts::{Camera, CutOptions};

/// The bytes of the report.
const REPORT_BYTES: u64 = 64;

/// A table of cuts, if there is one, and the grid that its cells are in.
#[derive(Default)]
pub(in crate::plan) struct CutStore {
    table: Option<Table>,
    /// The camera of the marks to come.
    camera: Option<Camera>,
    /// The world's origin at the last plan.
    origin: DVec3,
}

/// A table.
pub(in crate::plan) struct Table {
    options: CutOptions,
    places: CutPlaces,
    pub cells: BufferId,
    pub report: BufferId,
    /// The grid that `cells` holds.
    sent: GridRecord,
}

impl CutStore {
    pub fn table(&self) -> Option<&Table> {
        self.table.as_ref()
    }

    /// A new table, and its buffers.
    pub fn reserve(
        &self,
        options: CutOptions,
        limit: u64,
        (ids, new): (&mut Ids, &mut Vec<NewBuffer>),
    ) -> Result<Table, PlanError> {
        let places = CutPlaces::new(options);
        if places.bytes() > limit {
            return Err(PlanError::Full { what: "shared cuts", needed: places.bytes(), limit });
        }
        let mut add = |buffer: NewBuffer| {
            new.push(buffer);
            buffer.id
        };
        let cells = add(ids.storage("shared cuts", places.bytes()));
        let report = add(ids.indirect("report of shared cuts", REPORT_BYTES));
        let sent = GridRecord::new(options, &options.grid(self.camera, self.origin), &places);
        Ok(Table { options, places, cells, report, sent })
    }

    /// Replaces the table.
    pub fn adopt(&mut self, table: Option<Table>, commands: &mut Commands, freed: &mut Vec<BufferId>) {
        if let Some(table) = &table {
            table.empty(commands);
        }
        let former = std::mem::replace(&mut self.table, table);
        freed.extend(former.iter().flat_map(|table| [table.cells, table.report]));
    }

    /// Makes cells follow another camera.
    pub fn set_camera(&mut self, commands: &mut Commands, camera: Option<Camera>) {
        self.camera = camera;
        self.send_grid(commands);
    }

    /// Follows the origin, and makes cuts void if the lights have changed. `is_lost` is whether the device may lack
    /// what the buffers should hold.
    pub fn follow(&mut self, commands: &mut Commands, origin: DVec3, (has_changed, is_lost): (bool, bool)) {
        self.origin = origin;
        self.send_grid(commands);
        match &self.table {
            Some(table) if is_lost => table.empty(commands),
            _ if has_changed => self.make_void(commands),
            _ => {}
        }
    }

    /// Makes all cuts void until they are built again.
    pub fn make_void(&self, commands: &mut Commands) {
        if let Some(table) = &self.table {
            commands.write(table.cells, WORDS_AT, &[0; 4]);
        }
    }

    /// Writes the grid, if it has changed.
    fn send_grid(&mut self, commands: &mut Commands) {
        let Some(table) = &mut self.table else { return };
        let grid = GridRecord::new(table.options, &table.options.grid(self.camera, self.origin), &table.places);
        if table.sent != grid {
            table.sent = grid;
            commands.write(table.cells, 0, bytemuck::bytes_of(&grid));
        }
    }

    /// Adds the build of the cuts of marked cells. `lights` are the buffers that shaders bind, and `learnt` is a
    /// table of learnt visibility.
    pub fn build(&self, commands: &mut Commands, lights: ShaderBuffers, learnt: Option<BufferId>, effects: Effects) {
        let Some(table) = &self.table else { return };
        let [params, top, nodes, instances, lights] = lights.0;
        let own = [params, table.cells, table.report];
        commands.dispatch(LIST, &own, 0, table.places.slots.div_ceil(LANES));
        commands.dispatch(LOOKS, &own, 0, 1);
        commands.dispatch_indirect(KEEP, &[params, top, nodes, instances, lights, table.cells], 0, table.report);
        commands.dispatch(DISPATCH, &own, 0, 1);
        match learnt {
            Some(learnt) => {
                let all = [params, top, nodes, instances, lights, table.cells, learnt];
                commands.dispatch_indirect(build_by_visibility(effects), &all, 0, table.report);
            }
            None => {
                let all = [params, top, nodes, instances, lights, table.cells];
                commands.dispatch_indirect(build(effects), &all, 0, table.report);
            }
        }
    }
}

impl Table {
    /// Makes it a table without cells, whatever its buffer holds.
    fn empty(&self, commands: &mut Commands) {
        commands.zero(self.cells, 0..self.places.bytes());
        let head: &[u32] = &self.places.head();
        commands.write_with(self.cells, 0, |bytes| {
            bytes.extend_from_slice(bytemuck::bytes_of(&self.sent));
            bytes.extend_from_slice(bytemuck::cast_slice(head));
        });
        let free_rows = WORDS_AT + 4 * u64::from(self.places.free_rows);
        commands.write_with(self.cells, free_rows, |bytes| {
            (1..=self.places.rows).for_each(|row| bytes.extend_from_slice(&row.to_ne_bytes()));
        });
    }
}
