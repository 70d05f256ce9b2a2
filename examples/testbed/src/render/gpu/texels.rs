//! The texels of all images in one texture, which shaders read by the index of a texel.

use super::scene::texture::Texture;
use super::scene::{Scene, SceneError};
use girandole::wgpu;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Texels of a row, and rows of a layer: within the limits that WebGPU guarantees.
pub const TEXEL_ROW: u32 = 2048;
/// Bytes of a texel.
const TEXEL_BYTES: u32 = 4;

/// The images of a scene, one after the other.
pub struct Texels {
    /// The first texel of the image of each texture of the scene.
    pub first: Vec<u32>,
    /// All texels, up to the end of the last row.
    bytes: Vec<u8>,
}

impl Texels {
    /// Images that textures share are stored once. Refuses more texels than a device has room for.
    pub fn new(scene: &Scene, limits: &wgpu::Limits) -> Result<Self, SceneError> {
        let layer = u64::from(TEXEL_ROW * TEXEL_ROW * TEXEL_BYTES);
        let limit = layer * u64::from(limits.max_texture_array_layers.min(255));
        let mut known = BTreeMap::new();
        let (mut first, mut bytes) = (Vec::new(), Vec::new());
        for Texture { pixels, .. } in &scene.textures {
            let start = *known.entry(Arc::as_ptr(pixels)).or_insert_with(|| {
                let start = bytes.len() as u32 / TEXEL_BYTES;
                bytes.extend_from_slice(pixels.rgba.as_flattened());
                start
            });
            first.push(start);
            if bytes.len() as u64 > limit {
                return Err(SceneError(format!(
                    "the textures of the scene need more than {limit} bytes, the limit of this adapter; try --backend cpu"
                )));
            }
        }
        let row = (TEXEL_ROW * TEXEL_BYTES) as usize;
        bytes.resize(bytes.len().next_multiple_of(row).max(row), 0);
        Ok(Self { first, bytes })
    }

    /// Uploads the texels.
    pub fn upload(&self, device: &wgpu::Device, queue: &wgpu::Queue) -> wgpu::TextureView {
        let rows = self.bytes.len() as u32 / (TEXEL_ROW * TEXEL_BYTES);
        let layers = rows.div_ceil(TEXEL_ROW);
        let size = wgpu::Extent3d { width: TEXEL_ROW, height: rows.min(TEXEL_ROW), depth_or_array_layers: layers };
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("city texels"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R32Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let row_bytes = TEXEL_ROW * TEXEL_BYTES;
        for (layer, bytes) in (0..).zip(self.bytes.chunks((row_bytes * TEXEL_ROW) as usize)) {
            let height = bytes.len() as u32 / row_bytes;
            queue.write_texture(
                wgpu::TexelCopyTextureInfo {
                    texture: &texture,
                    mip_level: 0,
                    origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
                    aspect: wgpu::TextureAspect::All,
                },
                bytes,
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row_bytes), rows_per_image: None },
                wgpu::Extent3d { width: TEXEL_ROW, height, depth_or_array_layers: 1 },
            );
        }
        let dimension = Some(wgpu::TextureViewDimension::D2Array);
        texture.create_view(&wgpu::TextureViewDescriptor { dimension, ..Default::default() })
    }
}
