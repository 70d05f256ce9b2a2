//! The probabilities of the last frame.

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::gpu::GpuLights;
use girandole::{
    Effects, FrameBudget, InstanceKey, Light, LightTree, LightWorld, ORIGIN_GRID, OriginMode, Placement, Policy,
    TreeKey, wgpu,
};
use wgpu::util::DeviceExt;

use crate::gpu::read;
use testbed::common::gpu as device;
use testbed::testing::support::Rng;

const TEXT: &str = "
    struct Query { position: vec3<f32>, instance: u32, light: u32, a: u32, b: u32, c: u32 }
    @group(2) @binding(0) var<storage, read> queries: array<Query>;
    @group(2) @binding(1) var<storage, read_write> answers: array<vec4<f32>>;
    @compute @workgroup_size(64) fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
        if id.x >= arrayLength(&queries) {
            return;
        }
        let q = queries[id.x];
        let at = light_surface_point(q.position, vec3(0.0, 1.0, 0.0));
        answers[id.x] = vec4(
            light_pmf(at, q.instance, q.light), light_pmf_previous(at, q.instance, q.light),
            f32(light_generation(q.instance)), 0.0,
        );
    }
";

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Query {
    position: [f32; 3],
    instance: u32,
    light: u32,
    padding: [u32; 3],
}

struct Asker {
    device: wgpu::Device,
    queue: wgpu::Queue,
    lights: GpuLights,
    own: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

impl Asker {
    fn new() -> Self {
        // Eight storage buffers of the lights, and two of the test.
        let limits = wgpu::Limits { max_storage_buffers_per_shader_stage: 10, ..wgpu::Limits::default() };
        let adapter = device::find_adapter(None).expect("an adapter");
        let (device, queue) =
            device::open_device(&adapter, wgpu::Features::empty(), limits).expect("ten storage buffers");
        let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
        lights.keep_previous(true);
        let shader = lights.shader(0, Effects::all()).with_previous(1);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(shader.join(TEXT).into()),
        });
        let entry = |binding, read_only| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let own = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &[entry(0, true), entry(1, false)],
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&shader.layout), Some(&shader.layout), Some(&own)],
            ..Default::default()
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: Some(&layout),
            module: &module,
            entry_point: Some("ask"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        Self { device, queue, lights, own, pipeline }
    }

    /// Uploads a frame and asks for the probabilities of lights: now, and in the last frame.
    fn frame(&mut self, world: &mut LightWorld, queries: &[Query]) -> Vec<[f32; 4]> {
        let Self { device, queue, lights, own, pipeline } = self;
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        lights.sync(world, FrameBudget::NONE, &mut encoder).expect("room enough");
        let input = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: None,
            contents: bytemuck::cast_slice(queries),
            usage: wgpu::BufferUsages::STORAGE,
        });
        let output = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 16 * queries.len() as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: own,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: input.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: output.as_entire_binding() },
            ],
        });
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, lights.bind_group(), &[]);
            pass.set_bind_group(1, lights.previous_bind_group(), &[]);
            pass.set_bind_group(2, &group, &[]);
            pass.dispatch_workgroups((queries.len() as u32).div_ceil(64), 1, 1);
        }
        queue.submit([encoder.finish()]);
        read(device, queue, &output)
    }
}

fn tree(world: &mut LightWorld, rng: &mut Rng, round: u32) -> TreeKey {
    let light = |rng: &mut Rng| {
        let (at, emission) = (rng.position(4.0), Vec3::splat(rng.between(1.0, 9.0)));
        match round {
            // Other layouts of nodes and lights.
            8.. => Light::spot(at, Vec3::NEG_Y, 0.2, 1.4, emission).with_range(300.0),
            _ => Light::point(at, emission),
        }
    };
    let count = 4 + 60 * (round as usize % 3);
    world.add_tree(LightTree::new((0..count).map(|_| light(rng)).collect()).expect("valid"))
}

#[test]
fn the_last_frames_probabilities_are_those_that_it_had() {
    let (mut asker, mut world, mut rng) = (Asker::new(), LightWorld::new(), Rng(71));
    let mut instances: Vec<(InstanceKey, u32)> = Vec::new();
    let mut before: Option<(Vec<Query>, Vec<[f32; 4]>)> = None;
    let (mut compared, mut gone) = (0, 0);
    for round in 0..20 {
        // Growth, moves, removals whose slots are used again, edits, and frames without any change.
        if round % 5 != 4 {
            for _ in 0..1 + round % 7 * 9 {
                let tree = tree(&mut world, &mut rng, round);
                let lights = world.tree(tree).expect("it lives").lights().len() as u32;
                let at = Placement::at(rng.position(30.0).as_dvec3());
                let key = world.add_instance(tree, at, Policy::Budgeted).expect("valid");
                instances.push((key, lights));
            }
            for i in 0..instances.len() {
                match rng.bits() % 10 {
                    0 => {
                        let scale = Mat3::IDENTITY * if round > 12 { 2.0 } else { 1.0 };
                        let at = Placement { linear: scale, ..Placement::at(rng.position(30.0).as_dvec3()) };
                        world.move_instance(instances[i].0, at).expect("valid");
                    }
                    1 => {
                        let tree = world.instance_tree(instances[i].0).expect("it lives");
                        world.set_emission(tree, 1, Vec3::splat(rng.between(1.0, 50.0))).expect("valid");
                    }
                    2 if i % 3 == 0 => world.set_enabled(instances[i].0, rng.bits() % 2 == 0).expect("it lives"),
                    _ => {}
                }
            }
            if round % 3 == 1 {
                for _ in 0..instances.len() / 3 {
                    let index = (rng.bits() % instances.len() as u64) as usize;
                    world.remove_instance(instances.swap_remove(index).0).expect("it lives");
                }
            }
        }
        // The queries of the last frame first, then others.
        let asked = before.as_ref().map_or(0, |(queries, _)| queries.len());
        let mut queries = before.as_ref().map_or_else(Vec::new, |(queries, _)| queries.clone());
        let fresh: Vec<Query> = (0..200)
            .map(|_| {
                let (key, lights) = instances[(rng.bits() % instances.len() as u64) as usize];
                Query {
                    position: rng.position(30.0).to_array(),
                    instance: world.slot(key).expect("it lives"),
                    light: rng.bits() as u32 % lights,
                    padding: [0; 3],
                }
            })
            .collect();
        queries.extend(&fresh);
        let answers = asker.frame(&mut world, &queries);
        if let Some((_, then)) = &before {
            for ((query, now), then) in queries.iter().zip(&answers).zip(then).take(asked) {
                let generation = world.instance_at(query.instance).and_then(|key| world.generation(key)).unwrap_or(0);
                assert_eq!(now[2], generation as f32);
                if now[2] == then[2] {
                    compared += usize::from(then[0] > 0.0);
                    assert_eq!(now[1], then[0], "round {round}");
                } else {
                    gone += 1;
                    assert_eq!(now[1], 0.0, "round {round}");
                }
            }
        }
        before = Some((fresh, answers[asked..].to_vec()));
    }
    assert!(compared > 1000 && gone > 50, "{compared} {gone}");
}

#[test]
fn before_the_first_frame_there_were_no_lights() {
    let (mut asker, mut world) = (Asker::new(), LightWorld::new());
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid"));
    let key = world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted).expect("valid");
    let query = Query { position: [0.0; 3], instance: world.slot(key).expect("it lives"), light: 0, padding: [0; 3] };
    let answers: Vec<_> = (0..3).map(|_| asker.frame(&mut world, &[query])[0]).collect();
    assert_eq!(answers, [[1.0, 0.0, 1.0, 0.0], [1.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, 0.0]]);
}

#[test]
fn a_build_that_was_dropped_belongs_to_the_frame_in_which_it_is_made() {
    let (mut asker, mut world) = (Asker::new(), LightWorld::new());
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).expect("valid"));
    let mut add = |x| world.add_instance(tree, Placement::at(Vec3::new(x, 1.0, 0.0).as_dvec3()), Policy::Budgeted);
    let keys: Vec<_> = (0..40).map(|i| add(3.0 * i as f32 - 60.0).expect("valid")).collect();
    let query = |key: &InstanceKey| Query {
        position: [0.0; 3],
        instance: world.slot(*key).expect("it lives"),
        light: 0,
        padding: [0; 3],
    };
    let queries: Vec<_> = keys.iter().map(query).collect();
    let first = asker.frame(&mut world, &queries);
    for (key, x) in keys.iter().zip(0..) {
        world.move_instance(*key, Placement::at(Vec3::new(50.0 - x as f32, 2.0, 9.0).as_dvec3())).expect("valid");
    }
    let mut encoder = asker.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    asker.lights.sync(&mut world, FrameBudget::NONE, &mut encoder).expect("room enough");
    drop(encoder);
    // Nothing changes any more, but the build is recorded again.
    let [made, next] = [(); 2].map(|_| asker.frame(&mut world, &queries));
    assert!(made.iter().zip(&first).any(|(made, first)| made[0] != first[0]));
    assert!(made.iter().zip(&next).all(|(made, next)| made[0] == next[0] && made[0] == next[1]));
}

#[test]
fn the_last_frame_keeps_the_origin_that_it_had() {
    let (mut asker, mut world, mut rng) = (Asker::new(), LightWorld::new(), Rng(72));
    world.set_origin_mode(OriginMode::Following).expect("zero is on the grid");
    let start = DVec3::new(6.0e6, -40.0, 8.0e6);
    world.set_viewpoint(start).expect("within the limits");
    let mut keys = Vec::new();
    for round in 0..30 {
        let tree = tree(&mut world, &mut rng, round % 8);
        let at = Placement::at(start + rng.position(60.0).as_dvec3());
        keys.push(world.add_instance(tree, at, Policy::Budgeted).expect("valid"));
    }
    let queries: Vec<Query> = (0..200)
        .map(|i| Query {
            position: (start + rng.position(50.0).as_dvec3() - world.origin()).as_vec3().to_array(),
            instance: world.slot(keys[i % keys.len()]).expect("it lives"),
            light: i as u32 % 4,
            padding: [0; 3],
        })
        .collect();
    let first = asker.frame(&mut world, &queries);
    // The queries stay where they were, relative to the origin of the first frame.
    let mut last = first.clone();
    for step in [1.2, 2.4, 6.0e3, 6.0e3] {
        world.set_viewpoint(start + DVec3::X * step * ORIGIN_GRID).expect("within the limits");
        let answers = asker.frame(&mut world, &queries);
        assert!(answers.iter().zip(&last).all(|(now, last)| now[1] == last[0]), "{step}");
        last = answers;
    }
    assert!(first.iter().filter(|answer| answer[0] > 0.0).count() > 60);
    assert!(first.iter().zip(&last).any(|(first, last)| first[0] != last[0]), "the origin has moved");
}
