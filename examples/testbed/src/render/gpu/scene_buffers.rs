//! The buffers that the shader reads, and how it binds them.

use super::super::nodes::Node;
use super::geometry::{Geometry, GeometryChange, PackedTriangle};
use super::records::{FrameUniform, Record};
use super::scene::{Scene, SceneError};
use super::texels::Texels;
use bytemuck::Zeroable;
use girandole::wgpu::{self, util::DeviceExt};

/// The scene on a device.
pub struct SceneBuffers {
    pub uniform: wgpu::Buffer,
    /// Those of the geometry, and the upper hierarchy of the last frame.
    nodes: wgpu::Buffer,
    /// Triangles, then their attributes.
    triangles: wgpu::Buffer,
    /// Materials, then textures, then objects, and the objects of the last frame.
    records: wgpu::Buffer,
    /// On the way from one frame to the next: WebGPU copies no buffer to itself.
    scratch: wgpu::Buffer,
    /// The texels of all images.
    texels: wgpu::TextureView,
    /// Number of records that precede those of the objects.
    first_object: usize,
    /// Objects of the scene, and nodes of the geometry.
    objects: usize,
    all_nodes: usize,
}

impl SceneBuffers {
    /// Allocates the buffers and uploads the geometry. Refuses a scene that exceeds the limits of the
    /// device.
    pub fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        scene: &Scene,
        geometry: &Geometry,
    ) -> Result<Self, SceneError> {
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
        let objects = || geometry.objects.iter().map(Record::of_object);
        let records: Vec<Record> = materials.chain(textures).chain(objects().chain(objects())).collect();
        let records: &[u8] = bytemuck::cast_slice(&records);
        let nodes = [&geometry.nodes[..], geometry.top_nodes_and_room()].concat();
        let nodes: &[u8] = bytemuck::cast_slice(&nodes);
        // WebGPU refuses an empty binding. No node refers to the triangle that takes its place.
        let unused = [PackedTriangle::zeroed()];
        let triangles = if geometry.triangles.is_empty() { &unused[..] } else { &geometry.triangles };
        let attributes: &[u8] = bytemuck::cast_slice(&geometry.attributes);
        let triangles = &[bytemuck::cast_slice(triangles), attributes].concat();
        checked("nodes", nodes.len())?;
        checked("triangles", triangles.len())?;
        checked("objects", records.len())?;

        let filled = |label, contents, usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
        };
        use wgpu::BufferUsages as Usage;
        Ok(Self {
            uniform: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("city frame"),
                size: size_of::<FrameUniform>() as u64,
                usage: Usage::UNIFORM | Usage::COPY_DST,
                mapped_at_creation: false,
            }),
            nodes: filled("city nodes", nodes, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC),
            triangles: filled("city triangles", triangles, Usage::STORAGE),
            records: filled("city records", records, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC),
            scratch: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("city scratch"),
                size: (geometry.objects.len().max(1) * size_of::<Record>().max(size_of::<Node>())) as u64,
                usage: Usage::COPY_SRC | Usage::COPY_DST,
                mapped_at_creation: false,
            }),
            texels: texels.upload(device, queue),
            first_object: scene.materials.len() + scene.textures.len(),
            objects: geometry.objects.len(),
            all_nodes: geometry.nodes.len(),
        })
    }

    /// Number of records that precede those of the objects.
    pub fn first_object(&self) -> u32 {
        self.first_object as u32
    }

    /// The first record of an object of the last frame, and the first node of its upper hierarchy.
    pub fn first_then(&self) -> [u32; 2] {
        [self.first_object + self.objects, self.all_nodes].map(|first| first as u32)
    }

    /// Keeps the scene as that of the last frame, before it changes.
    pub fn keep(&self, device: &wgpu::Device, queue: &wgpu::Queue) {
        let mut encoder = device.create_command_encoder(&Default::default());
        let mut copy = |buffer: &wgpu::Buffer, from: usize, to: usize, bytes: usize| {
            encoder.copy_buffer_to_buffer(buffer, from as u64, &self.scratch, 0, bytes as u64);
            encoder.copy_buffer_to_buffer(&self.scratch, 0, buffer, to as u64, bytes as u64);
        };
        copy(&self.nodes, 0, self.all_nodes * size_of::<Node>(), self.objects.max(1) * size_of::<Node>());
        let [from, to] = [self.first_object, self.first_object + self.objects].map(|first| first * size_of::<Record>());
        copy(&self.records, from, to, self.objects * size_of::<Record>());
        queue.submit([encoder.finish()]);
    }

    /// Uploads what changed and returns the number of bytes.
    pub fn upload(&self, queue: &wgpu::Queue, geometry: &Geometry, change: &GeometryChange) -> u64 {
        let mut uploaded = 0;
        let mut write = |buffer: &wgpu::Buffer, offset: usize, bytes: &[u8]| {
            queue.write_buffer(buffer, offset as u64, bytes);
            uploaded += bytes.len() as u64;
        };
        for range in &change.objects {
            let records: Vec<Record> = geometry.objects[range.clone()].iter().map(Record::of_object).collect();
            let offset = (self.first_object + range.start) * size_of::<Record>();
            write(&self.records, offset, bytemuck::cast_slice(&records));
        }
        if change.top {
            write(&self.nodes, 0, bytemuck::cast_slice(geometry.top_nodes()));
        }
        uploaded
    }

    /// Bind group 0 of the render shader, with the pixels that it writes and what they keep, and its layout.
    pub fn bind(
        &self,
        device: &wgpu::Device,
        image: &wgpu::Buffer,
        kept: Option<&wgpu::Buffer>,
    ) -> (wgpu::BindGroupLayout, wgpu::BindGroup) {
        let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
        let bindings = [
            (&self.uniform, wgpu::BufferBindingType::Uniform),
            (&self.nodes, storage(true)),
            (&self.triangles, storage(true)),
            (&self.records, storage(true)),
            (image, storage(false)),
        ];
        let layout_entry = |(binding, (_, ty)): (u32, (_, _))| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let texels = bindings.len() as u32;
        let kept = kept.map(|kept| (texels + 1, (kept, storage(false))));
        let bindings = || (0..).zip(bindings).chain(kept);
        let mut layout_entries: Vec<_> = bindings().map(layout_entry).collect();
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
        let mut entries: Vec<_> = bindings()
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
