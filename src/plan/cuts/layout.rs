//! The layout of the two storage buffers of a table of cuts: what shaders read, and what they write.

use bytemuck::{Pod, Zeroable};

use crate::sampling::cuts::{CutGrid, CutOptions, SHARED_NODES, slots};
use crate::tree::WIDTH;
use crate::visibility::{BINS, TABLE_HEAD, VisibilityOptions};

/// The words of the marks ahead of the first slot. `shaders/cut_list.wgsl` has their meaning; all are 0 at first but
/// those with the ends of the free rows.
pub(crate) const HEAD: u32 = 17;
/// The word that counts marks for whose cells there was no room.
pub(crate) const LOST_MARKS: u32 = 13;
/// The words of a slot of the marks, of which `shaders/mark.wgsl` has the fields.
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

/// The byte of the cuts at which the state begins: behind the grid.
pub(crate) const STATE_AT: u64 = size_of::<GridRecord>() as u64;
/// The word with the end of the free rows in their ring.
const END_OF_FREE: u32 = 3;
/// The word with the end of those that were free before the frame.
const USABLE: u32 = 4;

/// The places of the parts of both storage buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CutPlaces {
    pub slots: u32,
    pub rows: u32,
    /// The word of the marks of the first free row of their ring, whose length is a power of two.
    pub free_rows: u32,
    /// The word of the first slot that is listed, of as many as the ring has rows.
    pub listed: u32,
    /// The word of the records of visibility.
    pub records: u32,
    /// The first row of the cuts, in units of 16 bytes behind the grid.
    pub first_row: u32,
    /// What is learnt about visibility, likewise; 0 if nothing is.
    pub learnt: u32,
    /// The rows of cells and blocks that learn.
    learnt_rows: u32,
}

impl CutPlaces {
    pub fn new(options: CutOptions, learning: Option<VisibilityOptions>) -> Self {
        let (slots, rows) = (slots(options) as u32, options.cells() as u32);
        let ring = rows.next_power_of_two();
        let free_rows = HEAD + SLOT_WORDS * slots;
        let listed = free_rows + ring;
        let first_row = 1 + slots;
        let learnt = if learning.is_some() { first_row + rows * ROW_QUADS } else { 0 };
        let learnt_rows = learning.map_or(0, |learning| learning.rows().iter().sum::<usize>() as u32);
        Self { slots, rows, free_rows, listed, records: listed + 2 * ring, first_row, learnt, learnt_rows }
    }

    /// The sizes of the cuts and of the marks in bytes: without learning, at most 127 MB.
    pub fn bytes(&self) -> [u64; 2] {
        let [learnt, records] = self.learnt_bytes();
        let quads = u64::from(self.first_row) + u64::from(self.rows) * u64::from(ROW_QUADS);
        [STATE_AT + 16 * quads + learnt, 4 * u64::from(self.records) + records]
    }

    /// The sizes of what is learnt and of the records in bytes.
    fn learnt_bytes(&self) -> [u64; 2] {
        let rows = u64::from(self.learnt_rows);
        let groups = rows * BINS as u64;
        let head = if rows > 0 { 16 * u64::from(TABLE_HEAD) } else { 0 };
        [head + 8 * rows + groups, 8 * rows + 8 * groups]
    }

    /// The bytes of the cuts where what is learnt lies, and those of the marks where the records lie.
    pub fn learnt_ranges(&self) -> [std::ops::Range<u64>; 2] {
        let [learnt, records] = self.learnt_bytes();
        let starts = [STATE_AT + 16 * u64::from(self.learnt), 4 * u64::from(self.records)];
        [starts[0]..starts[0] + learnt, starts[1]..starts[1] + records]
    }

    /// The first words of the marks: all rows are free.
    pub fn head(&self) -> [u32; HEAD as usize] {
        let mut words = [0; HEAD as usize];
        (words[END_OF_FREE as usize], words[USABLE as usize]) = (self.rows, self.rows);
        words
    }
}

/// What comes first in the cuts. Twin of `LightCutGrid` in `shaders/cut_grid.wgsl`,
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
    learnt: u32,
    eye: [f32; 3],
    has_eye: u32,
    first_row: u32,
    free_rows: u32,
    listed: u32,
    records: u32,
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
            learnt: places.learnt,
            eye: grid.eye.unwrap_or_default().to_array(),
            has_eye: u32::from(grid.eye.is_some()),
            first_row: places.first_row,
            free_rows: places.free_rows,
            listed: places.listed,
            records: places.records,
        }
    }
}
