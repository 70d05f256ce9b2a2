//! The first light that a ray hits, against all lights in turn, in f64.

use girandole::glam::{DMat3, DVec3, Mat3, Vec2, Vec3};
use girandole::{
    Effects, FrameBudget, Instance, Light, LightId, LightSample, LightTree, LightWorld, Placement, Policy,
    ShadingPoint, Shape,
};

use crate::gpu::{ask, close, uploaded};
use crate::pdf::{hit, tolerance};
use testbed::testing::support::{Rng, SPLITS, place_tree};

/// Roundings of coordinates of up to some forty metres in a distance.
const ROUNDING: f64 = 1.0e-4;
/// Rays that pass an edge within rounding may hit or miss: one in so many.
const RAYS_PER_EDGE: usize = 500;

/// The first light that sends light back along a ray, by all lights in turn: its distance and its radiance.
fn first_of_all(world: &LightWorld, at: &ShadingPoint, direction: Vec3, max_dist: f64) -> Option<(LightId, f64, Vec3)> {
    let mut first: Option<(LightId, f64, Vec3)> = None;
    for instance in world.instances() {
        let Instance { placement, appearance, tree, .. } = world.instance(instance).expect("a live instance");
        if !appearance.is_enabled || appearance.mask & at.mask == 0 {
            continue;
        }
        let to_local: DMat3 = placement.linear.as_dmat3().inverse();
        let origin = to_local * (at.position.as_dvec3() - placement.translation);
        let local = to_local * direction.as_dvec3();
        let tree = world.tree(*tree).expect("a live tree");
        for (index, light) in tree.lights().iter().enumerate().filter(|(_, light)| light.flux() > 0.0) {
            let Some(dist) = hit(light, origin, local) else { continue };
            let (normal, two_sided) = match light.shape {
                Shape::Rectangle { half_u, half_v, two_sided, .. } => (half_u.cross(half_v), two_sided),
                Shape::Triangle { vertices: [p, q, r], two_sided } => ((q - p).cross(r - p), two_sided),
                _ => (Vec3::ZERO, true),
            };
            let is_lit = two_sided || normal.as_dvec3().dot(local) < 0.0;
            let window =
                if f64::from(light.range) < 1.0e18 { 1.0 - (dist / f64::from(light.range)).powi(4) } else { 1.0 };
            if is_lit && window > 0.0 && dist < first.map_or(max_dist, |(_, nearest, _)| nearest) {
                let radiance = light.emission * window as f32 * appearance.factor;
                first = Some((LightId::Local { instance, light: index as u32 }, dist, radiance));
            }
        }
    }
    first
}

/// A ray toward a random place, or toward a point on a random light.
fn ray(rng: &mut Rng, world: &LightWorld) -> (ShadingPoint, Vec3, f32) {
    let shading_point = rng.masked_point(20.0);
    let sampler = world.sampler();
    let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
    let toward = sampler.sample(&shading_point, u).map(|sample| sample.incident.direction);
    let direction = toward.filter(|_| rng.unit() < 0.7).unwrap_or_else(|| rng.direction());
    let max_dist = if rng.unit() < 0.3 { rng.between(0.0, 30.0) } else { f32::INFINITY };
    (shading_point, direction, max_dist)
}

#[test]
fn a_ray_hits_the_first_of_all_lights() {
    let (mut hits, mut rays, mut edges) = (0, 0, 0);
    for round in 0..30 {
        let mut rng = Rng(900 + round);
        let mut world = rng.varied_world(5, 1 + 3 * round as usize, 6, 15.0);
        world.set_solid_angle_sampling(round % 2 == 1);
        world.update(FrameBudget::NONE);
        let sampler = world.sampler().with_splits(SPLITS[round as usize % SPLITS.len()]);
        for _ in 0..400 {
            let (at, direction, max_dist) = ray(&mut rng, &world);
            let found = sampler.hit(&at, direction, max_dist);
            let is_above = at.normal == Vec3::ZERO || at.normal.dot(direction) > 0.0;
            let expected = first_of_all(&world, &at, direction, max_dist.into()).filter(|_| is_above);
            rays += 1;
            match (found, expected) {
                (None, None) => {}
                (Some(found), Some((light, dist, radiance))) if found.light == light => {
                    let (incident, point) = (found.incident, at.position + direction * found.incident.dist);
                    assert!((f64::from(incident.dist) - dist).abs() <= ROUNDING * (1.0 + dist), "{found:?} {dist}");
                    assert!(close(incident.radiance.length(), radiance.length()), "{found:?} {radiance}");
                    assert_eq!((incident.direction, incident.is_delta), (direction, false));
                    assert_eq!(found.pmf, sampler.pmf(&at, light));
                    // The point has the rounding of its coordinates, which the direction has not.
                    let (pdf, rounding) = (sampler.pdf(&at, light, point), tolerance(&world, &at, light, point));
                    let is_close = (pdf / (found.pmf * incident.pdf) - 1.0).abs() <= rounding;
                    assert!(rounding > 0.05 || is_close, "{found:?} {pdf} {rounding}");
                    let LightId::Local { instance, .. } = light else { panic!("{light:?}") };
                    assert_eq!(Some(found.user_data), world.instance(instance).map(|i| i.appearance.user_data));
                    hits += 1;
                }
                _ => edges += 1,
            }
        }
    }
    assert!(hits > 1500, "{hits} hits are too few");
    assert!(edges * RAYS_PER_EDGE <= rays, "{edges} of {rays} rays hit another light");
}

#[test]
fn rays_and_samples_weighed_by_the_balance_heuristic_have_the_mean_of_samples() {
    let mut rng = Rng(77);
    let mut world = LightWorld::new();
    let lights = vec![
        Light::rectangle(Vec3::new(0.0, 3.0, 0.0), Vec3::X, Vec3::Z, Vec3::splat(5.0)),
        Light::sphere(Vec3::new(1.5, 1.0, 0.5), 0.6, Vec3::splat(2.0)),
        Light::point(Vec3::new(-2.0, 1.0, 0.0), Vec3::splat(3.0)),
    ];
    let tree = world.add_tree(LightTree::new(lights).expect("valid"));
    for x in [0.0, 4.0, -5.0] {
        world.add_instance(tree, Placement::at(DVec3::new(x, 0.0, 1.0)), Policy::Static).expect("valid");
    }
    let sampler = world.sampler();
    let at = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    let density = 1.0 / std::f32::consts::TAU;
    // The first are those of samples alone, the second those of both; uniform directions stand for the BSDF.
    let (mut sums, mut squares) = ([0.0; 2], [0.0; 2]);
    let n = 100_000;
    for _ in 0..n {
        let lux = |s: &LightSample, pdf: f32| s.incident.radiance.y * s.incident.direction.y / pdf;
        let mut values = [0.0; 2];
        if let Some(s) = sampler.sample(&at, [rng.unit(), rng.unit(), rng.unit(), rng.unit()]) {
            let pdf = s.pmf * s.incident.pdf;
            values = [lux(&s, pdf), lux(&s, pdf + if s.incident.is_delta { 0.0 } else { density })];
        }
        let direction = rng.direction();
        let direction = direction.with_y(direction.y.abs());
        if let Some(s) = sampler.hit(&at, direction, f32::INFINITY) {
            values[1] += lux(&s, s.pmf * s.incident.pdf + density);
        }
        for (k, value) in values.into_iter().enumerate() {
            sums[k] += f64::from(value);
            squares[k] += f64::from(value).powi(2);
        }
    }
    let n = f64::from(n);
    let [a, b] = sums.map(|sum| sum / n);
    let variance: f64 = (0..2).map(|k| (squares[k] / n - (sums[k] / n).powi(2)) / n).sum();
    // Five standard deviations: a false alarm in one of 10^6 seeds. One percent would be found.
    assert!((a - b).abs() <= 5.0 * variance.sqrt(), "{a} {b} {}", variance.sqrt());
    assert!(5.0 * variance.sqrt() < 0.01 * a, "too noisy: {a} {}", variance.sqrt());
}

#[test]
fn rays_that_meet_nothing_that_shines_hit_nothing() {
    let mut world = LightWorld::new();
    let lights = vec![
        Light::rectangle(Vec3::ZERO, Vec3::X, Vec3::Z, Vec3::ONE).with_range(2.0),
        Light::sphere(Vec3::new(5.0, 0.0, 0.0), 1.0, Vec3::ONE),
        Light::point(Vec3::new(9.0, 0.0, 0.0), Vec3::ONE),
        Light::sphere(Vec3::new(20.0, 0.0, 0.0), 1.0, Vec3::ZERO),
    ];
    assert!(world.sampler().hit(&ShadingPoint::volume(Vec3::ZERO), Vec3::X, f32::INFINITY).is_none(), "no lights");
    let (_, instance) = place_tree(&mut world, lights, Placement::IDENTITY, Policy::Static);
    let hits = |world: &LightWorld, from: Vec3, direction: Vec3, max_dist: f32| {
        world.sampler().hit(&ShadingPoint::volume(from), direction, max_dist).is_some()
    };
    // X x Z points down.
    assert!(hits(&world, Vec3::NEG_Y, Vec3::Y, 1.01));
    assert!(!hits(&world, Vec3::NEG_Y, Vec3::Y, 0.99), "too far");
    assert!(!hits(&world, Vec3::NEG_Y, Vec3::NEG_Y, f32::INFINITY), "in the other direction");
    assert!(!hits(&world, Vec3::Y, Vec3::NEG_Y, f32::INFINITY), "behind");
    assert!(!hits(&world, Vec3::Y * -2.1, Vec3::Y, f32::INFINITY), "out of range");
    assert!(hits(&world, Vec3::new(5.0, -3.0, 0.0), Vec3::Y, f32::INFINITY));
    assert!(!hits(&world, Vec3::X * 5.5, Vec3::Y, f32::INFINITY), "inside");
    assert!(!hits(&world, Vec3::new(9.0, -1.0, 0.0), Vec3::Y, f32::INFINITY), "no size");
    assert!(!hits(&world, Vec3::new(20.0, -3.0, 0.0), Vec3::Y, f32::INFINITY), "dark");
    assert!(!hits(&world, Vec3::NEG_Y, Vec3::splat(f32::NAN), f32::INFINITY), "no direction");
    let below = ShadingPoint::surface(Vec3::NEG_Y, Vec3::NEG_Y);
    assert!(world.sampler().hit(&below, Vec3::Y, f32::INFINITY).is_none(), "below the horizon");
    let segment = ShadingPoint::segment(Vec3::NEG_Y, Vec3::Y, 0.5);
    assert!(world.sampler().hit(&segment, Vec3::Y, f32::INFINITY).is_none(), "a segment");
    world.set_appearance(instance, |a| a.is_enabled = false).expect("a live instance");
    assert!(!hits(&world, Vec3::NEG_Y, Vec3::Y, f32::INFINITY), "hidden");
}

#[test]
fn a_light_that_a_factor_makes_black_hides_none_behind_it() {
    let mut world = LightWorld::new();
    // X x Z points down.
    let panel = Light::rectangle(Vec3::ZERO, Vec3::X, Vec3::Z, Vec3::Z);
    let tree = world.add_tree(LightTree::new(vec![panel]).expect("valid"));
    let [near, far] =
        [1.0, 2.0].map(|y| world.add_instance(tree, Placement::at(DVec3::Y * y), Policy::Static).expect("valid"));
    let hit = |world: &LightWorld| world.sampler().hit(&ShadingPoint::volume(Vec3::ZERO), Vec3::Y, 9.0);
    let of = |instance| Some(LightId::Local { instance, light: 0 });
    assert_eq!(hit(&world).map(|hit| hit.light), of(near));
    // The light is blue.
    world.set_appearance(near, |a| a.factor = Vec3::X).expect("a live instance");
    assert_eq!(hit(&world).map(|hit| hit.light), of(far));
}

#[test]
fn rays_in_an_engines_shader_hit_what_they_hit_on_the_cpu() {
    let mut rng = Rng(901);
    let mut world = rng.varied_world(5, 60, 6, 15.0);
    // Crossing strings of panels, which are parts of the top level.
    for i in 0..6 {
        let panel = |i: usize| Light::rectangle(Vec3::X * (i as f32 - 4.0), Vec3::Y * 0.2, Vec3::Z * 0.2, Vec3::ONE);
        let tree = world.add_tree(LightTree::new((0..9).map(panel).collect()).expect("valid"));
        let linear = Mat3::from_rotation_y(i as f32);
        world.add_instance(tree, Placement { linear, ..Placement::IDENTITY }, Policy::Budgeted).expect("valid");
    }
    world.update(FrameBudget::NONE);
    let mut lights = uploaded(&world);
    let sampler = world.sampler().from_roots();
    let mut questions: Vec<[f32; 12]> = Vec::new();
    let (mut expected, mut places) = (Vec::new(), Vec::new());
    for _ in 0..4000 {
        let (at, direction, max_dist) = ray(&mut rng, &world);
        let max_dist = max_dist.min(1.0e18);
        let ([x, y, z], [p, q, r]) = (at.position.to_array(), at.normal.to_array());
        let [a, b, c] = direction.to_array();
        questions.push([x, y, z, f32::from_bits(at.mask), p, q, r, max_dist, a, b, c, 0.0]);
        let hit = sampler.hit(&at, direction, max_dist);
        places.push(hit.and_then(|hit| sampler.place_on_light(&at, &hit)));
        expected.push(hit);
    }
    let text =
        "struct Question { position: vec3<f32>, mask: u32, normal: vec3<f32>, max_dist: f32, direction: vec3<f32> }
        struct Answer { hit: LightSample, place: vec2<f32> }
        fn answer(q: Question) -> Answer {
            let point = light_masked_point(light_surface_point(q.position, q.normal), q.mask);
            let hit = light_hit(point, q.direction, q.max_dist);
            return Answer(hit, light_place_on(point, hit));
        }";
    let answers: Vec<[f32; 16]> = ask(&mut lights, Effects::all(), text, &questions);
    let (mut hits, mut edges) = (0, 0);
    for ((cpu, gpu), place) in expected.iter().zip(&answers).zip(&places) {
        let [_, _, _, dist, red, green, blue, pdf, pmf, instance, light, _, x, y, ..] = *gpu;
        let radiance = Vec3::new(red, green, blue);
        let named = (radiance != Vec3::ZERO).then(|| LightId::Local {
            instance: world.instance_at(instance.to_bits()).expect("a live slot"),
            light: light.to_bits(),
        });
        match cpu {
            Some(cpu) if named == Some(cpu.light) => {
                assert!(close(dist, cpu.incident.dist) && close(pmf, cpu.pmf), "{gpu:?} {cpu:?}");
                assert!(close(radiance.length(), cpu.incident.radiance.length()), "{gpu:?} {cpu:?}");
                // Near its edge, the density of a surface is the inverse of a small difference.
                assert!(close(pdf, cpu.incident.pdf) || pdf > 1.0e3, "{gpu:?} {cpu:?}");
                let on_light = Vec2::new(x, y);
                assert!(on_light.distance(place.unwrap_or(Vec2::ZERO)) < 1.0e-3, "{on_light} {place:?} {cpu:?}");
                hits += 1;
            }
            None if named.is_none() => {}
            _ => edges += 1,
        }
    }
    assert!(hits > 500, "{hits} hits are too few");
    assert!(edges * RAYS_PER_EDGE <= expected.len(), "{edges} of {} rays hit another light", expected.len());
}
