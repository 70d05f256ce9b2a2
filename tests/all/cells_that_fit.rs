//! Cells fit what a camera sees where the points of one disagree about lights: lamps nearer than the edge of a cell, leaves
//! and small balls, a shelf with LEDs.

use girandole::glam::{DVec3, Vec3, vec3};
use girandole::{CutOptions, CutTable, FrameBudget, Light, Policy, ShadingPoint};
use rayon::prelude::*;

use testbed::measuring::sigma::Noise;
use testbed::testing::support::{Rng, world_of};

/// The height of one of 1080 pixels over its distance, with 60 degrees from the lowest to the highest.
const PIXEL: f32 = 0.001_069;
/// A part of a picture of 1920 x 1080 pixels, from its middle.
const SIZE: [usize; 2] = [320, 180];

/// What a ray from the eye meets first. The number is that of the pixel.
type Trace = dyn Fn(Vec3, Vec3, usize) -> Option<ShadingPoint> + Sync;

/// The rms of sigma over points of the picture, by cuts of their own and by those of cells.
fn noise(lights: Vec<Light>, [eye, target]: [Vec3; 2], trace: &Trace) -> [f64; 2] {
    let (mut world, ..) = world_of(lights, Policy::Static);
    world.update(FrameBudget::UNLIMITED);
    let forward = (target - eye).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let [width, height] = SIZE;
    let hit = |pixel: usize| {
        let (x, y) = (pixel % width, pixel / width);
        let (x, y) = (x as f32 - 0.5 * width as f32 + 0.5, y as f32 - 0.5 * height as f32 + 0.5);
        trace(eye, (forward + (right * x - right.cross(forward) * y) * PIXEL).normalize(), pixel)
    };
    let hits: Vec<ShadingPoint> = (0..width * height).into_par_iter().filter_map(hit).collect();
    let mut cuts = CutTable::new(CutOptions::default());
    cuts.set_view(DVec3::from(eye), PIXEL);
    hits.par_iter().for_each(|at| world.sampler().with_cuts(&cuts).mark(at));
    cuts.build(world.sampler());
    let (own, cells) = (world.sampler(), world.sampler().with_cuts(&cuts));
    let lights: Vec<_> = own.all_lights().collect();
    let mut rng = Rng(1);
    let chosen: Vec<_> = (0..150).map(|_| hits[rng.below(hits.len())]).collect();
    let squares = chosen.par_iter().filter_map(|at| {
        let sent = |light| {
            let sample = own.sample_light(at, light, [0.5; 2])?;
            Some(sample.radiance.y * sample.direction.dot(at.normal).max(0.0) / sample.pdf)
        };
        let sent: Vec<f32> = lights.iter().map(|light| sent(*light).unwrap_or(0.0)).collect();
        let square = |pmfs: &[f32]| Some(Noise::of(&sent, pmfs)?.sigma.powi(2));
        let mut pmfs = [Vec::new(), Vec::new()];
        own.distribution(at, &mut pmfs[0]);
        cells.distribution(at, &mut pmfs[1]);
        Some([square(&pmfs[0])?, square(&pmfs[1])?])
    });
    let squares: Vec<_> = squares.collect();
    assert!(squares.len() > 100, "light reaches what the camera sees");
    [0, 1].map(|k| (squares.iter().map(|of| of[k]).sum::<f64>() / squares.len() as f64).sqrt())
}

fn street(factor: f32) -> Vec<Light> {
    let mut rng = Rng(2);
    (0..400)
        .map(|_| Light::point(rng.position(50.0) * vec3(1.0, 0.05, 1.0) + 5.5 * Vec3::Y, Vec3::splat(100.0 * factor)))
        .collect()
}

fn plane(height: f32, eye: Vec3, ray: Vec3) -> Option<ShadingPoint> {
    let along = (height - eye.y) / ray.y;
    (along > 0.0).then(|| ShadingPoint::surface(eye + ray * along, Vec3::Y * -ray.y.signum()))
}

fn ball(center: Vec3, radius: f32, eye: Vec3, ray: Vec3) -> Option<[f32; 2]> {
    let along = (center - eye).dot(ray);
    let rest = radius * radius - ((center - eye).length_squared() - along * along);
    (rest > 0.0).then(|| [along - rest.sqrt(), along + rest.sqrt()])
}

/// A street, and lamps of 10 candela, 10 cm above it and 31 cm from each other.
fn low_lamps(factor: f32) -> Vec<Light> {
    let lamps = (0..100).map(|i| vec3(0.31 * (i % 10) as f32 - 1.55, 0.1, 0.31 * (i / 10) as f32 - 1.55));
    street(factor).into_iter().chain(lamps.map(|at| Light::point(at, Vec3::splat(10.0 * factor)))).collect()
}

fn noise_of_low_lamps(lights: Vec<Light>, distance: f32) -> [f64; 2] {
    noise(lights, [vec3(0.0, 0.4 * distance, distance), Vec3::ZERO], &|eye, ray, _| plane(0.0, eye, ray))
}

#[test]
fn lamps_nearer_than_the_edge_of_a_cell_do_not_raise_the_noise() {
    for distance in [1.5, 5.0, 20.0, 60.0] {
        let [own, cells] = noise_of_low_lamps(low_lamps(1.0), distance);
        assert!(cells <= own, "{distance} m: {own} {cells}");
    }
}

/// What the others bring is kept in lux.
#[test]
fn contested_nodes_share_with_the_others_at_any_brightness() {
    let [_, usual] = noise_of_low_lamps(low_lamps(1.0), 20.0);
    for factor in [1.0e-12, 1.0e13] {
        let [_, scaled] = noise_of_low_lamps(low_lamps(factor), 20.0);
        assert!((scaled / usual - 1.0).abs() < 0.01, "{factor}: {scaled} {usual}");
    }
}

/// Leaves of a few pixels in a crown of 3 m, with any normals.
#[test]
fn leaves_have_no_more_noise_than_with_cuts_of_their_own() {
    for (distance, pixels, most) in [(3.0, 8, 1.0), (10.0, 3, 1.1), (20.0, 1, 1.1)] {
        let crown = 2.0 * Vec3::Y;
        let trace = move |eye: Vec3, ray: Vec3, pixel: usize| {
            let [near, far] = ball(crown, 1.5, eye, ray)?;
            let mut rng = Rng(3 + (pixel % SIZE[0] / pixels + 1000 * (pixel / SIZE[0] / pixels)) as u64);
            let normal = rng.position(1.0).normalize();
            let depth = near + 0.5 * (far - near) * rng.unit();
            Some(ShadingPoint::surface(eye + depth * ray, if normal.dot(ray) > 0.0 { -normal } else { normal }))
        };
        let [own, cells] = noise(street(1.0), [vec3(0.0, 1.7, distance), crown], &trace);
        assert!(cells <= most * own, "{distance} m: {own} {cells}");
    }
}

/// Balls on a street.
#[test]
fn small_balls_have_hardly_more_noise_than_with_cuts_of_their_own() {
    for (radius, distance, most) in [(0.1, 2.0, 1.1), (0.1, 10.0, 1.5), (0.5, 5.0, 1.0)] {
        let trace = move |eye: Vec3, ray: Vec3, _| {
            let centers =
                (0..225).map(|i| radius * vec3(3.0 * (i % 15) as f32 - 21.0, 1.0, 3.0 * (i / 15) as f32 - 21.0));
            let hits = centers.filter_map(|center| Some((ball(center, radius, eye, ray)?[0], center)));
            match hits.min_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((near, center)) => {
                    let at = eye + near * ray;
                    Some(ShadingPoint::surface(at, (at - center) / radius))
                }
                None => plane(0.0, eye, ray),
            }
        };
        let [own, cells] = noise(street(1.0), [vec3(0.0, 0.5 * distance, distance), Vec3::ZERO], &trace);
        assert!(cells <= most * own, "{radius} m from {distance} m: {own} {cells}");
    }
}

/// A hundred LEDs under each of eight boards, 2 cm from the wall behind. Cuts of points have hardly any noise: all LEDs
/// that matter are candidates.
#[test]
fn a_shelf_with_leds_has_little_noise() {
    let leds = (0..800).map(|i| vec3(0.02 * (i % 100) as f32 - 0.99, 0.3 * (i / 100) as f32 + 0.28, 0.02));
    let leds: Vec<_> = leds.map(|at| Light::point(at, Vec3::splat(0.3))).collect();
    let trace = move |eye: Vec3, ray: Vec3, _| {
        let boards = (0..8).filter_map(|i| plane(0.3 * i as f32, eye, ray));
        let boards = boards.filter(|at| at.position.z > 0.0 && at.position.z < 0.3 && at.position.x.abs() < 1.0);
        let wall = ShadingPoint::surface(eye - ray * (eye.z / ray.z), Vec3::Z);
        boards.chain([wall]).min_by(|a, b| a.position.distance(eye).total_cmp(&b.position.distance(eye)))
    };
    for distance in [1.0, 3.0, 10.0] {
        let [own, cells] = noise(leds.clone(), [vec3(0.3, 1.2, distance), vec3(0.0, 1.05, 0.0)], &trace);
        assert!(cells <= 0.25, "{distance} m: {own} {cells}");
    }
}
