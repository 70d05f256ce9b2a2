//! The scene of all sweeps, in f64: a street between two rows of objects with lights of all shapes.

use crate::common::pcg::Rng;
use crate::measuring::emitter::{Emitter, Form, Receiver};
use girandole::glam::{DMat3, DQuat, DVec3, dvec3};
use std::f64::consts::PI;

/// Different objects.
const OBJECTS: usize = 12;
const LIGHTS_PER_OBJECT: usize = 50;
/// Instances on either side of the street.
const PER_SIDE: usize = 30;
/// The distance between neighbouring objects along the street, in metres.
const SPACING: f64 = 12.0;
/// Half the width of the street, in metres.
const HALF_WIDTH: f64 = 9.0;
/// Half the edges of an object, in metres. Its lights are between the ground and twice the height.
const HALF_OBJECT: DVec3 = dvec3(5.0, 4.0, 3.0);
/// The luminances of points, in candela, and of surfaces, in nits. A scene that is scaled by 1e6,
/// or has a contrast of 1e24, stays below the limit of 1e15.
const EMISSION: [f64; 2] = [20.0, 400.0];

/// An object of the street.
#[derive(Clone, Copy, Debug)]
pub struct Instance {
    pub object: usize,
    pub turn: DMat3,
    pub position: DVec3,
}

/// The lights, and the points on surfaces that receive them.
#[derive(Clone, Debug)]
pub struct Street {
    /// The lights of each object, in its own space.
    pub objects: Vec<Vec<Emitter>>,
    pub instances: Vec<Instance>,
    pub receivers: Vec<Receiver>,
    /// A number from -0.5 to 0.5 for each light of each object: its place between the faintest and
    /// the brightest.
    levels: Vec<Vec<f64>>,
}

/// Uniform in [low, high), with more bits than f32 has.
fn between(rng: &mut Rng, low: f64, high: f64) -> f64 {
    let unit = (f64::from(rng.bits()) + f64::from(rng.bits()) / 2.0_f64.powi(32)) / 2.0_f64.powi(32);
    low + (high - low) * unit
}

fn in_box(rng: &mut Rng, half: DVec3) -> DVec3 {
    half * dvec3(between(rng, -1.0, 1.0), between(rng, -1.0, 1.0), between(rng, -1.0, 1.0))
}

fn direction(rng: &mut Rng) -> DVec3 {
    let z = between(rng, -1.0, 1.0);
    let (s, c) = between(rng, 0.0, 2.0 * PI).sin_cos();
    dvec3(c, s, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
}

/// A light of an object; the five shapes take turns.
fn light(rng: &mut Rng, number: usize) -> Emitter {
    let position = in_box(rng, HALF_OBJECT) + DVec3::Y * HALF_OBJECT.y;
    let axis = direction(rng);
    let u = axis.any_orthonormal_vector() * between(rng, 0.1, 0.6);
    let v = axis.cross(u).normalize() * between(rng, 0.1, 0.6);
    let two_sided = number % 10 >= 5;
    let form = match number % 5 {
        0 => Form::Point { position },
        1 => {
            let outer_angle = between(rng, 0.2, 1.4);
            let inner_angle = outer_angle * between(rng, 0.2, 0.9);
            Form::Spot { position, direction: axis, inner_angle, outer_angle }
        }
        2 => Form::Rectangle { center: position, half_u: u, half_v: v, two_sided },
        3 => Form::Triangle { vertices: [position, position + u, position + v], two_sided },
        _ => Form::Sphere { center: position, radius: u.length() * 0.5 },
    };
    Emitter { form, emission: between(rng, EMISSION[0], EMISSION[1]), range: f64::INFINITY }
}

/// A light after a scale, a turn and a shift. Points and spots become brighter by the square of the
/// scale, so that the illuminance at a scaled shading point stays the same.
pub fn moved(light: &Emitter, scale: f64, turn: &DMat3, shift: DVec3) -> Emitter {
    let vector = |v: DVec3| *turn * (v * scale);
    let point = |p: DVec3| vector(p) + shift;
    let (form, gain) = match light.form {
        Form::Point { position } => (Form::Point { position: point(position) }, scale * scale),
        Form::Spot { position, direction, inner_angle, outer_angle } => {
            let direction = *turn * direction;
            (Form::Spot { position: point(position), direction, inner_angle, outer_angle }, scale * scale)
        }
        Form::Profile { .. } => unreachable!("a street has none"),
        Form::Rectangle { center, half_u, half_v, two_sided } => {
            (Form::Rectangle { center: point(center), half_u: vector(half_u), half_v: vector(half_v), two_sided }, 1.0)
        }
        Form::Triangle { vertices, two_sided } => (Form::Triangle { vertices: vertices.map(point), two_sided }, 1.0),
        Form::Sphere { center, radius } => (Form::Sphere { center: point(center), radius: radius * scale }, 1.0),
    };
    Emitter { form, emission: light.emission * gain, range: light.range * scale }
}

impl Street {
    /// The street at its own scale around the origin, with so many shading points: half of them on
    /// the ground, the others on surfaces in all directions between the objects.
    pub fn new(seed: u64, receivers: usize) -> Self {
        let mut rng = Rng::new(seed, 0);
        let object = |rng: &mut Rng| (0..LIGHTS_PER_OBJECT).map(|number| light(rng, number)).collect();
        let objects: Vec<Vec<Emitter>> = (0..OBJECTS).map(|_| object(&mut rng)).collect();
        let levels =
            objects.iter().map(|lights| lights.iter().map(|_| between(&mut rng, -0.5, 0.5)).collect()).collect();
        let mut instance = |number: usize| {
            let along = ((number / 2) as f64 - 0.5 * (PER_SIDE - 1) as f64) * SPACING;
            let side = if number.is_multiple_of(2) { -1.0 } else { 1.0 };
            let position =
                dvec3(along, 0.0, side * (HALF_WIDTH + HALF_OBJECT.z)) + in_box(&mut rng, dvec3(1.5, 0.2, 1.0));
            let turn = DQuat::from_rotation_y(between(&mut rng, 0.0, 2.0 * PI))
                * DQuat::from_axis_angle(direction(&mut rng), between(&mut rng, 0.0, 0.1));
            Instance { object: rng.below(OBJECTS), turn: DMat3::from_quat(turn), position }
        };
        let instances = (0..2 * PER_SIDE).map(&mut instance).collect();
        let half_length = 0.5 * SPACING * PER_SIDE as f64;
        let mut receiver = |number: usize| match number % 2 {
            0 => Receiver { position: in_box(&mut rng, dvec3(half_length, 0.0, HALF_WIDTH)), normal: DVec3::Y },
            _ => {
                let half = dvec3(half_length, HALF_OBJECT.y, HALF_WIDTH + HALF_OBJECT.z);
                Receiver { position: in_box(&mut rng, half) + DVec3::Y * half.y, normal: direction(&mut rng) }
            }
        };
        let receivers = (0..receivers).map(&mut receiver).collect();
        Self { objects, instances, receivers, levels }
    }

    /// The street with all lengths multiplied by a scale.
    #[must_use]
    pub fn scaled(mut self, scale: f64) -> Self {
        for light in self.objects.iter_mut().flatten() {
            *light = moved(light, scale, &DMat3::IDENTITY, DVec3::ZERO);
        }
        self.instances.iter_mut().for_each(|instance| instance.position *= scale);
        self.receivers.iter_mut().for_each(|receiver| receiver.position *= scale);
        self
    }

    /// The street whose lights are multiplied by factors from 1 / √contrast to √contrast, uniform
    /// on a logarithmic scale.
    #[must_use]
    pub fn with_contrast(mut self, contrast: f64) -> Self {
        for (light, level) in self.objects.iter_mut().flatten().zip(self.levels.iter().flatten()) {
            light.emission *= contrast.powf(*level);
        }
        self
    }

    /// All lights in the space of the world, instance by instance.
    pub fn lights(&self) -> Vec<Emitter> {
        let placed = |Instance { object, turn, position }: &Instance| {
            self.objects[*object].iter().map(|light| moved(light, 1.0, turn, *position)).collect::<Vec<_>>()
        };
        self.instances.iter().flat_map(placed).collect()
    }
}
