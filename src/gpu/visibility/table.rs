//! The buffers of a table on the GPU, and the kernel that folds them.

use std::sync::OnceLock;

use glam::DVec3;

use super::super::bindings::{bind, bind_lights, storage_entry, visibility_layout};
use super::super::error::GpuError;
use super::super::memory;
use super::super::player;
use crate::plan::ShaderBuffers;
use crate::plan::text;
use crate::visibility::{BINS, CellGrid, TABLE_HEAD, VisibilityOptions};

/// The parameters at the start of the table; `shaders/visibility.wgsl` reads them.
type Head = [u32; 4 * TABLE_HEAD as usize];

/// The layout of shaders that learn, and a table if there is one.
pub(in crate::gpu) struct LearntTable {
    pub layout: wgpu::BindGroupLayout,
    pub bind_group: wgpu::BindGroup,
    /// The light buffers that the bind group was made for; `None` if the table was replaced.
    bound: Option<ShaderBuffers>,
    /// What samples read: zeros without a table.
    pub learnt: wgpu::Buffer,
    /// What shaders write in a frame.
    records: wgpu::Buffer,
    table: Option<Table>,
    /// Made when a table is first folded.
    fold: OnceLock<Fold>,
}

/// What only the fold needs.
struct Table {
    options: VisibilityOptions,
    head: Head,
    known: wgpu::Buffer,
}

struct Fold {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

impl LearntTable {
    /// No table. `learnt` and `records` are two buffers of zeros, and `lights` are the other
    /// buffers of the bind group.
    pub fn new(device: &wgpu::Device, learnt: wgpu::Buffer, records: wgpu::Buffer, lights: &[&wgpu::Buffer]) -> Self {
        let layout = visibility_layout(device);
        let bind_group = bind_group(device, &layout, lights, &learnt, &records);
        Self { layout, bind_group, bound: None, learnt, records, table: None, fold: OnceLock::new() }
    }

    /// Replaces the table by one that knows nothing. Changes nothing if there is no memory for it.
    pub fn start(
        &mut self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        options: VisibilityOptions,
        origin: DVec3,
    ) -> Result<(), GpuError> {
        let (cells, groups) = (options.cells() as u64, (options.cells() * BINS) as u64);
        let storage = wgpu::BufferUsages::STORAGE;
        let readable = storage | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        // A row is read only once it has a cell, and gets full shares with it.
        let learnt_bytes = size_of::<Head>() as u64 + 8 * cells + groups;
        let learnt = memory::create_buffer(device, "learnt visibility", learnt_bytes, readable)?;
        let records = memory::create_buffer(device, "records of visibility", 8 * cells + 8 * groups, storage)?;
        let known = memory::create_buffer(device, "known visibility", 4 * groups, storage)?;
        let head = head(&options, origin);
        queue.write_buffer(&learnt, 0, bytemuck::bytes_of(&head));
        (self.learnt, self.records, self.bound) = (learnt, records, None);
        self.table = Some(Table { options, head, known });
        Ok(())
    }

    /// Drops the table. The buffers are as in [`LearntTable::new`].
    pub fn stop(&mut self, learnt: wgpu::Buffer, records: wgpu::Buffer) {
        (self.learnt, self.records, self.bound) = (learnt, records, None);
        self.table = None;
    }

    /// Places the cells relative to an origin, ahead of the next submission. Returns the bytes
    /// sent.
    pub fn set_origin(&mut self, queue: &wgpu::Queue, origin: DVec3) -> u64 {
        let Some(table) = &mut self.table else { return 0 };
        let head = head(&table.options, origin);
        if head == table.head {
            return 0;
        }
        table.head = head;
        queue.write_buffer(&self.learnt, 0, bytemuck::bytes_of(&head));
        size_of::<Head>() as u64
    }

    /// Replaces the bind group if a buffer of it was replaced. `identity` identifies the light
    /// buffers.
    pub fn rebind(&mut self, device: &wgpu::Device, lights: &[&wgpu::Buffer], identity: Option<ShaderBuffers>) {
        if self.bound.is_none() || self.bound != identity {
            self.bind_group = bind_group(device, &self.layout, lights, &self.learnt, &self.records);
            self.bound = identity;
        }
    }

    /// Records the fold, if there is a table.
    pub fn fold(&self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder) {
        let Some(table) = &self.table else { return };
        let label = "visibility_fold";
        let fold = self.fold.get_or_init(|| Fold::new(device, label));
        let own = [&self.learnt, &self.records, &table.known].map(|buffer| buffer.as_entire_binding());
        let group = bind(device, label, &fold.layout, &own);
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes: None });
        pass.set_pipeline(&fold.pipeline);
        pass.set_bind_group(0, &group, &[]);
        player::dispatch(&mut pass, table.options.cells() as u32);
    }
}

impl Fold {
    fn new(device: &wgpu::Device, label: &'static str) -> Self {
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(label),
            entries: &[storage_entry(0, false), storage_entry(1, false), storage_entry(2, false)],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: &[Some(&layout)],
            ..Default::default()
        });
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Wgsl(text::wgsl_of_visibility_fold().into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(label),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(label),
            compilation_options: player::UNCLEARED,
            cache: None,
        });
        Self { layout, pipeline }
    }
}

/// The edge, its inverse and the number of rows; the origin in its cell; the cell of the origin.
fn head(options: &VisibilityOptions, origin: DVec3) -> Head {
    let grid = CellGrid::new(options.edge(), origin);
    let [x, y, z] = grid.offset.to_array().map(f32::to_bits);
    let [i, j, k] = grid.first;
    let rows = options.cells() as u32;
    [grid.edge.to_bits(), grid.cells_per_metre.to_bits(), rows, 0, x, y, z, 0, i, j, k, 0, 0, 0, 0, 0]
}

/// Binds all buffers.
fn bind_group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    lights: &[&wgpu::Buffer],
    learnt: &wgpu::Buffer,
    records: &wgpu::Buffer,
) -> wgpu::BindGroup {
    let buffers: Vec<_> = lights.iter().copied().chain([learnt, records]).collect();
    bind_lights(device, layout, &buffers)
}
