//! A kernel of our own over the buffers of an engine, in a variant for each set of effects.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use super::bindings::{bind, label_of, storage_entry};
use super::player::dispatch;
use crate::effects::Effects;
use crate::plan::text;

/// The stage of [`GpuLights::sample`](super::GpuLights::sample), with the record that it reads.
const BATCH: &str = concat!(include_str!("../../shaders/request.wgsl"), include_str!("../../shaders/batch.wgsl"));

/// Invocations of a workgroup.
pub(super) const LANES: u32 = 64;

/// Reads the lights at group 0 and the engine's buffers at group 1, with one invocation for each of
/// their records.
pub(super) struct RequestKernel {
    device: wgpu::Device,
    /// The layout of group 1.
    layout: wgpu::BindGroupLayout,
    pipeline_layout: wgpu::PipelineLayout,
    entry: &'static str,
    text: &'static str,
    /// By the effects that they serve.
    pipelines: Mutex<HashMap<Effects, wgpu::ComputePipeline>>,
}

impl RequestKernel {
    /// Chooses one light for each request. Compiles nothing yet. `lights` is the layout of group 0.
    pub fn sampling(device: &wgpu::Device, lights: &wgpu::BindGroupLayout) -> Self {
        Self::new(device, lights, "batch", BATCH, &[storage_entry(0, true), storage_entry(1, false)])
    }

    /// `text` has one entry point, which names it in graphics debuggers.
    fn new(
        device: &wgpu::Device,
        lights: &wgpu::BindGroupLayout,
        entry: &'static str,
        text: &'static str,
        entries: &[wgpu::BindGroupLayoutEntry],
    ) -> Self {
        let label = label_of(entry);
        let label = Some(label.as_str());
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(lights), Some(&layout)],
            ..Default::default()
        });
        Self { device: device.clone(), layout, pipeline_layout, entry, text, pipelines: Mutex::default() }
    }

    /// The pipeline for these effects, which the first call for them compiles.
    pub fn pipeline(&self, effects: Effects) -> wgpu::ComputePipeline {
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        pipelines.entry(effects).or_insert_with(|| self.compile(effects)).clone()
    }

    pub fn compile(&self, effects: Effects) -> wgpu::ComputePipeline {
        let label = label_of(self.entry);
        let label = Some(label.as_str());
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl((text::wgsl(0, effects) + self.text).into()),
        });
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&self.pipeline_layout),
            module: &module,
            entry_point: Some(self.entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
    }

    /// Records the work on `count` records. `own` are the engine's buffers, in the order of their
    /// bindings.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipeline: &wgpu::ComputePipeline,
        lights: &wgpu::BindGroup,
        own: &[wgpu::BindingResource],
        count: u32,
    ) {
        let label = label_of(self.entry);
        let group = bind(&self.device, &label, &self.layout, own);
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(&label), timestamp_writes: None });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, lights, &[]);
        pass.set_bind_group(1, &group, &[]);
        dispatch(&mut pass, count.div_ceil(LANES));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stages_have_one_entry_point_with_as_many_invocations_as_the_host_assumes() {
        let text = text::wgsl(0, Effects::all()) + BATCH;
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect("it parses");
        let points: Vec<_> = module.entry_points.iter().map(|p| (p.name.as_str(), p.workgroup_size)).collect();
        assert_eq!(points, [("batch", [LANES, 1, 1])]);
    }

    #[test]
    fn the_text_does_not_depend_on_whether_lights_move() {
        for effects in [Effects::empty(), Effects::all() - Effects::MOVING] {
            assert_eq!(text::wgsl(0, effects | Effects::MOVING), text::wgsl(0, effects));
        }
    }
}
