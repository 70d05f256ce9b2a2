//! The passes that the stages of a build are recorded in: one for all of them, or one each, which can be timed.

use super::measure::TopStage;
use super::stages;

/// How many passes there are.
#[derive(Clone, Copy)]
enum Passes<'a> {
    /// One for all stages.
    One,
    /// One for each stage, the i-th with timestamps 2 i and 2 i + 1.
    Each(Option<&'a wgpu::QuerySet>),
}

/// Records stages, and counts their dispatches where they are recorded apart.
pub(crate) struct Recorder<'a> {
    encoder: &'a mut wgpu::CommandEncoder,
    label: &'static str,
    passes: Passes<'a>,
    pass: Option<wgpu::ComputePass<'static>>,
    stages: Vec<TopStage>,
}

impl<'a> Recorder<'a> {
    /// All stages in one pass of this name.
    pub(crate) fn together(encoder: &'a mut wgpu::CommandEncoder, label: &'static str) -> Self {
        Self { encoder, label, passes: Passes::One, pass: None, stages: Vec::new() }
    }

    /// Each stage in a pass of its own, timed if there is a set to write to.
    pub(crate) fn apart(
        encoder: &'a mut wgpu::CommandEncoder,
        label: &'static str,
        queries: Option<&'a wgpu::QuerySet>,
    ) -> Self {
        Self { encoder, label, passes: Passes::Each(queries), pass: None, stages: Vec::new() }
    }

    /// Fills a buffer with zeros. Only before the first stage.
    pub(crate) fn clear(&mut self, buffer: &wgpu::Buffer) {
        self.encoder.clear_buffer(buffer, 0, None);
    }

    /// What is recorded from here on belongs to the stage of this name.
    pub(crate) fn stage(&mut self, name: &'static str) {
        if matches!(self.passes, Passes::One) && self.pass.is_some() {
            return;
        }
        // Ends the last pass, which has locked the encoder.
        self.pass = None;
        let mut descriptor = wgpu::ComputePassDescriptor { label: Some(self.label), timestamp_writes: None };
        if let Passes::Each(queries) = self.passes {
            let first = 2 * self.stages.len() as u32;
            descriptor.label = Some(name);
            descriptor.timestamp_writes = queries.map(|query_set| wgpu::ComputePassTimestampWrites {
                query_set,
                beginning_of_pass_write_index: Some(first),
                end_of_pass_write_index: Some(first + 1),
            });
            self.stages.push(TopStage { name, dispatches: 0 });
        }
        self.pass = Some(self.encoder.begin_compute_pass(&descriptor).forget_lifetime());
    }

    pub(crate) fn set_bind_group(&mut self, index: u32, group: &wgpu::BindGroup, offsets: &[u32]) {
        self.pass().set_bind_group(index, group, offsets);
    }

    pub(crate) fn set_pipeline(&mut self, pipeline: &wgpu::ComputePipeline) {
        self.pass().set_pipeline(pipeline);
    }

    /// At least so many workgroups, in two dimensions where one is too short.
    pub(crate) fn dispatch(&mut self, groups: u32) {
        stages::dispatch(self.pass(), groups);
        if let Some(stage) = self.stages.last_mut() {
            stage.dispatches += 1;
        }
    }

    /// The stages that were recorded apart, in order.
    pub(crate) fn finish(self) -> Vec<TopStage> {
        self.stages
    }

    fn pass(&mut self) -> &mut wgpu::ComputePass<'static> {
        self.pass.as_mut().expect("a stage comes first")
    }
}
