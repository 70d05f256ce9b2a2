//! What plans write and dispatch so that cells learn which lights are visible.

use glam::DVec3;

use super::super::buffers::BufferId;
use super::super::commands::Commands;
use super::super::kernel::{Binding, Kernel};
use super::super::layout::ParamsRecord;
use super::super::text::wgsl_of_kernel;
use super::layout::CutPlaces;
use crate::effects::Effects;
use crate::visibility::{BINS, CellGrid, TABLE_HEAD, VisibilityOptions};

/// The parameters ahead of what is learnt; `shaders/visibility.wgsl` reads them.
type Head = [u32; 4 * TABLE_HEAD as usize];

const FOLD_BINDINGS: &[Binding] = &[PARAMS, Binding::ReadWrite, Binding::ReadWrite, Binding::ReadWrite];

const PARAMS: Binding = Binding::Uniform { bytes: size_of::<ParamsRecord>() as u32 };

fn text(_: Effects) -> String {
    wgsl_of_kernel(&[], &[], &[shader!("cut_grid"), shader!("visibility_fold")])
}

/// Adds what was recorded in cells to their blocks: a workgroup for each row of a cell.
const GATHER: Kernel = Kernel::new("visibility_gather", "visibility", FOLD_BINDINGS, text);

/// Folds the records of blocks: a workgroup for each row of a block.
const FOLD_BLOCKS: Kernel = Kernel::new("visibility_fold_blocks", "visibility", FOLD_BINDINGS, text);

/// Folds the records of cells: a workgroup for each row of a cell.
const FOLD_CELLS: Kernel = Kernel::new("visibility_fold_cells", "visibility", FOLD_BINDINGS, text);

/// The kernels that [`LightPlanner::build_cuts`](super::super::LightPlanner::build_cuts) begins with where cells learn.
pub fn visibility_kernels() -> [Kernel; 3] {
    [GATHER, FOLD_BLOCKS, FOLD_CELLS]
}

/// The learning of a table of cells.
#[derive(Clone)]
pub(super) struct Learning {
    options: VisibilityOptions,
    /// What only the fold knows: for each row and group, visible and all records.
    pub known: BufferId,
    /// The parameters that the table holds.
    sent: Head,
}

/// The bytes of [`Learning::known`].
pub(super) fn known_bytes(options: VisibilityOptions) -> u64 {
    4 * (options.rows().iter().sum::<usize>() * BINS) as u64
}

impl Learning {
    pub fn new(options: VisibilityOptions, known: BufferId, origin: DVec3) -> Self {
        Self { options, known, sent: head(&options, origin) }
    }

    /// Places the cells relative to an origin.
    pub fn follow(&mut self, commands: &mut Commands, cuts: BufferId, places: &CutPlaces, origin: DVec3) {
        let head = head(&self.options, origin);
        if std::mem::replace(&mut self.sent, head) != head {
            commands.write(cuts, places.learnt_ranges()[0].start, bytemuck::bytes_of(&head));
        }
    }

    /// Makes the table know nothing, whatever its buffers hold. A row is read only once it has a cell, and gets full
    /// shares with it.
    pub fn forget(&self, commands: &mut Commands, buffers: [BufferId; 2], places: &CutPlaces) {
        let [learnt, records] = places.learnt_ranges();
        let start = learnt.start;
        commands.zero(buffers[0], learnt);
        commands.zero(buffers[1], records);
        commands.write(buffers[0], start, bytemuck::bytes_of(&self.sent));
    }

    /// Adds the fold. `buffers` are the uniform of shaders, the cuts and the marks.
    pub fn fold(&self, commands: &mut Commands, [params, cuts, marks]: [BufferId; 3]) {
        let [cells, blocks] = self.options.rows().map(|rows| rows as u32);
        for (kernel, rows) in [(GATHER, cells), (FOLD_BLOCKS, blocks), (FOLD_CELLS, cells)] {
            commands.dispatch(kernel, &[params, cuts, marks, self.known], 0, rows);
        }
    }
}

/// The edge, its inverse, and the number of rows of cells; the origin in its cell and the number of rows of blocks; the
/// cell of the origin.
fn head(options: &VisibilityOptions, origin: DVec3) -> Head {
    let grid = CellGrid::new(options.edge(), origin);
    let [x, y, z] = grid.offset.to_array().map(f32::to_bits);
    let [i, j, k] = grid.first;
    let [cells, blocks] = options.rows().map(|rows| rows as u32);
    [grid.edge.to_bits(), grid.cells_per_metre.to_bits(), cells, 0, x, y, z, blocks, i, j, k, 0, 0, 0, 0, 0]
}
