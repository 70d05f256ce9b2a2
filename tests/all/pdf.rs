//! The density of a point that a ray hit is the density that sampling has for it.

use girandole::glam::{DMat3, DVec3, Mat3, Vec3};
use girandole::{Effects, Light, LightId, LightSampler, LightTree, LightWorld, Placement, Policy, ShadingPoint, Shape};

use crate::gpu::{ask, uploaded};
use testbed::testing::support::{Rng, SPLITS, place_tree};

/// Rounding of products of some forty factors on both sides.
const TOLERANCE: f32 = 1.0e-4;
/// Roundings of coordinates that add up in a distance or in the height above a surface.
const ROUNDINGS: f32 = 32.0;
/// As in `gpu.rs`: probabilities are products of some twenty terms that GPUs round differently.
const GPU_TOLERANCE: f32 = 2.0e-3;

/// The cosine at a light's surface, in f64: near its edge the density is the inverse of a small
/// difference.
fn cosine(world: &LightWorld, light: LightId, direction: Vec3) -> f32 {
    let LightId::Local { instance, light } = light else { return 1.0 };
    let tree = world.instance(instance).and_then(|i| world.tree(i.tree)).expect("a live instance");
    let normal = match tree.lights()[light as usize].shape {
        Shape::Rectangle { half_u, half_v, .. } => half_u.as_dvec3().cross(half_v.as_dvec3()),
        Shape::Triangle { vertices: [a, b, c], .. } => (b - a).as_dvec3().cross((c - a).as_dvec3()),
        _ => return 1.0,
    };
    let linear: DMat3 = world.instance(instance).expect("a live instance").placement.linear.as_dmat3();
    let normal = (linear.inverse().transpose() * normal).normalize();
    normal.dot(direction.as_dvec3()).abs() as f32
}

/// The largest relative difference of two densities at a point that is known by its f32 coordinates
/// only.
pub(crate) fn tolerance(world: &LightWorld, shading_point: &ShadingPoint, light: LightId, point: Vec3) -> f32 {
    let toward = point - shading_point.position;
    let coordinates = shading_point.position.abs().element_sum() + point.abs().element_sum() + 1.0;
    let height = toward.length() * cosine(world, light, toward.normalize());
    TOLERANCE + ROUNDINGS * f32::EPSILON * coordinates / height
}

/// Compares the densities at one sampled point. Returns whether there was a point that can be
/// compared.
fn agrees_at_a_sample(
    sampler: &LightSampler<'_>,
    world: &LightWorld,
    shading_point: &ShadingPoint,
    u: [f32; 4],
) -> bool {
    let Some(sample) = sampler.sample(shading_point, u) else { return false };
    let point = shading_point.position + sample.incident.direction * sample.incident.dist;
    if sample.incident.is_delta {
        assert_eq!(sampler.pdf(shading_point, sample.light, point), 0.0);
        return false;
    }
    let expected = sample.pmf * sample.incident.pdf;
    let tolerance = tolerance(world, shading_point, sample.light, point);
    let pdf = sampler.pdf(shading_point, sample.light, point);
    // Where rounding leaves nothing of a distance or a height, no density can be compared.
    let is_comparable = tolerance < 0.05;
    assert!(
        !is_comparable || (pdf / expected - 1.0).abs() <= tolerance,
        "{pdf} {expected} {tolerance} {shading_point:?} {sample:?}"
    );
    is_comparable
}

/// Moves all instances by `far` along each axis.
fn moved(mut world: LightWorld, far: f64) -> LightWorld {
    let instances: Vec<_> = world.instances().collect();
    for instance in instances {
        let placement = world.instance(instance).expect("a live instance").placement;
        let translation = placement.translation + DVec3::splat(far);
        world.move_instance(instance, Placement { translation, ..placement }).expect("valid");
    }
    world
}

#[test]
fn densities_at_sampled_points_are_those_of_the_samples() {
    let mut rng = Rng(60);
    let mut compared = 0;
    for far in [0.0, 1.0e4] {
        for round in 0..12 {
            let mut world = moved(rng.world(5, 40, 5, 15.0), far);
            world.set_solid_angle_sampling(round >= 6);
            let sampler = world.sampler().with_splits(SPLITS[round % SPLITS.len()]);
            for _ in 0..2500 {
                let mut shading_point = rng.shading_point(20.0);
                shading_point.position += far as f32;
                let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
                compared += usize::from(agrees_at_a_sample(&sampler, &world, &shading_point, u));
            }
        }
    }
    assert!(compared > 6000, "{compared} are too few to compare");
}

#[test]
fn densities_agree_very_near_lights() {
    let mut rng = Rng(61);
    let mut compared = 0;
    for round in 0..40 {
        let mut world = rng.world(2, 12, 3, 4.0);
        world.set_solid_angle_sampling(round % 2 == 1);
        let sampler = world.sampler();
        for _ in 0..400 {
            let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
            let Some(sample) = sampler.sample(&ShadingPoint::volume(rng.position(5.0)), u) else { continue };
            if sample.incident.is_delta {
                continue;
            }
            // A point on a light, and a shading point up to a decimetre from it.
            let from = rng.direction() * 10.0_f32.powf(rng.between(-4.0, -1.0));
            let at = ShadingPoint::volume(rng.position(5.0));
            if let Some(near) = sampler.sample_light(&at, sample.light, [rng.unit(), rng.unit()]) {
                let shading_point = ShadingPoint::volume(at.position + near.direction * near.dist + from);
                for _ in 0..4 {
                    let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
                    compared += usize::from(agrees_at_a_sample(&sampler, &world, &shading_point, u));
                }
            }
        }
    }
    assert!(compared > 4000, "{compared} are too few to compare");
}

/// The distance along a ray to its first hit of a light, both in the light's space.
pub(crate) fn hit(light: &Light, origin: DVec3, direction: DVec3) -> Option<f64> {
    let flat = |corner: DVec3, a: DVec3, b: DVec3, inside: &dyn Fn(f64, f64) -> bool| {
        let inverse = DMat3::from_cols(a, b, -direction).inverse();
        let DVec3 { x, y, z } = inverse * (origin - corner);
        (inverse.is_finite() && z > 0.0 && inside(x, y)).then_some(z)
    };
    match light.shape {
        Shape::Rectangle { center, half_u, half_v, .. } => {
            let inside = |x: f64, y: f64| x.abs() <= 1.0 && y.abs() <= 1.0;
            flat(center.as_dvec3(), half_u.as_dvec3(), half_v.as_dvec3(), &inside)
        }
        Shape::Triangle { vertices: [p, q, r], .. } => {
            let inside = |x: f64, y: f64| x >= 0.0 && y >= 0.0 && x + y <= 1.0;
            flat(p.as_dvec3(), (q - p).as_dvec3(), (r - p).as_dvec3(), &inside)
        }
        Shape::Sphere { center, radius } => {
            let (from, a) = (origin - center.as_dvec3(), direction.length_squared());
            let (b, c) = (from.dot(direction), from.length_squared() - f64::from(radius).powi(2));
            let root = b * b - a * c;
            (root >= 0.0 && b < 0.0).then(|| (-b - root.sqrt()) / a)
        }
        Shape::Point { .. } | Shape::Spot { .. } => None,
        _ => unreachable!("this version has no others"),
    }
}

#[test]
fn densities_integrate_to_the_probability_of_a_sample() {
    for by_solid_angle in [false, true] {
        check_integrals(&mut Rng(62), by_solid_angle);
    }
}

fn check_integrals(rng: &mut Rng, by_solid_angle: bool) {
    let triangle = [Vec3::new(-1.0, -0.7, 0.2), Vec3::new(1.2, -0.8, 0.0), Vec3::new(0.1, 1.1, 0.3)];
    let shapes = [
        Light::rectangle(Vec3::ZERO, Vec3::X, Vec3::new(0.3, 0.8, 0.0), Vec3::ONE),
        Light::rectangle(Vec3::ZERO, Vec3::X, Vec3::new(0.3, 0.8, 0.0), Vec3::ONE).two_sided(),
        Light::triangle(triangle, Vec3::ONE),
        Light::triangle(triangle, Vec3::ONE).two_sided(),
        Light::sphere(Vec3::ZERO, 0.9, Vec3::ONE),
    ];
    let linears = [
        Mat3::IDENTITY,
        Mat3::from_diagonal(Vec3::splat(0.7)),
        Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)),
        Mat3::from_cols(Vec3::X, Vec3::new(0.6, 1.0, 0.2), Vec3::new(0.0, 0.3, 1.4)),
        Mat3::from_diagonal(Vec3::new(1.5, 0.4, 0.8)),
    ];
    let mut lit = 0;
    for light in shapes {
        for linear in linears {
            let mut world = LightWorld::new();
            world.set_solid_angle_sampling(by_solid_angle);
            let tree = world.add_tree(LightTree::new(vec![light]).expect("valid"));
            let placement = Placement { linear, translation: DVec3::new(0.5, -0.2, 0.3) };
            let instance = world.add_instance(tree, placement, Policy::Static).expect("valid");
            let id = LightId::Local { instance, light: 0 };
            let sampler = world.sampler();
            let at = rng.direction() * rng.between(1.7, 2.5);
            for shading_point in
                [ShadingPoint::volume(at), ShadingPoint::surface(at, (rng.direction() - 0.6 * at).normalize())]
            {
                let draws = 40_000;
                let to_local = linear.as_dmat3().inverse();
                let origin = to_local * (at.as_dvec3() - placement.translation);
                let (mut sum, mut squares, mut chosen) = (0.0, 0.0, 0);
                for _ in 0..draws {
                    let direction = rng.direction();
                    if let Some(distance) = hit(&light, origin, to_local * direction.as_dvec3()) {
                        let point = at + direction * distance as f32;
                        let over = f64::from(sampler.pdf(&shading_point, id, point)) * 4.0 * std::f64::consts::PI;
                        sum += over;
                        squares += over * over;
                    }
                    let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
                    chosen += u32::from(sampler.sample(&shading_point, u).is_some());
                }
                let n = f64::from(draws);
                let (mean, share) = (sum / n, f64::from(chosen) / n);
                // Five standard deviations of both: a false alarm in one of 10^6 checks, of which
                // there are 100.
                let variance = (squares / n - mean * mean + share * (1.0 - share)) / n;
                let difference = (mean - share).abs();
                assert!(difference <= 5.0 * variance.sqrt() + 1e-6, "{mean} {share} {light:?} {linear:?}");
                lit += u32::from(chosen > 0);
            }
        }
    }
    assert!(lit >= 25, "only {lit} of 50 shading points are lit");
}

#[test]
fn points_that_sampling_never_returns_have_no_density() {
    let mut world = LightWorld::new();
    let lights = vec![
        Light::rectangle(Vec3::ZERO, Vec3::X, Vec3::Z, Vec3::ONE).with_range(2.0),
        Light::sphere(Vec3::new(5.0, 0.0, 0.0), 1.0, Vec3::ONE),
        Light::point(Vec3::new(9.0, 0.0, 0.0), Vec3::ONE),
    ];
    let (_, instance) = place_tree(&mut world, lights, Placement::IDENTITY, Policy::Static);
    let sampler = world.sampler();
    let pdf = |shading_point: ShadingPoint, light, point| {
        sampler.pdf(&shading_point, LightId::Local { instance, light }, point)
    };
    let below = ShadingPoint::volume(Vec3::new(0.1, -1.0, 0.1));
    // X x Z points down.
    assert!(pdf(below, 0, Vec3::ZERO) > 0.0);
    assert_eq!(pdf(ShadingPoint::volume(Vec3::Y), 0, Vec3::ZERO), 0.0, "behind");
    assert_eq!(pdf(ShadingPoint::surface(below.position, Vec3::NEG_Y), 0, Vec3::ZERO), 0.0, "below the horizon");
    assert_eq!(pdf(ShadingPoint::volume(Vec3::Y * -2.1), 0, Vec3::ZERO), 0.0, "out of range");
    assert_eq!(pdf(ShadingPoint::volume(Vec3::ZERO), 0, Vec3::ZERO), 0.0, "on the light");
    assert_eq!(pdf(ShadingPoint::volume(Vec3::X * 5.5), 1, Vec3::X * 6.0), 0.0, "inside");
    assert_eq!(pdf(below, 2, Vec3::X * 9.0), 0.0, "no size");
    assert_eq!(pdf(below, 3, Vec3::ZERO), 0.0, "no such light");
}

#[test]
fn densities_in_an_engines_shader_are_those_of_the_cpu() {
    for (far, by_solid_angle) in [(0.0, false), (1.0e4, false), (0.0, true), (1.0e4, true)] {
        // The same world each time.
        compare_densities(&mut Rng(63), far, by_solid_angle);
    }
}

fn compare_densities(rng: &mut Rng, far: f64, by_solid_angle: bool) {
    let mut world = moved(rng.world(4, 25, 4, 12.0), far);
    world.set_solid_angle_sampling(by_solid_angle);
    let mut lights = uploaded(&world);
    let sampler = world.sampler().from_roots();
    let mut questions: Vec<[u32; 12]> = Vec::new();
    let mut expected = Vec::new();
    while expected.len() < 4000 {
        let mut shading_point = rng.shading_point(15.0);
        shading_point.position += far as f32;
        let Some(pick) = sampler.pick(&shading_point, [rng.unit(), rng.unit()]) else { continue };
        let LightId::Local { instance, light } = pick.light else { continue };
        // Sampled from another place, so that some points lie on backs and below horizons.
        let at = ShadingPoint::volume(rng.position(15.0) + far as f32);
        let Some(incident) = sampler.sample_light(&at, pick.light, [rng.unit(), rng.unit()]) else { continue };
        let point = at.position + incident.direction * incident.dist;
        if expected.len() % 3 == 0 {
            // Up to a decimetre from it.
            shading_point.position = point + rng.direction() * 10.0_f32.powf(rng.between(-4.0, -1.0));
        }
        let [x, y, z] = shading_point.position.to_array().map(f32::to_bits);
        let [p, q, r] = shading_point.normal.to_array().map(f32::to_bits);
        let [a, b, c] = point.to_array().map(f32::to_bits);
        questions.push([x, y, z, world.slot(instance).expect("a live instance"), p, q, r, light, a, b, c, 0]);
        let tolerance = GPU_TOLERANCE + tolerance(&world, &shading_point, pick.light, point);
        expected.push((sampler.pdf(&shading_point, pick.light, point), tolerance));
    }
    let text = "struct Question { position: vec3<f32>, instance: u32, normal: vec3<f32>, light: u32, point: vec3<f32> }
        fn answer(q: Question) -> f32 {
            return light_pdf(light_surface_point(q.position, q.normal), q.instance, q.light, q.point);
        }";
    let answers: Vec<f32> = ask(&mut lights, Effects::all(), text, &questions);
    let (mut lit, mut dark) = (0, 0);
    for ((cpu, tolerance), gpu) in expected.iter().zip(&answers) {
        let is_comparable = *tolerance < 0.05;
        assert!(!is_comparable || (cpu - gpu).abs() <= tolerance * cpu.max(*gpu), "{cpu} {gpu} {tolerance}");
        lit += u32::from(is_comparable && *cpu > 0.0);
        dark += u32::from(is_comparable && *cpu == 0.0);
    }
    assert!(lit > 200 && dark > 200, "{lit} {dark}");
}
