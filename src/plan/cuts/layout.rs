//! The layout of the storage buffer with the cuts that cells share: a record of the grid, and words of 32 bits.

use bytemuck::{Pod, Zeroable};

use crate::sampling::cuts::{CutGrid, CutOptions, SHARED_NODES, slots};
use crate::tree::WIDTH;

/// The words ahead of the first slot. `shaders/cut_list.wgsl` has their meaning; all are 0 at first but
/// those with the ends of the free rows.
pub(crate) const HEAD: u32 = 20;
/// The word that counts marks for whose cells there was no room.
pub(crate) const LOST_MARKS: u32 = 13;
/// The words of a slot: tag, marks, row, points that its cut was made for, corner, kind, mask, points.
pub(crate) const SLOT_WORDS: u32 = 16;
/// The units of 16 bytes of a row, up to its nodes, and up to its running sums. `shaders/shared.wgsl` has
/// the fields.
pub(crate) const ROW_QUADS: u32 = ROW_FLUX + (SHARED_NODES * WIDTH / 16) as u32;
/// See [`ROW_QUADS`].
pub(crate) const ROW_NODES: u32 = 5;
/// See [`ROW_QUADS`].
pub(crate) const ROW_SUMS: u32 = ROW_NODES + (SHARED_NODES / 2) as u32;
/// Up to what tells whether a row still suits, of which `shaders/row.wgsl` has the fields.
pub(crate) const ROW_FROM: u32 = ROW_SUMS + (SHARED_NODES * WIDTH / 4) as u32;
/// See [`ROW_FROM`].
pub(crate) const ROW_STATE: u32 = ROW_FROM + (SHARED_NODES / 16) as u32;
/// See [`ROW_FROM`].
pub(crate) const ROW_FLUX: u32 = ROW_STATE + 1;

/// The byte at which the words begin: behind the grid.
pub(crate) const WORDS_AT: u64 = size_of::<GridRecord>() as u64;
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
    /// The word of the first slot to look at, of as many.
    pub looks: u32,
    /// The first row, in units of 16 bytes.
    pub first_row: u32,
}

impl CutPlaces {
    pub fn new(options: CutOptions) -> Self {
        let (slots, rows) = (slots(options) as u32, options.cells() as u32);
        let ring = rows.next_power_of_two().max(4);
        let free_rows = HEAD + SLOT_WORDS * slots;
        let listed = free_rows + ring;
        let looks = listed + ring;
        Self { slots, rows, free_rows, listed, looks, first_row: (looks + ring) / 4 }
    }

    /// The size of the storage buffer in bytes: at most 127 MB.
    pub fn bytes(&self) -> u64 {
        WORDS_AT + 16 * (u64::from(self.first_row) + u64::from(self.rows) * u64::from(ROW_QUADS))
    }

    /// The first words of the storage buffer: all rows are free.
    pub fn head(&self) -> [u32; HEAD as usize] {
        let mut words = [0; HEAD as usize];
        (words[END_OF_FREE as usize], words[USABLE as usize]) = (self.rows, self.rows);
        words
    }
}

/// What comes first in the storage buffer. Twin of `LightCutGrid` in `shaders/cut_grid.wgsl`,
/// which explains the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct GridRecord {
    unit: f32,
    units_per_metre: f32,
    edges_sq: f32,
    last_slot: u32,
    offset: [f32; 3],
    min_marks: u32,
    first: [u32; 3],
    looks: u32,
    eye: [f32; 3],
    has_eye: u32,
    first_row: u32,
    free_rows: u32,
    listed: u32,
    padding: u32,
}

impl GridRecord {
    pub fn new(options: CutOptions, grid: &CutGrid, places: &CutPlaces) -> Self {
        Self {
            unit: grid.unit,
            units_per_metre: grid.units_per_metre,
            edges_sq: grid.edges_sq,
            last_slot: places.slots - 1,
            offset: grid.offset.to_array(),
            min_marks: options.min_marks(),
            first: grid.first,
            looks: places.looks,
            eye: grid.eye.unwrap_or_default().to_array(),
            has_eye: u32::from(grid.eye.is_some()),
            first_row: places.first_row,
            free_rows: places.free_rows,
            listed: places.listed,
            padding: 0,
        }
    }
}
