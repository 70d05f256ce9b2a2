//! Devices for the library's own GPU tests: one that they share, with WebGPU's default limits and
//! no features, and others for tests that need more or less.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, OnceLock, PoisonError};

use glam::{DVec3, Mat3, Quat, Vec3};
use testbed::common::batch::{self, SampleRecord, SampleRequest};
use testbed::common::gpu as shared;

use super::GpuLights;
use crate::effects::Effects;
use crate::instance::placement::Placement;
use crate::light::{DirectionalLight, Light};
use crate::math::dice::hash;
use crate::policy::Policy;
use crate::profile::tests::street_lamp;
use crate::sky::Sky;
use crate::tree::LightTree;
use crate::world::LightWorld;

/// The shared device and its queue, made once for each process.
///
/// Panics if there is no adapter: a GPU test never passes without running.
pub(crate) fn gpu() -> (wgpu::Device, wgpu::Queue) {
    static GPU: OnceLock<(wgpu::Device, wgpu::Queue)> = OnceLock::new();
    GPU.get_or_init(|| limited_gpu(&wgpu::Limits::default(), wgpu::Features::empty())).clone()
}

/// Lights on the shared device, whose kernels are compiled once for all tests.
pub(crate) fn gpu_lights() -> GpuLights {
    let (device, queue) = gpu();
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    lights.player.is_shared = true;
    lights
}

/// A pipeline of the shared device by its entry point, and by its effects if it depends on them. Each is
/// compiled once for all tests: compilers take most of their time.
pub(crate) fn compiled_once(
    name: (&'static str, Option<Effects>),
    compile: impl FnOnce() -> wgpu::ComputePipeline,
) -> wgpu::ComputePipeline {
    type Compiled = HashMap<(&'static str, Option<Effects>), Arc<OnceLock<wgpu::ComputePipeline>>>;
    static COMPILED: LazyLock<Mutex<Compiled>> = LazyLock::new(Mutex::default);
    let place = COMPILED.lock().unwrap_or_else(PoisonError::into_inner).entry(name).or_default().clone();
    place.get_or_init(compile).clone()
}

/// A pipeline of the shared device, for the entry point of a text that binds two groups.
pub(crate) fn compute_pipeline(
    text: String,
    entry: &str,
    groups: [&wgpu::BindGroupLayout; 2],
) -> wgpu::ComputePipeline {
    let (device, _) = gpu();
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(text.into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        bind_group_layouts: &groups.map(Some),
        ..Default::default()
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: Some(&layout),
        module: &module,
        entry_point: Some(entry),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

/// A new device with these limits and features.
pub(crate) fn limited_gpu(limits: &wgpu::Limits, features: wgpu::Features) -> (wgpu::Device, wgpu::Queue) {
    let opened = shared::find_adapter(None)
        .map_err(|error| format!("{error}; run scripts/test.sh, or {}", shared::HOW_TO_GET_AN_ADAPTER))
        .and_then(|adapter| shared::open_device(&adapter, features, limits.clone()));
    opened.unwrap_or_else(|error| panic!("GPU tests need an adapter: {error}"))
}

/// A device of wgpu's `noop` backend, which checks commands but runs none.
pub(crate) fn noop() -> (wgpu::Device, wgpu::Queue) {
    wgpu::Device::noop(&wgpu::DeviceDescriptor::default())
}

/// The content of a buffer with `COPY_SRC` after all work that was submitted so far.
pub(crate) fn read<T: bytemuck::Pod>(device: &wgpu::Device, queue: &wgpu::Queue, buffer: &wgpu::Buffer) -> Vec<T> {
    shared::read(device, queue, buffer).expect("the device finishes its work and the buffer maps")
}

/// The commands that build the top level and sample by the shader for some effects, and the buffer for the samples.
pub(crate) fn record_batch(
    lights: &mut GpuLights,
    requests: &[SampleRequest],
    variant: Effects,
) -> (wgpu::CommandEncoder, wgpu::Buffer) {
    let (device, queue) = gpu();
    let buffer = |size: usize| {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: size as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        })
    };
    let count = requests.len() as u32;
    let (input, output) = (buffer(size_of_val(requests)), buffer(size_of::<SampleRecord>() * requests.len()));
    queue.write_buffer(&input, 0, bytemuck::cast_slice(requests));
    let variant = variant - Effects::MOVING;
    let shader = lights.shader(0, variant);
    let pipeline = || batch::pipeline(&device, &shader.join(batch::STAGE), &shader.layout);
    let pipeline = compiled_once(("batch", Some(variant)), pipeline);
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    lights.build_top(&mut encoder);
    batch::record(&device, &mut encoder, &pipeline, lights.bind_group(), [&input, &output], count);
    (encoder, output)
}

/// A number in [0, 1) for each index and purpose; the same every time.
pub(crate) fn random(index: u32, salt: u32) -> f32 {
    let mix = (u64::from(index) << 32 | u64::from(salt)).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mix = (mix ^ (mix >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mix >> 40) as f32 / (1u64 << 24) as f32
}

/// A vector with coordinates in [-0.5, 0.5) for each index and purpose.
pub(crate) fn random_vec(index: u32, salt: u32) -> Vec3 {
    Vec3::new(random(index, salt), random(index, salt + 1), random(index, salt + 2)) - Vec3::splat(0.5)
}

/// A number in [0, 1) for a seed.
pub(crate) fn unit(seed: u32) -> f32 {
    (hash(seed) >> 8) as f32 / (1 << 24) as f32
}

/// A map with a sun and black texels.
pub(crate) fn small_sky() -> Sky {
    let mut pixels: Vec<Vec3> =
        (0..32 * 16).map(|i| Vec3::new(0.3, 0.5, 1.0) * 0.002 * (unit(i) - 0.3).max(0.0)).collect();
    pixels[5 * 32 + 20] = Vec3::splat(0.5);
    Sky::equirectangular(32, &pixels).expect("sound pixels")
}

/// Instances of several trees, turned and some scaled, a sun and a sky.
pub(crate) fn mixed_world() -> LightWorld {
    let mut world = LightWorld::new();
    for tree in 0..4_u32 {
        let light = |i: u32| {
            let seed = 1000 * tree + 10 * i;
            let place = Vec3::new(unit(seed), unit(seed + 1), unit(seed + 2)) * 6.0 - 3.0;
            match i % 4 {
                3 => Light::profile(
                    place,
                    Quat::from_rotation_x(unit(seed + 4) * 3.0),
                    street_lamp(tree.into()),
                    Vec3::splat(0.002),
                ),
                0 => Light::point(place, Vec3::splat(1.0 + unit(seed + 3))),
                1 => Light::spot(place, Vec3::NEG_Y, 0.2, 1.3, Vec3::splat(3.0)).with_range(40.0),
                _ => Light::rectangle(place, Vec3::X * 0.2, Vec3::Z * 0.2, Vec3::splat(9.0)),
            }
        };
        let key = world.add_tree(LightTree::new((0..30).map(light).collect()).expect("valid"));
        for i in 0..6_u32 {
            let seed = 50_000 + 100 * tree + 10 * i;
            let linear = Mat3::from_rotation_y(unit(seed)) * if i == 3 { 1.5 } else { 1.0 };
            let translation = DVec3::new(unit(seed + 1).into(), 0.2, unit(seed + 2).into()) * 40.0;
            world.add_instance(key, Placement { linear, translation }, Policy::Static).expect("valid");
        }
    }
    let sun = DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::splat(0.01) };
    world.add_directional(sun).expect("valid");
    let sky = world.set_sky(small_sky());
    let turn = Placement { linear: Mat3::from_rotation_z(0.7), ..Placement::IDENTITY };
    world.move_instance(sky, turn).expect("valid");
    world
}
