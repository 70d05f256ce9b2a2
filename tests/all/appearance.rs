//! What instances change about the lights of their trees: lights that are disabled, and user data.

use girandole::glam::{DVec3, Vec3};
use girandole::gpu::{GpuLights, wgsl};
use girandole::{Effects, FrameBudget, InstanceKey, Light, LightId, LightWorld, Placement, Policy, ShadingPoint};

use crate::gpu::{ask, gpu, requests, sample};
use crate::support::{Rng, SPLITS, all_pmfs, user_data_of};

/// Cars in a row along x that share a tree of one lamp.
fn cars(count: u32) -> (LightWorld, Vec<InstanceKey>) {
    let mut world = LightWorld::new();
    let tree = world.add_tree(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid");
    let at = |i: u32| Placement::at(DVec3::X * 3.0 * f64::from(i));
    let keys = (0..count).map(|i| world.add_instance(tree, at(i), Policy::Static).expect("valid")).collect();
    (world, keys)
}

#[test]
fn disabled_instances_send_nothing_and_come_back_with_the_same_probabilities() {
    let mut rng = Rng(300);
    let mut world = rng.world(4, 20, 5, 15.0);
    let keys: Vec<InstanceKey> = world.instances().collect();
    let shading_point = ShadingPoint::volume(rng.place(15.0));
    let before = all_pmfs(&world.sampler(), &shading_point);
    let disabled: Vec<InstanceKey> = keys.iter().copied().step_by(3).collect();
    for key in &disabled {
        world.set_enabled(*key, false).expect("it lives");
        assert_eq!((world.is_enabled(*key), world.slot(*key).is_some()), (Some(false), true));
    }
    let sampler = world.sampler();
    let mut others = 0;
    for (light, pmf) in all_pmfs(&sampler, &shading_point) {
        let LightId::Local { instance, .. } = light else { continue };
        if disabled.contains(&instance) {
            assert_eq!(pmf, 0.0);
            assert_eq!(sampler.sample_light(&shading_point, light, [0.5; 2]), None);
            assert_eq!(sampler.pdf(&shading_point, light, rng.place(15.0)), 0.0);
        } else {
            others += usize::from(pmf > 0.0);
        }
    }
    assert!(others > 50, "{others}");
    for key in &disabled {
        world.set_enabled(*key, true).expect("it lives");
    }
    assert_eq!(all_pmfs(&world.sampler(), &shading_point), before);
}

#[test]
fn edits_of_one_instance_send_one_record_and_edits_without_effect_send_nothing() {
    let (device, queue) = gpu();
    let (mut world, keys) = cars(5000);
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    let mut upload = |world: &mut LightWorld| {
        world.update(FrameBudget::NONE);
        let delta = world.take_delta();
        let report = lights.upload(world, &delta).expect("room enough");
        let needs_build = format!("{lights:?}").contains("needs_build: true");
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        lights.build_top(&mut encoder);
        queue.submit([encoder.finish()]);
        (report.bytes, report.trees, report.instances, needs_build)
    };
    upload(&mut world);
    let nothing = (0, 0, 0, false);
    let car = keys[77];
    // A rigid instance has 80 bytes. User data is no matter of the top level.
    world.set_user_data(car, 5).expect("it lives");
    assert_eq!(upload(&mut world), (80, 0, 1, false));
    world.set_user_data(car, 5).expect("it lives");
    world.set_enabled(car, true).expect("it lives");
    assert_eq!(upload(&mut world), nothing);
    world.set_enabled(car, false).expect("it lives");
    assert_eq!(upload(&mut world), (80, 0, 1, true));
    // The record of an instance that is not shown does not change.
    world.set_user_data(car, 6).expect("it lives");
    assert_eq!(upload(&mut world), nothing);
    world.set_enabled(car, true).expect("it lives");
    assert_eq!(upload(&mut world), (80, 0, 1, true));
    assert_eq!((world.tree_count(), world.user_data(car)), (1, Some(6)));
}

#[test]
fn keys_of_removed_instances_are_refused() {
    let (mut world, keys) = cars(2);
    let gone = keys[0];
    world.remove_instance(gone).expect("it lives");
    let refused = Err(girandole::WorldError::NoSuchInstance(gone));
    assert_eq!(world.set_enabled(gone, false), refused);
    assert_eq!(world.set_user_data(gone, 1), refused);
    assert_eq!((world.is_enabled(gone), world.user_data(gone)), (None, None));
    // The next instance in the slot has the properties of any new instance.
    let tree = world.trees().next().expect("a tree");
    let new = world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
    assert_eq!((world.is_enabled(new), world.user_data(new)), (Some(true), Some(0)));
}

#[test]
fn every_sample_returns_the_user_data_of_its_instance_on_both_sides() {
    let (device, queue) = gpu();
    let mut rng = Rng(301);
    let mut world = rng.varied_world(5, 20, 6, 15.0);
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    let requests = requests(&mut rng, 512, 15.0);
    let mut samples = 0;
    for splits in SPLITS {
        let sampler = world.sampler().with_splits(splits);
        for request in &requests {
            let at = crate::gpu::shading_point(request);
            let Some(sample) = sampler.sample(&at, request.u) else { continue };
            let expected = match sample.light {
                LightId::Local { instance, .. } => user_data_of(&world, instance),
                LightId::Directional(_) => 0,
            };
            assert_eq!(sample.user_data, expected);
            samples += 1;
        }
    }
    assert!(samples > 300, "{samples}");
    sample(&mut lights, &mut world, SPLITS[0], &requests);
    let text = wgsl(1, Effects::empty())
        + "@group(0) @binding(0) var<storage, read> questions: array<u32>;
        @group(0) @binding(1) var<storage, read_write> answers: array<u32>;
        @compute @workgroup_size(64) fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
            if id.x < arrayLength(&questions) { answers[id.x] = light_user_data(questions[id.x]); }
        }";
    let keys: Vec<InstanceKey> = world.instances().collect();
    let mut questions: Vec<u32> = keys.iter().map(|key| world.slot(*key).expect("it lives")).collect();
    questions.extend([u32::MAX, 1000]);
    let answers: Vec<u32> = ask(&mut lights, text, &questions, questions.len());
    let shown = |key: &InstanceKey| world.is_enabled(*key) == Some(true);
    let expected = keys.iter().map(|key| if shown(key) { user_data_of(&world, *key) } else { 0 }).chain([0, 0]);
    assert_eq!(answers, expected.collect::<Vec<u32>>());
}
