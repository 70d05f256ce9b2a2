//! Resampling is unbiased, lowers the noise, and is the same on the GPU.

use crate::gpu::{OTHER_PICKS, ask, close, named, requests, shading_point, uploaded};
use girandole::glam::Vec3;
use girandole::light::luminance;
use girandole::{
    Incident, Light, LightId, LightSample, LightSampler, LightTree, LightWorld, Placement, Policy, Reservoir,
    ShadingPoint, Shape,
};
use testbed::common::batch::{SampleRecord, SampleRequest};
use testbed::testing::support::{Rng, mean};

fn random_numbers(rng: &mut Rng) -> [f32; 5] {
    [rng.unit(), rng.unit(), rng.unit(), rng.unit(), rng.unit()]
}

fn cosine(shading_point: &ShadingPoint, direction: Vec3) -> f32 {
    if shading_point.normal == Vec3::ZERO { 1.0 } else { shading_point.normal.dot(direction).max(0.0) }
}

#[test]
fn one_candidate_is_a_plain_sample() {
    let mut rng = Rng(70);
    let world = rng.world(4, 30, 4, 15.0);
    let sampler = world.sampler();
    let mut lit = 0;
    for _ in 0..3000 {
        let (shading_point, u) = (rng.shading_point(20.0), random_numbers(&mut rng));
        let one = sampler.resample(&shading_point, u, 1);
        let pick = sampler.pick(&shading_point, [u[0], u[1]]);
        assert_eq!((one.light, one.weight, one.count), (pick.map(|p| p.light), pick.map_or(0.0, |p| 1.0 / p.pmf), 1.0));
        assert!(one.light.is_none() || (0..2).all(|i| (one.numbers[i] - u[2 + i]).abs() <= 0.5 / 65_536.0));
        lit += u32::from(one.light.is_some());
    }
    assert!(lit > 1000, "{lit}");
}

/// The light of what is kept of several candidates.
fn kept(sampler: &LightSampler<'_>, at: &ShadingPoint, u: [f32; 5], candidates: u32) -> Option<LightSample> {
    sampler.reservoir_sample(at, &sampler.resample(at, u, candidates))
}

/// A measure that differs from the weights of candidates, as shadows do: the red light of every
/// second light.
fn red_of_even(light: LightId, radiance: Vec3) -> f64 {
    let is_even = matches!(light, LightId::Local { light, .. } if light % 2 == 0);
    if is_even { f64::from(radiance.x) } else { 0.0 }
}

/// Random lights without size.
fn without_size(rng: &mut Rng) -> Vec<Light> {
    let all = rng.lights(90, 4.0);
    all.into_iter().filter(|light| matches!(light.shape, Shape::Point { .. } | Shape::Spot { .. })).collect()
}

/// A world of lights without size.
fn world_without_size(rng: &mut Rng) -> LightWorld {
    let mut world = rng.world(0, 0, 0, 1.0);
    for _ in 0..4 {
        let tree = world.add_tree(LightTree::new(without_size(rng)).expect("valid"));
        for _ in 0..4 {
            world.add_instance(tree, rng.affine(10.0), Policy::Static).expect("valid");
        }
    }
    world
}

#[test]
fn the_mean_is_the_sum_over_all_lights() {
    let mut rng = Rng(71);
    let world = world_without_size(&mut rng);
    let sampler = world.sampler();
    let mut checks = 0;
    // 10 shading points with 5 numbers of candidates each.
    for _ in 0..10 {
        let at = rng.shading_point(10.0);
        let part = |light, incident: Incident| {
            red_of_even(light, incident.radiance) * f64::from(cosine(&at, incident.direction))
        };
        let of = |light| Some(part(light, sampler.sample_light(&at, light, [0.5, 0.5])?));
        let exact: f64 = sampler.all_lights().filter_map(of).sum();
        for candidates in [1, 2, 3, 8, 100] {
            let [mean, deviation] = mean(6000, || {
                let kept = kept(&sampler, &at, random_numbers(&mut rng), candidates);
                kept.map_or(0.0, |kept| part(kept.light, kept.incident) / f64::from(kept.pmf))
            });
            // Five standard deviations: a false alarm in one of 10^6 checks, of which there are 50.
            assert!((mean - exact).abs() <= 5.0 * deviation, "{candidates}: {mean} {exact} {deviation}");
            // Counts the checks that are precise.
            checks += u32::from(deviation < 0.05 * exact);
        }
    }
    assert!(checks >= 25, "only {checks} of 50 checks are precise");
}

/// The relative variance of the light that one sample estimates, surfaces included, without
/// shadows.
fn variance(sampler: &LightSampler<'_>, shading_point: &ShadingPoint, candidates: u32, rng: &mut Rng) -> f64 {
    let [mean, error] = mean(3000, || {
        kept(sampler, shading_point, random_numbers(rng), candidates).map_or(0.0, |sample| {
            let lux = luminance(sample.incident.radiance) * cosine(shading_point, sample.incident.direction);
            f64::from(lux) / f64::from(sample.pmf * sample.incident.pdf)
        })
    });
    if mean > 0.0 { 3000.0 * (error / mean).powi(2) } else { 0.0 }
}

#[test]
fn stratified_candidates_have_less_noise_than_independent_ones() {
    let mut rng = Rng(72);
    let world = rng.world(6, 40, 4, 20.0);
    let sampler = world.sampler();
    let (mut one, mut eight) = (0.0, 0.0);
    for _ in 0..60 {
        let shading_point = rng.shading_point(20.0);
        one += variance(&sampler, &shading_point, 1, &mut rng).sqrt();
        eight += variance(&sampler, &shading_point, 8, &mut rng).sqrt();
    }
    // Independent candidates would have the deviation of one over the root of eight.
    assert!(eight < 0.9 * one / 8.0_f64.sqrt(), "{one} {eight}");
}

#[test]
fn extreme_lights_and_empty_worlds_give_finite_weights_or_none() {
    let mut rng = Rng(73);
    let mut world = LightWorld::new();
    let ground = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    let nothing = Reservoir { count: 1.0, ..Reservoir::default() };
    assert_eq!(world.sampler().resample(&ground, [0.5; 5], 8), nothing);
    let mut add = |height: f32, candela: f32| {
        let tree =
            world.add_tree(LightTree::new(vec![Light::point(Vec3::Y * height, Vec3::splat(candela))]).expect("valid"));
        world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid")
    };
    add(-3.0, 1.0);
    let dim = add(2.0, 1.0e-15);
    let bright = add(1.0e-10, 1.0e15);
    for candidates in [1, 2, 8, 32] {
        for _ in 0..200 {
            let kept = world.sampler().resample(&ground, random_numbers(&mut rng), candidates);
            assert!(kept.light.is_some() && kept.weight.is_finite() && kept.weight > 0.0, "{kept:?}");
        }
    }
    world.remove_instance(bright).expect("a live instance");
    assert!(world.sampler().resample(&ground, [0.5; 5], 8).weight > 0.0);
    world.remove_instance(dim).expect("a live instance");
    // Only what lies below the ground is left.
    assert_eq!(world.sampler().resample(&ground, [0.5; 5], 8), nothing);
}

/// A shading point and the numbers of its candidates.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Question {
    request: SampleRequest,
    choice: f32,
    candidates: u32,
    padding: [u32; 2],
}

const ENGINE: &str = "
    struct Question {
        position: vec3<f32>, padding: u32, normal: vec3<f32>, padding_after_normal: u32,
        u: vec4<f32>, choice: f32, candidates: u32,
    }
    fn answer(q: Question) -> LightSample {
        let at = light_surface_point(q.position, q.normal);
        return light_reservoir_sample(at, light_resample(at, q.u, q.choice, q.candidates));
    }";

/// Counts the records with another light or another weight than the CPU's.
fn others(world: &LightWorld, questions: &[Question], records: &[SampleRecord]) -> usize {
    let sampler = world.sampler().from_roots();
    let differs = |(question, record): (&Question, &SampleRecord)| {
        let [a, b, x, y] = question.request.u;
        let at = shading_point(&question.request);
        let twin = kept(&sampler, &at, [a, b, x, y, question.choice], question.candidates);
        let (Some(twin), true) = (twin, record.pmf > 0.0) else { return twin.is_some() != (record.pmf > 0.0) };
        let turn = (Vec3::from(record.direction) - twin.incident.direction).length();
        named(world, record.instance, record.light) != twin.light
            || turn > 2.0e-3
            || !close(record.pmf, twin.pmf)
            || !close(record.pdf, twin.incident.pdf)
    };
    questions.iter().zip(records).filter(|pair| differs(*pair)).count()
}

#[test]
fn the_gpu_keeps_the_same_candidates_with_the_same_weights() {
    let mut rng = Rng(74);
    let count = 2048;
    let requests = requests(&mut rng, count, 25.0);
    let mut lit = 0;
    for (trees, per_tree, instances) in [(5, 50, 5), (0, 0, 0)] {
        let mut world = rng.world(trees, per_tree, instances, 20.0);
        if trees == 0 {
            let keys: Vec<_> = world.directionals().collect();
            keys.into_iter().for_each(|key| world.remove_directional(key).expect("a live key"));
        }
        let mut lights = uploaded(&world);
        for candidates in [1, 2, 5, 8, 32] {
            let question = |request: &SampleRequest| Question {
                request: *request,
                choice: rng.unit(),
                candidates,
                padding: [0; 2],
            };
            let questions: Vec<_> = requests.iter().map(question).collect();
            let records: Vec<SampleRecord> = ask(&mut lights, world.effects(), ENGINE, &questions);
            let others = others(&world, &questions, &records);
            // Each candidate may fall on the other side of a border between two lights, which
            // changes the weight.
            let allowed = OTHER_PICKS * f64::from(candidates) * count as f64;
            assert!(others as f64 <= allowed, "{candidates}: {others} of {count} differ");
            lit += records.iter().filter(|r| r.pmf > 0.0).count();
        }
    }
    assert!(lit > 3000, "{lit} are too few to compare");
}
