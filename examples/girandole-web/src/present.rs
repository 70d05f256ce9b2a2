//! Shows pictures on the canvas.

use bytemuck::{Pod, Zeroable};
use girandole::wgpu;

use crate::device::Gpu;

/// `Screen` in `present.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Screen {
    width: u32,
    exposure: f32,
}

/// The pass that draws to the canvas.
pub struct Presenter {
    pipeline: wgpu::RenderPipeline,
    screen: wgpu::Buffer,
    groups: [wgpu::BindGroup; 2],
    size: [u32; 2],
}

impl Presenter {
    /// For two pictures that take turns.
    pub fn new(gpu: &Gpu, size: [u32; 2], pictures: &[wgpu::Buffer; 2]) -> Self {
        let device = &gpu.device;
        let module = device.create_shader_module(wgpu::include_wgsl!("present.wgsl"));
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("present"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("cover"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("show"),
                compilation_options: Default::default(),
                targets: &[Some(gpu.format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let screen = gpu.buffer("screen", size_of::<Screen>() as u64, usage);
        let layout = pipeline.get_bind_group_layout(0);
        let groups = [0, 1].map(|picture: usize| {
            let entries = [(0, &screen), (1, &pictures[picture])]
                .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() });
            let descriptor = wgpu::BindGroupDescriptor { label: Some("present"), layout: &layout, entries: &entries };
            device.create_bind_group(&descriptor)
        });
        Self { pipeline, screen, groups, size }
    }

    /// Records the pass. Without a canvas to draw to in this frame, it makes the canvas ready for the next
    /// one.
    pub fn record(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, picture: usize, exposure: f32) {
        let screen = Screen { width: self.size[0], exposure };
        gpu.queue.write_buffer(&self.screen, 0, bytemuck::bytes_of(&screen));
        let texture = match gpu.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(texture) | wgpu::CurrentSurfaceTexture::Suboptimal(texture) => texture,
            _ => return gpu.configure(self.size),
        };
        let view = texture.texture.create_view(&Default::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("present"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
            })],
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.groups[picture], &[]);
        pass.draw(0..3, 0..1);
    }
}
