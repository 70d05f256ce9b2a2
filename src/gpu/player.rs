//! Plays plans on the engine's wgpu device.

use std::collections::HashMap;

use super::bindings::label_of;
use super::error::GpuError;
use super::memory;
use crate::plan::{Binding, BufferId, BufferKind, Command, Commands, Kernel, NewBuffer};

/// The buffers of plans, and the pipelines and bind groups of their kernels.
#[derive(Debug)]
pub(super) struct Player {
    device: wgpu::Device,
    queue: wgpu::Queue,
    buffers: HashMap<BufferId, wgpu::Buffer>,
    layouts: Vec<Layout>,
    pipelines: HashMap<Kernel, wgpu::ComputePipeline>,
    /// A handful: each kernel binds the same buffers in every frame.
    groups: Vec<BoundGroup>,
    /// Whether the device is that of [`gpu`](super::testing::gpu), and pipelines come from other tests.
    #[cfg(test)]
    pub is_shared: bool,
    #[cfg(test)]
    pub submissions: usize,
    /// The most workgroups along the first dimension of a dispatch.
    #[cfg(test)]
    pub widest: u32,
}

/// Kernels initialise the workgroup memory that they use. For drivers that cannot clear it, wgpu would
/// add stores to the shader, which some compilers need half a minute for.
pub(super) const UNCLEARED: wgpu::PipelineCompilationOptions<'static> =
    wgpu::PipelineCompilationOptions { constants: &[], zero_initialize_workgroup_memory: false };

/// The text of a kernel. In unit tests, its workgroup memory starts with arbitrary values.
fn text_of(kernel: Kernel) -> String {
    let text = kernel.wgsl();
    #[cfg(test)]
    let text = super::poison::poisoned(&text, kernel.entry());
    text
}

/// What kernels with the same bindings share.
#[derive(Debug)]
struct Layout {
    bindings: &'static [Binding],
    group: wgpu::BindGroupLayout,
    pipeline: wgpu::PipelineLayout,
}

#[derive(Debug)]
struct BoundGroup {
    /// The index of the layout.
    layout: usize,
    buffers: Vec<BufferId>,
    group: wgpu::BindGroup,
}

impl Player {
    /// Compiles no kernel and makes no buffer yet.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        Self {
            device: device.clone(),
            queue: queue.clone(),
            buffers: HashMap::new(),
            layouts: Vec::new(),
            pipelines: HashMap::new(),
            groups: Vec::new(),
            #[cfg(test)]
            is_shared: false,
            #[cfg(test)]
            submissions: 0,
            #[cfg(test)]
            widest: u32::MAX,
        }
    }

    /// Compiles a kernel, if it is not compiled yet.
    pub fn compile(&mut self, kernel: Kernel) {
        if !self.pipelines.contains_key(&kernel) {
            #[cfg(not(test))]
            let pipeline = self.compiled(kernel);
            #[cfg(test)]
            let pipeline = match self.is_shared {
                true => super::testing::compiled_once((kernel.entry(), kernel.effects()), || self.compiled(kernel)),
                false => self.compiled(kernel),
            };
            self.pipelines.insert(kernel, pipeline);
        }
    }

    fn compiled(&mut self, kernel: Kernel) -> wgpu::ComputePipeline {
        let layout = self.layout(kernel.bindings());
        let label = label_of(kernel.entry());
        let label = Some(label.as_str());
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl(text_of(kernel).into()),
        });
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&self.layouts[layout].pipeline),
            module: &module,
            entry_point: Some(kernel.entry()),
            compilation_options: UNCLEARED,
            cache: None,
        })
    }

    /// Makes all buffers, or none.
    pub fn create(&mut self, buffers: &[NewBuffer]) -> Result<(), GpuError> {
        let mut made = Vec::with_capacity(buffers.len());
        for NewBuffer { id, what, bytes, kind } in buffers {
            let usage = wgpu::BufferUsages::COPY_DST
                | match kind {
                    BufferKind::Uniform => wgpu::BufferUsages::UNIFORM,
                    BufferKind::Storage => wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
                    BufferKind::Indirect => {
                        wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::INDIRECT
                    }
                };
            let buffer = memory::create_buffer(&self.device, what, *bytes, usage)?;
            #[cfg(test)]
            fill_with_garbage(&self.queue, &buffer);
            made.push((*id, buffer));
        }
        self.buffers.extend(made);
        Ok(())
    }

    /// Lets go of buffers. Commands that were recorded before keep them alive.
    pub fn free(&mut self, freed: &[BufferId]) {
        freed.iter().for_each(|id| drop(self.buffers.remove(id)));
        self.groups.retain(|group| !group.buffers.iter().any(|buffer| freed.contains(buffer)));
    }

    /// A buffer of a plan. Panics if it was not made or was freed.
    pub fn buffer(&self, id: BufferId) -> &wgpu::Buffer {
        self.buffers.get(&id).expect("plans name buffers that exist")
    }

    /// Runs commands on the queue. Writes go ahead of the next submission. Other commands are
    /// submitted at once, where a later write needs their order, or at the end.
    pub fn play(&mut self, commands: &Commands) {
        let mut encoder: Option<wgpu::CommandEncoder> = None;
        // The buffers that the encoder's commands use.
        let mut used: Vec<BufferId> = Vec::new();
        for command in commands.iter() {
            if let Command::Write { buffer, offset, bytes } = command {
                if used.contains(&buffer) {
                    self.submit(encoder.take());
                    used.clear();
                }
                self.queue.write_buffer(self.buffer(buffer), offset, bytes);
                continue;
            }
            match command {
                Command::Copy { from, to, .. } => used.extend([from, to]),
                Command::Clear { buffer, .. } => used.push(buffer),
                Command::Dispatch { buffers, .. } => used.extend(buffers),
                Command::DispatchIndirect { buffers, workgroups, .. } => {
                    used.extend(buffers.iter().chain([&workgroups]));
                }
                Command::Write { .. } => {}
            }
            let device = &self.device;
            let encoder = encoder.get_or_insert_with(|| {
                device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("girandole upload") })
            });
            self.record(encoder, &labelled("girandole upload"), std::iter::once(command));
        }
        self.submit(encoder);
    }

    /// Submits the commands of an encoder; nothing without one, so that writes wait for the engine's
    /// own submission.
    fn submit(&mut self, encoder: Option<wgpu::CommandEncoder>) {
        if let Some(encoder) = encoder {
            self.queue.submit([encoder.finish()]);
            #[cfg(test)]
            {
                self.submissions += 1;
            }
        }
    }

    /// Records commands, none of them a write. Dispatches in a row share a pass.
    pub fn record<'a>(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        descriptor: &wgpu::ComputePassDescriptor<'_>,
        commands: impl Iterator<Item = Command<'a>>,
    ) {
        // An open pass locks the encoder.
        let mut open: Option<wgpu::ComputePass<'static>> = None;
        for command in commands {
            let (kernel, buffers, uniform_offset) = match command {
                Command::Write { .. } => unreachable!("writes go through the queue"),
                Command::Copy { from, to, offset, bytes } => {
                    open = None;
                    encoder.copy_buffer_to_buffer(self.buffer(from), 0, self.buffer(to), offset, bytes);
                    continue;
                }
                Command::Clear { buffer, offset, bytes } => {
                    open = None;
                    encoder.clear_buffer(self.buffer(buffer), offset, Some(bytes));
                    continue;
                }
                Command::Dispatch { kernel, buffers, uniform_offset, .. }
                | Command::DispatchIndirect { kernel, buffers, uniform_offset, .. } => {
                    (kernel, buffers, uniform_offset)
                }
            };
            self.compile(kernel);
            let group = self.group(kernel, buffers);
            let pass = open.get_or_insert_with(|| encoder.begin_compute_pass(descriptor).forget_lifetime());
            pass.set_pipeline(&self.pipelines[&kernel]);
            pass.set_bind_group(0, &self.groups[group].group, &[uniform_offset]);
            match command {
                Command::DispatchIndirect { workgroups, .. } => {
                    pass.dispatch_workgroups_indirect(self.buffer(workgroups), 0);
                }
                Command::Dispatch { workgroups, .. } => {
                    #[cfg(test)]
                    let workgroups = self.narrowed(kernel, workgroups);
                    let [x, y, z] = workgroups;
                    pass.dispatch_workgroups(x, y, z);
                }
                _ => {}
            }
        }
    }

    /// The index of a layout, which is made at first use.
    fn layout(&mut self, bindings: &'static [Binding]) -> usize {
        if let Some(index) = self.layouts.iter().position(|layout| layout.bindings == bindings) {
            return index;
        }
        let entry = |(binding, kind): (u32, &Binding)| {
            let (ty, has_dynamic_offset, bytes) = match kind {
                Binding::Uniform { bytes } => (wgpu::BufferBindingType::Uniform, true, u64::from(*bytes)),
                Binding::Read => (wgpu::BufferBindingType::Storage { read_only: true }, false, 0),
                Binding::ReadWrite => (wgpu::BufferBindingType::Storage { read_only: false }, false, 0),
            };
            let min_binding_size = wgpu::BufferSize::new(bytes);
            wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset, min_binding_size },
                count: None,
            }
        };
        let entries: Vec<_> = (0..).zip(bindings).map(entry).collect();
        let label = Some("girandole");
        let group = self.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
        let pipeline = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&group)],
            ..Default::default()
        });
        self.layouts.push(Layout { bindings, group, pipeline });
        self.layouts.len() - 1
    }

    /// The index of a bind group, which is made at first use.
    fn group(&mut self, kernel: Kernel, buffers: &[BufferId]) -> usize {
        let layout = self.layout(kernel.bindings());
        let is_same = |group: &BoundGroup| group.layout == layout && group.buffers == buffers;
        if let Some(index) = self.groups.iter().position(is_same) {
            return index;
        }
        let entry = |((binding, id), kind): ((u32, &BufferId), &Binding)| {
            let size = match kind {
                Binding::Uniform { bytes } => wgpu::BufferSize::new(u64::from(*bytes)),
                Binding::Read | Binding::ReadWrite => None,
            };
            let buffer = wgpu::BufferBinding { buffer: self.buffer(*id), offset: 0, size };
            wgpu::BindGroupEntry { binding, resource: wgpu::BindingResource::Buffer(buffer) }
        };
        let entries: Vec<_> = (0..).zip(buffers).zip(kernel.bindings()).map(entry).collect();
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&label_of(kernel.stage())),
            layout: &self.layouts[layout].group,
            entries: &entries,
        });
        self.groups.push(BoundGroup { layout, buffers: buffers.to_vec(), group });
        self.groups.len() - 1
    }
}

#[cfg(test)]
impl Player {
    /// The same number of workgroups or more, of which at most `widest` are along the first
    /// dimension. Indices in two dimensions then occur with few records. A sort has as few blocks as
    /// fit into one dimension.
    fn narrowed(&self, kernel: Kernel, workgroups: [u32; 3]) -> [u32; 3] {
        if kernel.stage() == "sort" || workgroups[0] <= self.widest {
            return workgroups;
        }
        let groups: u32 = workgroups.iter().product();
        [self.widest, groups.div_ceil(self.widest), 1]
    }
}

/// A pass of this name.
pub(super) fn labelled(label: &str) -> wgpu::ComputePassDescriptor<'_> {
    wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes: None }
}

/// Plans must not rely on the content of new buffers, although wgpu fills them with zeros.
#[cfg(test)]
fn fill_with_garbage(queue: &wgpu::Queue, buffer: &wgpu::Buffer) {
    queue.write_buffer(buffer, 0, &vec![0xcd; buffer.size() as usize]);
}
