//! What instances change about the lights of their trees: factors, lights that are disabled, and
//! user data.

use girandole::glam::{DVec3, Vec3};
use girandole::gpu::{GpuLights, wgsl};
use girandole::light::MAX_EMISSION;
use girandole::{
    Effects, FrameBudget, InstanceKey, Light, LightId, LightWorld, MAX_FACTOR, Placement, Policy, ShadingPoint,
};

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
    // The first factor lengthens the records of all instances, which the GPU converts. From then on
    // one record of 96 bytes is sent.
    world.set_factor(car, Vec3::splat(0.5)).expect("valid");
    let (bytes, trees, instances, needs_build) = upload(&mut world);
    assert!(bytes < 1000 && (trees, instances, needs_build) == (0, 1, true), "{bytes}");
    world.set_factor(car, Vec3::splat(0.5)).expect("valid");
    assert_eq!(upload(&mut world), nothing);
    world.set_factor(car, Vec3::new(0.1, 0.2, 0.3)).expect("valid");
    assert_eq!(upload(&mut world), (96, 0, 1, true));
    assert_eq!(world.tree_count(), 1);
}

#[test]
fn one_of_five_thousand_cars_dims_and_the_mean_follows() {
    let (mut world, keys) = cars(5000);
    let ground = ShadingPoint::surface(Vec3::new(231.0, 0.0, 0.5), Vec3::Y);
    // The lamp of car i is 1 m high and has an intensity of 1 cd.
    let lux_of = |i: usize| {
        let toward = to_lamp(3.0 * i as f64 - 231.0);
        toward.y / toward.length().powi(3)
    };
    for factor in [Vec3::ONE, Vec3::new(0.25, 0.5, 0.125), Vec3::new(8.0, 0.0, 2.0), Vec3::ZERO] {
        world.set_factor(keys[77], factor).expect("valid");
        let of_car = |i: usize| if i == 77 { factor.as_dvec3() } else { DVec3::ONE };
        let exact: DVec3 = (0..keys.len()).map(|i| of_car(i) * lux_of(i)).sum();
        let sampler = world.sampler();
        let lux = |radiance: Vec3, direction: Vec3| radiance.as_dvec3() * f64::from(direction.dot(ground.normal));
        let lit = sampler.all_lights().filter_map(|light| sampler.sample_light(&ground, light, [0.5; 2]));
        let summed: DVec3 = lit.map(|incident| lux(incident.radiance, incident.direction)).sum();
        assert!((summed - exact).abs().max_element() < 1.0e-4 * exact.max_element(), "{summed} for {exact}");
        // The relative standard deviation of a sample of the green channel follows from all
        // probabilities.
        let mut pmfs = Vec::new();
        sampler.distribution(&ground, &mut pmfs);
        let second: f64 = (0..keys.len())
            .map(|i| (of_car(i).y * lux_of(i)).powi(2) / f64::from(pmfs[i]))
            .filter(|x| x.is_finite())
            .sum();
        let deviation = (second - exact.y * exact.y).max(0.0).sqrt();
        let (draws, mut rng) = (20_000, Rng(302));
        let draw = |rng: &mut Rng| {
            let sample = sampler.sample(&ground, [rng.unit(), rng.unit(), 0.5, 0.5])?;
            Some(lux(sample.incident.radiance, sample.incident.direction) / f64::from(sample.pmf))
        };
        let mean = (0..draws).filter_map(|_| draw(&mut rng)).sum::<DVec3>() / f64::from(draws);
        // Six standard deviations: a false alarm in one of 10^8 runs.
        let limit = 6.0 * deviation / f64::from(draws).sqrt();
        assert!((mean.y - exact.y).abs() <= limit, "{mean} for {exact}, within {limit}");
        assert!(limit < 0.2 * exact.y, "{limit} tells nothing");
    }
    assert_eq!(world.tree_count(), 1);
}

/// From the ground to a lamp that is so far away along x.
fn to_lamp(x: f64) -> DVec3 {
    DVec3::new(x, 1.0, -0.5)
}

#[test]
fn factors_change_probabilities_as_lights_of_that_emission_do() {
    let mut rng = Rng(303);
    let lights = rng.lights(40, 3.0);
    let mut worlds = [1.0, 4.0].map(|scale: f32| {
        let mut world = LightWorld::new();
        for (i, size) in [(0, 20.0), (1, 20.0), (2, 3.0)] {
            let share = if i == 1 { scale } else { 1.0 };
            let scaled = lights.iter().map(|light| Light { emission: light.emission * share, ..*light });
            let tree = world.add_tree(scaled.collect()).expect("valid");
            world.add_instance(tree, Rng(i).affine(size), Policy::Static).expect("valid");
        }
        world
    });
    let instance = worlds[0].instances().nth(1).expect("three instances");
    worlds[0].set_factor(instance, Vec3::splat(4.0)).expect("valid");
    for _ in 0..40 {
        let at = rng.shading_point(15.0);
        let [by_factor, by_light] = worlds.each_ref().map(|world| all_pmfs(&world.sampler(), &at));
        for ((light, a), (_, b)) in by_factor.iter().zip(&by_light) {
            // A power of two changes no mantissa.
            assert!((a - b).abs() <= 1.0e-5 * b, "{light:?}: {a} and {b}");
        }
    }
}

#[test]
fn the_greatest_and_the_least_factors_leave_all_results_finite() {
    let mut rng = Rng(304);
    for factor in [MAX_FACTOR, 1.0e-12, 1.0e-37, 1.0e-45, 0.0] {
        let mut world = LightWorld::new();
        let mut lights = rng.lights(30, 3.0);
        lights.extend([MAX_EMISSION, 1.0e-20].map(|candela| Light::point(rng.place(3.0), Vec3::splat(candela))));
        lights.push(Light::sphere(rng.place(3.0), 1.0, Vec3::splat(MAX_EMISSION)));
        let lamp = lights[30].aabb().center();
        let tree = world.add_tree(lights).expect("valid");
        let instance = world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
        let plain = world.add_instance(tree, Placement::at(DVec3::X), Policy::Static).expect("valid");
        world.set_factor(instance, Vec3::splat(factor)).expect("within the limits");
        let sampler = world.sampler();
        for i in 0..200 {
            let at = match i % 4 {
                // On the strongest lamp, and so near that the product exceeds f32.
                0 => ShadingPoint::volume(lamp),
                1 => ShadingPoint::volume(lamp + Vec3::X * 1.0e-6),
                _ => rng.shading_point(5.0),
            };
            let pmfs = all_pmfs(&sampler, &at);
            let sum: f64 = pmfs.iter().map(|(_, pmf)| f64::from(*pmf)).sum();
            assert!(sum <= 1.0 + 1.0e-4, "{factor}: {sum}");
            for (light, pmf) in pmfs {
                let Some(incident) = sampler.sample_light(&at, light, [rng.unit(), rng.unit()]) else { continue };
                assert!(incident.radiance.is_finite() && pmf > 0.0, "{factor}: {light:?} {incident:?} {pmf}");
                let LightId::Local { instance: from, .. } = light else { continue };
                assert!(from == plain || factor >= f32::MIN_POSITIVE, "{factor} shows nothing");
            }
        }
    }
}

#[test]
fn keys_of_removed_instances_are_refused() {
    let (mut world, keys) = cars(2);
    let gone = keys[0];
    world.remove_instance(gone).expect("it lives");
    let refused = Err(girandole::WorldError::NoSuchInstance(gone));
    assert_eq!(world.set_enabled(gone, false), refused);
    assert_eq!(world.set_user_data(gone, 1), refused);
    assert_eq!(world.set_factor(gone, Vec3::ZERO), refused);
    assert_eq!((world.is_enabled(gone), world.user_data(gone), world.factor(gone)), (None, None, None));
    // The next instance in the slot has the properties of any new instance.
    let tree = world.trees().next().expect("a tree");
    let new = world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
    assert_eq!(
        (world.is_enabled(new), world.user_data(new), world.factor(new)),
        (Some(true), Some(0), Some(Vec3::ONE))
    );
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
    let shown = |key: &InstanceKey| world.is_enabled(*key) == Some(true) && world.factor(*key) != Some(Vec3::ZERO);
    let expected = keys.iter().map(|key| if shown(key) { user_data_of(&world, *key) } else { 0 }).chain([0, 0]);
    assert_eq!(answers, expected.collect::<Vec<u32>>());
}
