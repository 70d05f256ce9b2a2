//! Copies records from one layout to another on the GPU, so that a change of layout sends nothing from the CPU.

use super::stages::{Access, Stages, dispatch};
use super::stored::{Missing, Stored};

/// Invocations of a workgroup, 16 bytes each.
const LANES: u32 = 256;

/// Sixteenths of the longest record's bytes.
const MOST_QUADS: usize = 13;

/// Stands for a word that was not stored.
const NOT_STORED: u32 = u32::MAX;

/// Twin of `RelayoutPass` in `shaders/relayout.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct RelayoutPass {
    /// Records to copy.
    records: u32,
    /// From one to the next before, in words.
    words_before: u32,
    /// From one to the next after, in 16 bytes.
    quads_after: u32,
    padding: u32,
    /// For each word after where it lies in the record before, or [`NOT_STORED`].
    sources: [[u32; 4]; MOST_QUADS],
    /// What it is if it was not stored.
    values: [[u32; 4]; MOST_QUADS],
}

impl RelayoutPass {
    fn new(records: u32, before: &Stored, after: &Stored, missing: fn(usize) -> Missing) -> Self {
        let mut pass = Self {
            records,
            words_before: before.bytes() as u32 / 4,
            quads_after: after.bytes() as u32 / 16,
            padding: 0,
            sources: [[NOT_STORED; 4]; MOST_QUADS],
            values: [[0; 4]; MOST_QUADS],
        };
        for (place, word) in after.words().enumerate() {
            let source = before.place_of_word(word).map_or_else(|| missing(word), Missing::Word);
            match source {
                Missing::Value(value) => pass.values[place / 4][place % 4] = value,
                Missing::Word(source) => {
                    pass.sources[place / 4][place % 4] = source as u32;
                }
            }
        }
        pass
    }
}

/// The pipeline.
pub(crate) struct Relayout {
    stages: Stages,
    pipeline: wgpu::ComputePipeline,
}

impl Relayout {
    pub(crate) fn new(device: &wgpu::Device) -> Self {
        let bytes = size_of::<RelayoutPass>() as u64;
        let stages = Stages::new(device, "relayout", bytes, &[Access::Read, Access::Write]);
        let pipeline = stages.pipeline(device, "relayout", text());
        Self { stages, pipeline }
    }

    /// Submits a copy of the first `records` records from one buffer to another, which must have room for them.
    /// Returns the bytes sent: a few hundred.
    pub(crate) fn submit(
        &self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        records: u32,
        (from, before): (&wgpu::Buffer, &Stored),
        (to, after): (&wgpu::Buffer, &Stored),
        missing: fn(usize) -> Missing,
    ) -> u64 {
        let pass = RelayoutPass::new(records, before, after, missing);
        let uniform = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("relayout"),
            size: size_of::<RelayoutPass>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        queue.write_buffer(&uniform, 0, bytemuck::bytes_of(&pass));
        let group = self.stages.bind(device, &uniform, &[from, to]);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("girandole relayout"),
                timestamp_writes: None,
            });
            compute.set_pipeline(&self.pipeline);
            compute.set_bind_group(0, &group, &[0]);
            dispatch(&mut compute, (records * pass.quads_after).div_ceil(LANES));
        }
        queue.submit([encoder.finish()]);
        size_of::<RelayoutPass>() as u64
    }
}

fn text() -> String {
    format!(
        "const RELAYOUT_LANES: u32 = {LANES}u;\nconst RELAYOUT_QUADS: u32 = {MOST_QUADS}u;\n\
         const RELAYOUT_NOT_STORED: u32 = {NOT_STORED}u;\n{}",
        include_str!("../../shaders/relayout.wgsl")
    )
}
