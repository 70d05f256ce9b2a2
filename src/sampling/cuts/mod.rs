//! Cuts that neighbours share: one cut for all shading points of a cell.
//!
//! A cell is a cube of the world and a direction of the normal, of a size that follows the pixels in
//! which it is seen. Shading points are marked; each cell then gets a cut that suits a few of its
//! points, with far more splits than a point could pay for alone, and all of its points choose from
//! it. docs/math.md, "Shared cuts", has the weights; docs/cuts.md says when to use them.

mod build;
mod builds;
mod cell;
pub(crate) mod keep;
mod marks;
pub(crate) mod options;
mod placed;
pub(crate) mod shared;
pub(crate) mod table;

#[cfg(feature = "gpu-plan")]
pub(crate) use build::{CENTER, CHILD_BITS, DEVIATION, DISAGREEMENT, EVEN, MIN_SHARED_DOUBT};
#[cfg(feature = "gpu-plan")]
pub(crate) use cell::{
    COARSE_MARKS, COARSER, GLOSS_SHIFT, LEVELS, PLACE_BITS, POINTS, RANDOM_BITS, REFLECTANCES, ROUGHNESS_STEPS,
    SLOPE_BITS, SLOPE_CLASSES, SLOPE_STEPS, SLOPE_ZERO, VIEW_COSINE, VOLUME,
};
#[cfg(feature = "gpu-plan")]
pub(crate) use cell::{Camera, CutGrid};
#[cfg(feature = "gpu-plan")]
pub(crate) use options::{CutOptions, PROBES, camera, slots};
#[cfg(feature = "gpu-plan")]
pub(crate) use shared::{CONTESTED, MIN_SIDE, SHARED_NODES, UNITS};
