//! Compute stages that share one bind group layout: a uniform with a dynamic offset, which selects
//! the record of a pass, and storage buffers.

/// Bytes from one record of the uniform to the next: WebGPU's default alignment of dynamic offsets.
/// `check_limits` refuses devices that need a larger one.
pub(crate) const PASS_STRIDE: u32 = 256;

/// WebGPU's default limit of workgroups along one dimension.
pub(crate) const MAX_WORKGROUPS: u32 = 65_535;

/// How a set of stages uses a storage buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Access {
    /// No stage writes it.
    Read,
    /// At least one stage writes it.
    Write,
}

/// The layout of the bind group: the uniform at binding 0, the storage buffers from binding 1 on.
#[derive(Debug)]
pub(crate) struct Stages {
    label: &'static str,
    bindings: wgpu::BindGroupLayout,
    pipelines: wgpu::PipelineLayout,
    uniform_bytes: u64,
}

impl Stages {
    /// Makes the layouts; `uniform_bytes` is the size of one record of the uniform.
    pub(crate) fn new(device: &wgpu::Device, label: &'static str, uniform_bytes: u64, storage: &[Access]) -> Self {
        let entry = |binding, ty, has_dynamic_offset, bytes| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset, min_binding_size: wgpu::BufferSize::new(bytes) },
            count: None,
        };
        let mut entries = vec![entry(0, wgpu::BufferBindingType::Uniform, true, uniform_bytes)];
        entries.extend((1..).zip(storage).map(|(binding, access)| {
            let read_only = *access == Access::Read;
            entry(binding, wgpu::BufferBindingType::Storage { read_only }, false, 0)
        }));
        let bindings =
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries });
        let pipelines = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: &[Some(&bindings)],
            immediate_size: 0,
        });
        Self { label, bindings, pipelines, uniform_bytes }
    }

    /// Compiles the stage with the entry point `entry` from its whole text.
    pub(crate) fn pipeline(&self, device: &wgpu::Device, entry: &str, text: String) -> wgpu::ComputePipeline {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(entry),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: Some(&self.pipelines),
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
    }

    /// Binds the buffers, which are in the order of the layout.
    pub(crate) fn bind(
        &self,
        device: &wgpu::Device,
        uniform: &wgpu::Buffer,
        storage: &[&wgpu::Buffer],
    ) -> wgpu::BindGroup {
        let resource = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: uniform,
            offset: 0,
            size: wgpu::BufferSize::new(self.uniform_bytes),
        });
        let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource }];
        entries.extend(
            (1..)
                .zip(storage)
                .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() }),
        );
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(self.label),
            layout: &self.bindings,
            entries: &entries,
        })
    }
}

/// The bytes of a uniform with one record every [`PASS_STRIDE`].
pub(crate) fn pass_bytes<T: bytemuck::NoUninit>(passes: &[T]) -> Vec<u8> {
    let mut bytes = vec![0; passes.len() * PASS_STRIDE as usize];
    for (pass, slot) in passes.iter().zip(bytes.chunks_exact_mut(PASS_STRIDE as usize)) {
        slot[..size_of::<T>()].copy_from_slice(bytemuck::bytes_of(pass));
    }
    bytes
}

/// Dispatches at least `groups` workgroups, at least one, and in two dimensions if one is too
/// short.
pub(crate) fn dispatch(pass: &mut wgpu::ComputePass<'_>, groups: u32) {
    let x = groups.clamp(1, MAX_WORKGROUPS);
    pass.dispatch_workgroups(x, groups.div_ceil(x).max(1), 1);
}
