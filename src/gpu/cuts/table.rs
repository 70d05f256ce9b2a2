//! The buffers of a table of cuts on the GPU, and what binds them.

use glam::DVec3;

use super::super::bindings::{bind, bind_lights, cut_layout, mark_layout};
use super::super::error::GpuError;
use super::super::memory;
use super::places::{CutPlaces, GridRecord};
use crate::plan::ShaderBuffers;
use crate::sampling::cuts::{Camera, CutOptions};

/// The layouts of shaders that mark cells and that choose from their cuts, and a table if there is one.
pub(in crate::gpu) struct SharedCuts {
    pub layout: wgpu::BindGroupLayout,
    pub bind_group: wgpu::BindGroup,
    pub mark_layout: wgpu::BindGroupLayout,
    pub mark_bind_group: wgpu::BindGroup,
    /// The light buffers that the bind group was made for; `None` if the table was replaced.
    bound: Option<ShaderBuffers>,
    pub buffers: CutBuffers,
    table: Option<Table>,
}

/// What shaders bind: zeros without a table.
#[derive(Clone)]
pub(in crate::gpu) struct CutBuffers {
    pub grid: wgpu::Buffer,
    pub table: wgpu::Buffer,
}

/// What only a table has.
struct Table {
    options: CutOptions,
    places: CutPlaces,
    camera: Option<Camera>,
    /// The eye of the last build.
    built_eye: Option<DVec3>,
    origin: DVec3,
    /// What the grid's buffer holds.
    sent: GridRecord,
    report: wgpu::Buffer,
}

impl Table {
    fn record(&self) -> GridRecord {
        let grid = self.options.grid(self.camera, self.origin);
        let has_eye_moved = self.camera.map(|camera| camera.eye) != self.built_eye;
        GridRecord::new(self.options, &grid, &self.places, has_eye_moved)
    }
}

/// What a build of cuts needs.
pub(in crate::gpu) struct BuildParts<'t> {
    pub places: &'t CutPlaces,
    pub report: &'t wgpu::Buffer,
}

impl SharedCuts {
    /// No table. `zeros` are two buffers of zeros, and `lights` are the other buffers of the bind group.
    pub fn new(device: &wgpu::Device, zeros: CutBuffers, lights: &[&wgpu::Buffer]) -> Self {
        let (layout, mark_layout) = (cut_layout(device, true), mark_layout(device));
        let bind_group = bind_group(device, &layout, lights, &zeros);
        let mark_bind_group = mark_bind_group(device, &mark_layout, &zeros);
        Self { layout, bind_group, mark_layout, mark_bind_group, bound: None, buffers: zeros, table: None }
    }

    /// Replaces the table by one without cells. Changes nothing if there is no memory for it.
    pub fn start(
        &mut self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        options: CutOptions,
        origin: DVec3,
    ) -> Result<(), GpuError> {
        use wgpu::BufferUsages as Usages;
        let places = CutPlaces::new(options);
        let (copied, uniform) = (Usages::COPY_DST | Usages::COPY_SRC, Usages::UNIFORM | Usages::COPY_DST);
        let cells = memory::create_buffer(device, "shared cuts", places.bytes(), Usages::STORAGE | copied)?;
        let grid = memory::create_buffer(device, "grid of shared cuts", size_of::<GridRecord>() as u64, uniform)?;
        let usage = Usages::STORAGE | Usages::INDIRECT | Usages::COPY_SRC;
        let report = memory::create_buffer(device, "report of shared cuts", REPORT_BYTES, usage)?;
        queue.write_buffer(&cells, 0, bytemuck::cast_slice(&places.head()));
        let free_rows: Vec<u32> = (1..=places.rows).collect();
        queue.write_buffer(&cells, 4 * u64::from(places.free_rows), bytemuck::cast_slice(&free_rows));
        let sent = GridRecord::new(options, &options.grid(None, origin), &places, false);
        queue.write_buffer(&grid, 0, bytemuck::bytes_of(&sent));
        let table = Table { options, places, camera: None, built_eye: None, origin, sent, report };
        self.replace(device, CutBuffers { grid, table: cells }, Some(table));
        Ok(())
    }

    /// Drops the table. The buffers are as in [`SharedCuts::new`].
    pub fn stop(&mut self, device: &wgpu::Device, zeros: CutBuffers) {
        self.replace(device, zeros, None);
    }

    fn replace(&mut self, device: &wgpu::Device, buffers: CutBuffers, table: Option<Table>) {
        self.mark_bind_group = mark_bind_group(device, &self.mark_layout, &buffers);
        (self.buffers, self.table, self.bound) = (buffers, table, None);
    }

    /// Takes the camera of the marks to come.
    pub fn set_camera(&mut self, queue: &wgpu::Queue, camera: Option<Camera>) {
        if let Some(table) = &mut self.table {
            table.camera = camera;
        }
        self.send(queue);
    }

    /// Places the cells relative to an origin. Returns the bytes sent.
    pub fn set_origin(&mut self, queue: &wgpu::Queue, origin: DVec3) -> u64 {
        match &mut self.table {
            Some(table) if table.origin != origin => table.origin = origin,
            _ => return 0,
        }
        self.send(queue)
    }

    /// Makes all cuts void until they are built again. Returns the bytes sent.
    pub fn make_void(&self, queue: &wgpu::Queue) -> u64 {
        if self.table.is_none() {
            return 0;
        }
        queue.write_buffer(&self.buffers.table, 0, &[0; 4]);
        4
    }

    /// Sends the grid if it has changed.
    fn send(&mut self, queue: &wgpu::Queue) -> u64 {
        let Some(table) = &mut self.table else { return 0 };
        let record = table.record();
        if record == table.sent {
            return 0;
        }
        table.sent = record;
        queue.write_buffer(&self.buffers.grid, 0, bytemuck::bytes_of(&record));
        size_of::<GridRecord>() as u64
    }

    /// To be called when a build is recorded. `None` without a table.
    pub fn build(&mut self, queue: &wgpu::Queue) -> Option<BuildParts<'_>> {
        self.send(queue);
        let table = self.table.as_mut()?;
        table.built_eye = table.camera.map(|camera| camera.eye);
        Some(BuildParts { places: &table.places, report: &table.report })
    }

    /// The counters of the last build.
    pub fn report(&self) -> Option<&wgpu::Buffer> {
        self.table.as_ref().map(|table| &table.report)
    }

    /// Replaces the bind group if a buffer of it was replaced. `identity` identifies the light buffers.
    pub fn rebind(&mut self, device: &wgpu::Device, lights: &[&wgpu::Buffer], identity: Option<ShaderBuffers>) {
        if self.bound.is_none() || self.bound != identity {
            self.bind_group = bind_group(device, &self.layout, lights, &self.buffers);
            self.bound = identity;
        }
    }
}

/// The size of the report in bytes.
const REPORT_BYTES: u64 = 64;

fn bind_group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    lights: &[&wgpu::Buffer],
    cuts: &CutBuffers,
) -> wgpu::BindGroup {
    let buffers: Vec<_> = lights.iter().copied().chain([&cuts.grid, &cuts.table]).collect();
    bind_lights(device, layout, &buffers)
}

fn mark_bind_group(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, cuts: &CutBuffers) -> wgpu::BindGroup {
    bind(device, "girandole marks", layout, &[&cuts.grid, &cuts.table].map(|buffer| buffer.as_entire_binding()))
}
