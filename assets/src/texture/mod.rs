//! Surfaces that emit an image: signs, screens, and meshes with emissive textures.
//!
//! A surface is [cut](Texture::split) into parts, each of which is an ordinary light that emits the
//! [average](Texture::light) of its texels. So the tree over the parts is what chooses among bright and dark texels.

mod cells;
mod image;
mod split;
mod surface;

pub use cells::TextureWrap;
pub use image::Texture;
#[cfg(feature = "gltf")]
pub(crate) use image::{LINEAR, MAX_SIZE};
pub use surface::TexturedSurface;
