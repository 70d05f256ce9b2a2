//! The tables of all profiles of the process. Equal ones are kept once, and none is ever dropped.

use std::collections::HashMap;
use std::sync::{LazyLock, PoisonError, RwLock};

use super::grid::{Grid, Lobe};

/// A grid and what follows from it.
#[derive(Debug)]
pub(super) struct Table {
    pub grid: Grid,
    pub lobe: Lobe,
    /// The greatest intensity, in candela.
    pub greatest: f32,
    /// The same for equal grids, in all processes and versions.
    pub id: u64,
    /// Where it ends among the stored quads of all tables.
    #[cfg(feature = "gpu-plan")]
    pub end: u32,
}

#[derive(Default)]
struct Tables {
    /// Two grids may have the same number.
    by_id: HashMap<u64, Vec<&'static Table>>,
    /// In order.
    #[cfg(feature = "gpu-plan")]
    all: Vec<&'static Table>,
}

static TABLES: LazyLock<RwLock<Tables>> = LazyLock::new(RwLock::default);

/// The number of a grid: its hash FNV-1a of 64 bits, over its numbers as bytes with the least significant first.
fn id_of(grid: &Grid) -> u64 {
    let lists = [&grid.polar[..], &grid.around, &grid.candela, &grid.axes.to_cols_array()];
    let bytes = lists.into_iter().flatten().flat_map(|number| number.to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// The first table with a number.
pub(super) fn table_of(id: u64) -> Option<&'static Table> {
    TABLES.read().unwrap_or_else(PoisonError::into_inner).by_id.get(&id)?.first().copied()
}

/// The table of a grid.
pub(super) fn intern(grid: Grid) -> &'static Table {
    let id = id_of(&grid);
    let known = |tables: &Tables| tables.by_id.get(&id)?.iter().find(|table| table.grid == grid).copied();
    if let Some(found) = known(&TABLES.read().unwrap_or_else(PoisonError::into_inner)) {
        return found;
    }
    // Others wait for no integrals.
    let (lobe, greatest) = (grid.lobe(), grid.candela.iter().copied().fold(0.0, f32::max));
    // Tables are added last, so a panic leaves them whole.
    let mut tables = TABLES.write().unwrap_or_else(PoisonError::into_inner);
    if let Some(found) = known(&tables) {
        return found;
    }
    #[cfg(feature = "gpu-plan")]
    let end = tables.all.last().map_or(0, |last| last.end) + grid.stored_quads();
    let table: &'static Table = Box::leak(Box::new(Table {
        lobe,
        greatest,
        id,
        #[cfg(feature = "gpu-plan")]
        end,
        grid,
    }));
    tables.by_id.entry(id).or_default().push(table);
    #[cfg(feature = "gpu-plan")]
    tables.all.push(table);
    table
}

/// Where the last table ends.
#[cfg(feature = "gpu-plan")]
pub(super) fn last_end() -> u32 {
    TABLES.read().unwrap_or_else(PoisonError::into_inner).all.last().map_or(0, |last| last.end)
}

/// The tables whose ends are beyond a number of quads, in order.
#[cfg(feature = "gpu-plan")]
pub(super) fn tables_after(quads: u32) -> Vec<&'static Table> {
    let tables = TABLES.read().unwrap_or_else(PoisonError::into_inner);
    let first = tables.all.partition_point(|table| table.end <= quads);
    tables.all[first..].to_vec()
}
