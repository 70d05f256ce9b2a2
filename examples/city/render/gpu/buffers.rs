//! The buffers of the renderer, and how the shader binds them.

use super::backend::Gpu;
use super::geometry::{Geometry, PackedTriangle};
use super::records::{FrameUniform, Record};
use super::scene::{Scene, SceneError};
use super::texels::Texels;
use bytemuck::Zeroable;
use girandole::wgpu::{self, util::DeviceExt};

/// Bytes of a pixel: its sums of radiance, and its numbers of shadow rays.
pub const PIXEL_BYTES: u64 = 32;
/// Bytes of two timestamps.
pub const TIMESTAMP_BYTES: u64 = 16;

/// All buffers of the renderer.
pub struct Buffers {
    pub uniform: wgpu::Buffer,
    pub nodes: wgpu::Buffer,
    /// Triangles, then texture coordinates.
    triangles: wgpu::Buffer,
    /// Materials, then textures, then objects.
    pub records: wgpu::Buffer,
    /// The texels of all images.
    texels: wgpu::TextureView,
    /// The pixels of a band.
    pub image: wgpu::Buffer,
    /// Receives a copy of `image`.
    pub image_readback: wgpu::Buffer,
    /// `None` if the adapter has no timestamps.
    pub timer: Option<Timer>,
}

/// Timestamps of the start and the end of the top-level build.
pub struct Timer {
    pub queries: wgpu::QuerySet,
    pub resolved: wgpu::Buffer,
    /// Receives a copy of `resolved`.
    pub readback: wgpu::Buffer,
}

impl Buffers {
    /// Allocates the buffers and uploads the geometry. Refuses a scene that exceeds the limits or
    /// the memory of the device.
    pub fn new(gpu: &Gpu, scene: &Scene, geometry: &Geometry, band_pixels: u64) -> Result<Self, SceneError> {
        let device = &gpu.device;
        let limits = device.limits();
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let checked = |what: &str, bytes: usize| {
            if bytes as u64 <= limit {
                return Ok(());
            }
            Err(SceneError(format!(
                "the {what} of the scene need {bytes} bytes; the limit of this adapter is {limit}; try --backend cpu"
            )))
        };
        let texels = Texels::new(scene, &limits)?;
        let first_texture = scene.materials.len() as u32;
        let materials = scene.materials.iter().map(|material| Record::of_material(material, first_texture));
        let textures =
            scene.textures.iter().zip(&texels.first).map(|(texture, &first)| Record::of_texture(texture, first));
        let records: Vec<Record> =
            materials.chain(textures).chain(geometry.objects.iter().map(Record::of_object)).collect();
        let records: &[u8] = bytemuck::cast_slice(&records);
        let nodes: &[u8] = bytemuck::cast_slice(&geometry.nodes);
        // WebGPU refuses an empty binding. No node refers to the triangle that takes its place.
        let unused = [PackedTriangle::zeroed()];
        let triangles = if geometry.triangles.is_empty() { &unused[..] } else { &geometry.triangles };
        let tex_coords: &[u8] = bytemuck::cast_slice(&geometry.tex_coords);
        let triangles = &[bytemuck::cast_slice(triangles), tex_coords].concat();
        checked("nodes", nodes.len())?;
        checked("triangles", triangles.len())?;
        checked("objects", records.len())?;

        let memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let filled = |label, contents, usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
        };
        let empty = |label, size, usage| {
            device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
        };
        use wgpu::BufferUsages as Usage;
        let [image, image_readback] = band_buffers(device, band_pixels);
        let buffers = Self {
            uniform: empty("city frame", size_of::<FrameUniform>() as u64, Usage::UNIFORM | Usage::COPY_DST),
            nodes: filled("city nodes", nodes, Usage::STORAGE | Usage::COPY_DST),
            triangles: filled("city triangles", triangles, Usage::STORAGE),
            records: filled("city records", records, Usage::STORAGE | Usage::COPY_DST),
            texels: texels.upload(device, &gpu.queue),
            image,
            image_readback,
            timer: gpu.timestamps.then(|| Timer {
                queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("city top-level build"),
                    ty: wgpu::QueryType::Timestamp,
                    count: 2,
                }),
                resolved: empty("city timestamps", TIMESTAMP_BYTES, Usage::QUERY_RESOLVE | Usage::COPY_SRC),
                readback: empty("city timestamps readback", TIMESTAMP_BYTES, Usage::MAP_READ | Usage::COPY_DST),
            }),
        };
        match pollster::block_on(memory.pop()) {
            Some(error) => Err(SceneError(format!("the adapter does not have enough memory: {error}"))),
            None => Ok(buffers),
        }
    }

    /// Makes the buffers of a band larger or smaller. Returns whether they changed, so that they must
    /// be bound again.
    pub fn set_band(&mut self, gpu: &Gpu, pixels: u64) -> Result<bool, SceneError> {
        if self.image.size() == pixels * PIXEL_BYTES {
            return Ok(false);
        }
        let memory = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let [image, image_readback] = band_buffers(&gpu.device, pixels);
        if let Some(error) = pollster::block_on(memory.pop()) {
            return Err(SceneError(format!("the adapter does not have enough memory: {error}")));
        }
        (self.image, self.image_readback) = (image, image_readback);
        Ok(true)
    }

    /// Bind group 0 of the render shader, and its layout.
    pub fn bind(&self, device: &wgpu::Device) -> (wgpu::BindGroupLayout, wgpu::BindGroup) {
        let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
        let bindings = [
            (&self.uniform, wgpu::BufferBindingType::Uniform),
            (&self.nodes, storage(true)),
            (&self.triangles, storage(true)),
            (&self.records, storage(true)),
            (&self.image, storage(false)),
        ];
        let layout_entry = |(binding, &(_, ty)): (u32, &(_, _))| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let texels = bindings.len() as u32;
        let mut layout_entries: Vec<_> = (0..).zip(&bindings).map(layout_entry).collect();
        layout_entries.push(wgpu::BindGroupLayoutEntry {
            binding: texels,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Uint,
                view_dimension: wgpu::TextureViewDimension::D2Array,
                multisampled: false,
            },
            count: None,
        });
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("city"),
            entries: &layout_entries,
        });
        let mut entries: Vec<_> = (0..)
            .zip(&bindings)
            .map(|(binding, (buffer, _))| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let resource = wgpu::BindingResource::TextureView(&self.texels);
        entries.push(wgpu::BindGroupEntry { binding: texels, resource });
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("city"),
            layout: &layout,
            entries: &entries,
        });
        (layout, group)
    }
}

/// The buffer of a band of pixels, and the one that receives a copy of it.
fn band_buffers(device: &wgpu::Device, pixels: u64) -> [wgpu::Buffer; 2] {
    use wgpu::BufferUsages as Usage;
    let usages = [Usage::STORAGE | Usage::COPY_SRC, Usage::MAP_READ | Usage::COPY_DST];
    usages.map(|usage| {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("city image"),
            size: pixels * PIXEL_BYTES,
            usage,
            mapped_at_creation: false,
        })
    })
}
