//! Textures and opacity at a point of a surface. `gpu/textures.wgsl` has the same functions.

use super::scene::texture::Texture;
use super::scene::{Alpha, Material, Scene};
use crate::common::hash::pcg4d;
use girandole::glam::Vec4;

/// The material at a point with these texture coordinates: that of the surface, multiplied by its
/// textures.
pub fn textured(material: &Material, textures: &[Texture], coordinates: Vec4) -> Material {
    let sample = |texture: Option<u32>| texture.map(|texture| textures[texture as usize].sample(coordinates));
    let mut found = *material;
    if let Some(color) = sample(material.base_color_texture) {
        found.base_color *= color.truncate();
        found.opacity *= color.w;
    }
    if let Some(color) = sample(material.emission_texture) {
        found.emission *= color.truncate();
    }
    if let Some(color) = sample(material.roughness_texture) {
        found.roughness *= color.y;
        found.metallic *= color.z;
    }
    found
}

/// What rays need to know of materials: the share of the light that surfaces stop.
#[derive(Clone, Debug)]
pub struct Opacity {
    materials: Vec<Material>,
    textures: Vec<Texture>,
}

impl Opacity {
    /// The opacity of the materials of a scene.
    pub fn new(scene: &Scene) -> Self {
        Self { materials: scene.materials.clone(), textures: scene.textures.clone() }
    }

    /// The share of the light, from 0 to 1, that a surface stops at a point with these texture
    /// coordinates and this vertex alpha.
    pub fn coverage(&self, material: u32, coordinates: Option<Vec4>, vertex_alpha: f32) -> f32 {
        let material = &self.materials[material as usize];
        let texture = material.base_color_texture.zip(coordinates);
        let alpha = texture.map_or(1.0, |(texture, at)| self.textures[texture as usize].sample(at).w);
        let opacity = material.opacity * alpha * vertex_alpha;
        match material.alpha {
            Alpha::Opaque => 1.0,
            Alpha::Mask(cutoff) => f32::from(opacity >= cutoff),
            Alpha::Blend => opacity.clamp(0.0, 1.0),
        }
    }
}

/// The fractional part of the golden ratio times 2^32.
const GOLDEN: u32 = 0x9e37_79b9;

/// What a camera ray decides by at translucent surfaces.
#[derive(Clone, Copy, Debug)]
pub struct OpacitySeed {
    /// A hash of the pixel and of the frame.
    pub pixel: u32,
    /// The number of the sample.
    pub sample: u32,
}

impl OpacitySeed {
    /// The seed of a sample of a pixel, in a frame.
    pub fn new(pixel: u32, sample: u32, frame_seed: u32) -> Self {
        Self { pixel: pcg4d([pixel, frame_seed, 0, 0x3c6e_f372])[0], sample }
    }

    /// A random number in [0, 1) for a triangle of an object: the ray meets the triangle if the number
    /// is below the coverage. So the order in which a ray finds triangles does not matter. The numbers
    /// of a pixel's samples are evenly distributed.
    pub fn draw(self, object: u32, triangle: u32) -> f32 {
        let shift = pcg4d([self.pixel, object, triangle, 0xa54f_f53a])[0];
        (shift.wrapping_add(self.sample.wrapping_mul(GOLDEN)) >> 8) as f32 * (1.0 / 16_777_216.0)
    }
}
