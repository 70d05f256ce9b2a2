//! The kernels that build the cuts of cells.

use std::collections::HashMap;

use super::super::bindings::{bind, bind_lights, cut_layout, storage_entry, uniform_entry};
use super::super::player::{self, dispatch};
use super::table::{BuildParts, CutBuffers};
use crate::effects::Effects;
use crate::plan::text;

/// Invocations of a workgroup of the list.
const LANES: u32 = 64;

/// Lists the cells to build, and builds them.
pub(in crate::gpu) struct CutKernels {
    list_layout: wgpu::BindGroupLayout,
    list: wgpu::ComputePipeline,
    dispatch: wgpu::ComputePipeline,
    build_layout: wgpu::BindGroupLayout,
    /// By the effects that they serve.
    builds: HashMap<Effects, wgpu::ComputePipeline>,
}

impl CutKernels {
    pub fn new(device: &wgpu::Device) -> Self {
        let list_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("cut_list"),
            entries: &[uniform_entry(0), storage_entry(1, false), storage_entry(2, false)],
        });
        let module = module(device, "cut_list", text::wgsl_of_cut_list());
        let list = pipeline(device, &list_layout, &module, "cut_list");
        let dispatch = pipeline(device, &list_layout, &module, "cut_dispatch");
        Self { list_layout, list, dispatch, build_layout: cut_layout(device, false), builds: HashMap::new() }
    }

    /// Records the build. `lights` are the buffers of the lights, whose effects are `effects`.
    pub fn record(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        effects: Effects,
        (lights, cuts): (&[&wgpu::Buffer], &CutBuffers),
        parts: &BuildParts<'_>,
    ) {
        let build = self.builds.entry(effects).or_insert_with(|| {
            let module = module(device, "cut_build", text::wgsl_of_cut_build(effects));
            pipeline(device, &self.build_layout, &module, "cut_build")
        });
        let own = [&cuts.grid, &cuts.table, parts.report].map(|buffer| buffer.as_entire_binding());
        let list_group = bind(device, "cut_list", &self.list_layout, &own);
        let all: Vec<_> = lights.iter().copied().chain([&cuts.grid, &cuts.table]).collect();
        let build_group = bind_lights(device, &self.build_layout, &all);
        let mut pass = encoder
            .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("girandole cuts"), timestamp_writes: None });
        pass.set_bind_group(0, &list_group, &[]);
        pass.set_pipeline(&self.list);
        dispatch(&mut pass, parts.places.slots.div_ceil(LANES));
        pass.set_pipeline(&self.dispatch);
        pass.dispatch_workgroups(1, 1, 1);
        pass.set_pipeline(build);
        pass.set_bind_group(0, &build_group, &[]);
        pass.dispatch_workgroups_indirect(parts.report, 0);
    }
}

fn module(device: &wgpu::Device, label: &str, text: String) -> wgpu::ShaderModule {
    let source = wgpu::ShaderSource::Wgsl(text.into());
    device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(label), source })
}

fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    module: &wgpu::ShaderModule,
    entry: &'static str,
) -> wgpu::ComputePipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(entry),
        bind_group_layouts: &[Some(layout)],
        ..Default::default()
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry),
        layout: Some(&layout),
        module,
        entry_point: Some(entry),
        compilation_options: player::UNCLEARED,
        cache: None,
    })
}
