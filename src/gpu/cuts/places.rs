//! What the buffers of a table of cuts hold.

use bytemuck::{Pod, Zeroable};

use crate::plan::cut_layout::{EYE_MOVED, HAS_EYE, HEAD, ROW_QUADS, SLOT_WORDS};
use crate::sampling::cuts::{CutGrid, CutOptions, slots};

/// The word with the end of the free rows in their ring.
const END_OF_FREE: u32 = 3;
/// The word with the end of those that were free before the frame.
const USABLE: u32 = 4;

/// The places of the parts of the storage buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CutPlaces {
    pub slots: u32,
    pub rows: u32,
    /// The word of the first free row of their ring, whose length is a power of two.
    pub free_rows: u32,
    /// The word of the first slot that is listed, of as many as the ring has rows.
    pub listed: u32,
    /// The first row, in units of 16 bytes.
    pub first_row: u32,
}

impl CutPlaces {
    pub fn new(options: CutOptions) -> Self {
        let (slots, rows) = (slots(options) as u32, options.cells() as u32);
        let ring = rows.next_power_of_two().max(4);
        let free_rows = HEAD + SLOT_WORDS * slots;
        let listed = free_rows + ring;
        Self { slots, rows, free_rows, listed, first_row: (listed + ring) / 4 }
    }

    /// The size of the storage buffer in bytes: at most 106 MB.
    pub fn bytes(&self) -> u64 {
        16 * (u64::from(self.first_row) + u64::from(self.rows) * u64::from(ROW_QUADS))
    }

    /// The first words of the storage buffer: all rows are free.
    pub fn head(&self) -> [u32; HEAD as usize] {
        let mut words = [0; HEAD as usize];
        (words[END_OF_FREE as usize], words[USABLE as usize]) = (self.rows, self.rows);
        words
    }
}

/// The uniform buffer of shaders that mark, build or sample. Twin of `LightCutGrid` in `shaders/cut_grid.wgsl`,
/// which explains the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct GridRecord {
    unit: f32,
    units_per_metre: f32,
    edges_sq: f32,
    levels: u32,
    offset: [f32; 3],
    last_slot: u32,
    first: [u32; 3],
    padding: u32,
    eye: [f32; 3],
    flags: u32,
    min_marks: u32,
    first_row: u32,
    free_rows: u32,
    listed: u32,
}

impl GridRecord {
    /// `has_eye_moved` is whether the eye is elsewhere than in the last build.
    pub fn new(options: CutOptions, grid: &CutGrid, places: &CutPlaces, has_eye_moved: bool) -> Self {
        let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
        let flags = flag(grid.eye.is_some(), HAS_EYE) | flag(has_eye_moved, EYE_MOVED);
        Self {
            unit: grid.unit,
            units_per_metre: grid.units_per_metre,
            edges_sq: grid.edges_sq,
            levels: grid.levels,
            offset: grid.offset.to_array(),
            last_slot: places.slots - 1,
            first: grid.first,
            padding: 0,
            eye: grid.eye.unwrap_or_default().to_array(),
            flags,
            min_marks: options.min_marks(),
            first_row: places.first_row,
            free_rows: places.free_rows,
            listed: places.listed,
        }
    }
}
