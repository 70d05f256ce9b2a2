//! A small engine with its own shader: ground under 4,000 lights, sampled 64 times per pixel.
//!
//! `cargo run --release -p engine_shader` prints the mean illuminance of the ground twice:
//! sampled by the shader on the GPU, and summed over all lights on the CPU. Expect 31.3 lux from
//! both. If they differ by more than 2 %, ten times the noise of 262,144 samples, the program
//! fails. It needs a GPU adapter; software Vulkan (`scripts/test.sh` installs it) will do.

use std::error::Error;

use girandole::glam::{DVec3, Vec3};
use pollster::block_on;

use girandole::{Effects, Light, LightTree, LightWorld, Placement, Policy, ShadingPoint, gpu::GpuLights, wgpu::*};

const SIZE: u32 = 64; // Pixels along an edge of the ground. A pixel is half a metre wide.
/// The engine's own shader. The library's text is joined before it.
const ENGINE: &str = "
@group(0) @binding(0) var<storage, read_write> lux: array<f32>;
fn random(seed: u32) -> f32 { return f32(light_hash(seed) >> 8u) * 5.9604645e-8; }

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = id.y * 64u + id.x;
    let ground = light_surface_point(vec3(f32(id.x) - 31.5, 0.0, f32(id.y) - 31.5) * 0.5, vec3(0.0, 1.0, 0.0));
    var sum = 0.0;
    for (var i = 0u; i < 64u; i++) {
        let seed = (pixel * 64u + i) * 4u;
        let u = vec4(random(seed), random(seed + 1u), random(seed + 2u), random(seed + 3u));
        let s = light_sample(ground, u);
        // An engine traces a shadow ray of length s.dist here.
        if s.pmf > 0.0 { sum += s.radiance.y * s.direction.y / (s.pmf * s.pdf); }
    }
    lux[pixel] = sum / 64.0;
}";

/// A hundred chandeliers of forty lights each above the ground.
fn world() -> Result<LightWorld, Box<dyn Error>> {
    let mut world = LightWorld::new();
    let light = |i: f32| Light::point(Vec3::new(i.cos(), 0.05 * i, i.sin()) * 0.4, Vec3::new(2.0, 1.5, 0.5));
    let chandelier = world.add_tree(LightTree::new((0..40).map(|i| light(i as f32)).collect())?);
    for i in 0..100 {
        let at = 3.0 * DVec3::new(f64::from(i % 10) - 4.5, 0.35, f64::from(i / 10) - 4.5);
        world.add_instance(chandelier, Placement::at(at), Policy::Static)?;
    }
    Ok(world)
}

/// A device of the best adapter, with Vulkan, Metal or D3D12. An engine has one already.
fn open_device() -> Result<(Device, Queue), Box<dyn Error>> {
    let backends = Backends::VULKAN | Backends::METAL | Backends::DX12;
    let instance = Instance::new(InstanceDescriptor { backends, ..InstanceDescriptor::new_without_display_handle() });
    let options = RequestAdapterOptions { power_preference: PowerPreference::HighPerformance, ..Default::default() };
    let adapter = block_on(instance.request_adapter(&options))?;
    Ok(block_on(adapter.request_device(&DeviceDescriptor::default()))?)
}

/// The mean illuminance of the ground by the engine's shader, in lux.
fn sampled(world: &mut LightWorld) -> Result<f32, Box<dyn Error>> {
    let (device, queue) = open_device()?;

    // Once: join the library's text and layout with the engine's own.
    let mut lights = GpuLights::new(&device, &queue)?;
    let shader = lights.shader(1, Effects::all());
    let source = ShaderSource::Wgsl(shader.join(ENGINE).into());
    let module = device.create_shader_module(ShaderModuleDescriptor { label: None, source });
    let ty = BufferBindingType::Storage { read_only: false };
    let ty = BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let entries = &[BindGroupLayoutEntry { binding: 0, visibility: ShaderStages::COMPUTE, ty, count: None }];
    let own = device.create_bind_group_layout(&BindGroupLayoutDescriptor { label: None, entries });
    let bind_group_layouts = &[Some(&own), Some(&shader.layout)];
    let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor { bind_group_layouts, ..Default::default() });
    let pipeline = device.create_compute_pipeline(&ComputePipelineDescriptor {
        label: None,
        layout: Some(&layout),
        module: &module,
        entry_point: Some("main"),
        compilation_options: PipelineCompilationOptions::default(),
        cache: None,
    });
    let (size, usage) = (u64::from(SIZE * SIZE * 4), BufferUsages::STORAGE | BufferUsages::COPY_SRC);
    let lux = device.create_buffer(&BufferDescriptor { label: None, size, usage, mapped_at_creation: false });
    let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
    let copy = device.create_buffer(&BufferDescriptor { label: None, size, usage, mapped_at_creation: false });
    let entries = &[BindGroupEntry { binding: 0, resource: lux.as_entire_binding() }];
    let group = device.create_bind_group(&BindGroupDescriptor { label: None, layout: &own, entries });

    // In every frame: upload the changes, record the build of the top level, and then the engine's
    // own passes.
    lights.upload(world)?;
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
    lights.build_top(&mut encoder);
    let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.set_bind_group(shader.group, lights.bind_group(), &[]);
    pass.dispatch_workgroups(SIZE / 8, SIZE / 8, 1);
    drop(pass);
    encoder.copy_buffer_to_buffer(&lux, 0, &copy, 0, size);
    queue.submit([encoder.finish()]);

    copy.map_async(MapMode::Read, .., |_| {});
    device.poll(PollType::wait_indefinitely())?;
    let lux: Vec<f32> = bytemuck::pod_collect_to_vec(&copy.get_mapped_range(..)?);
    Ok(lux.iter().sum::<f32>() / lux.len() as f32)
}

/// The same mean as a sum over all lights.
fn summed(world: &LightWorld) -> f32 {
    let sampler = world.sampler();
    let lux = |pixel: u32| -> f32 {
        let at = 0.5 * Vec3::new((pixel % SIZE) as f32 - 31.5, 0.0, (pixel / SIZE) as f32 - 31.5);
        let ground = ShadingPoint::surface(at, Vec3::Y);
        let incidents = sampler.all_lights().filter_map(|light| sampler.sample_light(&ground, light, [0.5; 2]));
        incidents.map(|incident| incident.radiance.y * incident.direction.y).sum()
    };
    (0..SIZE * SIZE).map(lux).sum::<f32>() / (SIZE * SIZE) as f32
}

#[allow(clippy::print_stdout, reason = "an example shows its result")]
fn main() -> Result<(), Box<dyn Error>> {
    let mut world = world()?;
    let (sampled, summed) = (sampled(&mut world)?, summed(&world));
    let line = format!("mean illuminance: {sampled:.3} lux from samples, {summed:.3} lux as the sum over all lights");
    if (sampled / summed - 1.0).abs() >= 0.02 {
        return Err(line.into());
    }
    println!("{line}");
    Ok(())
}
