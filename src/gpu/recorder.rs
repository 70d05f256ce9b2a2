//! Records the stages of a build, all in one compute pass or each in a pass of its own. Separate
//! passes can be timed.

use super::stages;

/// One stage of a build of the top level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct TopStage {
    /// The name of what the stage does. Several stages of one build may share a name.
    pub name: &'static str,
    /// The number of its dispatches.
    pub dispatches: u32,
}

/// How stages are divided into compute passes.
#[derive(Clone, Copy, Debug)]
enum Passes<'a> {
    /// One pass for all stages.
    One,
    /// A pass for each stage; the i-th writes the timestamps 2 i and 2 i + 1 of the set, if there
    /// is one.
    Each(Option<&'a wgpu::QuerySet>),
}

/// Records stages; counts the dispatches of each stage if it has a pass of its own.
#[derive(Debug)]
pub(crate) struct Recorder<'a> {
    encoder: &'a mut wgpu::CommandEncoder,
    label: &'static str,
    passes: Passes<'a>,
    pass: Option<wgpu::ComputePass<'static>>,
    stages: Vec<TopStage>,
}

impl<'a> Recorder<'a> {
    /// Records all stages in one pass of this name.
    pub(crate) fn together(encoder: &'a mut wgpu::CommandEncoder, label: &'static str) -> Self {
        Self { encoder, label, passes: Passes::One, pass: None, stages: Vec::new() }
    }

    /// Records each stage in a pass of its own, with timestamps if `queries` is given.
    pub(crate) fn apart(
        encoder: &'a mut wgpu::CommandEncoder,
        label: &'static str,
        queries: Option<&'a wgpu::QuerySet>,
    ) -> Self {
        Self { encoder, label, passes: Passes::Each(queries), pass: None, stages: Vec::new() }
    }

    /// Fills a buffer with zeros. To be called before the first stage.
    pub(crate) fn clear(&mut self, buffer: &wgpu::Buffer) {
        self.encoder.clear_buffer(buffer, 0, None);
    }

    /// Begins the stage of this name.
    pub(crate) fn stage(&mut self, name: &'static str) {
        if matches!(self.passes, Passes::One) && self.pass.is_some() {
            return;
        }
        // The open pass locks the encoder, so it has to end first.
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

    /// Dispatches at least `groups` workgroups, in two dimensions if one is too short.
    pub(crate) fn dispatch(&mut self, groups: u32) {
        stages::dispatch(self.pass(), groups);
        if let Some(stage) = self.stages.last_mut() {
            stage.dispatches += 1;
        }
    }

    /// Returns the stages in order; none if they share a pass.
    pub(crate) fn finish(self) -> Vec<TopStage> {
        self.stages
    }

    fn pass(&mut self) -> &mut wgpu::ComputePass<'static> {
        self.pass.as_mut().expect("a stage has begun")
    }
}
