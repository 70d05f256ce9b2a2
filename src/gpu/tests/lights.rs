//! [`GpuLights`] as engines see it.

use std::fmt;

use glam::{DVec3, Vec3};

use crate::gpu::memory::refusals::Refusals;
use crate::gpu::testing::{gpu, gpu_lights, noop, read};
use crate::gpu::*;
use crate::instance::placement::Placement;
use crate::light::Light;
use crate::policy::Policy;
use crate::scheduler::FrameBudget;
use crate::tree::LightTree;
use crate::world::LightWorld;

#[test]
fn every_public_type_has_a_debug_form_and_may_be_shared_by_threads() {
    fn check<T: fmt::Debug + Send + Sync>() {}
    check::<GpuLights>();
    check::<GpuError>();
    check::<LightShader>();
    check::<ShaderNameError>();
    check::<UploadReport>();
    let lights = gpu_lights();
    let text = format!("{lights:?}");
    assert!(text.contains("instance_slots: 0") && text.contains("needs_build: true"), "{text}");
}

#[test]
fn two_builds_of_one_upload_give_the_same_top_level() {
    let (device, queue) = gpu();
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid"));
    for i in 0..700_u32 {
        let place = DVec3::new(f64::from(i * i % 97), 0.0, f64::from(i % 31));
        world.add_instance(tree, Placement::at(place), Policy::Static).expect("valid");
    }
    let mut lights = gpu_lights();
    lights.upload(&world).expect("room enough");
    let mut record = || {
        lights.top_status.invalidate();
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        lights.build_top(&mut encoder);
        encoder.finish()
    };
    let [dropped, once, again] = [record(), record(), record()];
    drop(dropped);
    queue.submit([once]);
    let nodes: Vec<u32> = read(&device, &queue, lights.buffers()[1]);
    assert!(nodes.iter().any(|word| *word != 0));
    queue.submit([again]);
    assert!(read::<u32>(&device, &queue, lights.buffers()[1]) == nodes);
}

#[test]
fn a_frame_without_changes_writes_nothing_into_the_top_level() {
    let (device, queue) = gpu();
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid"));
    for i in 0..300_u32 {
        world.add_instance(tree, Placement::at(DVec3::X * f64::from(i)), Policy::Static).expect("valid");
    }
    let mut lights = gpu_lights();
    let frame = |lights: &mut GpuLights, world: &mut LightWorld| {
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        lights.sync(world, FrameBudget::NONE, &mut encoder).expect("room enough");
        queue.submit([encoder.finish()]);
    };
    frame(&mut lights, &mut world);
    // A build would replace this.
    let nodes = lights.buffers()[1];
    let garbage = vec![0x5a_u8; nodes.size() as usize];
    queue.write_buffer(nodes, 0, &garbage);
    frame(&mut lights, &mut world);
    frame(&mut lights, &mut world);
    assert!(read::<u8>(&device, &queue, lights.buffers()[1]) == garbage);
    let moved = world.instances().next().expect("300 instances");
    world.move_instance(moved, Placement::at(DVec3::Y)).expect("valid");
    frame(&mut lights, &mut world);
    assert!(read::<u8>(&device, &queue, lights.buffers()[1]) != garbage);
}

#[test]
fn the_report_of_a_frame_covers_frames_that_were_refused() {
    let (device, queue) = noop();
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid"));
    let add = |world: &mut LightWorld| world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
    let keys = [0; 3].map(|_| add(&mut world));
    let slots = keys.map(|key| world.slot(key).expect("it lives"));
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    let mut frame = |world: &mut LightWorld| {
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let report = lights.sync(world, FrameBudget::NONE, &mut encoder);
        queue.submit([encoder.finish()]);
        report
    };
    let lists = |world: &LightWorld, report: SyncReport| {
        let changes = world.changes_since(report.since);
        let moved: Vec<u32> = changes.moved_instances().collect();
        (moved, changes.added_instances().collect::<Vec<_>>(), changes.removed_instances().collect::<Vec<_>>())
    };
    let first = frame(&mut world).expect("room enough");
    assert_eq!(lists(&world, first), (vec![], slots.to_vec(), vec![]));
    assert_eq!(world.changes_since(first.since).origin_shift(), None);
    world.move_instance(keys[0], Placement::at(DVec3::X)).expect("valid");
    world.set_origin_near(2048.0 * DVec3::X).expect("near");
    {
        let _refusals = Refusals::of_other_memory();
        assert!(matches!(frame(&mut world), Err(GpuError::OutOfMemory { .. })));
    }
    world.remove_instance(keys[2]).expect("it lives");
    let reused = add(&mut world);
    assert_eq!(world.slot(reused), Some(slots[2]));
    world.set_origin_near(4096.0 * DVec3::X).expect("near");
    let second = frame(&mut world).expect("there is memory again");
    assert_eq!(lists(&world, second), (vec![slots[0]], vec![slots[2]], vec![slots[2]]));
    assert_eq!(world.changes_since(second.since).origin_shift(), Some(4096.0 * DVec3::X));
    let third = frame(&mut world).expect("room enough");
    assert!(world.changes_since(third.since).is_empty());
    assert_eq!(third.upload, UploadReport::default());
}
