//! The GPU side: upload, the top level rebuilt every frame, and sampling. The only place that knows wgpu.
//!
//! Everything happens on the engine's own device and queue and in its own command encoder (but for the copy of a
//! buffer that outgrew its size or changes its layout, which is submitted at once); nothing waits, and nothing is read
//! back but counts of picks, where they are asked for ([`GpuLights::count_usage`]). A frame is [`GpuLights::upload`],
//! [`GpuLights::build_top`], and then any number of shaders that bind [`GpuLights::bind_group`] and call the functions
//! of [`LightShader`], or [`GpuLights::sample`] and [`GpuLights::resample`] for those who want no shader.

mod error;
mod kernel;
mod layout;
pub mod measure;
mod pipeline_variants;
mod usage;
mod pool;
mod probe;
mod recorder;
mod relayout;
mod resampling;
mod sampling;
mod shader;
mod sort;
mod stages;
mod stored;
#[cfg(test)]
mod testing;
mod text;
mod top;
mod upload;
#[cfg(test)]
mod variants;

use std::ops::Range;
use std::sync::OnceLock;

pub use error::GpuError;
use error::check_limits;
use kernel::Kernel;
use layout::{InstanceRecord, LightRecord, ParamsRecord, Strides, TreeRecord};
use measure::CountKernel;
pub use pipeline_variants::{MAX_VARIANTS, PipelineVariants};
use pool::Pool;
use recorder::Recorder;
use relayout::Relayout;
pub use resampling::ReservoirRecord;
pub use sampling::{SampleRecord, SampleRequest};
pub use shader::LightShader;
pub use text::wgsl;
use top::TopBuild;
pub use upload::UploadReport;
use upload::{TreeRanges, Unsent};
use usage::UsageCounters;
pub use usage::{DEFAULT_USAGE_INTERVAL, UsageCounts};

use crate::counts::SplitCount;
use crate::effects::Effects;
use crate::tree::Node;

/// A world's lights on a GPU.
pub struct GpuLights {
    device: wgpu::Device,
    queue: wgpu::Queue,
    nodes: Pool<Node>,
    lights: Pool<LightRecord>,
    /// Tables by slot.
    instances: Pool<InstanceRecord>,
    instance_count: u32,
    trees: Pool<TreeRecord>,
    tree_count: u32,
    tree_ranges: Vec<TreeRanges>,
    /// What failed uploads left.
    unsent: Unsent,
    /// Of the light pool.
    directionals: Range<u32>,
    params: ParamsRecord,
    params_buffer: wgpu::Buffer,
    /// Made when first needed.
    relayout: Option<Relayout>,
    top: TopBuild,
    top_is_stale: bool,
    batch: Kernel,
    resampling: Kernel,
    /// What the world called for at the last upload: of all that lies in the buffers.
    effects: Effects,
    /// Made when first asked for.
    counting: OnceLock<CountKernel>,
    /// Made when first asked for.
    picks: OnceLock<UsageCounters>,
    layout: wgpu::BindGroupLayout,
    bind_group: wgpu::BindGroup,
    /// Of the buffers that the bind group was made for.
    bound: [u64; 4],
}

impl GpuLights {
    /// Makes pipelines and small buffers on the engine's device; both handles are cloned, nothing is submitted.
    ///
    /// # Errors
    /// [`GpuError::Limit`] names the first limit that is below WebGPU's default; [`GpuError::DeviceLost`].
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Self, GpuError> {
        check_limits(&device.limits())?;
        probe::check(device)?;
        let nodes = Pool::new(device, queue, "light tree nodes", 64)?;
        let lights = Pool::new(device, queue, "lights", 64)?;
        let instances = Pool::new(device, queue, "instances", 64)?;
        let trees = Pool::new(device, queue, "light trees", 16)?;
        let params_buffer = params_buffer(device);
        let params = ParamsRecord {
            splits: SplitCount::DEFAULT.get() as u32,
            strides: Strides::of(Effects::all()),
            ..ParamsRecord::default()
        };
        queue.write_buffer(&params_buffer, 0, bytemuck::bytes_of(&params));
        let top = TopBuild::new(device, queue)?;
        let layout = bind_group_layout(device);
        let batch = sampling::kernel(device, &layout);
        let resampling = resampling::kernel(device, &layout);
        let buffers = [&params_buffer, top.nodes(), nodes.buffer(), instances.buffer(), lights.buffer()];
        let bind_group = bind_group(device, &layout, &buffers);
        let bound = [top.generation(), nodes.generation(), instances.generation(), lights.generation()];
        Ok(Self {
            device: device.clone(),
            queue: queue.clone(),
            nodes,
            lights,
            instances,
            instance_count: 0,
            trees,
            tree_count: 0,
            tree_ranges: Vec::new(),
            unsent: Unsent::default(),
            directionals: 0..0,
            params,
            params_buffer,
            relayout: None,
            top,
            top_is_stale: true,
            batch,
            resampling,
            effects: Effects::all(),
            counting: OnceLock::new(),
            picks: OnceLock::new(),
            layout,
            bind_group,
            bound,
        })
    }

    /// Records the build of the top level into the engine's encoder: 16 dispatches, and two for each round, of which a
    /// hundred thousand instances take five; none if nothing was uploaded since the last build. The encoder must be
    /// submitted, and before the next upload: the build is not recorded twice, and finds its counts where that one's go.
    pub fn build_top(&mut self, encoder: &mut wgpu::CommandEncoder) {
        if std::mem::take(&mut self.top_is_stale) {
            let mut recorder = Recorder::together(encoder, "girandole top level");
            self.top.record(&mut recorder, self.params.slots);
        }
    }

    /// Sets how many clusters shaders split before a choice; [`SplitCount::DEFAULT`] at first. As
    /// [`LightSampler::with_splits`](crate::LightSampler::with_splits). Writes 48 bytes ahead of the next submission.
    pub fn set_splits(&mut self, splits: SplitCount) {
        self.send_params(ParamsRecord { splits: splits.get() as u32, ..self.params });
    }

    /// Returns the bytes sent.
    fn send_params(&mut self, params: ParamsRecord) -> u64 {
        if params == self.params {
            return 0;
        }
        self.params = params;
        self.queue.write_buffer(&self.params_buffer, 0, bytemuck::bytes_of(&params));
        size_of::<ParamsRecord>() as u64
    }

    /// For the pipeline layouts of the engine's shaders: one uniform buffer and four read-only storage buffers.
    pub fn bind_group_layout(&self) -> &wgpu::BindGroupLayout {
        &self.layout
    }

    /// To be bound at the group that [`wgsl`] was asked for. An upload that replaces a buffer, by a larger one or one of
    /// another layout, replaces the bind group too: ask each frame, after [`GpuLights::upload`], and submit what was
    /// recorded with it before the next upload. The old one goes on naming the buffers of before, all of them in the
    /// layout of before, for commands that are submitted late.
    pub fn bind_group(&self) -> &wgpu::BindGroup {
        &self.bind_group
    }

    /// What the buffers hold as of the last upload: the effects that a pipeline must serve to draw with
    /// [`GpuLights::bind_group`]. [`LightWorld::effects`](crate::LightWorld::effects) of then, without [`Effects::MOVING`], which
    /// is nothing to shaders; all others before the first upload.
    pub fn effects(&self) -> Effects {
        self.effects - Effects::MOVING
    }

    /// Tells shaders of the parameters, and binds again what was replaced. Returns the bytes sent.
    fn refresh(&mut self, params: ParamsRecord) -> u64 {
        let bound =
            [self.top.generation(), self.nodes.generation(), self.instances.generation(), self.lights.generation()];
        self.top.set_strides(params.strides);
        self.top.bind(&self.instances, &self.trees);
        if bound != self.bound {
            // The old bind group names the old buffers, to which the old strides belong.
            self.params_buffer = params_buffer(&self.device);
            self.queue.write_buffer(&self.params_buffer, 0, bytemuck::bytes_of(&params));
            self.params = params;
            self.bind_group = bind_group(&self.device, &self.layout, &self.buffers(None));
            self.bound = bound;
            return size_of::<ParamsRecord>() as u64;
        }
        self.send_params(params)
    }

    /// What shaders bind, in the order of the layout.
    fn buffers<'a>(&'a self, counts: Option<&'a wgpu::Buffer>) -> Vec<&'a wgpu::Buffer> {
        let lights =
            [&self.params_buffer, self.top.nodes(), self.nodes.buffer(), self.instances.buffer(), self.lights.buffer()];
        lights.into_iter().chain(counts).collect()
    }
}

fn params_buffer(device: &wgpu::Device) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("girandole params"),
        size: size_of::<ParamsRecord>() as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn bind_group_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("girandole lights"),
        entries: &light_entries(),
    })
}

/// The same with the counters of picks, which any stage may write.
fn counting_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let visibility = wgpu::ShaderStages::COMPUTE | wgpu::ShaderStages::FRAGMENT;
    let counts = wgpu::BindGroupLayoutEntry { visibility, ..storage_entry(5, false) };
    let entries: Vec<_> = light_entries().into_iter().chain([counts]).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("girandole lights, counting"),
        entries: &entries,
    })
}

fn light_entries() -> [wgpu::BindGroupLayoutEntry; 5] {
    let uniform = wgpu::BindGroupLayoutEntry {
        binding: 0,
        visibility: wgpu::ShaderStages::COMPUTE | wgpu::ShaderStages::FRAGMENT,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    };
    [uniform, storage_entry(1, true), storage_entry(2, true), storage_entry(3, true), storage_entry(4, true)]
}

/// A whole storage buffer, for any stage if it is only read.
fn storage_entry(binding: u32, read_only: bool) -> wgpu::BindGroupLayoutEntry {
    let visibility = if read_only {
        wgpu::ShaderStages::COMPUTE | wgpu::ShaderStages::FRAGMENT
    } else {
        wgpu::ShaderStages::COMPUTE
    };
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    }
}

fn bind_group(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
    let entries: Vec<_> = buffers
        .iter()
        .zip(0..)
        .map(|(buffer, binding)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("girandole lights"), layout, entries: &entries })
}
