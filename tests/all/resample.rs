//! Resampling is unbiased, lowers the noise, and is the same on the GPU.

use girandole::glam::Vec3;
use girandole::gpu::{GpuLights, ReservoirRecord, SampleRequest, TargetHook};
use girandole::light::luminance;
use girandole::{
    CandidateCount, Effects, Light, LightId, LightSample, LightSampler, LightTree, LightWorld, MAX_CANDIDATES,
    Placement, Policy, Reservoir, ShadingPoint, Shape,
};

use crate::gpu::{OTHER_PICKS, ask, buffer, close, gpu, read, shading_point};
use testbed::testing::support::Rng;

fn random_numbers(rng: &mut Rng) -> [f32; 5] {
    [rng.unit(), rng.unit(), rng.unit(), rng.unit(), rng.unit()]
}

/// The numbers of a request.
fn numbers(request: &SampleRequest) -> [f32; 5] {
    let [a, b, x, y] = request.u;
    [a, b, x, y, request.choice]
}

fn requests(rng: &mut Rng, count: usize, size: f32) -> Vec<SampleRequest> {
    let mut requests = crate::gpu::requests(rng, count, size);
    requests.iter_mut().for_each(|request| request.choice = rng.unit());
    requests
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
        let one = sampler.resample(&shading_point, u, CandidateCount::ONE);
        let plain = sampler.sample(&shading_point, [u[0], u[1], u[2], u[3]]);
        assert_eq!(one.map(|r| r.chosen), plain);
        // The target of a single candidate cancels.
        let target = rng.unit() + 0.01;
        assert_eq!(sampler.resample_by(&shading_point, u, CandidateCount::ONE, |_| target), one);
        if let Some(Reservoir { chosen: sample, weight, .. }) = one {
            assert_eq!(weight, 1.0 / (sample.pmf * sample.incident.pdf));
            lit += 1;
        }
    }
    assert!(lit > 1000, "{lit}");
}

fn candidate_count(count: u32) -> CandidateCount {
    CandidateCount::new(count).expect("within the limits")
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

/// Keeps one of several candidates.
type Resample<'a> = dyn Fn(&ShadingPoint, [f32; 5], CandidateCount) -> Option<Reservoir> + 'a;

/// Compares means of estimates with sums of `part` over all lights, at 10 shading points with 5
/// numbers of candidates each.
fn check_means(
    sampler: &LightSampler<'_>,
    rng: &mut Rng,
    part: impl Fn(&ShadingPoint, &LightSample) -> f64,
    resample: &Resample<'_>,
) {
    let mut checks = 0;
    for _ in 0..10 {
        let at = rng.shading_point(10.0);
        let of = |light| {
            let incident = sampler.sample_light(&at, light, [0.5, 0.5])?;
            Some(part(&at, &LightSample { light, pmf: sampler.pmf(&at, light), incident, user_data: 0 }))
        };
        let exact: f64 = sampler.all_lights().filter_map(of).sum();
        for candidates in [1, 2, 3, 8, MAX_CANDIDATES].map(candidate_count) {
            let draws = 6000;
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..draws {
                let kept = resample(&at, random_numbers(rng), candidates);
                let value = kept.map_or(0.0, |kept| part(&at, &kept.chosen) * f64::from(kept.weight));
                sum += value;
                squares += value * value;
            }
            let n = f64::from(draws);
            let (mean, deviation) = (sum / n, ((squares / n - (sum / n).powi(2)) / n).sqrt());
            // Five standard deviations: a false alarm in one of 10^6 checks, of which there are 50.
            assert!((mean - exact).abs() <= 5.0 * deviation, "{candidates}: {mean} {exact} {deviation}");
            // Counts the checks that are precise.
            checks += u32::from(deviation < 0.05 * exact);
        }
    }
    assert!(checks >= 25, "only {checks} of 50 checks are precise");
}

#[test]
fn the_mean_is_the_sum_over_all_lights() {
    let mut rng = Rng(71);
    let world = world_without_size(&mut rng);
    let sampler = world.sampler();
    let part = |at: &ShadingPoint, sample: &LightSample| {
        red_of_even(sample.light, sample.incident.radiance) * f64::from(cosine(at, sample.incident.direction))
    };
    check_means(&sampler, &mut rng, part, &|at, u, candidates| sampler.resample(at, u, candidates));
}

#[test]
fn the_mean_is_the_sum_over_all_lights_for_any_target_that_is_positive_where_they_count() {
    let mut rng = Rng(75);
    let world = world_without_size(&mut rng);
    let sampler = world.sampler();
    // Parts in proportion to the probability of the light: plain estimates are then between 0 and
    // 3, and means of several thousand have a normal distribution. Odd lights do not count.
    let part = |_: &ShadingPoint, sample: &LightSample| match sample.light {
        LightId::Local { light, .. } if light % 2 == 0 => f64::from(sample.pmf) * f64::from(1 + light % 3),
        _ => 0.0,
    };
    // Far from the parts, by factors between 0.5 and 17.5 that depend on direction and index.
    let target = |sample: &LightSample| match sample.light {
        LightId::Local { light, .. } if light % 2 == 0 => {
            sample.pmf * (1.5 + sample.incident.direction.y) * (1 + light % 7) as f32
        }
        _ => f32::NAN,
    };
    check_means(&sampler, &mut rng, part, &|at, u, candidates| sampler.resample_by(at, u, candidates, target));
}

#[test]
fn a_target_like_the_integrand_leaves_less_noise() {
    let mut rng = Rng(76);
    let world = world_without_size(&mut rng);
    let sampler = world.sampler();
    let (mut by_light, mut by_gloss) = (0.0, 0.0);
    for _ in 0..30 {
        let (at, mirrored) = (rng.shading_point(10.0), rng.direction());
        let gloss = |sample: &LightSample| {
            let lobe = sample.incident.direction.dot(mirrored).max(0.0).powi(20) + 0.01;
            luminance(sample.incident.radiance) * cosine(&at, sample.incident.direction) * lobe
        };
        let squares = |resample: &Resample<'_>, rng: &mut Rng| {
            let values = (0..1000).map(|_| {
                let kept = resample(&at, random_numbers(rng), CandidateCount::of::<8>());
                kept.map_or(0.0, |kept| f64::from(gloss(&kept.chosen)) * f64::from(kept.weight))
            });
            let (sum, squares) = values.fold((0.0, 0.0), |(sum, squares), v| (sum + v, squares + v * v));
            if sum > 0.0 { (squares * 1000.0 / (sum * sum) - 1.0).sqrt() } else { 0.0 }
        };
        by_light += squares(&|at, u, candidates| sampler.resample(at, u, candidates), &mut rng);
        by_gloss += squares(&|at, u, candidates| sampler.resample_by(at, u, candidates, gloss), &mut rng);
    }
    assert!(by_gloss < 0.9 * by_light, "{by_gloss} {by_light}");
}

#[test]
fn candidates_without_a_positive_target_are_never_kept() {
    let mut rng = Rng(77);
    let world = rng.world(4, 30, 4, 15.0);
    let sampler = world.sampler();
    let unwanted = [0.0, -0.0, -1.0, f32::NEG_INFINITY, f32::NAN, f32::MIN_POSITIVE / 2.0];
    let is_even = |sample: &LightSample| matches!(sample.light, LightId::Local { light, .. } if light % 2 == 0);
    let (mut kept_some, mut kept_none) = (0, 0);
    for round in 0..2000 {
        let (at, u) = (rng.shading_point(20.0), random_numbers(&mut rng));
        let (nothing, candidates) = (unwanted[round % unwanted.len()], candidate_count(1 + round as u32 % 9));
        assert_eq!(sampler.resample_by(&at, u, candidates, |_| nothing), None);
        let mut any = false;
        let kept = sampler.resample_by(&at, u, candidates, |sample| {
            any |= is_even(sample);
            if is_even(sample) { 1.0 } else { nothing }
        });
        assert_eq!(kept.is_some(), any);
        assert!(kept.is_none_or(|kept| is_even(&kept.chosen) && kept.weight > 0.0));
        kept_some += u32::from(any);
        kept_none += u32::from(!any);
    }
    assert!(kept_some > 500 && kept_none > 300, "{kept_some} {kept_none}");
}

#[test]
fn huge_and_tiny_targets_give_finite_weights() {
    let mut rng = Rng(78);
    let world = rng.world(4, 30, 4, 15.0);
    let sampler = world.sampler();
    let targets = [f32::MIN_POSITIVE, 1.0e-30, 1.0, 1.0e30, f32::MAX, f32::INFINITY];
    let mut kept = 0;
    for _ in 0..3000 {
        let (at, mut u) = (rng.shading_point(20.0), random_numbers(&mut rng));
        // Both ends of the unit interval, and numbers that are none.
        u[4] = [u[4], 0.0, 0.999_999_94, 1.0, -1.0, f32::NAN][kept as usize % 6];
        let mut target = || targets[(rng.unit() * 6.0) as usize];
        let Some(reservoir) = sampler.resample_by(&at, u, CandidateCount::of::<8>(), |_| target()) else { continue };
        assert!(reservoir.weight.is_finite() && reservoir.weight > 0.0, "{reservoir:?}");
        kept += 1;
    }
    assert!(kept > 1000, "{kept}");
}

/// The relative variance of the light that one sample estimates, surfaces included, without
/// shadows.
fn variance(
    sampler: &LightSampler<'_>,
    shading_point: &ShadingPoint,
    candidates: CandidateCount,
    rng: &mut Rng,
) -> f64 {
    let draws = 3000;
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..draws {
        let kept = sampler.resample(shading_point, random_numbers(rng), candidates);
        let value = kept.map_or(0.0, |Reservoir { chosen: sample, weight, .. }| {
            let lux = luminance(sample.incident.radiance) * cosine(shading_point, sample.incident.direction);
            f64::from(lux) * f64::from(weight)
        });
        sum += value;
        squares += value * value;
    }
    if sum > 0.0 { squares * f64::from(draws) / (sum * sum) - 1.0 } else { 0.0 }
}

#[test]
fn stratified_candidates_have_less_noise_than_independent_ones() {
    let mut rng = Rng(72);
    let world = rng.world(6, 40, 4, 20.0);
    let sampler = world.sampler();
    let (mut one, mut eight) = (0.0, 0.0);
    for _ in 0..60 {
        let shading_point = rng.shading_point(20.0);
        one += variance(&sampler, &shading_point, CandidateCount::ONE, &mut rng).sqrt();
        eight += variance(&sampler, &shading_point, CandidateCount::of::<8>(), &mut rng).sqrt();
    }
    // Independent candidates would have the deviation of one over the root of eight.
    assert!(eight < 0.9 * one / 8.0_f64.sqrt(), "{one} {eight}");
}

#[test]
fn extreme_lights_and_empty_worlds_give_finite_weights_or_none() {
    let mut rng = Rng(73);
    let mut world = LightWorld::new();
    let ground = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    assert_eq!(world.sampler().resample(&ground, [0.5; 5], CandidateCount::of::<8>()), None);
    let mut add = |height: f32, candela: f32| {
        let tree =
            world.add_tree(LightTree::new(vec![Light::point(Vec3::Y * height, Vec3::splat(candela))]).expect("valid"));
        world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid")
    };
    add(-3.0, 1.0);
    let dim = add(2.0, 1.0e-15);
    let bright = add(1.0e-10, 1.0e15);
    for candidates in [1, 2, 8, 32].map(candidate_count) {
        for _ in 0..200 {
            let kept =
                world.sampler().resample(&ground, random_numbers(&mut rng), candidates).expect("a light in sight");
            assert!(kept.weight.is_finite() && kept.weight > 0.0, "{kept:?}");
        }
    }
    world.remove_instance(bright).expect("a live instance");
    assert!(world.sampler().resample(&ground, [0.5; 5], CandidateCount::of::<8>()).is_some_and(|r| r.weight > 0.0));
    world.remove_instance(dim).expect("a live instance");
    // Only what lies below the ground is left.
    assert_eq!(world.sampler().resample(&ground, [0.5; 5], CandidateCount::of::<8>()), None);
}

/// Counts the records with another light or another weight than the CPU's.
fn others(
    world: &LightWorld,
    requests: &[SampleRequest],
    records: &[ReservoirRecord],
    resample: impl Fn(&LightSampler<'_>, &SampleRequest) -> Option<Reservoir>,
) -> usize {
    let sampler = world.sampler().from_roots();
    let directionals: Vec<_> = world.directionals().collect();
    let differs = |(request, record): (&SampleRequest, &ReservoirRecord)| {
        let twin = resample(&sampler, request);
        let (Some(twin), true) = (twin, record.weight > 0.0) else { return twin.is_some() != (record.weight > 0.0) };
        let light = match record.chosen.instance {
            u32::MAX => LightId::Directional(directionals[record.chosen.light as usize]),
            slot => {
                LightId::Local { instance: world.instance_at(slot).expect("a live slot"), light: record.chosen.light }
            }
        };
        let turn = (Vec3::from(record.chosen.direction) - twin.chosen.incident.direction).length();
        light != twin.chosen.light
            || turn > 2.0e-3
            || !close(record.weight, twin.weight)
            || !close(record.chosen.pmf, twin.chosen.pmf)
            || !close(record.chosen.pdf, twin.chosen.incident.pdf)
    };
    requests.iter().zip(records).filter(|pair| differs(*pair)).count()
}

#[test]
fn the_gpu_keeps_the_same_candidates_with_the_same_weights() {
    let (device, queue) = gpu();
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
        let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
        lights.upload(&world).expect("room enough");
        let input = buffer(&device, &queue, bytemuck::cast_slice(&requests));
        for candidates in [1, 2, 5, 8, MAX_CANDIDATES].map(candidate_count) {
            let output = buffer(&device, &queue, &vec![0; count * size_of::<ReservoirRecord>()]);
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            lights.build_top(&mut encoder);
            lights.resample(&mut encoder, &input, &output, requests.len() as u32, candidates);
            queue.submit([encoder.finish()]);
            let records: Vec<ReservoirRecord> = read(&device, &queue, &output);
            let others = others(&world, &requests, &records, |sampler, request| {
                sampler.resample(&shading_point(request), numbers(request), candidates)
            });
            // Each candidate may fall on the other side of a border between two lights, which
            // changes the weight.
            let allowed = OTHER_PICKS * f64::from(candidates.get()) * count as f64;
            assert!(others as f64 <= allowed, "{candidates}: {others} of {count} differ");
            lit += records.iter().filter(|r| r.weight > 0.0).count();
        }
    }
    assert!(lit > 3000, "{lit} are too few to compare");
}

/// An engine that weighs candidates by its own function. The host puts `CANDIDATES` and the record
/// of requests before it. Locals of the library do not hide the name of the function.
const ENGINE: &str = "
@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read_write> reservoirs: array<LightReservoir>;

struct argument { axis: vec3<f32>, not_a_number: f32 }

fn candidate(shading_point: LightShadingPoint, gloss: argument, light: LightSample) -> f32 {
    if light.instance != LIGHT_DIRECTIONAL {
        if light.light % 5u == 0u { return gloss.not_a_number; }
        if light.light % 5u == 1u { return -1.0; }
        if light.light % 11u == 3u { return 1.0e38; }
    }
    let lobe = max(dot(light.direction, gloss.axis), 0.0);
    return light.radiance.y * (lobe * lobe + 0.1) * max(dot(light.direction, shading_point.normal), 0.1);
}

@compute @workgroup_size(64) fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&requests) { return; }
    let request = requests[id.x];
    let gloss = argument(vec3(0.6, 0.8, 0.0), bitcast<f32>(request.padding));
    let at = light_surface_point(request.position, request.normal);
    reservoirs[id.x] = light_resample_by(at, gloss, request.u, request.choice, CANDIDATES);
}";

/// Twin of the function in [`ENGINE`].
fn engine_target(shading_point: &ShadingPoint, sample: &LightSample) -> f32 {
    if let LightId::Local { light, .. } = sample.light {
        match light {
            light if light % 5 == 0 => return f32::NAN,
            light if light % 5 == 1 => return -1.0,
            light if light % 11 == 3 => return 1.0e38,
            _ => {}
        }
    }
    let lobe = sample.incident.direction.dot(Vec3::new(0.6, 0.8, 0.0)).max(0.0);
    let cosine = sample.incident.direction.dot(shading_point.normal).max(0.1);
    sample.incident.radiance.y * (lobe * lobe + 0.1) * cosine
}

#[test]
fn an_engines_function_weighs_the_same_candidates_on_the_gpu() {
    let (device, queue) = gpu();
    let mut rng = Rng(79);
    let count = 2048;
    let mut requests = requests(&mut rng, count, 25.0);
    // The shader reads its NaN there.
    requests.iter_mut().for_each(|request| request.padding = f32::NAN.to_bits());
    let world = rng.world(5, 50, 5, 20.0);
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    lights.upload(&world).expect("room enough");
    let hook = TargetHook::new("candidate", "argument").expect("identifiers");
    let shader = lights.shader(1, Effects::all()).with_target(hook);
    let mut lit = 0;
    for candidates in [1, 5, 8, MAX_CANDIDATES].map(candidate_count) {
        let constant = format!("const CANDIDATES = {}u;\n", candidates.get());
        let text = shader.join(&(constant + include_str!("../../shaders/request.wgsl") + ENGINE));
        let records: Vec<ReservoirRecord> = ask(&mut lights, text, &requests, count);
        let others = others(&world, &requests, &records, |sampler, request| {
            let at = shading_point(request);
            sampler.resample_by(&at, numbers(request), candidates, |sample| engine_target(&at, sample))
        });
        // As for the library's own weights.
        let allowed = OTHER_PICKS * f64::from(candidates.get()) * count as f64;
        assert!(others as f64 <= allowed, "{candidates}: {others} of {count} differ");
        lit += records.iter().filter(|r| r.weight > 0.0).count();
    }
    assert!(lit > 3000, "{lit} are too few to compare");
}
