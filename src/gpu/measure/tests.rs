use glam::{DVec3, Vec3};

use super::*;
use crate::gpu::testing::{gpu, gpu_lights, limited_gpu, read};
use crate::instance::placement::Placement;
use crate::light::Light;
use crate::policy::Policy;
use crate::tree::LightTree;
use crate::world::LightWorld;

/// A world of one tree of point lights with some instances.
fn lamps(instances: u32, lights: u32) -> LightWorld {
    let mut world = LightWorld::new();
    let lamp = |i: u32| Light::point(Vec3::new(i as f32, 3.0, 0.0), Vec3::ONE);
    let tree = world.add_tree(LightTree::new((0..lights).map(lamp).collect()).expect("valid"));
    for i in 0..instances {
        let place = DVec3::new(f64::from(i * i % 97), 0.0, f64::from(i % 31));
        world.add_instance(tree, Placement::at(place), Policy::Static).expect("valid");
    }
    world
}

fn upload(device: &wgpu::Device, queue: &wgpu::Queue, world: LightWorld) -> GpuLights {
    let mut lights = GpuLights::new(device, queue).expect("default limits are enough");
    lights.upload(&world).expect("room enough");
    lights
}

#[test]
fn a_build_in_separate_passes_makes_the_same_top_level_as_a_build_in_one_pass() {
    let (device, queue) = gpu();
    let mut lights = upload(&device, &queue, lamps(700, 3));
    let mut build = |is_timed: bool| {
        lights.top_status.invalidate();
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(lights.buffers()[1], 0, None);
        let stages = if is_timed {
            build_top_timed(&mut lights, &mut encoder, None)
        } else {
            lights.build_top(&mut encoder);
            Vec::new()
        };
        queue.submit([encoder.finish()]);
        (read::<u32>(&device, &queue, lights.buffers()[1]), stages)
    };
    let (together, _) = build(false);
    let (apart, stages) = build(true);
    assert!(apart == together && apart.iter().any(|word| *word != 0));
    assert!(stages.len() >= 4 && stages.len() <= MAX_TOP_STAGES as usize, "{stages:?}");
    assert!(stages.iter().all(|stage| stage.dispatches > 0), "{stages:?}");
    let sort: Vec<_> = stages.iter().filter(|stage| stage.name == "sort").collect();
    assert!(matches!(sort[..], [TopStage { dispatches: 4, .. }]), "{stages:?}");
}

#[test]
fn a_build_before_the_first_upload_has_no_stages() {
    let (device, _) = gpu();
    let mut lights = gpu_lights();
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    assert_eq!(build_top_timed(&mut lights, &mut encoder, None), []);
}

#[test]
fn each_stage_writes_the_timestamps_of_its_start_and_end() {
    let features = wgpu::Features::TIMESTAMP_QUERY;
    let (device, queue) = limited_gpu(&wgpu::Limits::default(), features);
    let mut lights = upload(&device, &queue, lamps(700, 3));
    let count = 2 * MAX_TOP_STAGES;
    let queries =
        device.create_query_set(&wgpu::QuerySetDescriptor { label: None, ty: wgpu::QueryType::Timestamp, count });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let stages = build_top_timed(&mut lights, &mut encoder, Some(&queries));
    let written = 2 * stages.len() as u32;
    let ticks = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: 8 * u64::from(written),
        usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    encoder.resolve_query_set(&queries, 0..written, &ticks, 0);
    queue.submit([encoder.finish()]);
    let ticks = read::<u64>(&device, &queue, &ticks);
    assert!(ticks[0] > 0 && ticks.is_sorted(), "{ticks:?}");
}
