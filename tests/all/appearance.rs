//! What instances change about the lights of their trees: factors, masks, lights that are disabled,
//! and user data.

use girandole::glam::{DVec3, Vec3};
use girandole::gpu::{GpuLights, wgsl};
use girandole::light::MAX_EMISSION;
use girandole::{
    Effects, FrameBudget, InstanceKey, Light, LightId, LightTree, LightWorld, MAX_FACTOR, Placement, Policy,
    ShadingPoint, VisibilityTable,
};

use crate::gpu::{OTHER_PICKS, ask, close, gpu, requests, sample};
use testbed::testing::support::{Rng, SPLITS, all_pmfs, assert_frequencies, assert_probabilities, user_data_of};

/// Cars in a row along x that share a tree of one lamp.
fn cars(count: u32) -> (LightWorld, Vec<InstanceKey>) {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid"));
    let at = |i: u32| Placement::at(DVec3::X * 3.0 * f64::from(i));
    let keys = (0..count).map(|i| world.add_instance(tree, at(i), Policy::Static).expect("valid")).collect();
    (world, keys)
}

#[test]
fn disabled_instances_send_nothing_and_come_back_with_the_same_probabilities() {
    let mut rng = Rng(300);
    let mut world = rng.world(4, 20, 5, 15.0);
    let keys: Vec<InstanceKey> = world.instances().collect();
    let shading_point = ShadingPoint::volume(rng.position(15.0));
    let before = all_pmfs(&world.sampler(), &shading_point);
    let disabled: Vec<InstanceKey> = keys.iter().copied().step_by(3).collect();
    for key in &disabled {
        world.set_appearance(*key, |a| a.is_enabled = false).expect("it lives");
        assert_eq!(
            (world.instance(*key).map(|i| i.appearance.is_enabled), world.slot(*key).is_some()),
            (Some(false), true)
        );
    }
    let sampler = world.sampler();
    let mut others = 0;
    for (light, pmf) in all_pmfs(&sampler, &shading_point) {
        let LightId::Local { instance, .. } = light else { continue };
        if disabled.contains(&instance) {
            assert_eq!(pmf, 0.0);
            assert_eq!(sampler.sample_light(&shading_point, light, [0.5; 2]), None);
            assert_eq!(sampler.pdf(&shading_point, light, rng.position(15.0)), 0.0);
        } else {
            others += usize::from(pmf > 0.0);
        }
    }
    assert!(others > 50, "{others}");
    for key in &disabled {
        world.set_appearance(*key, |a| a.is_enabled = true).expect("it lives");
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
        let report = lights.upload(world).expect("room enough");
        let needs_build = format!("{lights:?}").contains("needs_build: true");
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        lights.build_top(&mut encoder);
        queue.submit([encoder.finish()]);
        (report.bytes, report.trees, report.instances, needs_build)
    };
    upload(&mut world);
    let nothing = (0, 0, 0, false);
    let car = keys[77];
    // An instance has 160 bytes. User data is no matter of the top level.
    world.set_appearance(car, |a| a.user_data = 5).expect("it lives");
    assert_eq!(upload(&mut world), (160, 0, 1, false));
    world.set_appearance(car, |a| a.user_data = 5).expect("it lives");
    world.set_appearance(car, |a| a.is_enabled = true).expect("it lives");
    assert_eq!(upload(&mut world), nothing);
    world.set_appearance(car, |a| a.is_enabled = false).expect("it lives");
    assert_eq!(upload(&mut world), (160, 0, 1, true));
    // The record of an instance that is not shown does not change.
    world.set_appearance(car, |a| a.user_data = 6).expect("it lives");
    assert_eq!(upload(&mut world), nothing);
    world.set_appearance(car, |a| a.is_enabled = true).expect("it lives");
    assert_eq!(upload(&mut world), (160, 0, 1, true));
    assert_eq!((world.trees().len(), world.instance(car).map(|i| i.appearance.user_data)), (1, Some(6)));
    world.set_appearance(car, |a| a.factor = Vec3::splat(0.5)).expect("valid");
    assert_eq!(upload(&mut world), (160, 0, 1, true));
    world.set_appearance(car, |a| a.factor = Vec3::splat(0.5)).expect("valid");
    assert_eq!(upload(&mut world), nothing);
    world.set_appearance(car, |a| a.factor = Vec3::new(0.1, 0.2, 0.3)).expect("valid");
    assert_eq!(upload(&mut world), (160, 0, 1, true));
    // The first mask makes room for the masks of the top level, so the uniforms are sent too: that
    // of shaders, those of the four passes of a sort, and those of three passes of the top level.
    world.set_appearance(car, |a| a.mask = 3).expect("it lives");
    assert_eq!(upload(&mut world), (160 + 48 + 4 * 256 + 3 * 64, 0, 1, true));
    world.set_appearance(car, |a| a.mask = 3).expect("it lives");
    assert_eq!(upload(&mut world), nothing);
    world.set_appearance(car, |a| a.mask = 4).expect("it lives");
    assert_eq!(upload(&mut world), (160, 0, 1, true));
    assert_eq!(world.trees().len(), 1);
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
            let pmfs = all_pmfs(&sampler, &seen);
            let is_seen = |light: &LightId| match light {
                LightId::Local { instance, .. } => {
                    world.instance(*instance).expect("it lives").appearance.mask & mask != 0
                }
                LightId::Directional(_) => true,
                &_ => unreachable!("this version has no others"),
            };
            for (light, pmf) in &pmfs {
                let incident = sampler.sample_light(&seen, *light, [rng.unit(), rng.unit()]);
                assert!(is_seen(light) || (*pmf == 0.0 && incident.is_none()), "{light:?} {mask:b}");
                assert!(*pmf > 0.0 || incident.is_none(), "{light:?} is never drawn");
            }
            // In a volume every cluster that is seen can be estimated, so few draws are lost.
            let total: f64 = pmfs.iter().map(|(_, pmf)| f64::from(*pmf)).sum();
            assert!(total > 0.5 && total <= 1.0 + 1.0e-4, "{total} for {mask:b}");
            let mut misses = 0;
            for i in 0..2000 {
                match sampler.pick(&seen, [(i as f32 + 0.5) / 2000.0, rng.unit()]) {
                    Some(pick) => assert!(is_seen(&pick.light), "{pick:?} {mask:b}"),
                    None => misses += 1,
                }
            }
            assert!((f64::from(misses) / 2000.0 - (1.0 - total)).abs() < 0.06, "{misses} of 2000 for {total}");
        }
    }
}

#[test]
fn the_mean_over_a_masked_world_is_that_of_the_lights_that_reach_the_point() {
    let mut rng = Rng(306);
    let mut world = rng.world(4, 10, 5, 10.0);
    for (i, key) in world.instances().collect::<Vec<_>>().into_iter().enumerate() {
        world.set_appearance(key, |a| a.mask = 1 << (i % 4)).expect("it lives");
    }
    // Lights without size, so that the sum over all lights is exact.
    for tree in world.trees().collect::<Vec<_>>() {
        let points = (0..10).map(|_| Light::point(rng.position(1.0), Vec3::splat(rng.between(0.1, 10.0)))).collect();
        world.replace_lights(tree, points).expect("valid");
    }
    let sampler = world.sampler();
    for mask in [0b0001, 0b0110, 0b1111] {
        let at = ShadingPoint::volume(rng.position(10.0)).with_mask(mask);
        let (mut exact, mut second) = (0.0, 0.0);
        for (light, pmf) in all_pmfs(&sampler, &at) {
            let Some(incident) = sampler.sample_light(&at, light, [0.5; 2]) else { continue };
            exact += f64::from(incident.radiance.y);
            second += f64::from(incident.radiance.y).powi(2) / f64::from(pmf);
        }
        let draws = 20_000;
        let draw = |u| sampler.sample(&at, u).map_or(0.0, |s| f64::from(s.incident.radiance.y) / f64::from(s.pmf));
        let mean = (0..draws).map(|_| draw([rng.unit(), rng.unit(), 0.5, 0.5])).sum::<f64>() / f64::from(draws);
        // Six standard deviations: a false alarm in one of 10^8 runs.
        let limit = 6.0 * ((second - exact * exact).max(0.0) / f64::from(draws)).sqrt() + 1.0e-4 * exact;
        assert!((mean - exact).abs() <= limit && limit < 0.2 * exact, "{mean} for {exact}, within {limit}");
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
    let mut pmfs = Vec::new();
    sampler.distribution(at, &mut pmfs);
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
fn masks_without_a_common_bit_leave_the_directional_lights() {
    let mut rng = Rng(307);
    let mut world = rng.world(2, 10, 3, 10.0);
    let nowhere = ShadingPoint::volume(rng.position(5.0)).with_mask(0);
    let only_directionals = |world: &LightWorld, at: &ShadingPoint| {
        let sampler = world.sampler();
        let mut sum = 0.0;
        for (light, pmf) in all_pmfs(&sampler, at) {
            assert!(matches!(light, LightId::Directional(_)) || pmf == 0.0, "{light:?} {pmf}");
            sum += pmf;
        }
        let mut pmfs = Vec::new();
        sampler.distribution(at, &mut pmfs);
        assert!((pmfs.iter().sum::<f32>() - sum).abs() < 1.0e-5);
        sum
    };
    // A point without bits, in a world without masks and in one with masks.
    assert!((only_directionals(&world, &nowhere) - 1.0).abs() < 1.0e-5);
    for key in world.instances().collect::<Vec<_>>() {
        world.set_appearance(key, |a| a.mask = 0b1000).expect("it lives");
    }
    assert!((only_directionals(&world, &nowhere) - 1.0).abs() < 1.0e-5);
    // Bits that no instance has.
    assert!((only_directionals(&world, &nowhere.with_mask(!0b1000)) - 1.0).abs() < 1.0e-5);
    for key in world.directionals().collect::<Vec<_>>() {
        world.remove_directional(key).expect("it lives");
    }
    assert_eq!(world.sampler().sample(&nowhere, [0.5; 4]), None);
    assert_eq!(only_directionals(&world, &nowhere), 0.0);
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

/// A question of [`the_gpu_chooses_the_same_lights_for_masked_points`].
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Question {
    position: [f32; 3],
    mask: u32,
    normal: [f32; 3],
    padding: u32,
    u: [f32; 4],
}

#[test]
fn the_gpu_chooses_the_same_lights_for_masked_points() {
    let (device, queue) = gpu();
    let mut rng = Rng(309);
    let mut world = rng.varied_world(6, 30, 8, 20.0);
    // More parts than one piece of the top level, so that masks pass through rounds.
    let lamp = world.add_tree(LightTree::new(rng.lights(3, 1.0)).expect("valid"));
    for i in 0..900 {
        let key = world.add_instance(lamp, rng.affine(60.0), Policy::Static).expect("valid");
        world.set_appearance(key, |a| a.mask = [0b01, 0b10, u32::MAX, 0][i % 4]).expect("it lives");
    }
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    let text = wgsl(1, Effects::all())
        + "struct Question { position: vec3<f32>, mask: u32, normal: vec3<f32>, padding: u32, u: vec4<f32> }
        @group(0) @binding(0) var<storage, read> questions: array<Question>;
        @group(0) @binding(1) var<storage, read_write> answers: array<vec4<f32>>;
        @compute @workgroup_size(64) fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
            if id.x >= arrayLength(&questions) { return; }
            let q = questions[id.x];
            let at = light_masked_point(light_surface_point(q.position, q.normal), q.mask);
            let s = light_sample(at, q.u);
            var pmf = 0.0;
            if s.pmf > 0.0 { pmf = light_pmf(at, s.instance, s.light); }
            answers[id.x] = vec4(bitcast<f32>(s.light), s.pmf, pmf, s.radiance.y);
        }";
    let (mut questions, mut points) = (Vec::new(), Vec::new());
    for _ in 0..2048 {
        let at = rng.masked_point(25.0);
        let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
        let (position, normal) = (at.position.to_array(), at.normal.to_array());
        questions.push(Question { position, mask: at.mask, normal, padding: 0, u });
        points.push(at);
    }
    sample(&mut lights, &mut world, &requests(&mut Rng(1), 64, 1.0));
    let answers: Vec<[f32; 4]> = ask(&mut lights, text, &questions, questions.len());
    let sampler = world.sampler().from_roots();
    let (mut others, mut lit) = (0, 0);
    for ((at, question), [light, pmf, again, green]) in points.iter().zip(&questions).zip(answers) {
        match sampler.sample(at, question.u) {
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
fn one_of_five_thousand_cars_dims_and_the_mean_follows() {
    let (mut world, keys) = cars(5000);
    let ground = ShadingPoint::surface(Vec3::new(231.0, 0.0, 0.5), Vec3::Y);
    // The lamp of car i is 1 m high and has an intensity of 1 cd.
    let lux_of = |i: usize| {
        let toward = to_lamp(3.0 * i as f64 - 231.0);
        toward.y / toward.length().powi(3)
    };
    for factor in [Vec3::ONE, Vec3::new(0.25, 0.5, 0.125), Vec3::new(8.0, 0.0, 2.0), Vec3::ZERO] {
        world.set_appearance(keys[77], |a| a.factor = factor).expect("valid");
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
    assert_eq!(world.trees().len(), 1);
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
            let scaled = lights.iter().map(|light| light.with_emission(light.emission * share));
            let tree = world.add_tree(LightTree::new(scaled.collect()).expect("valid"));
            world.add_instance(tree, Rng(i).affine(size), Policy::Static).expect("valid");
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
        let tree = world.add_tree(LightTree::new(lights).expect("valid"));
        let instance = world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
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
fn keys_of_removed_instances_are_refused() {
    let (mut world, keys) = cars(2);
    let gone = keys[0];
    world.remove_instance(gone).expect("it lives");
    let refused = Err(girandole::WorldError::NoSuchInstance(gone));
    assert_eq!(world.set_appearance(gone, |a| a.is_enabled = false), refused);
    assert_eq!(world.set_appearance(gone, |a| a.user_data = 1), refused);
    assert_eq!(world.set_appearance(gone, |a| a.factor = Vec3::ZERO), refused);
    assert_eq!(world.set_appearance(gone, |a| a.mask = 1), refused);
    assert_eq!(
        (world.instance(gone).map(|i| i.appearance.is_enabled), world.instance(gone).map(|i| i.appearance.user_data)),
        (None, None)
    );
    assert_eq!(
        (world.instance(gone).map(|i| i.appearance.factor), world.instance(gone).map(|i| i.appearance.mask)),
        (None, None)
    );
    // The next instance in the slot has the properties of any new instance.
    let tree = world.trees().next().expect("a tree");
    let new = world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
    assert_eq!(
        (
            world.instance(new).map(|i| i.appearance.is_enabled),
            world.instance(new).map(|i| i.appearance.user_data),
            world.instance(new).map(|i| i.appearance.factor)
        ),
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
                _ => unreachable!("this version has no others"),
            };
            assert_eq!(sample.user_data, expected);
            samples += 1;
        }
    }
    assert!(samples > 300, "{samples}");
    sample(&mut lights, &mut world, &requests);
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
    let shown = |key: &InstanceKey| {
        world.instance(*key).map(|i| i.appearance.is_enabled) == Some(true)
            && world.instance(*key).map(|i| i.appearance.factor) != Some(Vec3::ZERO)
    };
    let expected = keys.iter().map(|key| if shown(key) { user_data_of(&world, *key) } else { 0 }).chain([0, 0]);
    assert_eq!(answers, expected.collect::<Vec<u32>>());
}
