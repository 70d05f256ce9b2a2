//! The stages that answer one request per invocation, with more requests than one dimension of a
//! dispatch has room for. Functions that copy a number stand for those that sample, so that
//! millions of requests take little time.

use crate::gpu::testing::{gpu, read};
use crate::plan::kernel::{MAX_WORKGROUPS, workgroups};

/// Two workgroups more than one dimension has, the last of them with one request.
const COUNT: u32 = MAX_WORKGROUPS * 64 + 65;

/// What precedes a stage: all that a request has to say is the number in `u`.
const SAMPLERS: &str = "
    struct Request { position: u32, normal: u32, choice: u32, u: u32 }
    alias LightSample = u32;
    alias LightReservoir = u32;
    var<private> light_nodes_read: u32;
    fn light_surface_point(position: u32, normal: u32) -> u32 { return 0u; }
    fn light_mark(shading_point: u32) {}
    fn light_sample(shading_point: u32, u: u32) -> u32 { return u; }
    fn light_reservoir_sample(shading_point: u32, reservoir: u32) -> u32 { return reservoir; }
    fn light_resample(shading_point: u32, u: u32, choice: u32, candidates: u32) -> u32 {
        light_nodes_read = u;
        return u;
    }
";

/// Runs a stage over these buffers, at the bindings of their indices. Returns the answers.
fn run(entry: &str, text: String, contents: &[(&[u32], wgpu::BufferUsages)]) -> Vec<u32> {
    let (device, queue) = gpu();
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(text.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some(entry),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let make = |(content, usage): &(&[u32], wgpu::BufferUsages)| {
        let descriptor = wgpu::BufferDescriptor {
            label: None,
            size: size_of_val(*content) as u64,
            usage: *usage | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        };
        let buffer = device.create_buffer(&descriptor);
        queue.write_buffer(&buffer, 0, bytemuck::cast_slice(content));
        buffer
    };
    let buffers: Vec<wgpu::Buffer> = contents.iter().map(make).collect();
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
    let (storage, uniform) = (wgpu::BufferUsages::STORAGE, wgpu::BufferUsages::UNIFORM);
    let candidates: (&[u32], _) = (&[1, 0, 0, 0], uniform);
    for (entry, text, has_candidates) in [
        ("batch", include_str!("../../../shaders/batch.wgsl"), false),
        ("batch_resample", include_str!("../../../shaders/batch_resample.wgsl"), true),
        ("batch_count", include_str!("../../../shaders/batch_count.wgsl"), true),
    ] {
        let buffers = [(&requests[..], storage), (&zeros[..], storage), candidates];
        let answers = run(entry, String::from(SAMPLERS) + text, &buffers[..if has_candidates { 3 } else { 2 }]);
        assert!(answers.into_iter().eq(1..=COUNT), "{entry}");
    }
}
