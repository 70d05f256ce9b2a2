//! What instances change about the lights of their trees: factors, masks, lights that are disabled,
//! and user data.

use girandole::glam::{DVec3, Vec3};
use girandole::light::MAX_EMISSION;
use girandole::{
    Appearance, Effects, FrameBudget, InstanceKey, Light, LightId, LightTree, LightWorld, MAX_FACTOR, Placement,
    Policy, ShadingPoint, VisibilityTable,
};

use crate::gpu::{OTHER_PICKS, ask, close, gpu, gpu_lights, requests, sample};
use testbed::testing::support::{
    Rng, SPLITS, all_pmfs, assert_frequencies, assert_probabilities, distribution, place_tree, user_data_of,
};

/// Cars in a row along x that share a tree of one lamp.
fn cars(count: u32) -> (LightWorld, Vec<InstanceKey>) {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid"));
    let at = |i: u32| Placement::at(DVec3::X * 3.0 * f64::from(i));
    let keys = (0..count).map(|i| world.add_instance(tree, at(i), Policy::Static).expect("valid")).collect();
    (world, keys)
}

#[test]
fn edits_of_one_instance_send_one_record_and_edits_without_effect_send_nothing() {
    let (device, queue) = gpu();
    let (mut world, keys) = cars(5000);
    let mut lights = gpu_lights();
    let mut upload = |world: &mut LightWorld| {
        world.update(FrameBudget::NONE);
        let report = lights.upload(world).expect("room enough");
        let needs_build = format!("{lights:?}").contains("needs_build: true");
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        lights.build_top(&mut encoder);
        queue.submit([encoder.finish()]);
        (report.bytes, report.trees, report.instances, needs_build)
    };
    upload(&mut world);
    // The first mask makes room for the masks of the top level, so the uniforms are sent too: that
    // of shaders, those of the four passes of a sort, and those of three passes of the top level.
    let first_mask = 160 + 48 + 4 * 256 + 3 * 64;
    type Edit = fn(&mut Appearance);
    // An instance has 160 bytes. User data is no matter of the top level.
    let edits: [(&str, Edit, u64, bool); 11] = [
        ("user data", |a| a.user_data = 5, 160, false),
        ("no change", |a| (a.user_data, a.is_enabled) = (5, true), 0, false),
        ("disabled", |a| a.is_enabled = false, 160, true),
        ("user data of an instance that is not shown", |a| a.user_data = 6, 0, false),
        ("enabled", |a| a.is_enabled = true, 160, true),
        ("factor", |a| a.factor = Vec3::splat(0.5), 160, true),
        ("the same factor", |a| a.factor = Vec3::splat(0.5), 0, false),
        ("another factor", |a| a.factor = Vec3::new(0.1, 0.2, 0.3), 160, true),
        ("first mask", |a| a.mask = 3, first_mask, true),
        ("the same mask", |a| a.mask = 3, 0, false),
        ("another mask", |a| a.mask = 4, 160, true),
    ];
    for (name, edit, bytes, needs_build) in edits {
        world.set_appearance(keys[77], edit).expect("valid");
        assert_eq!(upload(&mut world), (bytes, 0, usize::from(bytes > 0), needs_build), "{name}");
    }
    assert_eq!((world.trees().len(), world.instance(keys[77]).map(|i| i.appearance.user_data)), (1, Some(6)));
}

#[test]
fn masked_lights_are_never_drawn_and_the_others_are_drawn_as_if_they_did_not_exist() {
    let mut rng = Rng(305);
    for masks in [[0b01, 0b10, 0b11], [0, 0b01, u32::MAX], [u32::MAX; 3]] {
        let mut world = rng.world(6, 12, 6, 15.0);
        let keys: Vec<InstanceKey> = world.instances().collect();
        for (key, mask) in keys.iter().zip(masks.into_iter().cycle()) {
            world.set_appearance(*key, |a| a.mask = mask).expect("it lives");
        }
        for mask in [0b01, 0b10, 0b100, 0, u32::MAX] {
            let mut seen = rng.shading_point(15.0);
            seen.normal = Vec3::ZERO;
            let seen = seen.with_mask(mask);
            let sampler = world.sampler();
            assert_probabilities(&sampler, &seen, 2000, &mut rng);
            let is_seen = |light: &LightId| match light {
                LightId::Local { instance, .. } => {
                    world.instance(*instance).expect("it lives").appearance.mask & mask != 0
                }
                LightId::Directional(_) => true,
                &_ => unreachable!("this version has no others"),
            };
            let mut total = 0.0;
            for (light, pmf) in all_pmfs(&sampler, &seen) {
                assert!(is_seen(&light) || pmf == 0.0, "{light:?} {mask:b}");
                total += pmf;
            }
            // In a volume every cluster that is seen can be estimated, so few draws are lost.
            assert!(total > 0.5, "{total} for {mask:b}");
        }
    }
}

/// Equal lamps 5 m above a square of 1 km. Each has one of 32 masks: at random, or in stripes of 3 m.
fn lamps_of_32_masks(count: u32, in_stripes: bool) -> LightWorld {
    let mut rng = Rng(5);
    let mut world = LightWorld::new();
    let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::splat(100.0))]).expect("valid"));
    for _ in 0..count {
        let (x, z) = (rng.between(-500.0, 500.0), rng.between(-500.0, 500.0));
        let at = Placement::at(DVec3::new(x.into(), 5.0, z.into()));
        let key = world.add_instance(lamp, at, Policy::Static).expect("valid");
        let number = if in_stripes { ((x + 500.0) * 0.32) as u32 } else { (32.0 * rng.unit()) as u32 };
        world.set_appearance(key, |a| a.mask = 1 << (number % 32)).expect("it lives");
    }
    world
}

/// The relative standard deviation of one sample, from the probabilities of all lights, which are points.
fn exact_sigma(world: &LightWorld, at: &ShadingPoint) -> f64 {
    let sampler = world.sampler();
    let pmfs = distribution(&sampler, at);
    let (mut total, mut second) = (0.0, 0.0);
    for (light, pmf) in sampler.all_lights().zip(pmfs) {
        let Some(incident) = sampler.sample_light(at, light, [0.5; 2]) else { continue };
        let lux = f64::from(incident.radiance.y * incident.direction.dot(at.normal));
        total += lux;
        second += lux * lux / f64::from(pmf);
    }
    (second / (total * total) - 1.0).sqrt()
}

#[test]
fn a_point_that_sees_one_of_32_lamps_expects_little_of_clusters_that_it_hardly_sees() {
    // It is 0.88 and 1.04 if a cluster weighs as much as if all of its lamps were seen. Measured: 0.68 and less.
    for (in_stripes, most) in [(false, 0.72), (true, 0.55)] {
        let world = lamps_of_32_masks(20_000, in_stripes);
        let mut rng = Rng(310);
        let points = 32;
        let sum: f64 = (0..points)
            .map(|_| Vec3::new(rng.between(-400.0, 400.0), 0.0, rng.between(-400.0, 400.0)))
            .map(|position| exact_sigma(&world, &ShadingPoint::surface(position, Vec3::Y).with_mask(1 << 3)))
            .sum();
        let sigma = sum / f64::from(points);
        assert!(sigma < most, "in stripes: {in_stripes}, sigma {sigma}");
    }
}

#[test]
fn lamps_of_many_masks_are_drawn_as_often_as_their_probabilities_say() {
    let mut rng = Rng(311);
    for in_stripes in [false, true] {
        let world = lamps_of_32_masks(1000, in_stripes);
        let sampler = world.sampler();
        for mask in [1 << 3, 0b1011 << 20, !1, u32::MAX] {
            let position = Vec3::new(rng.between(-400.0, 400.0), 0.0, rng.between(-400.0, 400.0));
            let at = ShadingPoint::surface(position, Vec3::Y).with_mask(mask);
            assert_probabilities(&sampler, &at, 2000, &mut rng);
            assert_frequencies(&sampler, &at, 20_000, &mut rng);
        }
    }
}

#[test]
fn learnt_visibility_and_segments_follow_masks() {
    let mut rng = Rng(308);
    let world = rng.varied_world(4, 20, 6, 10.0);
    let mut table = VisibilityTable::default();
    let at = ShadingPoint::volume(rng.position(5.0)).with_mask(0b10);
    for _ in 0..8 {
        let sampler = world.sampler().with_visibility(&table);
        for _ in 0..32 {
            let Some(sample) = sampler.sample(&at, [rng.unit(), rng.unit(), 0.5, 0.5]) else { continue };
            sampler.record_visibility(&at, &sample, sample.incident.direction.x > 0.0);
        }
        table.end_frame();
    }
    let ray = ShadingPoint::segment(rng.position(5.0), rng.direction(), 6.0).with_mask(0b10);
    for (sampler, at) in [(world.sampler().with_visibility(&table), at), (world.sampler(), ray)] {
        let mut drawn = 0;
        for _ in 0..500 {
            let Some(sample) = sampler.sample(&at, [rng.unit(), rng.unit(), rng.unit(), rng.unit()]) else { continue };
            let pmf = sampler.pmf(&at, sample.light);
            assert!((sample.pmf - pmf).abs() <= 1.0e-4 * pmf, "{sample:?} {pmf}");
            let LightId::Local { instance, .. } = sample.light else { continue };
            assert!(world.instance(instance).expect("it lives").appearance.mask & 0b10 != 0, "{sample:?}");
            drawn += 1;
        }
        assert!(drawn > 50, "{drawn}");
        let sum: f64 = all_pmfs(&sampler, &at).iter().map(|(_, pmf)| f64::from(*pmf)).sum();
        assert!(sum <= 1.0 + 1.0e-4, "{sum}");
    }
}

#[test]
fn the_gpu_chooses_the_same_lights_for_masked_points() {
    let mut rng = Rng(309);
    let mut world = rng.varied_world(6, 30, 8, 20.0);
    // More parts than one piece of the top level, so that masks pass through rounds.
    let lamp = world.add_tree(LightTree::new(rng.lights(3, 1.0)).expect("valid"));
    for i in 0..900 {
        let key = world.add_instance(lamp, rng.affine(60.0), Policy::Static).expect("valid");
        world.set_appearance(key, |a| a.mask = [0b01, 0b10, u32::MAX, 0][i % 4]).expect("it lives");
    }
    let mut lights = gpu_lights();
    let text = "struct Question { position: vec3<f32>, mask: u32, normal: vec3<f32>, padding: u32, u: vec4<f32> }
        fn answer(q: Question) -> vec4<f32> {
            let at = light_masked_point(light_surface_point(q.position, q.normal), q.mask);
            let s = light_sample(at, q.u);
            var pmf = 0.0;
            if s.pmf > 0.0 { pmf = light_pmf(at, s.instance, s.light); }
            return vec4(bitcast<f32>(s.light), s.pmf, pmf, s.radiance.y);
        }";
    let (mut questions, mut points) = (Vec::new(), Vec::new());
    for _ in 0..2048 {
        let at = rng.masked_point(25.0);
        let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
        questions.push([at.position.extend(f32::from_bits(at.mask)).to_array(), at.normal.extend(0.0).to_array(), u]);
        points.push(at);
    }
    sample(&mut lights, &mut world, &requests(&mut Rng(1), 64, 1.0));
    let answers: Vec<[f32; 4]> = ask(&mut lights, Effects::all(), text, &questions);
    let sampler = world.sampler().from_roots();
    let (mut others, mut lit) = (0, 0);
    for ((at, question), [light, pmf, again, green]) in points.iter().zip(&questions).zip(answers) {
        match sampler.sample(at, question[2]) {
            None => others += usize::from(pmf > 0.0),
            Some(twin) => {
                let index = match twin.light {
                    LightId::Local { light, .. } => light,
                    LightId::Directional(_) => light.to_bits(),
                    _ => unreachable!("this version has no others"),
                };
                if index != light.to_bits() || !close(pmf, twin.pmf) || pmf == 0.0 {
                    others += 1;
                    continue;
                }
                assert!(close(again, pmf), "{again} {pmf}");
                let radiance = twin.incident.radiance;
                assert!((green - radiance.y).abs() <= 1.0e-2 * radiance.max_element(), "{green} {twin:?}");
                lit += 1;
            }
        }
    }
    assert!(others as f64 <= OTHER_PICKS * 2048.0 + 1.0 && lit > 800, "{others} differ, {lit} are lit");
}

#[test]
fn factors_change_probabilities_as_lights_of_that_emission_do() {
    let mut rng = Rng(303);
    let lights = rng.lights(40, 3.0);
    let mut worlds = [1.0, 4.0].map(|scale: f32| {
        let mut world = LightWorld::new();
        for (i, size) in [(0, 20.0), (1, 20.0), (2, 3.0)] {
            let share = if i == 1 { scale } else { 1.0 };
            let scaled = lights.iter().map(|light| light.with_emission(light.emission * share));
            place_tree(&mut world, scaled.collect(), Rng(i).affine(size), Policy::Static);
        }
        world
    });
    let instance = worlds[0].instances().nth(1).expect("three instances");
    worlds[0].set_appearance(instance, |a| a.factor = Vec3::splat(4.0)).expect("valid");
    for _ in 0..40 {
        let at = rng.shading_point(15.0);
        let [by_factor, by_light] = worlds.each_ref().map(|world| all_pmfs(&world.sampler(), &at));
        for ((light, a), (_, b)) in by_factor.iter().zip(&by_light) {
            // A power of two changes no mantissa.
            assert!((a - b).abs() <= 1.0e-5 * b, "{light:?}: {a} and {b}");
            let [a, b] = worlds.each_ref().map(|world| world.sampler().sample_light(&at, *light, [0.3, 0.6]));
            assert_eq!(a, b, "{light:?}");
        }
    }
}

#[test]
fn the_greatest_and_the_least_factors_leave_all_results_finite() {
    let mut rng = Rng(304);
    for factor in [MAX_FACTOR, 1.0e-12, 1.0e-37, 1.0e-45, 0.0] {
        let mut world = LightWorld::new();
        let mut lights = rng.lights(30, 3.0);
        lights.extend([MAX_EMISSION, 1.0e-20].map(|candela| Light::point(rng.position(3.0), Vec3::splat(candela))));
        lights.push(Light::sphere(rng.position(3.0), 1.0, Vec3::splat(MAX_EMISSION)));
        let lamp = lights[30].aabb().center();
        let (tree, instance) = place_tree(&mut world, lights, Placement::IDENTITY, Policy::Static);
        let plain = world.add_instance(tree, Placement::at(DVec3::X), Policy::Static).expect("valid");
        world.set_appearance(instance, |a| a.factor = Vec3::splat(factor)).expect("within the limits");
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
fn every_sample_returns_the_user_data_of_its_instance_on_both_sides() {
    let mut rng = Rng(301);
    let mut world = rng.varied_world(5, 20, 6, 15.0);
    let mut lights = gpu_lights();
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
                _ => unreachable!("this version has no others"),
            };
            assert_eq!(sample.user_data, expected);
            samples += 1;
        }
    }
    assert!(samples > 300, "{samples}");
    sample(&mut lights, &mut world, &requests);
    let text = "fn answer(q: u32) -> u32 { return light_user_data(q); }";
    let keys: Vec<InstanceKey> = world.instances().collect();
    let mut questions: Vec<u32> = keys.iter().map(|key| world.slot(*key).expect("it lives")).collect();
    questions.extend([u32::MAX, 1000]);
    let answers: Vec<u32> = ask(&mut lights, Effects::empty(), text, &questions);
    let shown = |key: &InstanceKey| {
        world.instance(*key).map(|i| i.appearance.is_enabled) == Some(true)
            && world.instance(*key).map(|i| i.appearance.factor) != Some(Vec3::ZERO)
    };
    let expected = keys.iter().map(|key| if shown(key) { user_data_of(&world, *key) } else { 0 }).chain([0, 0]);
    assert_eq!(answers, expected.collect::<Vec<u32>>());
}
