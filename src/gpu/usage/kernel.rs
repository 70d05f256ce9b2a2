//! Records the usage of what our own kernels chose, by a pass over their records.

use std::mem::offset_of;

use super::super::bindings::{bind, records, storage_entry};
use super::super::kernel::LANES;
use super::super::player;
use super::super::records::{ReservoirRecord, SampleRecord, SampleRequest};
use crate::plan::text;

/// A pipeline for each kind of record.
pub(in crate::gpu) struct UsageKernel {
    layout: wgpu::BindGroupLayout,
    of_samples: wgpu::ComputePipeline,
    of_reservoirs: wgpu::ComputePipeline,
}

// Both kinds of record begin with a sample.
const _: () = assert!(offset_of!(ReservoirRecord, chosen) == 0);

/// The records that one of our kernels wrote.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::gpu) enum RecordKind {
    /// [`SampleRecord`], by `GpuLights::sample`.
    Sample,
    /// [`ReservoirRecord`], by `GpuLights::resample`.
    Reservoir,
}

impl RecordKind {
    fn bytes(self) -> usize {
        match self {
            Self::Sample => size_of::<SampleRecord>(),
            Self::Reservoir => size_of::<ReservoirRecord>(),
        }
    }

    /// The whole text of the stage for these records.
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
    /// Compiles two short texts. `lights` is the layout of the lights with the counters.
    pub fn new(device: &wgpu::Device, lights: &wgpu::BindGroupLayout) -> Self {
        let label = Some("batch_usage");
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label,
            entries: &[storage_entry(0, true), storage_entry(1, true)],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(lights), Some(&layout)],
            ..Default::default()
        });
        let pipeline = |kind: RecordKind| {
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label,
                source: wgpu::ShaderSource::Wgsl(kind.text().into()),
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
        let (of_samples, of_reservoirs) = (pipeline(RecordKind::Sample), pipeline(RecordKind::Reservoir));
        Self { layout, of_samples, of_reservoirs }
    }

    /// Records a pass over the first `count` records, which counts the records that hold a light.
    /// They were written for `requests`.
    pub fn record(
        &self,
        (device, encoder): (&wgpu::Device, &mut wgpu::CommandEncoder),
        lights: &wgpu::BindGroup,
        (requests, written): (&wgpu::Buffer, &wgpu::Buffer),
        kind: RecordKind,
        count: u32,
    ) {
        let label = "batch_usage";
        let own = [records(requests, count, size_of::<SampleRequest>()), records(written, count, kind.bytes())];
        let group = bind(device, label, &self.layout, &own);
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes: None });
        pass.set_pipeline(match kind {
            RecordKind::Sample => &self.of_samples,
            RecordKind::Reservoir => &self.of_reservoirs,
        });
        pass.set_bind_group(0, lights, &[]);
        pass.set_bind_group(1, &group, &[]);
        player::dispatch(&mut pass, count.div_ceil(LANES));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_texts_are_valid_and_use_the_bindings_of_the_layouts() {
        for kind in [RecordKind::Sample, RecordKind::Reservoir] {
            let text = kind.text();
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
