//! Reservoirs that are merged over points and frames estimate the sum over all lights.

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::light::luminance;
use girandole::{
    DirectionalLight, Effects, FrameBudget, Light, LightId, LightSampler, LightTree, LightWorld, Placement, Policy,
    Reservoir, ShadingPoint,
};

use crate::gpu::{ask, close, gpu_lights};
use testbed::testing::support::{Rng, mean, place_tree};

/// Whether a ray passes walls, which cut the space into slabs with holes.
fn is_visible(from: Vec3, toward: Vec3) -> bool {
    let at = from + 0.37 * toward;
    (at.x * 0.7).sin() + (at.z * 0.9).cos() < 0.6
}

/// What the light of a reservoir reflects at a point, with shadows.
fn reflected(sampler: &LightSampler<'_>, at: &ShadingPoint, kept: &Reservoir) -> f32 {
    sampler.reservoir_sample(at, kept).map_or(0.0, |s| lit(at, s.incident) / s.incident.pdf)
}

fn lit(at: &ShadingPoint, incident: girandole::Incident) -> f32 {
    let cosine = if at.normal == Vec3::ZERO { 1.0 } else { at.normal.dot(incident.direction).max(0.0) };
    let is_lit = is_visible(at.position, incident.direction * incident.dist.min(50.0));
    if is_lit { luminance(incident.radiance) * cosine } else { 0.0 }
}

/// How many standard errors the mean of merged reservoirs differs from the sum over all lights, at each of some points.
fn deviations(rng: &mut Rng, world: &LightWorld) -> Vec<f64> {
    let sampler = world.sampler();
    let mut deviations = Vec::new();
    for _ in 0..12 {
        let at = rng.shading_point(8.0);
        let beside = [1.0, 4.0].map(|size| {
            let mut other = rng.shading_point(8.0);
            other.position = at.position + rng.position(size);
            other
        });
        let exact: f64 = sampler
            .all_lights()
            .filter_map(|light| sampler.sample_light(&at, light, [0.5; 2]))
            .map(|incident| f64::from(lit(&at, incident)))
            .sum();
        let draw = |rng: &mut Rng, at: &ShadingPoint, count: f32| {
            let own = sampler.resample(at, std::array::from_fn(|_| rng.unit()), 1);
            Reservoir { reflected: reflected(&sampler, at, &own), count, ..own }
        };
        let [mean, deviation] = mean(6000, || {
            let mut own = draw(rng, &at, 1.0);
            for (beside, count) in beside.iter().zip([7.0, 0.5]) {
                let other = draw(rng, beside, count);
                let [there, here] = [reflected(&sampler, beside, &own), reflected(&sampler, &at, &other)];
                own = own.merge(there, &other, here, rng.unit());
            }
            assert_eq!(own.count, 8.5);
            f64::from(own.reflected) * f64::from(own.weight)
        });
        // Only precise means tell anything.
        if deviation < 0.05 * exact {
            deviations.push((mean - exact).abs() / deviation);
        }
    }
    deviations
}

/// Random lights without size, at rest and moved.
fn world(rng: &mut Rng) -> LightWorld {
    let mut world = LightWorld::new();
    for _ in 0..4 {
        let lamps = (0..12).map(|_| Light::point(rng.position(6.0), Vec3::splat(rng.between(1.0, 30.0))));
        place_tree(&mut world, lamps.collect(), Placement::at(rng.position(6.0).as_dvec3()), Policy::Static);
    }
    let sun = DirectionalLight { direction: Vec3::new(0.3, -0.9, 0.2).normalize(), illuminance: Vec3::splat(2.0) };
    world.add_directional(sun).expect("valid");
    world
}

#[test]
fn merged_reservoirs_have_the_sum_over_all_lights_as_their_mean() {
    let mut rng = Rng(211);
    let world = world(&mut rng);
    let deviations = deviations(&mut rng, &world);
    // Five standard errors: a false alarm in one of 10^5 runs.
    assert!(deviations.len() >= 8 && deviations.iter().all(|deviation| *deviation < 5.0), "{deviations:?}");
}

#[test]
fn shares_of_a_merge_are_those_of_their_formula() {
    let own = Reservoir { weight: 2.0, count: 1.0, reflected: 3.0, ..Reservoir::default() };
    let other = Reservoir { weight: 5.0, count: 3.0, reflected: 4.0, numbers: [0.5; 2], ..Reservoir::default() };
    // At one point the shares are those of counts: 1/4 * 3 * 2 = 1.5 and 3/4 * 4 * 5 = 15.
    let merged = |choice| own.merge(3.0, &other, 4.0, choice);
    assert_eq!(merged(0.90), Reservoir { weight: 16.5 / 4.0, count: 4.0, ..other });
    assert_eq!(merged(0.92), Reservoir { weight: 16.5 / 3.0, count: 4.0, ..own });
    // Own: 3 / (3 + 3 * 6) of 6; other: 12 / (12 + 2) of 2 * 5.
    let merged = own.merge(6.0, &other, 2.0, 0.99);
    assert_eq!((merged.reflected, merged.count), (3.0, 4.0));
    assert!((f64::from(merged.weight) - (6.0 / 7.0 + 60.0 / 7.0) / 3.0).abs() < 1.0e-6);
    // The first of several has no rival, and light that only the other point sees has none either.
    assert_eq!(Reservoir::default().merge(0.0, &own, 3.0, 0.999_999_94), own);
    assert_eq!(own.merge(0.0, &Reservoir { reflected: 0.0, ..other }, 4.0, 0.0), Reservoir { count: 4.0, ..own });
    let dark = own.merge(3.0, &other, 0.0, 0.0);
    assert!((dark.weight - 0.5).abs() < 1.0e-6 && dark.reflected == 3.0);
}

/// Two reservoirs, what their lights reflect elsewhere, and a choice. Some numbers are extreme or none.
#[allow(clippy::manual_clamp, reason = "NaN becomes 0")]
fn extremes(rng: &mut Rng) -> [f32; 9] {
    let odd = [0.0, -1.0, f32::NAN, f32::INFINITY, f32::MIN_POSITIVE, 1.0e-40, 1.0e30, 1.0e37, f32::MAX];
    let mut number = |plain: [f32; 2]| match rng.bits() % 3 {
        0 => odd[(rng.bits() % 9) as usize],
        _ => rng.between(plain[0], plain[1]),
    };
    let weights = [(); 2].map(|()| number([0.5, 50.0]).max(0.0).min(1.0e37));
    let counts = [(); 2].map(|()| number([0.0, 20.0]).max(0.0).min(1.0e6));
    let [a, b, c, d] = [(); 4].map(|()| number([0.0, 9.0]));
    [weights[0], counts[0], a, weights[1], counts[1], b, c, d, number([0.0, 1.0])]
}

const ENGINE: &str = "
    fn answer(q: array<f32, 9>) -> vec4<f32> {
        let own = LightReservoir(1u, 2u, 3u, 4u, q[0], q[1], q[2]);
        let other = LightReservoir(5u, 6u, 7u, 8u, q[3], q[4], q[5]);
        let merged = light_reservoir_merge(own, q[6], other, q[7], q[8]);
        return vec4(f32(merged.instance), merged.weight, merged.count, merged.reflected);
    }";

#[test]
fn the_gpu_merges_as_the_cpu_and_numbers_that_are_none_stay_out() {
    let mut rng = Rng(212);
    let mut lights = gpu_lights();
    let questions: Vec<_> = (0..4000).map(|_| extremes(&mut rng)).collect();
    let answers: Vec<[f32; 4]> = ask(&mut lights, Effects::empty(), ENGINE, &questions);
    let (mut others, mut kept) = (0, 0);
    for ([a, b, c, d, e, f, g, h, choice], [instance, weight, count, reflected]) in questions.iter().zip(&answers) {
        let own = Reservoir { weight: *a, count: *b, reflected: *c, generation: 1, ..Reservoir::default() };
        let other = Reservoir { weight: *d, count: *e, reflected: *f, generation: 5, ..Reservoir::default() };
        let twin = own.merge(*g, &other, *h, *choice);
        let is_sound = |number: f32| number.is_finite() && number >= 0.0;
        assert!([*weight, *reflected, twin.weight, twin.reflected].into_iter().all(is_sound), "{twin:?}");
        let is_same = close(*weight, twin.weight) && close(*reflected, twin.reflected) && *count == twin.count;
        // A choice at the border of two parts.
        others += usize::from(!is_same || *instance != twin.generation as f32);
        kept += usize::from(twin.weight > 0.0);
    }
    assert!(others <= 8 && kept > 1500, "{others} differ, {kept} keep a light");
}

#[test]
fn a_kept_light_is_evaluated_as_it_is_now_and_not_in_the_name_of_another() {
    let mut world = LightWorld::new();
    let lamp = |candela| Light::point(Vec3::Y * 2.0, Vec3::splat(candela));
    let (tree, instance) = place_tree(&mut world, vec![lamp(8.0)], Placement::IDENTITY, Policy::Budgeted);
    let ground = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    let kept = world.sampler().resample(&ground, [0.3; 5], 8);
    let light = LightId::Local { instance, light: 0 };
    assert_eq!((kept.light, kept.weight, kept.count), (Some(light), 1.0, 1.0));
    let lux = |world: &LightWorld| world.sampler().reservoir_sample(&ground, &kept).map(|s| s.incident.radiance.x);
    assert_eq!(lux(&world), Some(2.0));
    world.set_emission(tree, 0, Vec3::splat(4.0)).expect("valid");
    world.update(FrameBudget::NONE);
    assert_eq!(lux(&world), Some(1.0));
    let far = Placement { linear: Mat3::IDENTITY, ..Placement::at(DVec3::Y * 2.0) };
    world.move_instance(instance, far).expect("it lives");
    assert_eq!(lux(&world), Some(0.25));
    // Away and back again is another light.
    world.remove_lights(tree, &[0]).expect("it lives");
    world.update(FrameBudget::NONE);
    assert_eq!(lux(&world), None);
    assert_eq!(world.add_lights(tree, &[lamp(8.0)]).expect("valid"), [0]);
    world.update(FrameBudget::NONE);
    assert_eq!(lux(&world), None);
    let named = world.sampler().reservoir_of(light, [0.5; 2]);
    assert_eq!((named.light, named.weight), (Some(light), 1.0));
    world.remove_instance(instance).expect("it lives");
    assert_eq!(world.sampler().reservoir_of(light, [0.5; 2]), Reservoir { count: 1.0, ..Reservoir::default() });
}

#[test]
fn a_snapshot_has_all_lights_as_they_were() {
    let mut rng = Rng(29);
    let mut world = LightWorld::new();
    world.set_solid_angle_sampling(true);
    let lights: Vec<Light> = (0..40).map(|_| rng.light(5.0)).collect();
    let tree = world.add_tree(LightTree::new(lights).expect("valid"));
    let place = |rng: &mut Rng| Placement {
        linear: Mat3::from_rotation_y(rng.unit()),
        ..Placement::at(rng.position(9.0).as_dvec3())
    };
    let instances: Vec<_> =
        (0..6).map(|_| world.add_instance(tree, place(&mut rng), Policy::Budgeted).expect("valid")).collect();
    let sun = DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::splat(2.0) };
    let sun = world.add_directional(sun).expect("valid");
    world.set_appearance(instances[1], |a| a.factor = Vec3::splat(0.5)).expect("it lives");
    world.set_appearance(instances[2], |a| a.mask = 2).expect("it lives");
    world.update(FrameBudget::UNLIMITED);
    let seen = |lights: &dyn Fn(&ShadingPoint, &Reservoir) -> Option<girandole::LightSample>, kept: &[Reservoir]| {
        let mut rng = Rng(5);
        let points: Vec<ShadingPoint> = (0..20).map(|_| rng.shading_point(12.0)).collect();
        points.iter().flat_map(|at| kept.iter().map(|kept| lights(at, kept))).collect::<Vec<_>>()
    };
    let sampler = world.sampler();
    let kept: Vec<Reservoir> = sampler.all_lights().map(|light| sampler.reservoir_of(light, [0.2, 0.7])).collect();
    let before = seen(&|at, kept| sampler.reservoir_sample(at, kept), &kept);
    assert!(before.iter().flatten().count() > 500);

    let snapshot = world.snapshot();
    for (i, instance) in instances.iter().enumerate() {
        match i {
            0 => world.remove_instance(*instance).expect("it lives"),
            _ => world.move_instance(*instance, place(&mut rng)).expect("it lives"),
        }
    }
    world.set_appearance(instances[3], |a| a.factor = Vec3::splat(3.0)).expect("it lives");
    world.remove_lights(tree, &[3, 9]).expect("they live");
    world.add_lights(tree, &[rng.light(5.0)]).expect("valid");
    world.set_emission(tree, 20, Vec3::splat(9.0)).expect("it lives");
    world.remove_directional(sun).expect("it lives");
    world.update(FrameBudget::UNLIMITED);
    assert_eq!(seen(&|at, kept| snapshot.reservoir_sample(at, kept), &kept), before);
    let sampler = world.sampler();
    assert_ne!(seen(&|at, kept| sampler.reservoir_sample(at, kept), &kept), before);
    // What came later is not there.
    let late = world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted).expect("valid");
    let late = world.sampler().reservoir_of(LightId::Local { instance: late, light: 0 }, [0.5; 2]);
    assert_eq!(late.weight, 1.0);
    assert!(seen(&|at, kept| snapshot.reservoir_sample(at, kept), &[late]).iter().all(Option::is_none));
}

/// The scene in which shadow rays of the last frame are traced, and where they end.
#[derive(Clone, Copy, PartialEq)]
enum RaysThen {
    LastScene,
    PresentScene,
    PresentSceneToFormerLights,
}

/// Mean light of a point beside which a lamp drives, with its housing behind it, relative to what arrives: with a kept
/// reservoir, in the frames from the tenth on.
fn light_beside_a_lamp_that_drives(rays: RaysThen) -> f64 {
    const FRAMES: u32 = 40;
    let mut world = LightWorld::new();
    let lamp = |candela| LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::splat(candela))]).expect("valid");
    let [moving, fixed] = [lamp(9.0), lamp(5.0)].map(|tree| world.add_tree(tree));
    let moving = world.add_instance(moving, Placement::IDENTITY, Policy::Static).expect("valid");
    world.add_instance(fixed, Placement::at(DVec3::new(2.0, 2.0, 1.0)), Policy::Static).expect("valid");
    let ground = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    let place = |frame: u32| Vec3::new(0.1 * frame as f32 - 2.0, 1.0, 0.5);
    // A ball that the lamp is in front of.
    let is_seen = |light: &girandole::LightSample, frame: u32| {
        let to_ball = place(frame) - Vec3::X * 0.1;
        let along = to_ball.dot(light.incident.direction).clamp(0.0, light.incident.dist);
        (light.incident.direction * along).distance(to_ball) > 0.08
    };
    let lux = |light: &girandole::LightSample| light.incident.radiance.x * light.incident.direction.y.max(0.0);
    let mut rng = Rng(31);
    let (mut sum, mut exact) = (0.0, 0.0);
    let mut kept = vec![Reservoir::default(); 4_000];
    let mut then = world.snapshot();
    for frame in 0..FRAMES {
        world.move_instance(moving, Placement::at(place(frame).as_dvec3())).expect("it lives");
        let sampler = world.sampler();
        let lit = |light: Option<girandole::LightSample>, scene: u32| {
            light.map_or(0.0, |light| if is_seen(&light, scene) { lux(&light) } else { 0.0 })
        };
        let here = |kept: &Reservoir| lit(sampler.reservoir_sample(&ground, kept), frame);
        for reservoir in &mut kept {
            let mut own = sampler.resample(&ground, std::array::from_fn(|_| rng.unit()), 1);
            own.reflected = here(&own);
            if frame > 0 {
                let former = then.reservoir_sample(&ground, &own);
                let own_there = match rays {
                    RaysThen::LastScene => lit(former, frame - 1),
                    RaysThen::PresentSceneToFormerLights => lit(former, frame),
                    RaysThen::PresentScene if here(&own) > 0.0 => former.map_or(0.0, |light| lux(&light)),
                    RaysThen::PresentScene => 0.0,
                };
                let other = Reservoir { count: reservoir.count.min(8.0), ..*reservoir };
                own = own.merge(own_there, &other, here(&other), rng.unit());
            }
            *reservoir = own;
        }
        then = world.snapshot();
        if frame >= 10 {
            sum += kept.iter().map(|kept| f64::from(kept.reflected * kept.weight)).sum::<f64>() / kept.len() as f64;
            let all = sampler.all_lights().map(|light| here(&sampler.reservoir_of(light, [0.5; 2])));
            exact += f64::from(all.sum::<f32>());
        }
    }
    sum / exact
}

#[test]
fn a_lamp_that_drives_with_its_housing_gets_no_brighter() {
    // The noise of a pixel is below 1, and that of a mean over 4,000 pixels below 0.016 in all frames together.
    let exact = light_beside_a_lamp_that_drives(RaysThen::LastScene);
    assert!((exact - 1.0).abs() < 0.05, "{exact}");
    let present = light_beside_a_lamp_that_drives(RaysThen::PresentScene);
    assert!((present - 1.0).abs() < 0.05, "{present}");
    // As docs/reuse.md warns.
    let former = light_beside_a_lamp_that_drives(RaysThen::PresentSceneToFormerLights);
    assert!(former > 1.5, "{former}");
}
