//! Learnt visibility: which lights reach which cells of the world, learnt from shadow rays.
//!
//! A cell is a cube of the world and one of six sides, or none for a volume. For each cell a row of
//! the table holds a share for each of [`BINS`] groups of lights, which are told apart by their
//! direction and distance. A share multiplies the importance of clusters in the cut, and the
//! weights of candidates.
//! Nothing is removed: no share is below 6/256. docs/math.md has the formulas and the sources.
//!
//! Blocks of 4 x 4 x 4 cells have rows as well, which add up those of their cells. A share begins as that of the
//! block, whose shares begin as its mean: what few records say about a cell is filled up by its neighbours.
//!
//! During a frame the table is read, and what is recorded goes to counters. The end of the frame
//! folds the counters into the shares. All of that adds and compares integers, so the result does
//! not depend on the order of records. Twin of `shaders/visibility.wgsl`.

mod cell;
mod fold;

use std::fmt;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

use glam::DVec3;

#[cfg(feature = "gpu-plan")]
pub(crate) use cell::{BIN_SHIFT, BLOCK_BITS, BLOCK_MIDDLE, COORDINATE_BITS, MAX_DIST, ROUNDING, USED_BIT};
pub(crate) use cell::{
    BINS, Cell, CellGrid, CellKey, LEARNT_BIT, LearntCell, MAX_COORDINATE, TAG_SEED, bin_of_child, bin_toward, side,
};
#[cfg(feature = "gpu-plan")]
pub(crate) use fold::{DOUBT, FIRST, MAX_NEW, MEMORY, MIN_SHARE, PRIOR, RARE, UNITS};
pub(crate) use fold::{FULL_SHARE, Known};
use fold::{fold, mean_code, share_code};

use crate::error::ValueError;

static NEXT_ID: AtomicU64 = AtomicU64::new(1);

/// The number of rows among which a cell may choose: a bucket.
pub(crate) const WAYS: usize = 4;

/// A row can be given to another cell once nothing was recorded in it for this many frames.
pub(crate) const MIN_IDLE: u32 = 8;

/// The quads of parameters with which the table of a GPU begins.
#[cfg(feature = "gpu-plan")]
pub(crate) const TABLE_HEAD: u32 = 4;

/// The largest number of cells of [`VisibilityOptions`]. The counters of a GPU then take 72 MiB, of the 128 that
/// one storage binding of WebGPU holds.
pub(crate) const MAX_CELLS: usize = 1 << 14;

/// A table has a row of a block for as many rows of cells.
const CELLS_FOR_BLOCK: usize = 8;

/// What stands in place of the row of a cell's block if that has none.
pub(crate) const NO_BLOCK: u32 = u32::MAX;

/// The least and the largest edge of a cell, in metres.
pub(crate) const EDGES: [f32; 2] = [0.01, 1.0e4];

/// How a [`VisibilityTable`] divides the world, and how much of it fits.
///
/// ```
/// use girandole::VisibilityOptions;
/// let options = VisibilityOptions::new(0.5, 16_384)?;
/// assert_eq!((options.edge(), options.cells()), (0.5, 16_384));
/// assert!(VisibilityOptions::new(0.0, 16_384).is_err() && VisibilityOptions::new(0.5, 1000).is_err());
/// # Ok::<(), girandole::ValueError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisibilityOptions {
    edge: f32,
    cells: usize,
}

impl VisibilityOptions {
    /// Cells with edges of `edge` metres, of which `cells` are known at the same time.
    ///
    /// Shorter edges know more about each place and learn more slowly, because fewer samples share
    /// a cell. The default is 1 m and 4,096 cells, which take 7.5 kB each with their part of the blocks. A floor of
    /// one square metre has one cell, and so has each square metre of a wall. Cells choose among four rows
    /// each, so a table should have twice as many as there are in sight. A cell without a row knows what its block
    /// of 4 x 4 x 4 cells knows.
    ///
    /// # Errors
    /// [`ValueError`] for an edge outside 0.01 to 10,000 m, and for a number of cells that is not
    /// a power of two from 4 to 16,384.
    pub const fn new(edge: f32, cells: usize) -> Result<Self, ValueError> {
        // NaN is in no range.
        if !(edge >= EDGES[0] && edge <= EDGES[1]) {
            return Err(ValueError::new("the edge of a cell", edge as f64, EDGES[0] as f64, EDGES[1] as f64));
        }
        if !(cells.is_power_of_two() && cells >= WAYS && cells <= MAX_CELLS) {
            let cells = ValueError::new("the number of cells", cells as f64, WAYS as f64, MAX_CELLS as f64);
            return Err(ValueError { rule: "a power of two", ..cells });
        }
        Ok(Self { edge, cells })
    }

    /// The edge of a cell, in metres.
    pub const fn edge(&self) -> f32 {
        self.edge
    }

    /// The number of cells that are known at the same time.
    pub const fn cells(&self) -> usize {
        self.cells
    }

    /// The same with half as many cells, but as many as a bucket.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn halved(self) -> Self {
        Self { cells: (self.cells / 2).max(WAYS), ..self }
    }

    /// The rows of cells, and then of blocks: each a power of two, and at least a bucket.
    pub(crate) const fn rows(&self) -> [usize; 2] {
        let blocks = self.cells / CELLS_FOR_BLOCK;
        [self.cells, if blocks < WAYS { WAYS } else { blocks }]
    }
}

impl Default for VisibilityOptions {
    fn default() -> Self {
        Self { edge: 1.0, cells: 4096 }
    }
}

/// What shadow rays have taught about the visibility of lights, by place.
///
/// A sampler that is made [`with_visibility`](crate::LightSampler::with_visibility) multiplies the
/// weight of a group of lights by the share of its shadow rays from the same cell that were not
/// blocked, or by a fortieth if that is more. Where few rays were traced, those of neighbours count.
/// No light loses its probability, so estimates stay unbiased whatever the table holds. Probabilities
/// are exact, because a table does not change while a sampler borrows it.
///
/// Use it where walls hide most lights, as in houses; in streets it gains little
/// (docs/benchmarks.md).
///
/// 1. During a frame, record the result of each shadow ray with
///    [`LightSampler::record_visibility`](crate::LightSampler::record_visibility), from any thread.
/// 2. After the frame, call [`VisibilityTable::end_frame`].
///
/// The table forgets: all records of earlier frames together count as at most 64 for each group of
/// lights in a cell, and as a quarter of that once a hidden group comes into sight. So doors and lamps
/// may move. It knows places of the world and no lights, so instances may come and go. Cells stay where they are when
/// [`LightWorld::set_origin_near`](crate::LightWorld::set_origin_near) moves the origin.
///
/// A cell gets a row of the table in the frame after it was first recorded. If its rows are taken,
/// it takes that of a cell in which nothing was recorded for 8 frames; until there is one, it knows what its
/// neighbours have taught. Where nothing is known, lights are chosen as without a table.
///
/// ```
/// use girandole::glam::Vec3;
/// use girandole::{Light, LightTree, LightWorld, Placement, Policy, ShadingPoint, VisibilityTable};
///
/// let mut world = LightWorld::new();
/// let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE)])?);
/// for position in [Vec3::new(-2.0, 3.0, 0.0), Vec3::new(2.0, 3.0, 0.0)] {
///     world.add_instance(lamp, Placement::at(position.as_dvec3()), Policy::Static)?;
/// }
/// let ground = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
/// let mut table = VisibilityTable::default();
/// for _ in 0..16 {
///     let sampler = world.sampler().with_visibility(&table);
///     for i in 0..8 {
///         let sample = sampler.sample(&ground, [(i as f32 + 0.5) / 8.0, 0.5, 0.5, 0.5]).expect("a lamp");
///         let is_visible = sample.incident.direction.x > 0.0; // a wall hides the other lamp
///         sampler.record_visibility(&ground, &sample, is_visible);
///     }
///     table.end_frame();
/// }
/// let sampler = world.sampler().with_visibility(&table);
/// let pmfs: Vec<f32> = sampler.all_lights().map(|light| sampler.pmf(&ground, light)).collect();
/// assert!(pmfs[0] < 0.1 && pmfs[1] > 0.9);
/// # Ok::<(), girandole::WorldError>(())
/// ```
pub struct VisibilityTable {
    options: VisibilityOptions,
    /// Differs between tables, and from 0.
    id: u64,
    /// How many frames have ended.
    frames: u64,
    /// The last of them in which anything was recorded; 0 for none.
    last_change: u64,
    /// The tag of the cell or block of each row, or 0: first the cells', then the blocks'.
    tags: Vec<u32>,
    /// Frames without a record, for each row.
    idle: Vec<u32>,
    /// [`BINS`] for each row, as [`fold::share`] encodes them.
    shares: Vec<u8>,
    /// [`BINS`] for each row.
    known: Vec<Known>,
    /// The greatest tag of the cells that want a row, for each row; 0 for none.
    claims: Vec<AtomicU32>,
    /// For rows with new counts one more than the row of the block, or [`NO_BLOCK`]; 0 for others.
    touched: Vec<AtomicU32>,
    /// The hidden and the visible samples of this frame, [`BINS`] for each row.
    counts: Vec<[AtomicU32; 2]>,
}

impl VisibilityTable {
    /// Creates a table that knows nothing.
    pub fn new(options: VisibilityOptions) -> Self {
        let [cells, blocks] = options.rows();
        let rows = cells + blocks;
        let zeros = || (0..rows).map(|_| AtomicU32::new(0)).collect();
        Self {
            options,
            id: NEXT_ID.fetch_add(1, Relaxed),
            frames: 0,
            last_change: 0,
            tags: vec![0; rows],
            idle: vec![0; rows],
            shares: vec![FULL_SHARE; rows * BINS],
            known: vec![Known::default(); rows * BINS],
            claims: zeros(),
            touched: zeros(),
            counts: (0..rows * BINS).map(|_| [AtomicU32::new(0), AtomicU32::new(0)]).collect(),
        }
    }

    /// The number of cells that have a row. O(cells of the table).
    pub fn cell_count(&self) -> usize {
        self.tags[..self.options.cells].iter().filter(|tag| **tag != 0).count()
    }

    /// Ends a frame: what was recorded since the last call becomes part of what samplers read.
    ///
    /// The result does not depend on the order or the threads of the records. O(cells of the
    /// table), and 512 small sums for each cell in which something was recorded.
    pub fn end_frame(&mut self) {
        self.frames += 1;
        let cells = self.options.cells;
        for row in 0..cells {
            self.add_to_block(row);
        }
        for row in (cells..self.tags.len()).chain(0..cells) {
            let touched = std::mem::take(self.touched[row].get_mut());
            let claim = std::mem::take(self.claims[row].get_mut());
            let bins = row * BINS..(row + 1) * BINS;
            if touched != 0 {
                self.last_change = self.frames;
                self.tags[row] |= LEARNT_BIT;
                self.idle[row] = 0;
                for (known, counts) in self.known[bins.clone()].iter_mut().zip(&mut self.counts[bins.clone()]) {
                    let [hidden, visible] = counts.each_mut().map(|count| std::mem::take(count.get_mut()));
                    if hidden | visible != 0 {
                        *known = fold(*known, visible, hidden);
                    }
                }
                let larger: [u8; BINS] = if row < cells && touched != NO_BLOCK {
                    let first = (touched as usize - 1) * BINS;
                    std::array::from_fn(|group| self.shares[first + group])
                } else {
                    [mean_code(&self.known[bins.clone()]); BINS]
                };
                for ((share, known), larger) in self.shares[bins.clone()].iter_mut().zip(&self.known[bins]).zip(larger)
                {
                    *share = share_code(*known, larger);
                }
            } else if claim != 0 {
                self.tags[row] = claim & !LEARNT_BIT;
                self.idle[row] = 0;
                self.known[bins.clone()].fill(Known::default());
                self.shares[bins].fill(FULL_SHARE);
            } else {
                self.idle[row] = self.idle[row].saturating_add(1);
            }
        }
    }

    /// Adds the counts of a cell to those of its block.
    fn add_to_block(&mut self, row: usize) {
        let touched = *self.touched[row].get_mut();
        if touched == 0 || touched == NO_BLOCK {
            return;
        }
        let block = touched as usize - 1;
        *self.touched[block].get_mut() = touched;
        // Rows of cells come before those of blocks.
        let (cells, blocks) = self.counts.split_at_mut(block * BINS);
        for (sums, counts) in blocks.iter_mut().zip(&mut cells[row * BINS..(row + 1) * BINS]) {
            for (sum, count) in sums.iter_mut().zip(counts.each_mut().map(|count| *count.get_mut())) {
                *sum.get_mut() = sum.get_mut().wrapping_add(count);
            }
        }
    }

    /// Forgets everything, as after a cut to another scene. O(cells of the table).
    pub fn clear(&mut self) {
        *self = Self::new(self.options);
    }

    /// The grid of cells in coordinates relative to an origin.
    pub(crate) fn grid(&self, origin: DVec3) -> CellGrid {
        CellGrid::new(self.options.edge, origin)
    }

    /// What is known about a cell or else about its block; `None` if nothing is.
    #[inline]
    pub(crate) fn cell(&self, cell: &Cell) -> Option<LearntCell<'_>> {
        let row = self.learnt_row(cell)?;
        let shares = self.shares[row * BINS..].first_chunk()?;
        Some(LearntCell { shares, from_center: cell.from_center, edge: self.options.edge })
    }

    /// The row in which something is known about a cell.
    #[inline]
    fn learnt_row(&self, cell: &Cell) -> Option<usize> {
        self.buckets(cell)
            .into_iter()
            .find_map(|(bucket, tag)| (bucket..bucket + WAYS).find(|row| self.tags[*row] == tag))
    }

    /// Differs between tables.
    pub(crate) fn id(&self) -> u64 {
        self.id
    }

    /// The number of the last frame in which anything was recorded, from 1 on; 0 if nothing was.
    pub(crate) fn last_change(&self) -> u64 {
        self.last_change
    }

    /// The row that counts the records of a cell in this frame: its own, or that of its block. Claims rows for those
    /// that have none.
    pub(crate) fn row_to_record(&self, cell: &Cell) -> Option<usize> {
        let [row, block] = self.buckets(cell).map(|(bucket, tag)| self.row_or_claim(bucket, tag));
        let found = row.or(block)?;
        self.touched[found].store(block.map_or(NO_BLOCK, |block| block as u32 + 1), Relaxed);
        Some(found)
    }

    /// The row of a tag in a bucket. If there is none, asks for one from the next frame on.
    fn row_or_claim(&self, first: usize, tag: u32) -> Option<usize> {
        let rows = first..first + WAYS;
        let found = rows.clone().find(|row| self.tags[*row] | LEARNT_BIT == tag);
        if found.is_none() {
            // Cells that come at once begin at different rows, so that most of them find one.
            let mut turned = (0..WAYS).map(|way| first + (tag as usize / 4 % WAYS + way) % WAYS);
            let free = turned.find(|row| self.tags[*row] == 0);
            // The first of the most idle ones: `max_by_key` would return the last.
            let idlest = || rows.rev().max_by_key(|row| self.idle[*row]).filter(|row| self.idle[*row] >= MIN_IDLE);
            if let Some(row) = free.or_else(idlest) {
                self.claims[row].fetch_max(tag, Relaxed);
            }
        }
        found
    }

    /// Counts a sample of a light in a bin of a row.
    pub(crate) fn count(&self, row: usize, bin: usize, is_visible: bool) {
        self.counts[row * BINS + bin][usize::from(is_visible)].fetch_add(1, Relaxed);
    }

    /// The tags, the idle frames and the shares, as a GPU stores them.
    #[cfg(all(test, feature = "gpu-plan"))]
    pub(crate) fn words(&self) -> Vec<u32> {
        let shares = self.shares.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes));
        self.tags.iter().chain(&self.idle).copied().chain(shares).collect()
    }

    /// The first rows of the buckets of a cell and of its block, and their tags.
    #[inline]
    fn buckets(&self, cell: &Cell) -> [(usize, u32); 2] {
        let [cells, blocks] = self.options.rows();
        let bucket = |key: CellKey, rows: usize| key.hash as usize & (rows - WAYS);
        [(bucket(cell.key, cells), cell.key.tag), (cells + bucket(cell.block, blocks), cell.block.tag)]
    }
}

impl Default for VisibilityTable {
    fn default() -> Self {
        Self::new(VisibilityOptions::default())
    }
}

impl fmt::Debug for VisibilityTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("VisibilityTable")
            .field("options", &self.options)
            .field("cell_count", &self.cell_count())
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests;
