//! The buffers of a table of learnt visibility, and what plans write to them.

use glam::DVec3;

use super::super::buffers::{BufferId, Ids, NewBuffer};
use super::super::commands::Commands;
use super::super::error::PlanError;
use super::super::kernel::{Binding, Kernel};
use super::super::layout::ParamsRecord;
use super::super::text;
use crate::visibility::{BINS, CellGrid, TABLE_HEAD, VisibilityOptions};

/// The parameters at the start of the table; `shaders/visibility.wgsl` reads them.
type Head = [u32; 4 * TABLE_HEAD as usize];

/// Folds what was recorded: a workgroup for each row.
const FOLD: Kernel = Kernel::new(
    "visibility_fold",
    "visibility",
    &[
        Binding::Uniform { bytes: size_of::<ParamsRecord>() as u32 },
        Binding::ReadWrite,
        Binding::ReadWrite,
        Binding::ReadWrite,
    ],
    text::wgsl_of_visibility_fold,
);

/// The kernel of [`LightPlanner::fold_visibility`](super::super::LightPlanner::fold_visibility).
pub fn visibility_kernel() -> Kernel {
    FOLD
}

/// A table of learnt visibility, if there is one, and the origin of its cells.
#[derive(Default)]
pub(in crate::plan) struct VisibilityStore {
    table: Option<Table>,
    /// The world's origin at the last plan.
    origin: DVec3,
}

/// A table.
pub(in crate::plan) struct Table {
    options: VisibilityOptions,
    /// What samples read.
    pub learnt: BufferId,
    /// What shaders write in a frame.
    pub records: BufferId,
    known: BufferId,
    /// The parameters that `learnt` holds.
    sent: Head,
}

/// The bytes of what samples read, of the records, and of what only the fold knows.
fn sizes(options: VisibilityOptions) -> [u64; 3] {
    let (cells, groups) = (options.cells() as u64, (options.cells() * BINS) as u64);
    [size_of::<Head>() as u64 + 8 * cells + groups, 8 * cells + 8 * groups, 4 * groups]
}

impl VisibilityStore {
    pub fn table(&self) -> Option<&Table> {
        self.table.as_ref()
    }

    /// A new table, and its buffers.
    pub fn reserve(
        &self,
        options: VisibilityOptions,
        limit: u64,
        (ids, new): (&mut Ids, &mut Vec<NewBuffer>),
    ) -> Result<Table, PlanError> {
        let sizes = sizes(options);
        let needed = sizes[0].max(sizes[1]).max(sizes[2]);
        if needed > limit {
            return Err(PlanError::Full { what: "records of visibility", needed, limit });
        }
        let whats = ["learnt visibility", "records of visibility", "known visibility"];
        let made = [0, 1, 2].map(|i| ids.storage(whats[i], sizes[i]));
        new.extend(made);
        let [learnt, records, known] = made.map(|buffer| buffer.id);
        Ok(Table { options, learnt, records, known, sent: head(&options, self.origin) })
    }

    /// Replaces the table.
    pub fn adopt(&mut self, table: Option<Table>, commands: &mut Commands, freed: &mut Vec<BufferId>) {
        if let Some(table) = &table {
            table.forget(commands);
        }
        let former = std::mem::replace(&mut self.table, table);
        freed.extend(former.iter().flat_map(|table| [table.learnt, table.records, table.known]));
    }

    /// Places the cells relative to an origin. `is_lost` is whether the device may lack what the buffers should
    /// hold.
    pub fn follow(&mut self, commands: &mut Commands, origin: DVec3, is_lost: bool) {
        self.origin = origin;
        let Some(table) = &mut self.table else { return };
        let head = head(&table.options, origin);
        let is_same = std::mem::replace(&mut table.sent, head) == head;
        if is_lost {
            table.forget(commands);
        } else if !is_same {
            commands.write(table.learnt, 0, bytemuck::bytes_of(&head));
        }
    }

    /// Adds the fold. `params` is the uniform of shaders.
    pub fn fold(&self, commands: &mut Commands, params: BufferId) {
        if let Some(table) = &self.table {
            let buffers = [params, table.learnt, table.records, table.known];
            commands.dispatch(FOLD, &buffers, 0, table.options.cells() as u32);
        }
    }
}

impl Table {
    /// Makes it a table that knows nothing, whatever its buffers hold. A row is read only once it has a cell, and
    /// gets full shares with it.
    fn forget(&self, commands: &mut Commands) {
        let [learnt, records, _] = sizes(self.options);
        commands.zero(self.learnt, 0..learnt);
        commands.zero(self.records, 0..records);
        commands.write(self.learnt, 0, bytemuck::bytes_of(&self.sent));
    }
}

/// The edge, its inverse and the number of rows; the origin in its cell; the cell of the origin.
fn head(options: &VisibilityOptions, origin: DVec3) -> Head {
    let grid = CellGrid::new(options.edge(), origin);
    let [x, y, z] = grid.offset.to_array().map(f32::to_bits);
    let [i, j, k] = grid.first;
    let rows = options.cells() as u32;
    [grid.edge.to_bits(), grid.cells_per_metre.to_bits(), rows, 0, x, y, z, 0, i, j, k, 0, 0, 0, 0, 0]
}
