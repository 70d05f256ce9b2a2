//! Lights that move, as functions of time.

use super::super::stage::direction;
use girandole::Light;
use girandole::glam::{Quat, Vec3, vec3};
use std::f32::consts::{PI, TAU};
use testbed::scene::rng::Rng;

/// A random vector with coordinates between `-half` and `half`.
pub fn in_box(half: Vec3, rng: &mut Rng) -> Vec3 {
    vec3(rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), rng.range(-1.0, 1.0)) * half
}

/// Point lights that swing through a box, each with its own frequencies. After about a second each
/// of them is somewhere else.
pub struct Swarm {
    half: Vec3,
    /// The intensity of each light, in candela.
    candela: f32,
    /// The frequencies in radians per second and the phases along the axes.
    paths: Vec<(Vec3, Vec3)>,
}

impl Swarm {
    /// `half` is half of the size of the box, in metres, and `candela` the intensity of all lights
    /// together.
    pub fn new(count: usize, half: Vec3, candela: f32, rng: &mut Rng) -> Self {
        let mut path = || {
            let speed = vec3(rng.range(2.0, 5.0), rng.range(2.0, 5.0), rng.range(2.0, 5.0));
            (speed, vec3(rng.unit(), rng.unit(), rng.unit()) * TAU)
        };
        Self { half, candela: candela / count as f32, paths: (0..count).map(|_| path()).collect() }
    }

    /// The lights at a time in seconds, with their indices.
    pub fn lights(&self, time: f32) -> Vec<(u32, Light)> {
        let light = |(speed, phase): &(Vec3, Vec3)| {
            Light::point((*speed * time + *phase).map(f32::sin) * self.half, Vec3::splat(self.candela))
        };
        (0..).zip(self.paths.iter().map(light)).collect()
    }
}

/// Half of the size of the box of spots and of walkers, in metres.
const RIG: Vec3 = vec3(8.0, 3.0, 8.0);

/// Narrow spots of different flux. Each turns about an axis of its own with a speed of its own.
pub struct Rig {
    /// The places of the spots, in metres.
    pub places: Vec<Vec3>,
    spots: Vec<TurningSpot>,
    /// How far spots move from their places, in metres.
    drift: f32,
}

struct TurningSpot {
    axis: Vec3,
    /// Radians per second.
    speed: f32,
    /// The direction at time 0.
    start: Vec3,
    /// The direction in which it drifts.
    way: Vec3,
    half_angle: f32,
    candela: f32,
}

impl Rig {
    /// Half angles are within 50 % of `half_angle`.
    pub fn new(count: usize, half_angle: f32, drift: f32, rng: &mut Rng) -> Self {
        let mut spot = || TurningSpot {
            axis: direction(rng),
            speed: rng.range(0.2, 2.0),
            start: direction(rng),
            way: direction(rng),
            half_angle: half_angle * rng.range(0.5, 1.5),
            candela: 100.0 * 2.0_f32.powf(rng.range(-2.0, 2.0)),
        };
        let spots = (0..count).map(|_| spot()).collect();
        Self { places: (0..count).map(|_| in_box(RIG, rng)).collect(), spots, drift }
    }

    /// The lights at a time in seconds, with their indices.
    pub fn lights(&self, time: f32) -> Vec<(u32, Light)> {
        let light = |(place, spot): (&Vec3, &TurningSpot)| {
            let angle = spot.speed * time;
            let facing = Quat::from_axis_angle(spot.axis, angle) * spot.start;
            let place = *place + spot.way * (self.drift * angle.sin());
            Light::spot(place, facing, 0.5 * spot.half_angle, spot.half_angle, Vec3::splat(spot.candela))
        };
        (0..).zip(self.places.iter().zip(&self.spots).map(light)).collect()
    }
}

/// Spots that shine up or down, half of which turn over about the X axis.
pub struct Turners {
    /// The place, the direction at time 0 and the speed in radians per second of each spot.
    spots: Vec<(Vec3, Vec3, f32)>,
    half_angle: f32,
}

impl Turners {
    /// The spots that turn over have turned once after `time` seconds.
    pub fn new(count: usize, half_angle: f32, time: f32, rng: &mut Rng) -> Self {
        let mut spot = || {
            let start = if rng.chance(0.5) { Vec3::Y } else { Vec3::NEG_Y };
            (in_box(RIG, rng), start, if rng.chance(0.5) { PI / time } else { 0.0 })
        };
        Self { spots: (0..count).map(|_| spot()).collect(), half_angle }
    }

    /// The lights at a time in seconds, with their indices.
    pub fn lights(&self, time: f32) -> Vec<(u32, Light)> {
        let light = |(place, start, speed): &(Vec3, Vec3, f32)| {
            let facing = Quat::from_rotation_x(speed * time) * *start;
            Light::spot(*place, facing, 0.5 * self.half_angle, self.half_angle, Vec3::splat(100.0))
        };
        (0..).zip(self.spots.iter().map(light)).collect()
    }
}

/// Point lights that move from one place to another nearby, at a constant speed.
pub struct Walkers {
    /// The position at time 0 and the velocity in metres per second of each light.
    paths: Vec<(Vec3, Vec3)>,
}

impl Walkers {
    /// The speed along each axis is at most `speed`, in metres per second.
    pub fn new(count: usize, speed: f32, rng: &mut Rng) -> Self {
        let mut path = || (in_box(RIG, rng), in_box(Vec3::splat(speed), rng));
        Self { paths: (0..count).map(|_| path()).collect() }
    }

    /// The lights at a time in seconds, with their indices.
    pub fn lights(&self, time: f32) -> Vec<(u32, Light)> {
        let light = |(start, velocity): &(Vec3, Vec3)| Light::point(*start + *velocity * time, Vec3::splat(100.0));
        (0..).zip(self.paths.iter().map(light)).collect()
    }
}

/// Shuffles the places of all lights.
pub fn scramble(places: &mut [Vec3], rng: &mut Rng) {
    for i in 1..places.len() {
        places.swap(i, rng.below(i + 1));
    }
}

/// The lights of a tree, without their indices.
pub fn without_indices(lights: &[(u32, Light)]) -> Vec<Light> {
    lights.iter().map(|(_, light)| *light).collect()
}
