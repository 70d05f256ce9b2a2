//! How a table of shared cuts divides the world.

use glam::DVec3;

use crate::error::ValueError;
use crate::sampling::cuts::cell::{Camera, CutGrid};

/// The largest number of cells of [`CutOptions`]. Their cuts take 106 MB.
pub(crate) const MAX_CELLS: usize = 1 << 16;

/// The least and the largest edge of a cell, in metres.
pub(crate) const EDGES: [f32; 2] = [0.01, 1.0e4];

/// The edge of a cell, in pixels of the camera.
pub(crate) const PIXELS: f32 = 16.0;

/// How a [`CutTable`](crate::CutTable) divides the world, and how much of it fits.
///
/// ```
/// use girandole::CutOptions;
/// let options = CutOptions::new(0.25, 16_384)?.with_min_marks(32);
/// assert_eq!((options.edge(), options.cells(), options.min_marks()), (0.25, 16_384, 32));
/// assert!(CutOptions::new(0.0, 16_384).is_err() && CutOptions::new(0.25, 0).is_err());
/// # Ok::<(), girandole::ValueError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutOptions {
    edge: f32,
    cells: usize,
    min_marks: u32,
}

impl CutOptions {
    /// Cells with edges of `edge` metres, of which `cells` have cuts at the same time.
    ///
    /// With a [view](crate::CutTable::set_view), edges are an eighth to 32 times of that, as pixels are large. The
    /// default is 0.25 m and 32,768 cells, which take 1.6 kB each.
    ///
    /// # Errors
    /// [`ValueError`] for an edge outside 0.01 to 10,000 m, and for 0 or more than 65,536 cells.
    pub const fn new(edge: f32, cells: usize) -> Result<Self, ValueError> {
        // NaN is in no range.
        if !(edge >= EDGES[0] && edge <= EDGES[1]) {
            return Err(ValueError::new("the edge of a cell", edge as f64, EDGES[0] as f64, EDGES[1] as f64));
        }
        if cells == 0 || cells > MAX_CELLS {
            return Err(ValueError::new("the number of cells", cells as f64, 1.0, MAX_CELLS as f64));
        }
        Ok(Self { edge, cells, min_marks: 8 })
    }

    /// The same with another number of marks that a cell needs to get a cut. A cut reads as many
    /// nodes as some 30 samples without one, and its samples have less noise. The default is 8.
    #[must_use]
    pub const fn with_min_marks(self, min_marks: u32) -> Self {
        Self { min_marks, ..self }
    }

    /// The edge of cells without a view, in metres.
    pub const fn edge(self) -> f32 {
        self.edge
    }

    /// The number of cells that may have cuts.
    pub const fn cells(self) -> usize {
        self.cells
    }

    /// The marks that a cell needs to get a cut.
    pub const fn min_marks(self) -> u32 {
        self.min_marks
    }
}

impl Default for CutOptions {
    fn default() -> Self {
        Self { edge: 0.25, cells: 1 << 15, min_marks: 8 }
    }
}

impl CutOptions {
    /// The same with half as many cells, but one.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn halved(self) -> Self {
        Self { cells: (self.cells / 2).max(1), ..self }
    }

    /// The grid of cells in coordinates relative to an origin.
    pub(crate) fn grid(&self, camera: Option<Camera>, origin: DVec3) -> CutGrid {
        CutGrid::new(self.edge, camera, origin)
    }
}

/// The places of a table on the GPU in which a marked cell may be.
#[cfg(feature = "gpu-plan")]
pub(crate) const PROBES: usize = 16;

/// The places for marked cells on the GPU: four for each cell that may have a cut.
#[cfg(feature = "gpu-plan")]
pub(crate) fn slots(options: CutOptions) -> usize {
    (4 * options.cells()).next_power_of_two().max(PROBES)
}

/// The camera of [`CutTable::set_view`](crate::CutTable::set_view).
pub(crate) fn camera(eye: DVec3, pixel: f32) -> Option<Camera> {
    let is_valid = eye.is_finite() && pixel > 0.0 && pixel.is_finite();
    is_valid.then_some(Camera { eye, edge_per_metre: PIXELS * pixel })
}
