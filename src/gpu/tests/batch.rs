//! The stage that answers one request per invocation, with more requests than one dimension of a
//! dispatch has room for. Functions that copy a number stand for those that sample, so that
//! millions of requests take little time.

use crate::gpu::testing::{gpu, read};
use crate::plan::kernel::{MAX_WORKGROUPS, workgroups};

/// Two workgroups more than one dimension has, the last of them with one request.
const COUNT: u32 = MAX_WORKGROUPS * 64 + 65;

/// What precedes a stage: all that a request has to say is the number in `u`.
const SAMPLERS: &str = "
    struct Request { position: u32, normal: u32, padding: u32, u: u32 }
    alias LightSample = u32;
    fn light_surface_point(position: u32, normal: u32) -> u32 { return 0u; }
    fn light_mark(shading_point: u32) {}
    fn light_sample(shading_point: u32, u: u32) -> u32 { return u; }
";

/// Runs the stage over these buffers, at the bindings of their indices. Returns the answers.
fn run(contents: [&[u32]; 2]) -> Vec<u32> {
    let (device, queue) = gpu();
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl((String::from(SAMPLERS) + include_str!("../../../shaders/batch.wgsl")).into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("batch"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let make = |content: &[u32]| {
        let descriptor = wgpu::BufferDescriptor {
            label: None,
            size: size_of_val(content) as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        };
        let buffer = device.create_buffer(&descriptor);
        queue.write_buffer(&buffer, 0, bytemuck::cast_slice(content));
        buffer
    };
    let buffers = contents.map(make);
    let entries: Vec<_> = (0..)
        .zip(&buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(1),
        entries: &entries,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(1, &group, &[]);
        let [x, y, z] = workgroups(COUNT.div_ceil(64));
        assert!(y > 1, "the dispatch has two dimensions");
        pass.dispatch_workgroups(x, y, z);
    }
    queue.submit([encoder.finish()]);
    read(&device, &queue, &buffers[1])
}

#[test]
fn requests_beyond_one_dimension_of_a_dispatch_get_their_own_answers() {
    let requests: Vec<u32> = (1..=COUNT).flat_map(|i| [0, 0, 0, i]).collect();
    let zeros = vec![0; COUNT as usize];
    let answers = run([&requests, &zeros]);
    assert!(answers.into_iter().eq(1..=COUNT));
}
