//! A kernel of our own over buffers of the engine, in a variant for each set of effects.

use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use super::pipeline_variants::PipelineVariants;
use super::text;
use crate::effects::Effects;

/// Invocations of a workgroup.
pub(super) const LANES: u32 = 64;
/// Workgroups along one dimension, as WebGPU allows.
pub(super) const ROW: u32 = 65535;

/// Reads the lights at group 0 and the engine's buffers at group 1, with one invocation for each of their records.
pub(super) struct Kernel {
    maker: Maker,
    layout: wgpu::BindGroupLayout,
    /// Made when first asked for. Who asks locks them for as long as it takes to find one; nobody makes one meanwhile.
    variants: OnceLock<Mutex<PipelineVariants<wgpu::ComputePipeline>>>,
}

/// Compiles a variant, on any thread.
#[derive(Clone)]
struct Maker {
    device: wgpu::Device,
    layout: wgpu::PipelineLayout,
    entry: &'static str,
    text: &'static str,
}

impl Kernel {
    /// Of a text that has one entry point, whose name also stands in graphics debuggers. Compiles nothing yet.
    pub fn new(
        device: &wgpu::Device,
        lights: &wgpu::BindGroupLayout,
        entry: &'static str,
        text: &'static str,
        entries: &[wgpu::BindGroupLayoutEntry],
    ) -> Self {
        let label = Some(entry);
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(lights), Some(&layout)],
            ..Default::default()
        });
        let maker = Maker { device: device.clone(), layout: pipeline_layout, entry, text };
        Self { maker, layout, variants: OnceLock::new() }
    }

    /// The best that is ready; the first call compiles the one for all effects.
    pub fn pipeline(&self, effects: Effects) -> wgpu::ComputePipeline {
        // Whether lights move is nothing to the text: so that what serves all else is not made twice.
        self.variants().get(effects | Effects::MOVING).clone()
    }

    pub fn variants(&self) -> MutexGuard<'_, PipelineVariants<wgpu::ComputePipeline>> {
        let make = || {
            let maker = self.maker.clone();
            Mutex::new(PipelineVariants::new(self.make(Effects::all()), move |effects| maker.make(effects)))
        };
        self.variants.get_or_init(make).lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Compiles a variant, here and now.
    pub fn make(&self, effects: Effects) -> wgpu::ComputePipeline {
        self.maker.make(effects)
    }

    /// Records the work on `count` records; `own` are the engine's buffers, in the order of their bindings.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipeline: &wgpu::ComputePipeline,
        lights: &wgpu::BindGroup,
        own: &[wgpu::BindingResource],
        count: u32,
    ) {
        let entries: Vec<_> = own
            .iter()
            .zip(0..)
            .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
            .collect();
        let label = Some(self.maker.entry);
        let group = self.maker.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label,
            layout: &self.layout,
            entries: &entries,
        });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes: None });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, lights, &[]);
        pass.set_bind_group(1, &group, &[]);
        let groups = count.div_ceil(LANES);
        pass.dispatch_workgroups(groups.min(ROW), groups.div_ceil(ROW), 1);
    }
}

impl Maker {
    fn make(&self, effects: Effects) -> wgpu::ComputePipeline {
        let label = Some(self.entry);
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl((text::wgsl(0, effects) + self.text).into()),
        });
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&self.layout),
            module: &module,
            entry_point: Some(self.entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
    }
}

/// The first `count` records of an engine's buffer.
pub(super) fn records<T>(buffer: &wgpu::Buffer, count: u32) -> wgpu::BindingResource<'_> {
    wgpu::BindingResource::Buffer(wgpu::BufferBinding {
        buffer,
        offset: 0,
        size: std::num::NonZeroU64::new(u64::from(count) * size_of::<T>() as u64),
    })
}
