//! Great contrasts of distance, brightness and direction.

use super::scene::{Make, Parts, direction, in_box, lamp};
use crate::common::pcg::Rng;
use girandole::Light;
use girandole::glam::{Vec3, vec3};

pub const SCENES: &[(&str, Make)] = &[
    ("one light 1e9 m away", far_light),
    ("stadium", stadium),
    ("beams in all directions", beams),
    ("spots at one place", spots_at_one_place),
    ("a street of collinear lamps", street),
    ("twelve decades of brightness", brightness),
    ("dense clusters far apart", clusters),
    ("short ranges", short_ranges),
    ("a bright lamp among faint ones", bright_lamp),
];

/// 4,096 lamps, and a light at the limit of coordinates that brings as much light as all of them.
fn far_light(parts: &mut Parts, rng: &mut Rng) {
    let mut lights: Vec<Light> = (0..4096).map(|_| lamp(in_box(rng, vec3(100.0, 5.0, 100.0)), 50.0)).collect();
    let far = vec3(0.6, 0.64, 0.48) * 1.0e9;
    lights.push(Light::sphere(far, 1.0e7, Vec3::splat(1.0e5)));
    parts.add_here(lights);
    parts.receive(|| (in_box(rng, vec3(80.0, 5.0, 80.0)), (Vec3::Y + 0.5 * direction(rng)).normalize()));
}

/// 3,000 narrow spots on four masts, each aimed at a place of its own on the field.
fn stadium(parts: &mut Parts, rng: &mut Rng) {
    let spot = |i: usize| {
        let mast = [vec3(-70.0, 40.0, -50.0), vec3(70.0, 40.0, -50.0), vec3(-70.0, 40.0, 50.0), vec3(70.0, 40.0, 50.0)];
        let place = mast[i % 4] + in_box(rng, vec3(6.0, 4.0, 1.0));
        let target = in_box(rng, vec3(55.0, 0.0, 35.0));
        Light::spot(place, (target - place).normalize(), 0.03, 0.08, Vec3::splat(50_000.0))
    };
    parts.add_here((0..3000).map(spot).collect());
    parts.receive(|| (in_box(rng, vec3(50.0, 0.0, 30.0)), Vec3::Y));
}

/// Narrow beams in all directions from all places of a hall.
fn beams(parts: &mut Parts, rng: &mut Rng) {
    let beam = |_| Light::spot(in_box(rng, vec3(30.0, 10.0, 30.0)), direction(rng), 0.1, 0.3, Vec3::splat(500.0));
    parts.add_here((0..5000).map(beam).collect());
    parts.receive(|| (in_box(rng, vec3(25.0, 8.0, 25.0)), direction(rng)));
}

/// 1,000 spots at one place: only their directions tell them apart.
fn spots_at_one_place(parts: &mut Parts, rng: &mut Rng) {
    let spot = |_| Light::spot(Vec3::ZERO, direction(rng), 0.05, 0.25, Vec3::splat(rng.range(10.0, 1000.0)));
    parts.add_here((0..1000).map(spot).collect());
    parts.receive(|| {
        let toward = direction(rng);
        (toward * rng.range(1.0, 20.0), -toward)
    });
}

/// 3,000 lamps on one line.
fn street(parts: &mut Parts, rng: &mut Rng) {
    parts.add_here((0..3000).map(|i| lamp(vec3(i as f32 * 8.0, 6.0, 0.0), 300.0)).collect());
    parts.receive(|| (vec3(rng.range(0.0, 24_000.0), 0.0, rng.range(-15.0, 15.0)), Vec3::Y));
}

/// 4,000 lamps from 1e-6 to 1e6 candela.
fn brightness(parts: &mut Parts, rng: &mut Rng) {
    let light = |_| lamp(in_box(rng, vec3(100.0, 10.0, 100.0)), 10.0_f32.powf(rng.range(-6.0, 6.0)));
    parts.add_here((0..4000).map(light).collect());
    parts.receive(|| (in_box(rng, vec3(90.0, 8.0, 90.0)), direction(rng)));
}

/// 40 clusters of 100 lamps, centimetres wide and kilometres apart. The shading points are near
/// clusters.
fn clusters(parts: &mut Parts, rng: &mut Rng) {
    let centers: Vec<Vec3> = (0..40).map(|_| in_box(rng, Vec3::splat(5000.0))).collect();
    let place = |rng: &mut Rng, center: Vec3| center + in_box(rng, Vec3::splat(0.3));
    let lights = (0..4000).map(|i| lamp(place(rng, centers[i % 40]), rng.range(1.0, 100.0))).collect();
    parts.add_here(lights);
    parts.receive(|| (rng.pick(&centers) + direction(rng) * 0.1 * 1000.0_f32.powf(rng.unit()), direction(rng)));
}

/// 10,000 lamps with ranges of 3 m to 12 m.
fn short_ranges(parts: &mut Parts, rng: &mut Rng) {
    let light = |_| lamp(in_box(rng, vec3(200.0, 3.0, 200.0)), 50.0).with_range(rng.range(3.0, 12.0));
    parts.add_here((0..10_000).map(light).collect());
    parts.receive(|| (in_box(rng, vec3(190.0, 0.0, 190.0)) - Vec3::Y * 3.0, Vec3::Y));
}

/// 4,000 faint lamps and one that is a million times brighter, in their midst.
fn bright_lamp(parts: &mut Parts, rng: &mut Rng) {
    let mut lights: Vec<Light> = (0..4000).map(|_| lamp(in_box(rng, vec3(50.0, 5.0, 50.0)), 1.0)).collect();
    lights.push(lamp(vec3(3.0, 1.0, -7.0), 1.0e6));
    parts.add_here(lights);
    parts.receive(|| (in_box(rng, vec3(45.0, 5.0, 45.0)), direction(rng)));
}
