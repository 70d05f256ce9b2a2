//! Mixes the samples of a frame with the last picture.

use bytemuck::{Pod, Zeroable};
use girandole::glam::Vec3;
use girandole::wgpu;

use crate::device::Gpu;
use testbed::render::gpu::pipeline::WORKGROUP;
use testbed::render::gpu::records::FrameUniform;

/// Bytes of a pixel of the picture.
const PIXEL_BYTES: u64 = 16;

/// A view, and how its picture is mixed with the last one. `View` in `resolve.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct View {
    eye: Vec3,
    least_share: f32,
    right: Vec3,
    width: u32,
    up: Vec3,
    height: u32,
    forward: Vec3,
    samples: f32,
}

/// What happened since the last picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Since {
    /// Something else is drawn.
    Restart,
    /// The camera or the scene moved.
    Motion,
    /// Nothing.
    Nothing,
}

impl Since {
    /// The most frames that a pixel is the mean of.
    pub fn most_frames(self) -> u32 {
        match self {
            Self::Restart => 1,
            Self::Motion => 12,
            // Half floats hold whole numbers up to 2048.
            Self::Nothing => 2000,
        }
    }
}

/// Two pictures that take turns, and the pass between them.
pub struct Resolver {
    pipeline: wgpu::ComputePipeline,
    views: [wgpu::Buffer; 2],
    pub pictures: [wgpu::Buffer; 2],
    /// By the picture that is written.
    groups: [wgpu::BindGroup; 2],
    last: View,
    /// The picture that was written last.
    pub newest: usize,
}

impl Resolver {
    /// `sums` are the pixels that the renderer writes.
    pub fn new(gpu: &Gpu, pixels: u64, sums: &wgpu::Buffer) -> Self {
        let device = &gpu.device;
        let module = device.create_shader_module(wgpu::include_wgsl!("resolve.wgsl"));
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("resolve"),
            layout: None,
            module: &module,
            entry_point: Some("resolve"),
            compilation_options: Default::default(),
            cache: None,
        });
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let views = [(); 2].map(|()| gpu.buffer("view", size_of::<View>() as u64, uniform));
        let pictures = [(); 2].map(|()| gpu.buffer("picture", pixels * PIXEL_BYTES, wgpu::BufferUsages::STORAGE));
        let layout = pipeline.get_bind_group_layout(0);
        let groups = [0, 1].map(|written| {
            let buffers = [&views[0], &views[1], sums, &pictures[1 - written], &pictures[written]];
            let entries: Vec<_> = (0..)
                .zip(buffers)
                .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
                .collect();
            let descriptor = wgpu::BindGroupDescriptor { label: Some("resolve"), layout: &layout, entries: &entries };
            device.create_bind_group(&descriptor)
        });
        Self { pipeline, views, pictures, groups, last: View::zeroed(), newest: 0 }
    }

    /// Records the pass after a frame of `samples` samples per pixel.
    pub fn record(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        frame: &FrameUniform,
        samples: u32,
        since: Since,
    ) {
        let samples = samples as f32;
        let view = View {
            eye: frame.eye,
            least_share: 1.0 / since.most_frames() as f32,
            right: frame.right,
            width: frame.width,
            up: frame.up,
            height: frame.height,
            forward: frame.forward,
            samples: if since == Since::Nothing { -samples } else { samples },
        };
        gpu.queue.write_buffer(&self.views[0], 0, bytemuck::bytes_of(&view));
        gpu.queue.write_buffer(&self.views[1], 0, bytemuck::bytes_of(&self.last));
        self.last = view;
        self.newest = 1 - self.newest;
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.groups[self.newest], &[]);
        pass.dispatch_workgroups(frame.width.div_ceil(WORKGROUP), frame.height.div_ceil(WORKGROUP), 1);
    }
}
