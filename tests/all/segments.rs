//! Segments of rays: every light that reaches a part of one keeps its chance, the probabilities and
//! the densities are true, and the GPU agrees.

use girandole::glam::{DVec3, Vec3};
use girandole::light::luminance;
use girandole::{DirectionalLight, Effects, Light, LightId, LightSample, Policy, ShadingPoint};

use crate::gpu::{ask, close, name_of, uploaded};
use testbed::measuring::in_scattering::{Ray, in_scattered};
use testbed::measuring::lights::carried;
use testbed::testing::support::{
    Rng, SPLITS, all_pmfs, assert_frequencies, assert_probabilities, distribution, mean, world_of,
};

/// A segment in the cube from `-size` to `size`, from a millimetre to a few hundred metres long.
fn segment(rng: &mut Rng, size: f32) -> ShadingPoint {
    ShadingPoint::segment(rng.position(size), rng.direction(), 10.0_f32.powf(rng.between(-3.0, 2.5)))
}

/// The point of a segment at a share of its length.
fn point(at: &ShadingPoint, share: f32) -> ShadingPoint {
    ShadingPoint::volume(at.position + at.segment * (share - 0.5))
}

#[test]
fn every_light_that_reaches_a_part_of_a_segment_is_chosen_with_the_probability_that_pmf_returns() {
    let mut rng = Rng(601);
    let world = rng.world(4, 40, 4, 15.0);
    let (mut lit, mut dark) = (0, 0);
    for splits in SPLITS {
        let sampler = world.sampler().with_splits(splits);
        for _ in 0..25 {
            let at = segment(&mut rng, 20.0);
            assert_probabilities(&sampler, &at, 200, &mut rng);
            for (light, pmf) in all_pmfs(&sampler, &at) {
                dark += u32::from(pmf == 0.0);
                for i in 0..24 {
                    let share = match i {
                        0 => 0.0,
                        1 => 1.0,
                        _ => rng.unit(),
                    };
                    let u = [rng.unit(), rng.unit()];
                    if sampler.sample_light(&point(&at, share), light, u).is_some() {
                        assert!(pmf > 0.0, "{light:?} is never chosen for {at:?}, but reaches it at {share}");
                        let along = share * at.segment.length();
                        // The ends of the segment may round to the outside.
                        let has_density = sampler.along_pdf(&at, light, along) > 0.0;
                        assert!(has_density || i < 2, "{light:?} never lights {at:?} at {share}");
                        lit += 1;
                    }
                }
            }
        }
    }
    assert!(lit > 100_000 && dark > 500, "{lit} lit points, {dark} dark lights");
}

/// Draws of [`frequencies_are_the_probabilities`] for each segment.
const DRAWS: usize = 20_000;

#[test]
fn frequencies_are_the_probabilities() {
    let mut rng = Rng(602);
    let world = world_of(rng.lights(60, 6.0), Policy::Static).0;
    let sampler = world.sampler();
    for _ in 0..6 {
        let at = segment(&mut rng, 5.0);
        assert_frequencies(&sampler, &at, DRAWS, &mut rng);
    }
}

#[test]
fn short_segments_have_the_probabilities_of_points_and_what_is_no_segment_has_their_bits() {
    let mut rng = Rng(603);
    let world = rng.world(3, 30, 3, 15.0);
    let sampler = world.sampler();
    for _ in 0..20 {
        let (origin, direction) = (rng.position(15.0), rng.direction());
        let of_point = distribution(&sampler, &ShadingPoint::volume(origin));
        let of_segment = distribution(&sampler, &ShadingPoint::segment(origin, direction, 1.0e-5));
        for (a, b) in of_point.iter().zip(of_segment) {
            // Bounds have wider margins for segments, so a light that is nearly dark may differ. In scaled
            // instances a segment scales the distance of a box as that of its mean, which a point does not.
            assert!((a - b).abs() <= 2.0e-3 * a.max(b).max(1.0e-4), "{a} {b}");
        }
        for (direction, length) in [
            (direction, 0.0),
            (direction, f32::NAN),
            (direction, f32::INFINITY),
            (direction, 1.0e10),
            (direction, 1.0e-10),
            (Vec3::ZERO, 1.0),
            (Vec3::splat(f32::NAN), 1.0),
            (Vec3::X * f32::INFINITY, 1.0),
        ] {
            assert_eq!(ShadingPoint::segment(origin, direction, length), ShadingPoint::volume(origin));
        }
        for vector in [Vec3::splat(f32::NAN), Vec3::X * f32::INFINITY, Vec3::X * 1.0e10, Vec3::X * 1.0e-10] {
            let mut at = ShadingPoint::volume(origin);
            at.segment = vector;
            assert_eq!(distribution(&sampler, &at), of_point, "{vector}");
        }
        let mut surface = ShadingPoint::surface(origin, direction);
        let matte = distribution(&sampler, &surface);
        surface.segment = Vec3::X;
        assert_eq!(distribution(&sampler, &surface), matte);
        let lost = ShadingPoint::segment(Vec3::splat(f32::NAN), direction, 1.0);
        assert!(distribution(&sampler, &lost).iter().all(|pmf| (0.0..=1.0).contains(pmf)));
    }
}

/// The closed form of the integral of the inverse squared distance.
fn equiangular(light: DVec3, ray: &Ray) -> f64 {
    let foot = (light - ray.origin).dot(ray.direction);
    let line = (light - ray.origin - ray.direction * foot).length();
    (((ray.length - foot) / line).atan() + (foot / line).atan()) / line
}

#[test]
fn two_lamps_are_chosen_in_proportion_to_the_closed_forms() {
    let mut rng = Rng(604);
    for i in 0..200 {
        // Whole metres lie on the grid of a node, so positions are exact.
        let places = [rng.position(40.0).round(), rng.position(40.0).round()];
        let candela = [0, 1].map(|_| rng.between(1.0, 9.0));
        let lamps = [0, 1].map(|k| Light::point(places[k], Vec3::splat(candela[k])));
        let world = world_of(lamps.to_vec(), Policy::Static).0;
        let at = segment(&mut rng, 40.0);
        let ray = Ray::of(&at);
        let exact = [0, 1].map(|k| f64::from(candela[k]) * equiangular(places[k].as_dvec3(), &ray));
        let sum = exact[0] + exact[1];
        for (pmf, exact) in distribution(&world.sampler(), &at).into_iter().zip(exact) {
            // The polynomial for the angle, and fluxes with eight bits of mantissa.
            assert!((f64::from(pmf) - exact / sum).abs() <= 6.0e-3, "{i}: {pmf} {}", exact / sum);
        }
    }
}

#[test]
fn samples_estimate_the_integral_over_the_segment_and_candidates_do_so_with_less_noise() {
    let mut rng = Rng(605);
    let world = rng.world(3, 20, 3, 10.0);
    let directional: Vec<DirectionalLight> =
        world.directionals().filter_map(|key| world.directional(key).copied()).collect();
    let (sampler, lights) = (world.sampler(), carried(&world));
    let draws = 20_000;
    let mut less = 0;
    for length in [0.01, 1.0, 10.0, 60.0, 200.0] {
        let at = ShadingPoint::segment(rng.position(10.0), rng.direction(), length);
        let ray = Ray::of(&at);
        let from_suns: f64 = directional.iter().map(|sun| f64::from(luminance(sun.illuminance)) * ray.length).sum();
        // A sphere that its instance flattens has another shape there: the sum is over the others.
        let is_exact = |light: &Light| !matches!(light.shape, girandole::Shape::Sphere { .. });
        let exact = lights.iter().filter(|light| is_exact(light)).map(|light| in_scattered(light, &ray, 4));
        let exact = exact.sum::<f64>() + from_suns;
        let counts = |light: LightId| match light {
            LightId::Local { instance, light } => {
                let tree = world.instance(instance).and_then(|i| world.tree(i.tree)).expect("a tree");
                is_exact(&tree.lights()[light as usize])
            }
            LightId::Directional(_) => true,
            _ => unreachable!("this version has no others"),
        };
        let value = |light, radiance: Vec3, weight: f32| match counts(light) {
            true => f64::from(luminance(radiance)) * f64::from(weight),
            false => 0.0,
        };
        let of = |sample: LightSample| {
            assert!((0.0..=length * 1.000_001).contains(&sample.incident.along));
            value(sample.light, sample.incident.radiance, 1.0 / (sample.pmf * sample.incident.pdf))
        };
        let [one, eight] = [1, 8].map(|candidates| {
            mean(draws, || {
                let u: [f32; 5] = std::array::from_fn(|_| rng.unit());
                let sample = match candidates {
                    1 => sampler.sample(&at, [u[0], u[1], u[2], u[3]]),
                    _ => sampler.reservoir_sample(&at, &sampler.resample(&at, u, candidates)),
                };
                sample.map_or(0.0, of)
            })
        });
        for [mean, error] in [one, eight] {
            // Five standard errors, and the window of ranges, which the exact integral takes at the
            // centres of lights: a false alarm in less than one of 10^6 runs.
            assert!((mean - exact).abs() <= 5.0 * error + 2.0e-3 * exact, "{length} m: {mean} {exact} {error}");
        }
        less += u32::from(eight[1] < 0.8 * one[1]);
    }
    assert!(less >= 4, "candidates lowered the noise of {less} segments only");
}

#[test]
fn distances_follow_their_density_and_make_the_estimate_of_a_point_light_exact() {
    let mut rng = Rng(606);
    for _ in 0..300 {
        let world = world_of(vec![rng.light(6.0)], Policy::Static).0;
        let sampler = world.sampler();
        let light = sampler.all_lights().next().expect("a light");
        let at = segment(&mut rng, 8.0);
        let length = f64::from(at.segment.length());
        let ray = Ray::of(&at);
        let mut last = 0.0;
        let steps = 64;
        for i in 0..=steps {
            let u = i as f32 / steps as f32;
            let Some(chosen) = sampler.sample_along(&at, light, u) else { continue };
            let slack = 1.0e-5 * at.segment.length();
            assert!(chosen.pdf > 0.0 && chosen.along >= last - slack, "{chosen:?} after {last} in {at:?}");
            assert!(f64::from(chosen.along) <= length * (1.0 + 1.0e-6));
            last = chosen.along;
            let pdf = sampler.along_pdf(&at, light, chosen.along);
            // Where a light nearly touches the line, a rounded place has another density.
            assert!((chosen.pdf / pdf - 1.0).abs() < 0.05 || pdf == 0.0 && (i == 0 || i == steps), "{chosen:?} {pdf}");
        }
        // The density integrates to 1: the angle under which the light sees the segment is the
        // variable in which it is flat, so equal steps of the numbers sum it up.
        let (mut sum, pieces) = (0.0, 4096);
        let mut before: Option<(f64, f64)> = None;
        for i in 0..=pieces {
            let Some(chosen) = sampler.sample_along(&at, light, i as f32 / pieces as f32) else { break };
            let now = (f64::from(chosen.along), f64::from(chosen.pdf));
            if let Some((along, pdf)) = before {
                sum += (now.0 - along) * (now.1 * pdf).sqrt();
            }
            before = Some(now);
        }
        if before.is_some() {
            assert!((sum - 1.0).abs() < 0.02, "{sum}: {at:?}");
        }
        let candela = rng.between(1.0, 9.0);
        let place = rng.position(6.0);
        let lamp = world_of(vec![Light::point(place, Vec3::splat(candela))], Policy::Static).0;
        let light = lamp.sampler().all_lights().next().expect("a lamp");
        let exact = f64::from(candela) * equiangular(place.as_dvec3(), &ray);
        for _ in 0..20 {
            let chosen = lamp.sampler().sample_along(&at, light, rng.unit()).expect("a lamp reaches all");
            let incident = lamp.sampler().sample_light(&chosen.shading_point, light, [0.5; 2]).expect("lit");
            let estimate = f64::from(incident.radiance.x) / f64::from(chosen.pdf);
            assert!((estimate / exact - 1.0).abs() < 2.0e-3, "{estimate} {exact} {at:?} {place}");
        }
    }
}

#[test]
fn lamps_on_the_line_behind_it_and_beyond_their_range_have_defined_distances() {
    let lamp = |place: Vec3| Light::point(place, Vec3::ONE);
    let world = world_of(
        vec![
            lamp(Vec3::new(5.0, 0.0, 0.0)),
            lamp(Vec3::new(-5.0, 0.0, 0.0)),
            lamp(Vec3::new(5.0, 3.0, 0.0)).with_range(2.0),
            Light::spot(Vec3::new(5.0, 3.0, 0.0), Vec3::Y, 0.1, 0.5, Vec3::ONE),
            Light::spot(Vec3::new(5.0, 3.0, 0.0), Vec3::NEG_Y, 0.1, std::f32::consts::FRAC_PI_4, Vec3::ONE),
        ],
        Policy::Static,
    )
    .0;
    let sampler = world.sampler();
    let ids: Vec<LightId> = sampler.all_lights().collect();
    let at = ShadingPoint::segment(Vec3::ZERO, Vec3::X, 10.0);
    for u in [0.0, 0.25, 0.5, 0.75, 1.0, -1.0, f32::NAN, f32::INFINITY] {
        // On the line: finite, inside, and the same point within rounding for most numbers.
        let on = sampler.sample_along(&at, ids[0], u).expect("it reaches the segment");
        assert!((0.0..=10.0).contains(&on.along) && on.pdf > 0.0 && on.pdf.is_finite(), "{on:?}");
        // Behind the start: the density of 1 / (t + 5)^2 on [0, 10], in closed form.
        let behind = sampler.sample_along(&at, ids[1], u).expect("it reaches the segment");
        let density = 7.5 / (5.0 + behind.along).powi(2);
        assert!((behind.pdf / density - 1.0).abs() < 1.0e-3, "{behind:?} {density}");
        if (0.0..1.0).contains(&u) {
            let exact = 1.0 / (0.2 - u / 7.5) - 5.0;
            assert!((behind.along - exact).abs() < 1.0e-3, "{behind:?} {exact}");
        }
        // Out of range, and a beam that points away.
        assert_eq!(sampler.sample_along(&at, ids[2], u), None);
        assert_eq!(sampler.sample_along(&at, ids[3], u), None);
        // A beam of 45 degrees about the foot at 5 m reaches from 2 m to 8 m.
        let beam = sampler.sample_along(&at, ids[4], u).expect("it reaches the segment");
        assert!((1.97..=8.03).contains(&beam.along), "{beam:?}");
        assert_eq!(sampler.along_pdf(&at, ids[4], 1.5), 0.0);
        // A point is the only point of itself.
        let point = ShadingPoint::volume(Vec3::ONE);
        let itself = sampler.sample_along(&point, ids[0], u).expect("a point");
        assert_eq!((itself.along, itself.pdf, itself.shading_point), (0.0, 1.0, point));
    }
    assert_eq!(sampler.along_pdf(&ShadingPoint::volume(Vec3::ONE), ids[0], 3.0), 1.0);
    let lost = ShadingPoint::segment(Vec3::splat(f32::NAN), Vec3::X, 10.0);
    let chosen = ids.iter().filter_map(|light| sampler.sample_along(&lost, *light, 0.5));
    assert!(chosen.into_iter().all(|chosen| chosen.pdf.is_nan() || chosen.pdf >= 0.0));
    assert!(sampler.sample(&lost, [0.5; 4]).is_none(), "no light reaches a segment that is nowhere");
    assert_eq!(sampler.pdf(&at, ids[0], Vec3::ONE), 0.0);
}

/// A stage that answers with the probability of a light, or with a number of the sample of a light
/// that was picked.
const STAGE: &str = "
    struct Question {
        origin: vec3<f32>, instance: u32, direction: vec3<f32>, light: u32,
        length: f32, kind: u32, u: vec2<f32>, padding: vec4<u32>,
    }
    fn answer(q: Question) -> f32 {
        let at = light_segment(q.origin, q.direction, q.length);
        if q.kind == 0u {
            return light_pmf(at, q.instance, q.light);
        }
        let chosen = light_reservoir_sample(at, light_reservoir_of(q.instance, q.light, q.u));
        let along = ALONG;
        switch q.kind {
            case 1u: { return select(0.0, along, chosen.pmf > 0.0); }
            case 2u: { return PDF_ALONG; }
            case 3u: { return chosen.radiance.x / max(chosen.pdf, 1.0e-30) * chosen.pmf; }
            case 4u: { return light_resample(at, vec4(q.u, q.u), 0.5, 4u).weight; }
            default: { return light_pdf(at, q.instance, q.light, vec3(1.0)); }
        }
    }";

#[test]
fn the_shader_gives_the_answers_of_the_cpu_and_takes_the_middle_without_the_effect() {
    let mut rng = Rng(607);
    let world = rng.world(4, 25, 3, 15.0);
    let mut lights = uploaded(&world);
    let sampler = world.sampler().from_roots();
    let (mut questions, mut expected, mut middles) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..40 {
        let (origin, direction) = (rng.position(20.0), rng.direction());
        let length = if i % 8 == 7 { 0.0 } else { 10.0_f32.powf(rng.between(-2.0, 2.3)) };
        let at = ShadingPoint::segment(origin, direction, length);
        for light in sampler.all_lights() {
            let [instance, index] = name_of(&world, light);
            let u = [rng.unit(), rng.unit()];
            let kind = if i < 20 { 0 } else { rng.bits() as u32 % 6 };
            let [x, y, z] = origin.to_array().map(f32::to_bits);
            let [p, q, r] = direction.to_array().map(f32::to_bits);
            let [a, b] = u.map(f32::to_bits);
            questions.push([x, y, z, instance, p, q, r, index, length.to_bits(), kind, a, b, 0, 0, 0, 0]);
            let sample = sampler.reservoir_sample(&at, &sampler.reservoir_of(light, u)).map(|sample| sample.incident);
            expected.push(match kind {
                0 => sampler.pmf(&at, light),
                1 => sample.map_or(0.0, |incident| incident.along),
                2 => sampler.along_pdf(&at, light, 0.4 * length),
                3 => sample.map_or(0.0, |incident| incident.radiance.x / incident.pdf.max(1.0e-30)),
                4 => sampler.resample(&at, [u[0], u[1], u[0], u[1], 0.5], 4).weight,
                _ => sampler.pdf(&at, light, Vec3::ONE),
            });
            middles.push(sampler.pmf(&ShadingPoint::volume(at.position), light));
        }
    }
    let mut with = |effects: Effects, [along, pdf]: [&str; 2]| -> Vec<f32> {
        let stage = STAGE.replace("PDF_ALONG", pdf).replace("ALONG", along);
        ask(&mut lights, effects, &stage, &questions)
    };
    let of_segments = with(
        Effects::all(),
        ["select(0.0, light_along, light_is_segment(at))", "light_along_pdf(at, q.instance, q.light, 0.4 * q.length)"],
    );
    let without = with(Effects::all() - Effects::SEGMENTS, ["0.0", "0.0"]);
    let mut changed = 0;
    let mut far = [0; 6];
    let mut counts = [0; 6];
    for (i, (cpu, gpu)) in expected.iter().zip(&of_segments).enumerate() {
        let kind = questions[i][9] as usize;
        counts[kind] += 1;
        // A light at the edge of a cone or near the line moves by more than its rounding.
        let is_close = (cpu - gpu).abs() <= 1.0e-2 * cpu.abs().max(gpu.abs()).max(1.0e-20);
        assert!(is_close || kind > 0, "{cpu} {gpu}: {:?}", questions[i].map(f32::from_bits));
        far[kind] += u32::from(!is_close);
        if kind == 0 {
            assert!(close(middles[i], without[i]), "{} {}", middles[i], without[i]);
            // A segment without length has the same bits in both shaders.
            assert!(questions[i][8] != 0 || of_segments[i].to_bits() == without[i].to_bits());
            changed += u32::from((cpu / middles[i] - 1.0).abs() > 0.1);
        }
    }
    assert!(changed > 300, "only {changed} probabilities depend on the segment");
    for (far, count) in far.into_iter().zip(counts) {
        assert!(far * 100 <= count, "{far} of {count} answers differ");
    }
}
