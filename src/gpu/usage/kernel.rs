//! Counts what our own kernels chose, by a pass over their records.

use std::mem::offset_of;

use super::super::kernel::LANES;
use super::super::resampling::ReservoirRecord;
use super::super::sampling::{SampleRecord, SampleRequest};
use super::super::{stages, storage_entry, text};

/// A pipeline for each kind of record.
pub(super) struct UsageKernel {
    layout: wgpu::BindGroupLayout,
    of_samples: wgpu::ComputePipeline,
    of_resampled: wgpu::ComputePipeline,
}

/// Where both kinds of record have their sample.
const _: () = assert!(offset_of!(ReservoirRecord, chosen) == 0);

/// Whose records are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::gpu) enum Chosen {
    /// Of `GpuLights::sample`.
    Samples,
    /// Of `GpuLights::resample`.
    Reservoir,
}

impl Chosen {
    fn bytes(self) -> usize {
        match self {
            Self::Samples => size_of::<SampleRecord>(),
            Self::Reservoir => size_of::<ReservoirRecord>(),
        }
    }

    /// The whole text of its stage.
    fn text(self) -> String {
        let mut text = text::wgsl_of_usage(0);
        for (name, bytes) in [
            ("REQUEST_WORDS", size_of::<SampleRequest>()),
            ("U_WORD", offset_of!(SampleRequest, u)),
            ("SAMPLE_WORDS", self.bytes()),
            ("PMF_WORD", offset_of!(SampleRecord, pmf)),
            ("INSTANCE_WORD", offset_of!(SampleRecord, instance)),
        ] {
            text += &format!("const {name}: u32 = {}u;\n", bytes / 4);
        }
        text + include_str!("../../../shaders/batch_usage.wgsl")
    }
}

impl UsageKernel {
    /// Compiles two short texts. `counting` is the layout of lights and counts.
    pub fn new(device: &wgpu::Device, counting: &wgpu::BindGroupLayout) -> Self {
        let label = Some("batch_usage");
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label,
            entries: &[storage_entry(0, true), storage_entry(1, true)],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(counting), Some(&layout)],
            ..Default::default()
        });
        let pipeline = |chosen: Chosen| {
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label,
                source: wgpu::ShaderSource::Wgsl(chosen.text().into()),
            });
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label,
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: label,
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        };
        let (of_samples, of_resampled) = (pipeline(Chosen::Samples), pipeline(Chosen::Reservoir));
        Self { layout, of_samples, of_resampled }
    }

    /// Counts the first `count` records of `samples` that hold a light, chosen for `requests`.
    pub fn record(
        &self,
        (device, encoder): (&wgpu::Device, &mut wgpu::CommandEncoder),
        lights: &wgpu::BindGroup,
        (requests, samples): (&wgpu::Buffer, &wgpu::Buffer),
        chosen: Chosen,
        count: u32,
    ) {
        let label = Some("batch_usage");
        let records = |binding, buffer, bytes: usize| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer,
                offset: 0,
                size: wgpu::BufferSize::new(u64::from(count) * bytes as u64),
            }),
        };
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label,
            layout: &self.layout,
            entries: &[records(0, requests, size_of::<SampleRequest>()), records(1, samples, chosen.bytes())],
        });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes: None });
        pass.set_pipeline(match chosen {
            Chosen::Samples => &self.of_samples,
            Chosen::Reservoir => &self.of_resampled,
        });
        pass.set_bind_group(0, lights, &[]);
        pass.set_bind_group(1, &group, &[]);
        stages::dispatch(&mut pass, count.div_ceil(LANES));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_texts_are_valid_and_bind_what_the_layouts_have() {
        for chosen in [Chosen::Samples, Chosen::Reservoir] {
            let text = chosen.text();
            let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect("it parses");
            naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
                .validate(&module)
                .map_err(|e| e.emit_to_string(&text))
                .expect("it is valid");
            let bound = module.global_variables.iter().filter_map(|(_, v)| v.binding.map(|b| (b.group, b.binding)));
            assert_eq!(bound.collect::<Vec<_>>(), [(0, 5), (1, 0), (1, 1)]);
            assert_eq!(module.entry_points[0].workgroup_size, [LANES, 1, 1]);
        }
    }
}
