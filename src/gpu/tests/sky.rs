//! The sky on the GPU: the samples, densities and hits of the CPU.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Mat3, Vec3};
use wgpu::util::DeviceExt;

use crate::effects::Effects;
use crate::gpu::GpuLights;
use crate::gpu::bindings::{bind, storage_entry};
use crate::gpu::testing::{compute_pipeline, gpu, gpu_lights, mixed_world, read, unit};
use crate::instance::placement::Placement;
use crate::instance::portal::Portal;
use crate::keys::LightId;
use crate::plan::{LightPlanner, PlanLimits};
use crate::sampling::sample::LightSample;
use crate::sampling::view::NO_INSTANCE;
use crate::shading::shading_point::ShadingPoint;
use crate::sky::Sky;
use crate::sky::tests::cloudy;
use crate::world::LightWorld;
use testbed::common::batch::SampleRecord;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Input {
    position: [f32; 3],
    padding: u32,
    normal: [f32; 3],
    more_padding: u32,
    u: [f32; 4],
}

/// A sample, what a ray in its direction meets, and the density of a point in that direction.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Output {
    sample: SampleRecord,
    hit: SampleRecord,
    pdf: f32,
    padding: [u32; 3],
}

const ENGINE: &str = "
    struct Input { position: vec3<f32>, normal: vec3<f32>, u: vec4<f32> }
    struct Output { chosen: LightSample, hit: LightSample, pdf: f32 }
    @group(0) @binding(0) var<storage, read> inputs: array<Input>;
    @group(0) @binding(1) var<storage, read_write> outputs: array<Output>;
    @compute @workgroup_size(64) fn engine(@builtin(global_invocation_id) id: vec3<u32>) {
        if id.x >= arrayLength(&inputs) { return; }
        let input = inputs[id.x];
        let at = light_surface_point(input.position, input.normal);
        let chosen = light_sample(at, input.u);
        var hit: LightSample;
        var pdf = 0.0;
        if chosen.pmf > 0.0 {
            hit = light_hit(at, chosen.direction, 2.0e18);
            pdf = light_pdf(at, chosen.instance, chosen.light, at.position + 3.0 * chosen.direction);
        }
        outputs[id.x] = Output(chosen, hit, pdf);
    }";

const COUNT: u32 = 4096;

fn inputs() -> Vec<Input> {
    let input = |i: u32| {
        let at = |k: u32| unit(11 * i + k);
        let normal = if i.is_multiple_of(5) {
            Vec3::ZERO
        } else {
            Vec3::new(at(0) - 0.5, at(1) - 0.5, at(2) - 0.5).normalize_or(Vec3::Y)
        };
        let position = (Vec3::new(at(3), at(4), at(5)) * 40.0).to_array();
        let u = [6, 7, 8, 9].map(at);
        Input { position, padding: 0, normal: normal.to_array(), more_padding: 0, u }
    };
    (0..COUNT).map(input).collect()
}

fn run(lights: &mut GpuLights, pipeline: &wgpu::ComputePipeline, own: &wgpu::BindGroupLayout) -> Vec<Output> {
    let (device, queue) = gpu();
    let input = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: bytemuck::cast_slice(&inputs()),
        usage: wgpu::BufferUsages::STORAGE,
    });
    let output = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: size_of::<Output>() as u64 * u64::from(COUNT),
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    let group = bind(&device, "test", own, &[&input, &output]);
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    lights.build_top(&mut encoder);
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.set_bind_group(1, lights.bind_group(), &[]);
    pass.dispatch_workgroups(COUNT.div_ceil(64), 1, 1);
    drop(pass);
    queue.submit([encoder.finish()]);
    read(&device, &queue, &output)
}

/// Three rooms, of which two overlap, with large windows.
fn rooms() -> [Portal; 3] {
    let portal = |low: DVec3, high: DVec3, center: DVec3, half_u: Vec3, half_v: Vec3| {
        let linear = Mat3::from_diagonal((0.5 * (high - low)).as_vec3());
        Portal { center, half_u, half_v, room: Placement { linear, translation: 0.5 * (low + high) } }
    };
    [
        portal(DVec3::ZERO, DVec3::splat(20.0), DVec3::new(10.0, 10.0, 20.0), 8.0 * Vec3::X, 7.0 * Vec3::Y),
        portal(DVec3::splat(12.0), DVec3::splat(40.0), DVec3::new(26.0, 40.0, 26.0), 12.0 * Vec3::X, 9.0 * Vec3::Z),
        portal(
            DVec3::new(20.0, 0.0, 0.0),
            DVec3::new(40.0, 40.0, 20.0),
            DVec3::new(40.0, 20.0, 10.0),
            Vec3::new(0.0, 9.0, 1.0),
            9.0 * Vec3::Z,
        ),
    ]
}

/// Asserts that all samples are those of the CPU, but for choices within rounding, and that `least` are of the sky.
fn compare(world: &LightWorld, outputs: &[Output], least: usize, what: &str) {
    let (sky, _) = world.sky().expect("a sky");
    let slot = world.slot(sky).expect("an instance");
    let close = |a: f32, b: f32, tolerance: f32| (a - b).abs() <= tolerance * a.abs().max(b.abs());
    let (mut others, mut of_sky, mut texels) = (0, 0, 0);
    for (input, output) in inputs().iter().zip(outputs) {
        let at = ShadingPoint::surface(input.position.into(), input.normal.into());
        let Output { sample: ours, hit, pdf, .. } = output;
        let Some(LightSample { light, pmf, incident, .. }) = world.sampler().from_roots().sample(&at, input.u) else {
            others += usize::from(ours.pmf > 0.0);
            continue;
        };
        let number = match light {
            LightId::Local { instance, light } => (world.slot(instance).expect("it lives"), light),
            LightId::Directional(_) => (u32::MAX, 0),
        };
        if (ours.instance, ours.light) != number || ours.pmf <= 0.0 {
            others += 1;
            continue;
        }
        assert!(close(ours.pmf, pmf, 2.0e-3), "{what}: {ours:?} {pmf}");
        if ours.instance != slot {
            continue;
        }
        of_sky += 1;
        // Another texel is chosen within rounding of a border.
        if !close(ours.radiance[1], incident.radiance.y, 1.0e-5) {
            texels += 1;
            continue;
        }
        assert!(ours.dist >= 1.0e18 && ours.is_delta == 0, "{what}: {ours:?}");
        // Where the map is stretched, the density depends on the direction within the texel.
        match world.sampler().from_roots().hit(&at, ours.direction.into(), f32::INFINITY) {
            Some(seen) if seen.light == light && seen.incident.radiance == incident.radiance => {
                assert!(close(ours.pdf, seen.incident.pdf, 1.0e-4), "{what}: {ours:?} {seen:?}");
            }
            Some(seen) => texels += usize::from(seen.incident.dist == f32::INFINITY),
            None => texels += 1,
        }
        let away = Vec3::from(ours.direction).distance(incident.direction);
        assert!(away < 5.0e-3, "{what}: {away}, a fraction of a texel");
        // Lamps stand before the sky, and the point of the density has rounded.
        if hit.instance == slot && hit.radiance == ours.radiance {
            assert!(hit.light == ours.light && close(hit.pmf, ours.pmf, 1.0e-4) && close(hit.pdf, ours.pdf, 1.0e-4));
            texels += usize::from(!close(*pdf, ours.pmf * ours.pdf, 1.0e-3));
        } else {
            texels += usize::from(hit.instance == slot);
        }
    }
    assert!(others <= 12 && of_sky > least, "{what}: {others} others, {of_sky} of the sky");
    assert!(texels <= of_sky / 25, "{what}: {texels} texels of {of_sky}");
}

#[test]
fn the_gpu_samples_the_sky_as_the_cpu_does_and_follows_its_changes() {
    let size = [128, 64];
    let mut pixels = cloudy(size, 1);
    pixels.iter_mut().for_each(|pixel| *pixel *= 1.0e-4);
    let mut world = mixed_world();
    let sky = world.set_sky(Sky::equirectangular(size[0], &pixels).expect("sound pixels"));
    let (device, _) = gpu();
    let mut lights = gpu_lights();
    let own = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[storage_entry(0, true), storage_entry(1, false)],
    });
    let shader = lights.shader(1, Effects::all());
    let pipeline = compute_pipeline(shader.join(ENGINE), "engine", [&own, &shader.layout]);
    let first = lights.upload(&world).expect("room enough").bytes;
    assert!(first > 16 * 128 * 64 / 3);
    compare(&world, &run(&mut lights, &pipeline, &own), 1400, "at first");

    // A part: its quads and those above, the patches and their tree.
    let part = vec![Vec3::new(0.15, 0.05, 0.05); 8 * 8];
    world.set_sky_part([40, 10], [8, 8], &part).expect("within the map");
    world.update(crate::FrameBudget::NONE);
    let (_, map) = world.sky().expect("a sky");
    let mut quads = 0;
    map.for_each_change(map.revision() - 1, |_, run| quads += run.len());
    // The head, and the quads of one or more blocks of each of four levels.
    assert_eq!(quads, 1 + 4 * (2 * 3 + 2 + 1 + 1));
    lights.upload(&world).expect("room enough");
    compare(&world, &run(&mut lights, &pipeline, &own), 1400, "with a part");

    // Turned and stretched, tinted, and masked for nobody here.
    let linear = Mat3::from_rotation_x(1.1) * Mat3::from_diagonal(Vec3::new(1.0, 1.5, -1.0));
    world.move_instance(sky, Placement { linear, ..Placement::IDENTITY }).expect("a placement");
    world.set_appearance(sky, |a| a.factor = Vec3::new(0.5, 1.5, 0.7)).expect("a factor");
    lights.upload(&world).expect("room enough");
    compare(&world, &run(&mut lights, &pipeline, &own), 1400, "turned");
    world.set_appearance(sky, |a| a.mask = 0).expect("an instance");
    lights.upload(&world).expect("room enough");
    let slot = world.slot(sky).expect("an instance");
    let outputs = run(&mut lights, &pipeline, &own);
    assert!(outputs.iter().all(|output| output.sample.instance != slot && output.hit.instance != slot));
    world.set_appearance(sky, |a| a.mask = u32::MAX).expect("an instance");

    // In rooms, which half of the points are in.
    world.set_portals(&rooms()).expect("sound portals");
    lights.upload(&world).expect("room enough");
    assert_eq!(lights.upload(&world).expect("room enough").bytes, 0);
    compare(&world, &run(&mut lights, &pipeline, &own), 500, "in rooms");
    world.set_portals(&[]).expect("no portals");

    // Another map, larger than there is room for, and then none.
    let size = [200, 100];
    let pixels: Vec<Vec3> = cloudy(size, 2).into_iter().map(|pixel| pixel * 1.0e-4).collect();
    world.set_sky(Sky::equirectangular(size[0], &pixels).expect("sound pixels"));
    lights.upload(&world).expect("room enough");
    compare(&world, &run(&mut lights, &pipeline, &own), 1400, "another map");
    world.remove_instance(sky).expect("an instance");
    lights.upload(&world).expect("room enough");
    let outputs = run(&mut lights, &pipeline, &own);
    assert!(outputs.iter().all(|output| output.sample.instance != slot && output.hit.dist < 1.0e18));
}

#[test]
fn the_sky_is_left_out_while_its_patches_wait_to_be_sent() {
    let mut planner = LightPlanner::new(PlanLimits::default().with_frame_bytes(0));
    let mut world = mixed_world();
    let slot = world.sky().and_then(|(sky, _)| world.slot(sky)).expect("a sky");
    let mut sky_of = |world: &LightWorld, bytes| {
        planner.set_frame_bytes(bytes);
        planner.reserve(world).expect("room enough").plan();
        planner.params().sky
    };
    assert_eq!(sky_of(&world, Some(0)), NO_INSTANCE);
    assert_eq!(sky_of(&world, None), slot);
    // Another map has other patches, and the former ones do not fit it.
    world.set_sky(Sky::equirectangular(128, &cloudy([128, 64], 3)).expect("sound pixels"));
    assert_eq!(sky_of(&world, Some(0)), NO_INSTANCE);
    assert_eq!(sky_of(&world, None), slot);
}
