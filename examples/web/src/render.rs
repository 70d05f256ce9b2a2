//! The geometry and the shader of the city's renderer. Its loop over frames waits for the device,
//! which a page may not do, so this page has one of its own.

use super::scene;

#[path = "../../city/render/image.rs"]
pub mod image;
#[path = "../../city/render/sequence.rs"]
pub mod sequence;
#[path = "../../city/render/shading.rs"]
pub mod shading;

#[path = "../../city/render/geometry.rs"]
pub mod geometry;
#[path = "../../city/render/nodes.rs"]
pub mod nodes;
#[path = "../../city/render/rays.rs"]
mod rays;
#[path = "../../city/render/textures.rs"]
pub mod textures;

pub mod gpu;
