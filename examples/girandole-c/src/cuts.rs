//! The cells that share cuts.

use girandole::{CutOptions, VisibilityOptions};

use crate::memory::object_mut;
use crate::planner::GirandolePlanner;
use crate::status::{Failure, GirandoleStatus, call};
use crate::vectors::GirandoleDVec3;

/// The cells of a planner. The shading points of a cell choose lights from a cut that they share.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleCutOptions {
    /// The edge of cells in metres, 0.01 to 10,000. After girandole_planner_set_cut_view, edges are an eighth to 32
    /// times of that.
    pub edge: f32,
    /// The number of cells that may have cuts, 1 to 65,536. Each takes about 2 kB of GPU memory. Where a buffer would be
    /// larger than GirandoleLimits allows, half as many are made, or a quarter and so on.
    pub cells: u32,
    /// How often shaders must mark a cell between two frames before it gets a cut.
    pub min_marks: u32,
    /// How many larger cells learn from shadow rays which lights are visible: a power of two from 4 to 16,384, of 7.5 kB
    /// each, or 0. Shaders record rays by light_record_visibility (GIRANDOLE_SHADER_LEARNS), and the next plan learns
    /// from them.
    pub learning_cells: u32,
    /// The edge of these cells in metres, 0.01 to 10,000.
    pub learning_edge: f32,
}

impl GirandoleCutOptions {
    pub(crate) fn options(&self) -> Result<(CutOptions, Option<VisibilityOptions>), Failure> {
        let cuts = CutOptions::new(self.edge, self.cells as usize)?.with_min_marks(self.min_marks);
        let learning = (self.learning_cells > 0)
            .then(|| VisibilityOptions::new(self.learning_edge, self.learning_cells as usize))
            .transpose()?;
        Ok((cuts, learning))
    }
}

/// Makes cells follow the pixels of a camera from the next plan on. Call it in each frame in which the camera has
/// moved. Without it, or with a pixel of 0, all cells have the same size. Views of several cameras may share the
/// cells of one.
///
/// eye is the position of the camera as for girandole_world_set_viewpoint, in metres. pixel is the size of a pixel at a
/// distance of one metre, in metres.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_set_cut_view(
    planner: *mut GirandolePlanner,
    eye: GirandoleDVec3,
    pixel: f32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let planner = unsafe { object_mut(planner, "planner")? };
        planner.edit(|planner| planner.set_cut_view(eye.into(), pixel))
    })
}

/// Forgets what cells have learnt from shadow rays, from the next plan on: for another scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_forget_visibility(planner: *mut GirandolePlanner) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let planner = unsafe { object_mut(planner, "planner")? };
        planner.edit(GirandolePlanner::forget_visibility)
    })
}
