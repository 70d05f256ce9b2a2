//! The GPU backend: `render.wgsl`, joined with the library's text, on the example's own device.
//!
//! The geometry is uploaded once. After that, only objects that changed are uploaded and, if any of
//! them moved, the upper hierarchy. The picture is rendered and read back in bands of rows, so that
//! its size is not limited. Each dispatch is short enough not to be stopped by a driver's watchdog.
//!
//! Read in this order:
//!
//! 1. `records`, `texels`, `scene_buffers` and `buffers`: what is on the device, and in which layout;
//! 2. `pipeline`, `sequence.wgsl`, `texels.wgsl`, `textures.wgsl`, `surface.wgsl`, `render.wgsl` and
//!    `mark.wgsl`: the shaders;
//! 3. `festival`, with `sparks.wgsl`, `suit.wgsl` and `splats.wgsl`: kernels that write lights, and draw sparks;
//! 4. `renderer`: the frames.

#[cfg(feature = "native")]
use super::{backend, settings};
use super::{geometry, image, scene, sequence, shading};

pub mod records;
pub mod texels;
pub mod scene_buffers;
#[cfg(feature = "native")]
mod buffers;
pub mod pipeline;
#[cfg(feature = "native")]
mod festival;
#[cfg(feature = "native")]
#[cfg(feature = "native")]
mod renderer;

#[cfg(feature = "native")]
pub use renderer::{GpuRenderer, GpuUpdate};
