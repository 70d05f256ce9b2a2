//! A small engine, from the guide `docs/integration.md`: a ground under 4,000 moving lamps, with a shader of
//! its own and shadow rays.
//!
//! ```text
//! cargo run --release -p engine_shader
//! ```
//!
//! It prints the mean illuminance of the ground over eight frames twice: sampled by the shader on the GPU, and
//! summed over all lights on the CPU. Expect 29.2 lux from both. If they differ by more than 0.5 %,
//! ten times the noise of 262,144 samples, the program fails. It needs a GPU adapter; software Vulkan (`scripts/test.sh`
//! installs it) will do.

use std::error::Error;
use std::time::Duration;

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::gpu::{GpuLights, LightShader};
use girandole::{
    Effects, FrameBudget, InstanceKey, Light, LightTree, LightWorld, Placement, Policy, ShadingPoint, wgpu,
};
use pollster::block_on;

/// Pixels along an edge of the ground. A pixel is a metre wide.
const SIZE: u32 = 32;
/// Samples of a pixel and a frame.
const SAMPLES: u32 = 32;
const FRAMES: u32 = 8;

/// What the engine keeps.
struct Engine {
    device: wgpu::Device,
    queue: wgpu::Queue,
    lights: GpuLights,
    shader: LightShader,
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    frame: wgpu::Buffer,
    lux: wgpu::Buffer,
    copy: wgpu::Buffer,
}

/// Swings of forty lamps each, in ten rows.
fn scene() -> Result<(LightWorld, Vec<InstanceKey>), Box<dyn Error>> {
    let mut world = LightWorld::new();
    let lamp = |i: f32| Light::point(Vec3::new(i.cos(), 0.05 * i, i.sin()) * 0.4, Vec3::new(2.0, 1.5, 0.5));
    let swing = world.add_tree(LightTree::new((0..40).map(|i| lamp(i as f32)).collect())?);
    let instances: Result<Vec<_>, _> =
        (0..100).map(|i| world.add_instance(swing, pose(i, 0), Policy::Budgeted)).collect();
    Ok((world, instances?))
}

/// Where a swing is in a frame. The shader's positions are relative to the world's origin, which stays where it is.
fn pose(swing: usize, frame: u32) -> Placement {
    let phase = f64::from(frame) * 0.4 + swing as f64;
    let at = 3.0 * DVec3::new((swing % 10) as f64 - 4.5, 0.35, (swing / 10) as f64 - 4.5);
    Placement { linear: Mat3::from_rotation_y(phase as f32), translation: at + DVec3::new(phase.sin(), 0.0, 0.0) }
}

impl Engine {
    /// The device, the library's lights, and a pipeline with its shader.
    fn new() -> Result<Self, Box<dyn Error>> {
        let backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
        let without_display = wgpu::InstanceDescriptor::new_without_display_handle();
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor { backends, ..without_display });
        let power_preference = wgpu::PowerPreference::HighPerformance;
        let options = wgpu::RequestAdapterOptions { power_preference, ..Default::default() };
        let adapter = block_on(instance.request_adapter(&options))?;
        let (device, queue) = block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;

        let lights = GpuLights::new(&device, &queue)?;
        let shader = lights.shader(1, Effects::all());
        let own = own_layout(&device);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("ground"),
            source: wgpu::ShaderSource::Wgsl(shader.join(include_str!("ground.wgsl")).into()),
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            bind_group_layouts: &[Some(&own), Some(&shader.layout)],
            ..Default::default()
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("ground"),
            layout: Some(&layout),
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });

        let buffer = |size, usage| {
            device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
        };
        let bytes = u64::from(SIZE * SIZE * 4);
        let frame = buffer(8, wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST);
        let lux = buffer(bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let copy = buffer(bytes, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &own,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: lux.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: frame.as_entire_binding() },
            ],
        });
        Ok(Self { device, queue, lights, shader, pipeline, group, frame, lux, copy })
    }

    /// Draws a frame, and returns the illuminance of each pixel in lux.
    fn frame(&mut self, world: &mut LightWorld, number: u32) -> Result<Vec<f32>, Box<dyn Error>> {
        self.queue.write_buffer(&self.frame, 0, bytemuck::cast_slice(&[number, SAMPLES]));
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        // A camera 32 m above the ground, where a pixel is a metre wide: cells have some 16 pixels on a side.
        self.lights.set_cut_view(DVec3::new(0.0, 32.0, 0.0), 1.0 / 32.0);
        // Brings the trees up to date, sends what changed, and records the build of the top level and of the cuts of
        // cells that the last frame marked. What it returns tells what was done.
        self.lights.sync(world, FrameBudget::new(Duration::from_micros(300)), &mut encoder)?;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.set_bind_group(self.shader.group, self.lights.bind_group(), &[]);
        pass.dispatch_workgroups(SIZE / 8, SIZE / 8, 1);
        drop(pass);
        encoder.copy_buffer_to_buffer(&self.lux, 0, &self.copy, 0, self.copy.size());
        self.queue.submit([encoder.finish()]);

        self.copy.map_async(wgpu::MapMode::Read, .., |_| {});
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        let lux = bytemuck::pod_collect_to_vec(&self.copy.get_mapped_range(..)?);
        self.copy.unmap();
        Ok(lux)
    }
}

/// The engine's own bind group: the picture, and a uniform.
fn own_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[
            entry(0, wgpu::BufferBindingType::Storage { read_only: false }),
            entry(1, wgpu::BufferBindingType::Uniform),
        ],
    })
}

/// The same picture as a sum over all lights, on the CPU.
fn summed(world: &LightWorld) -> Vec<f32> {
    let sampler = world.sampler();
    let pixel = |pixel: u32| {
        let at = Vec3::new((pixel % SIZE) as f32 - 15.5, 0.0, (pixel / SIZE) as f32 - 15.5);
        let ground = ShadingPoint::surface(at, Vec3::Y);
        let incidents = sampler.all_lights().filter_map(|light| sampler.sample_light(&ground, light, [0.5; 2]));
        let visible = incidents.filter(|incident| !is_occluded(at, incident.direction, 0.999 * incident.dist));
        visible.map(|incident| incident.radiance.y * incident.direction.y).sum()
    };
    (0..SIZE * SIZE).map(pixel).collect()
}

/// Twin of `engine_is_occluded` in ground.wgsl.
fn is_occluded(origin: Vec3, direction: Vec3, max_dist: f32) -> bool {
    let to_low = (Vec3::new(-12.0, 0.0, 1.9) - origin) / direction;
    let to_high = (Vec3::new(12.0, 1.5, 2.1) - origin) / direction;
    to_low.min(to_high).max_element().max(0.0) <= to_low.max(to_high).min_element().min(max_dist)
}

#[allow(clippy::print_stdout, reason = "an example shows its result")]
fn main() -> Result<(), Box<dyn Error>> {
    let mut engine = Engine::new()?;
    let (mut world, swings) = scene()?;
    let mut means = [0.0; 2];
    for frame in 0..FRAMES {
        for (i, swing) in swings.iter().enumerate() {
            world.move_instance(*swing, pose(i, frame))?;
        }
        let sampled = engine.frame(&mut world, frame)?;
        for (mean, lux) in means.iter_mut().zip([sampled, summed(&world)]) {
            *mean += lux.iter().sum::<f32>() / (lux.len() as u32 * FRAMES) as f32;
        }
    }
    let [sampled, summed] = means;
    let line = format!("mean illuminance: {sampled:.3} lux from samples, {summed:.3} lux as the sum over all lights");
    if (sampled / summed - 1.0).abs() >= 0.005 {
        return Err(line.into());
    }
    println!("{line}");
    Ok(())
}
