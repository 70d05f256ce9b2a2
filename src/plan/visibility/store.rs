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

const FOLD_BINDINGS: &[Binding] = &[PARAMS, Binding::ReadWrite, Binding::ReadWrite, Binding::ReadWrite];

const PARAMS: Binding = Binding::Uniform { bytes: size_of::<ParamsRecord>() as u32 };

/// Adds what was recorded in cells to their blocks: a workgroup for each row of a cell.
const GATHER: Kernel = Kernel::new("visibility_gather", "visibility", FOLD_BINDINGS, text::wgsl_of_visibility_fold);

/// Folds the records of blocks: a workgroup for each row of a block.
const FOLD_BLOCKS: Kernel =
    Kernel::new("visibility_fold_blocks", "visibility", FOLD_BINDINGS, text::wgsl_of_visibility_fold);

/// Folds the records of cells: a workgroup for each row of a cell.
const FOLD_CELLS: Kernel =
    Kernel::new("visibility_fold_cells", "visibility", FOLD_BINDINGS, text::wgsl_of_visibility_fold);

/// Makes cuts void that know less: one invocation.
const VOID: Kernel = Kernel::new(
    "visibility_void",
    "visibility",
    &[PARAMS, Binding::ReadWrite, Binding::ReadWrite],
    text::wgsl_of_visibility_void,
);

/// The kernels of [`LightPlanner::fold_visibility`](super::super::LightPlanner::fold_visibility). The last is
/// dispatched if there are shared cuts.
pub fn visibility_kernels() -> [Kernel; 4] {
    [GATHER, FOLD_BLOCKS, FOLD_CELLS, VOID]
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
    let rows = options.rows().iter().sum::<usize>() as u64;
    let groups = rows * BINS as u64;
    [size_of::<Head>() as u64 + 8 * rows + groups, 8 * rows + 8 * groups, 4 * groups]
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

    /// Adds the fold. `params` is the uniform of shaders, and `cuts` a table of shared cuts.
    pub fn fold(&self, commands: &mut Commands, params: BufferId, cuts: Option<BufferId>) {
        let Some(table) = &self.table else { return };
        let buffers = [params, table.learnt, table.records, table.known];
        let [cells, blocks] = table.options.rows().map(|rows| rows as u32);
        for (kernel, rows) in [(GATHER, cells), (FOLD_BLOCKS, blocks), (FOLD_CELLS, cells)] {
            commands.dispatch(kernel, &buffers, 0, rows);
        }
        if let Some(cuts) = cuts {
            commands.dispatch(VOID, &[params, table.learnt, cuts], 0, 1);
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

/// The edge, its inverse, the number of rows of cells, and whether something was learnt; the origin in its cell and
/// the number of rows of blocks; the cell of the origin.
fn head(options: &VisibilityOptions, origin: DVec3) -> Head {
    let grid = CellGrid::new(options.edge(), origin);
    let [x, y, z] = grid.offset.to_array().map(f32::to_bits);
    let [i, j, k] = grid.first;
    let [cells, blocks] = options.rows().map(|rows| rows as u32);
    [grid.edge.to_bits(), grid.cells_per_metre.to_bits(), cells, 0, x, y, z, blocks, i, j, k, 0, 0, 0, 0, 0]
}
