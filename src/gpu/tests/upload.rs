//! Uploads without enough memory, and what an upload compiles.

use glam::{DVec3, Mat3, Vec3};

use crate::gpu::memory::refusals::Refusals;
use crate::gpu::testing::{gpu, gpu_lights, noop, read, record_batch};
use crate::gpu::*;
use crate::instance::placement::Placement;
use crate::light::{DirectionalLight, Light};
use crate::policy::Policy;
use crate::tree::LightTree;
use crate::world::LightWorld;
use testbed::common::batch::{SampleRecord, SampleRequest};

/// Fewer than the first buffers hold.
fn small_world() -> LightWorld {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid"));
    world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
    world
}

/// Adds more trees, lights and instances than the first buffers hold, with all effects, so that
/// every buffer grows or changes its layout.
fn grow(world: &mut LightWorld) {
    let spot = |i: u32| Light::spot(Vec3::new(i as f32, 1.0, 0.0), Vec3::NEG_Y, 0.1, 1.4, Vec3::ONE).with_range(99.0);
    let scale = Mat3::from_diagonal(Vec3::new(1.0, 2.0, 3.0));
    for i in 0..40 {
        let tree = world.add_tree(LightTree::new((0..20).map(spot).collect()).expect("valid"));
        for j in 0..10 {
            let translation = DVec3::new(f64::from(i), 0.0, f64::from(j));
            world.add_instance(tree, Placement { linear: scale, translation }, Policy::Static).expect("valid");
        }
    }
    let sun = DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::splat(0.1) };
    world.add_directional(sun).expect("valid");
}

#[test]
fn each_buffer_of_an_upload_may_be_refused_and_the_next_upload_sends_what_is_missing() {
    let (device, queue) = noop();
    let mut refused = Vec::new();
    for successes in 0.. {
        let mut world = small_world();
        let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
        lights.upload(&world).expect("room enough");
        let before = (lights.bind_group().clone(), lights.effects());
        grow(&mut world);
        let refusals = Refusals::of_buffers_after(successes);
        let result = lights.upload(&world);
        if refusals.count() == 0 {
            assert!(result.is_ok_and(|report| (report.trees, report.instances) == (40, 400)));
            break;
        }
        drop(refusals);
        let Err(GpuError::OutOfMemory { what, bytes }) = result else { panic!("{result:?}") };
        assert!(bytes > 0, "{what}");
        let after = (lights.bind_group().clone(), lights.effects());
        assert!(after == before, "{what}: shaders go on reading what they read");
        refused.push(what);
        let report = lights.upload(&world).expect("there is memory again");
        assert!(report.trees >= 40 && report.instances >= 400, "{what}: {report:?}");
        assert_eq!(lights.upload(&world), Ok(UploadReport::default()));
    }
    for what in ["light tree nodes", "lights", "instances", "light trees", "sampling parameters", "sort keys"] {
        assert!(refused.contains(&what), "{what} never refused: {refused:?}");
    }
}

#[test]
fn each_buffer_of_new_lights_may_be_refused() {
    let (device, queue) = noop();
    for successes in 0.. {
        let refusals = Refusals::of_buffers_after(successes);
        let result = GpuLights::new(&device, &queue);
        if refusals.count() == 0 {
            assert!(result.is_ok() && successes > 5, "{successes} buffers");
            break;
        }
        assert!(matches!(result.err(), Some(GpuError::OutOfMemory { .. })));
    }
    let _refusals = Refusals::of_other_memory();
    let refused = GpuError::OutOfMemory { what: "pipelines", bytes: 0 };
    assert_eq!(GpuLights::new(&device, &queue).err(), Some(refused));
}

/// Builds the top level if that is due, and samples at a few shading points.
fn sample(lights: &mut GpuLights) -> Vec<SampleRecord> {
    let (device, queue) = gpu();
    let request = |i: u32| SampleRequest {
        position: [i as f32 * 0.6, 0.0, (i % 7) as f32],
        normal: [0.0, 1.0, 0.0],
        u: [0.1, 0.3, 0.5, 0.7].map(|u| (u + i as f32 * 0.618) % 1.0),
        ..SampleRequest::default()
    };
    let requests: Vec<_> = (0..64).map(request).collect();
    // The pipeline for all effects: no other is made.
    let (encoder, output) = record_batch(lights, &requests, Effects::all());
    queue.submit([encoder.finish()]);
    read(&device, &queue, &output)
}

fn count_lit(records: &[SampleRecord]) -> usize {
    records.iter().filter(|record| record.pmf > 0.0).count()
}

#[test]
fn a_refused_buffer_leaves_the_lights_and_a_due_build_in_place() {
    let mut world = small_world();
    let mut lights = gpu_lights();
    lights.upload(&world).expect("room enough");
    let before = sample(&mut lights);
    assert_eq!(count_lit(&before), 64);
    grow(&mut world);
    for successes in 0.. {
        let refusals = Refusals::of_buffers_after(successes);
        let result = lights.upload(&world);
        if refusals.count() == 0 {
            assert!(result.is_ok() && successes > 5, "{successes} buffers");
            break;
        }
        assert!(matches!(result, Err(GpuError::OutOfMemory { .. })));
        lights.top_status.invalidate();
        assert!(sample(&mut lights) == before, "refused after {successes} buffers");
    }
}

#[test]
fn refused_records_leave_no_light_until_the_next_upload_sends_all() {
    let mut world = small_world();
    let mut lights = gpu_lights();
    lights.upload(&world).expect("room enough");
    grow(&mut world);
    let seen = lights.revision();
    for _ in 0..2 {
        let _refusals = Refusals::of_other_memory();
        let Err(GpuError::OutOfMemory { what: "uploaded records", bytes }) = lights.upload(&world) else {
            panic!("the writes are refused");
        };
        assert!(bytes > 40 * 20 * 64, "{bytes} bytes would have been sent");
        assert_eq!(count_lit(&sample(&mut lights)), 0);
        assert_eq!(lights.revision(), seen, "readers of changes miss none");
    }
    let report = lights.upload(&world).expect("there is memory again");
    // Slot 0, which no instance has, is sent too.
    assert_eq!((report.trees, report.instances), (41, 402));
    let mut fresh = gpu_lights();
    fresh.upload(&world).expect("room enough");
    let expected = sample(&mut fresh);
    assert!(count_lit(&expected) > 32);
    assert!(sample(&mut lights) == expected);
}

#[test]
fn an_upload_submits_only_growth_and_scattered_records() {
    let (device, queue) = noop();
    let mut world = small_world();
    let tree = world.trees().next().expect("a tree");
    let place = |i: u32| Placement::at(DVec3::new(f64::from(i), 0.0, 0.0));
    let keys: Vec<_> = (0..400).map(|i| world.add_instance(tree, place(i), Policy::Static).expect("valid")).collect();
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    let submissions = |world: &mut LightWorld, lights: &mut GpuLights| {
        let before = lights.player.submissions;
        lights.upload(world).expect("room enough");
        lights.player.submissions - before
    };
    assert!(submissions(&mut world, &mut lights) > 0, "the buffers grow");
    assert_eq!(submissions(&mut world, &mut lights), 0, "nothing has changed");
    world.move_instance(keys[7], place(9)).expect("valid");
    assert_eq!(submissions(&mut world, &mut lights), 0, "one write");
    for key in keys.iter().step_by(2) {
        world.move_instance(*key, place(999)).expect("valid");
    }
    assert_eq!(submissions(&mut world, &mut lights), 1, "the pass that scatters");
}
