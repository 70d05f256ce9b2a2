//! Records commands of plans, all dispatches in one compute pass or each stage in a pass of its own.
//! Separate passes can be timed.

use super::bindings::label_of;
use crate::plan::Kernel;

/// One stage of a build of the top level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct TopStage {
    /// The name of what the stage does. Several stages of one build may share a name.
    pub name: &'static str,
    /// The number of its dispatches.
    pub dispatches: u32,
}

/// How many workgroups a dispatch has in each dimension.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Workgroups<'a> {
    Count([u32; 3]),
    /// The first three words of a buffer.
    In(&'a wgpu::Buffer),
}

/// How stages are divided into compute passes.
#[derive(Clone, Copy, Debug)]
enum PassDivision<'a> {
    /// One pass for all stages.
    One,
    /// A pass for each stage; the i-th writes the timestamps 2 i and 2 i + 1 of the set, if there
    /// is one.
    Each(Option<&'a wgpu::QuerySet>),
}

/// Records commands; counts the dispatches of each stage if it has a pass of its own.
#[derive(Debug)]
pub(crate) struct Recorder<'a> {
    encoder: &'a mut wgpu::CommandEncoder,
    label: &'static str,
    passes: PassDivision<'a>,
    pass: Option<wgpu::ComputePass<'static>>,
    stages: Vec<TopStage>,
}

impl<'a> Recorder<'a> {
    /// Records all stages in one pass of this name.
    pub(crate) fn together(encoder: &'a mut wgpu::CommandEncoder, label: &'static str) -> Self {
        Self { encoder, label, passes: PassDivision::One, pass: None, stages: Vec::new() }
    }

    /// Records each stage in a pass of its own, with timestamps in `queries` if there is one.
    pub(crate) fn apart(
        encoder: &'a mut wgpu::CommandEncoder,
        label: &'static str,
        queries: Option<&'a wgpu::QuerySet>,
    ) -> Self {
        Self { encoder, label, passes: PassDivision::Each(queries), pass: None, stages: Vec::new() }
    }

    /// Copies the first bytes of a buffer.
    pub(crate) fn copy(&mut self, from: &wgpu::Buffer, (to, offset): (&wgpu::Buffer, u64), bytes: u64) {
        self.pass = None;
        self.encoder.copy_buffer_to_buffer(from, 0, to, offset, bytes);
    }

    /// Sets bytes of a buffer to zero.
    pub(crate) fn clear(&mut self, buffer: &wgpu::Buffer, offset: u64, bytes: u64) {
        self.pass = None;
        self.encoder.clear_buffer(buffer, offset, Some(bytes));
    }

    /// Dispatches workgroups of a kernel.
    pub(crate) fn dispatch(
        &mut self,
        kernel: Kernel,
        (pipeline, group): (&wgpu::ComputePipeline, &wgpu::BindGroup),
        uniform_offset: u32,
        workgroups: Workgroups<'_>,
    ) {
        self.begin(kernel.stage());
        if let Some(stage) = self.stages.last_mut() {
            stage.dispatches += 1;
        }
        let pass = self.pass.as_mut().expect("a stage has begun");
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group, &[uniform_offset]);
        match workgroups {
            Workgroups::Count([x, y, z]) => pass.dispatch_workgroups(x, y, z),
            Workgroups::In(buffer) => pass.dispatch_workgroups_indirect(buffer, 0),
        }
    }

    /// Returns the stages in order; none if they share a pass.
    pub(crate) fn finish(self) -> Vec<TopStage> {
        self.stages
    }

    /// Begins a pass, if the open one is not for this stage.
    fn begin(&mut self, name: &'static str) {
        let is_open = match self.passes {
            PassDivision::One => true,
            PassDivision::Each(_) => self.stages.last().is_some_and(|stage| stage.name == name),
        };
        if is_open && self.pass.is_some() {
            return;
        }
        // The open pass locks the encoder, so it has to end first.
        self.pass = None;
        let label;
        let mut descriptor = wgpu::ComputePassDescriptor { label: Some(self.label), timestamp_writes: None };
        if let PassDivision::Each(queries) = self.passes {
            let first = 2 * self.stages.len() as u32;
            label = label_of(name);
            descriptor.label = Some(&label);
            descriptor.timestamp_writes = queries.map(|query_set| wgpu::ComputePassTimestampWrites {
                query_set,
                beginning_of_pass_write_index: Some(first),
                end_of_pass_write_index: Some(first + 1),
            });
            self.stages.push(TopStage { name, dispatches: 0 });
        }
        self.pass = Some(self.encoder.begin_compute_pass(&descriptor).forget_lifetime());
    }
}
