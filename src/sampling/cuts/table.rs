//! The table of cells: what was marked, and the cuts that were built from it.

use std::collections::HashMap;
use std::fmt;

use glam::DVec3;

use crate::sampling::cuts::cell::{Camera, CutCell, CutGrid};
use crate::sampling::cuts::marks::{Marks, map_bytes};
use crate::sampling::cuts::options::{CutOptions, camera};
use crate::sampling::cuts::shared::SharedCut;
use crate::shading::shading_point::ShadingPoint;

/// What the last build of a [`CutTable`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct CutReport {
    /// The cells that were marked.
    pub marked: usize,
    /// The cells that were built. They have a cut unless no light reaches any of their known points.
    pub built: usize,
    /// The cells that kept their cut: see [`CutTable::build`].
    pub kept: usize,
    /// The marked cells that had too few marks to get one.
    pub rare: usize,
    /// The marked cells for which there was no room.
    pub refused: usize,
    /// The marks for whose cells there was no room; 0 on the CPU.
    pub lost_marks: usize,
}

/// Cuts that neighbours share: less noise in less time, where many samples lie close together.
///
/// A sampler [without](crate::LightSampler::with_cuts) a table splits clusters of lights for each shading point,
/// six times. Points of one neighbourhood need nearly the same. So the table divides the world into
/// cells, and splits once for all points of a cell, 31 times. A sample then chooses from the cell's
/// clusters and walks down from there, with exact probabilities. Whatever the table holds, each light
/// that reaches a point can be chosen there. Points whose cell has no cut split for themselves, as they
/// do without a table.
///
/// In each frame, after [`LightWorld::update`](crate::LightWorld::update): [mark](crate::LightSampler::mark) the shading points, or those
/// of the frame before; [`build`](Self::build); and sample. After a change of the world, samplers
/// ignore the table until the next build, which keeps the cuts that still suit.
///
/// ```
/// use girandole::glam::Vec3;
/// use girandole::{CutTable, Light, LightTree, LightWorld, Placement, Policy, ShadingPoint};
///
/// let mut world = LightWorld::new();
/// let lamps = (0..100).map(|i| Light::point(Vec3::new(i as f32, 3.0, 0.0), Vec3::ONE)).collect();
/// let lamps = world.add_tree(LightTree::new(lamps)?);
/// world.add_instance(lamps, Placement::IDENTITY, Policy::Static)?;
/// let points: Vec<_> = (0..64).map(|i| ShadingPoint::surface(Vec3::X * i as f32 * 0.003, Vec3::Y)).collect();
///
/// let mut cuts = CutTable::default();
/// for point in &points {
///     world.sampler().with_cuts(&cuts).mark(point); // from any threads
/// }
/// cuts.build(world.sampler());
/// assert_eq!((cuts.report().marked, cuts.report().built), (1, 1));
/// let sampler = world.sampler().with_cuts(&cuts);
/// let sample = sampler.sample(&points[0], [0.1, 0.2, 0.3, 0.4]).expect("lamps are in sight");
/// assert!((sample.pmf / sampler.pmf(&points[0], sample.light) - 1.0).abs() < 1.0e-5);
/// # Ok::<(), girandole::WorldError>(())
/// ```
pub struct CutTable {
    pub(crate) options: CutOptions,
    /// For marks.
    pub(crate) camera: Option<Camera>,
    pub(crate) marks: Marks,
    pub(crate) built: Built,
}

/// The cuts of the last build.
#[derive(Default)]
pub(crate) struct Built {
    pub grid: Option<CutGrid>,
    /// [`TopLevel::id`](crate::top::TopLevel::id) of the world for which they were built; 0 for none.
    pub world: u64,
    /// Those of cells that no light reaches have no nodes.
    pub cuts: HashMap<CutCell, Box<SharedCut>>,
    /// The table of learnt visibility with which they were built and the last change there, or zeros.
    pub learnt: [u64; 2],
    /// The builds since the last one before which the world or what is learnt had changed.
    pub calm: u32,
    /// The builds since the last one before which the eye had moved.
    pub eye_rest: u32,
    pub report: CutReport,
}

impl CutTable {
    /// Creates a table without cells.
    pub fn new(options: CutOptions) -> Self {
        Self { options, camera: None, marks: Marks::new(), built: Built::default() }
    }

    /// Makes cells follow the pixels of a camera for all marks to come: about 16 pixels to an edge.
    ///
    /// `eye` is its position in the world, and `pixel` the size of a pixel at a distance of one metre, in
    /// metres: for a picture of `h` rows with a vertical field of view of `a`, `2 * tan(a / 2) / h`.
    /// Without a view all cells have the edge of the options, and glossy points share no cuts. A `pixel`
    /// that is not a positive finite number, and an eye that is not finite, are no view.
    pub fn set_view(&mut self, eye: DVec3, pixel: f32) {
        self.camera = camera(eye, pixel);
    }

    /// What the last build did.
    pub fn report(&self) -> CutReport {
        self.built.report
    }

    /// Forgets all marks and all cuts.
    pub fn clear(&mut self) {
        self.marks.clear();
        self.built = Built::default();
    }

    /// The memory of the table: 1.6 kB for each cell that has a cut, and some 100 bytes for each that was
    /// ever marked in one frame. O(1).
    pub fn memory_bytes(&self) -> usize {
        let Built { cuts, .. } = &self.built;
        size_of_val(self) + self.marks.memory_bytes() + map_bytes(cuts) + size_of::<SharedCut>() * cuts.len()
    }
}

impl Default for CutTable {
    fn default() -> Self {
        Self::new(CutOptions::default())
    }
}

impl fmt::Debug for CutTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CutTable")
            .field("options", &self.options)
            .field("report", &self.report())
            .finish_non_exhaustive()
    }
}

/// A table, as a sampler uses it.
#[derive(Clone, Copy)]
pub(crate) struct CutsInUse<'a> {
    table: &'a CutTable,
    /// The cuts and their cells; `None` if there are none for the world as it is.
    built: Option<(&'a Built, CutGrid)>,
    /// The origin of the world.
    origin: DVec3,
}

impl<'a> CutsInUse<'a> {
    pub fn new(table: &'a CutTable, world: u64, origin: DVec3) -> Self {
        let built = table.built.grid.filter(|_| table.built.world == world).map(|grid| (&table.built, grid));
        Self { table, built, origin }
    }

    /// Marks the cell of a shading point.
    pub fn mark(&self, shading_point: &ShadingPoint) {
        let CutTable { options, camera, .. } = self.table;
        let grid = options.grid(*camera, self.origin);
        let Some((cell, place)) = grid.cell(shading_point) else { return };
        self.table.marks.add(&cell, place);
        if let Some((cell, place)) = grid.coarse_cell(shading_point).filter(|_| place.marks_coarse) {
            self.table.marks.add(&cell, place);
        }
    }

    /// The cut of a shading point's cell, or of its coarse cell.
    pub fn cut(&self, shading_point: &ShadingPoint) -> Option<&'a SharedCut> {
        let (built, grid) = self.built.as_ref()?;
        let cut_of = |cell: CutCell| built.cuts.get(&cell).map(|cut| &**cut).filter(|cut| cut.count > 0);
        let (cell, _) = grid.cell(shading_point)?;
        cut_of(cell).or_else(|| cut_of(grid.coarse_cell(shading_point)?.0))
    }
}
