//! Rectangles and triangles that are sampled by solid angle: means against closed forms, densities,
//! extreme sizes and places, and the setting that turns them on.

use crate::gpu::{OTHER_PICKS, compare, gpu_lights, sample, sample_by};
use girandole::effects::EFFECT_HOLD_UPDATES;
use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::light::luminance;
use girandole::{
    Effects, FrameBudget, Incident, Light, LightId, LightSampler, LightTree, LightWorld, Placement, Policy,
    ShadingPoint, Shape,
};
use testbed::common::batch::SampleRequest;
use testbed::measuring::irradiance::irradiance;
use testbed::testing::support::Rng;

const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

/// Relative rounding of densities and of the closed form's inputs, for shading points that are not
/// much nearer than a hundredth of a light's size.
const ROUNDING: f64 = 1.0e-4;

/// An illuminance, in lux per nit, below what the rounding of a normal in f32 lifts above the
/// horizon.
const HORIZON: f64 = 1.0e-7;

/// A world of one light that is sampled by solid angle where it is near.
fn world_of(light: Light, linear: Mat3) -> (LightWorld, LightId) {
    let mut world = LightWorld::new();
    world.set_solid_angle_sampling(true);
    let tree = world.add_tree(LightTree::new(vec![light]).expect("valid"));
    let placement = Placement { linear, ..Placement::IDENTITY };
    let instance = world.add_instance(tree, placement, Policy::Static).expect("valid");
    (world, LightId::Local { instance, light: 0 })
}

/// The light in the world, with its front on the side on which the instance has it.
fn transformed(light: &Light, linear: Mat3) -> Light {
    let is_mirrored = linear.determinant() < 0.0;
    let mut light = *light;
    match &mut light.shape {
        Shape::Rectangle { center, half_u, half_v, .. } => {
            (*center, *half_u, *half_v) = (linear * *center, linear * *half_u, linear * *half_v);
            if is_mirrored {
                *half_v = -*half_v;
            }
        }
        Shape::Triangle { vertices, .. } => {
            *vertices = vertices.map(|vertex| linear * vertex);
            if is_mirrored {
                vertices.swap(1, 2);
            }
        }
        _ => unreachable!("only flat lights are tested here"),
    }
    light
}

fn shapes() -> [Light; 5] {
    let triangle = [Vec3::new(-1.0, -0.7, 0.2), Vec3::new(1.2, -0.8, 0.0), Vec3::new(0.1, 1.1, 0.3)];
    [
        Light::rectangle(Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE),
        Light::rectangle(Vec3::ZERO, Vec3::X, Vec3::new(0.6, 0.05, 0.0), Vec3::ONE),
        Light::rectangle(Vec3::ZERO, Vec3::X, Vec3::new(0.3, 0.8, 0.1), Vec3::ONE).two_sided(),
        Light::triangle(triangle, Vec3::ONE),
        Light::triangle([Vec3::ZERO, Vec3::X, Vec3::new(0.9, 0.03, 0.0)], Vec3::ONE).two_sided(),
    ]
}

/// The illuminance that one sample estimates, in lux.
fn estimate(shading_point: &ShadingPoint, incident: &Incident) -> f64 {
    let is_volume = shading_point.normal == Vec3::ZERO;
    let cosine = if is_volume { 1.0 } else { shading_point.normal.dot(incident.direction) };
    f64::from(luminance(incident.radiance) * cosine / incident.pdf)
}

/// The mean of the estimates of `draws` samples, and the standard deviation of that mean.
///
/// If the horizon leaves less than a hundred of the samples, their variance says little. Then the
/// deviation is the largest that is possible: estimates lie between 0 and the illuminance of a
/// surface that always faces the light.
fn mean(
    sampler: &LightSampler<'_>,
    light: LightId,
    shading_point: &ShadingPoint,
    [exact, largest]: [f64; 2],
    draws: u32,
    rng: &mut Rng,
) -> (f64, f64) {
    let (mut sum, mut squares, mut lit) = (0.0, 0.0, 0);
    for _ in 0..draws {
        let incident = sampler.sample_light(shading_point, light, [rng.unit(), rng.unit()]);
        let lux = incident.map_or(0.0, |incident| estimate(shading_point, &incident));
        sum += lux;
        squares += lux * lux;
        lit += u32::from(lux > 0.0);
    }
    let (n, mean) = (f64::from(draws), sum / f64::from(draws));
    let variance = if lit < 100 { largest * exact } else { squares / n - mean * mean };
    (mean, (variance.max(0.0) / n).sqrt())
}

#[test]
fn means_are_lamberts_irradiance() {
    let mut rng = Rng(310);
    let linears = [
        Mat3::IDENTITY,
        Mat3::from_diagonal(Vec3::splat(0.7)),
        Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)),
        Mat3::from_cols(Vec3::X, Vec3::new(0.6, 1.0, 0.2), Vec3::new(0.0, 0.3, 1.4)),
        Mat3::from_diagonal(Vec3::new(1.5, -0.4, 0.8)),
    ];
    let (mut lit, mut dark) = (0, 0);
    for light in shapes() {
        for linear in linears {
            let (world, id) = world_of(light, linear);
            let sampler = world.sampler();
            let placed = transformed(&light, linear);
            for distance in [0.03, 0.1, 0.3, 1.0] {
                let side = if rng.bits().is_multiple_of(2) { 1.0 } else { -1.0 };
                let place = rng.position(1.0);
                let at = linear * Vec3::new(place.x, place.y, side * distance);
                let normals = [-at.normalize(), at.normalize().any_orthonormal_vector(), rng.direction(), Vec3::ZERO];
                for normal in normals {
                    let shading_point = ShadingPoint::surface(at, normal);
                    let expected = [shading_point, ShadingPoint::volume(at)].map(|point| irradiance(&placed, &point));
                    let exact = expected[0];
                    let (mean, deviation) = mean(&sampler, id, &shading_point, expected, 10_000, &mut rng);
                    // Five standard deviations: a false alarm in one of 10^6 checks, of which there
                    // are 400.
                    let tolerance = 5.0 * deviation + ROUNDING * exact + HORIZON;
                    assert!((mean - exact).abs() <= tolerance, "{mean} {exact} {placed:?} {shading_point:?}");
                    lit += u32::from(exact > 0.0);
                    dark += u32::from(exact == 0.0);
                }
            }
        }
    }
    assert!(lit > 200 && dark > 20, "{lit} {dark}");
}

#[test]
fn near_panels_are_far_less_noisy_than_by_area() {
    // The relative variance of one sample over a square of one metre, at surfaces that face it:
    // distance, by area, by solid angle (docs/math.md). The bounds leave 30 % for 20,000 draws.
    for (distance, by_area, by_solid_angle) in [(1.0, 0.030, 0.0019), (0.5, 0.25, 0.0145), (0.1, 10.8, 0.16)] {
        let light = Light::rectangle(Vec3::ZERO, 0.5 * Vec3::X, 0.5 * Vec3::Y, Vec3::ONE);
        let (mut world, id) = world_of(light, Mat3::IDENTITY);
        let shading_point = ShadingPoint::surface(Vec3::Z * distance, Vec3::NEG_Z);
        let exact = irradiance(&light, &shading_point);
        for (is_on, expected) in [(false, by_area), (true, by_solid_angle)] {
            world.set_solid_angle_sampling(is_on);
            let draws = 20_000;
            let (_, deviation) = mean(&world.sampler(), id, &shading_point, [exact; 2], draws, &mut Rng(311));
            let variance = f64::from(draws) * (deviation / exact).powi(2);
            assert!((variance / expected - 1.0).abs() < 0.3, "{distance} {is_on}: {variance} and not {expected}");
        }
    }
}

/// The coordinates of a point of the world along the two edges of a flat light from a corner; the
/// light is where its tree has it.
fn edge_coordinates(light: &Light, point: DVec3) -> [f64; 2] {
    let [corner, u, v] = match light.shape {
        Shape::Rectangle { center, half_u, half_v, .. } => [center - half_u - half_v, 2.0 * half_u, 2.0 * half_v],
        Shape::Triangle { vertices: [p, q, r], .. } => [p, q - p, r - p],
        _ => unreachable!("only flat lights are tested here"),
    }
    .map(Vec3::as_dvec3);
    let normal = u.cross(v);
    let (from, size) = (point - corner, normal.length_squared());
    [from.cross(v).dot(normal) / size, u.cross(from).dot(normal) / size]
}

/// Lights of one size, of which some are a hundred and ten thousand times as long as wide.
fn shapes_of_size(size: f32) -> Vec<Light> {
    let [x, y] = [Vec3::X * size, Vec3::Y * size];
    let mut lights = Vec::new();
    for width in [1.0, 1.0e-2, 1.0e-4] {
        lights.push(Light::rectangle(Vec3::ZERO, 0.5 * x, 0.5 * width * y, Vec3::ONE).two_sided());
        lights.push(Light::triangle([-0.5 * x, 0.5 * x, width * y], Vec3::ONE).two_sided());
    }
    lights
}

/// Places over the middle, a corner, an edge and beside a light, at heights from 0 to 0.3 sizes;
/// each with its height as a share of the size.
fn extreme_places(size: f32) -> impl Iterator<Item = (f32, Vec3)> {
    let feet = [(0.0, 0.1), (0.05, 1.0e-5), (-0.5, 0.0), (-0.5, -0.5), (0.0, -0.5), (0.8, 0.1), (0.5000001, 0.0)];
    feet.into_iter().flat_map(move |(x, y)| {
        let heights = [0.0, 1.0e-20, 1.0e-6, 1.0e-5, 1.0e-4, 1.0e-2, 0.3];
        heights.into_iter().map(move |height| (height, Vec3::new(x, y, height) * size))
    })
}

#[test]
fn slivers_and_extreme_sizes_and_places_stay_finite_covered_and_right() {
    let mut rng = Rng(312);
    let (mut near, mut by_area, mut means) = (0, 0, 0);
    for size in [1.0e-6, 1.0, 1.0e6] {
        for light in shapes_of_size(size) {
            let (mut world, id) = world_of(light, Mat3::IDENTITY);
            for (height, at) in extreme_places(size) {
                let normal = rng.direction();
                for shading_point in [ShadingPoint::volume(at), ShadingPoint::surface(at, normal)] {
                    let mut is_near = false;
                    for draw in 0..24 {
                        let mut number = || [rng.unit(), 0.0, ONE_MINUS_EPSILON][if draw < 9 { 0 } else { draw % 3 }];
                        let u = [number(), number()];
                        world.set_solid_angle_sampling(false);
                        let plain = world.sampler().sample_light(&shading_point, id, u);
                        world.set_solid_angle_sampling(true);
                        let sampler = world.sampler();
                        let Some(incident) = sampler.sample_light(&shading_point, id, u) else { continue };
                        assert!(incident.direction.is_finite() && incident.dist.is_finite() && incident.dist > 0.0);
                        assert!(incident.pdf.is_finite() && incident.pdf > 0.0, "{incident:?}");
                        if plain == Some(incident) {
                            by_area += 1;
                            continue;
                        }
                        is_near = true;
                        near += 1;
                        let toward = incident.direction.as_dvec3() * f64::from(incident.dist);
                        let [s, t] = edge_coordinates(&light, at.as_dvec3() + toward);
                        // The width of the narrowest light is 1e-4 of its length, and positions
                        // round to 1e-7 of that.
                        let range = -4.0e-3..1.004;
                        assert!(range.contains(&s) && range.contains(&t), "({s}, {t}) {light:?} {shading_point:?}");
                        let point = at + incident.direction * incident.dist;
                        let pdf = sampler.pdf(&shading_point, id, point) / sampler.pmf(&shading_point, id);
                        let is_above = normal.dot(point - at) > 0.0 || shading_point.normal == Vec3::ZERO;
                        let is_same = (pdf / incident.pdf - 1.0).abs() < 1.0e-5;
                        assert!(is_same || !is_above, "{pdf} {incident:?} {light:?} {shading_point:?}");
                    }
                    if is_near && height >= 1.0e-4 {
                        let expected =
                            [shading_point, ShadingPoint::volume(at)].map(|point| irradiance(&light, &point));
                        let exact = expected[0];
                        let (mean, deviation) = mean(&world.sampler(), id, &shading_point, expected, 3000, &mut rng);
                        // Five standard deviations: a false alarm in one of 10^6 checks, of which
                        // there are 500. Heights round to some 1e-7 of the size.
                        let tolerance = 5.0 * deviation + exact * (ROUNDING + 1.0e-6 / f64::from(height)) + HORIZON;
                        assert!((mean - exact).abs() <= tolerance, "{mean} {exact} {light:?} {shading_point:?}");
                        means += 1;
                    }
                }
            }
        }
    }
    assert!(near > 3000 && by_area > 1000 && means > 200, "{near} {by_area} {means}");
}

#[test]
fn lights_that_are_far_and_worlds_without_the_setting_have_the_same_bits() {
    let mut rng = Rng(314);
    let mut world = rng.world(6, 40, 4, 12.0);
    let lights: Vec<_> = world.sampler().all_lights().collect();
    let (mut same, mut other) = (0, 0);
    for _ in 0..20_000 {
        let light = lights[(rng.bits() % lights.len() as u64) as usize];
        let (shading_point, u) = (rng.shading_point(12.0), [rng.unit(), rng.unit()]);
        world.set_solid_angle_sampling(false);
        let off = world.sampler().sample_light(&shading_point, light, u);
        world.set_solid_angle_sampling(true);
        let on = world.sampler().sample_light(&shading_point, light, u);
        // With the scales of the instances, no edge is longer than 4 m. So lights are far from 8 m
        // on, which the distance to a point of them exceeds by 3 m at most.
        let is_far = off.is_some_and(|incident| incident.dist > 12.0);
        assert!(!is_far || on == off, "{on:?} {off:?}");
        same += u32::from(is_far);
        other += u32::from(on != off);
    }
    assert!(same > 3000 && other > 0, "{same} {other}");
}

/// Large panels and shading points among them.
fn panels(rng: &mut Rng) -> LightWorld {
    let mut world = LightWorld::new();
    for _ in 0..3 {
        let panel = |rng: &mut Rng| {
            let (place, u, v) = (rng.position(4.0), rng.direction() * 1.5, rng.direction() * rng.between(0.2, 1.5));
            match rng.bits() % 4 {
                0 => Light::rectangle(place, u, v, Vec3::ONE),
                1 => Light::rectangle(place, u, v, Vec3::ONE).two_sided(),
                2 => Light::triangle([place, place + u, place + v], Vec3::ONE),
                _ => Light::triangle([place, place + u, place + v], Vec3::ONE).two_sided(),
            }
        };
        let tree = world.add_tree(LightTree::new((0..8).map(|_| panel(rng)).collect()).expect("valid"));
        for _ in 0..2 {
            world.add_instance(tree, rng.affine(4.0), Policy::Static).expect("valid");
        }
    }
    world
}

#[test]
fn the_gpu_follows_the_setting_and_samples_the_same_points() {
    let mut rng = Rng(315);
    let mut world = panels(&mut rng);
    let mut lights = gpu_lights();
    let requests: Vec<SampleRequest> = crate::gpu::requests(&mut rng, 4096, 6.0);
    let mut densities = Vec::new();
    for is_on in [false, true, false] {
        world.set_solid_angle_sampling(is_on);
        let records = sample(&mut lights, &mut world, &requests);
        let all = sample_by(Effects::all(), &mut lights, &requests);
        for records in [&records, &all] {
            let mismatches = compare(&world, &requests, records);
            assert!(mismatches as f64 <= OTHER_PICKS * 4096.0, "{mismatches} of 4096 name another light");
        }
        densities.push(records.iter().map(|record| record.pdf).collect::<Vec<_>>());
        assert!(records.iter().filter(|record| record.pmf > 0.0).count() > 1000);
    }
    let changed = densities[0].iter().zip(&densities[1]).filter(|(off, on)| off != on).count();
    assert!(changed > 1000, "only {changed} of 4096 samples are by solid angle");
    assert_eq!(densities[0], densities[2], "off again");
}

#[test]
fn the_setting_is_an_effect_that_costs_one_uniform_and_no_record() {
    let mut world = panels(&mut Rng(316));
    let mut lights = gpu_lights();
    let mut upload = |world: &mut LightWorld| {
        world.update(FrameBudget::NONE);
        let report = lights.upload(world).expect("room enough");
        assert_eq!(lights.effects(), world.effects());
        (report.bytes, report.trees, report.instances)
    };
    let effects = world.effects();
    upload(&mut world);
    assert!(!world.active_effects().contains(Effects::SOLID_ANGLES) && !effects.contains(Effects::SOLID_ANGLES));
    for _ in 0..2 {
        world.set_solid_angle_sampling(true);
        assert_eq!(world.effects(), effects | Effects::SOLID_ANGLES);
        assert_eq!(world.effect_counts().of(Effects::SOLID_ANGLES), 1);
    }
    assert_eq!(upload(&mut world), (48, 0, 0));
    assert_eq!(upload(&mut world), (0, 0, 0));
    for _ in 0..2 {
        world.set_solid_angle_sampling(false);
        assert_eq!(world.effect_counts().of(Effects::SOLID_ANGLES), 0);
    }
    assert_eq!(upload(&mut world), (48, 0, 0));
    // The effect is held for a while, but shaders sample by area already.
    assert_eq!(world.effects(), effects | Effects::SOLID_ANGLES);
    for _ in 0..EFFECT_HOLD_UPDATES {
        world.update(FrameBudget::NONE);
    }
    assert_eq!(world.effects(), effects);
}
