//! Lights that move: dancers in suits of lamps, swirls, and a fire of sparks.

use girandole::Light;
use girandole::glam::{Mat3, Quat, Vec3};
use testbed::scene::rng::Rng;

/// Frames a second.
const RATE: f32 = 60.0;

/// The share of sparks that die in a frame, and are born again as others.
pub const TURNOVER: f32 = 0.02;

/// A limb of a dancer: a box of triangles that turns about a joint of another limb.
struct Limb {
    /// The limb that it hangs from; itself for the trunk.
    parent: usize,
    /// The joint, in the space of the parent.
    joint: Vec3,
    /// Half its size. It hangs from its joint.
    half: Vec3,
    /// How far and how fast it swings about each axis, in radians and in turns a second.
    swing: Vec3,
    rate: f32,
}

const fn limb(parent: usize, joint: [f32; 3], half: [f32; 3], swing: [f32; 3], rate: f32) -> Limb {
    Limb { parent, joint: Vec3::from_array(joint), half: Vec3::from_array(half), swing: Vec3::from_array(swing), rate }
}

/// Trunk, head, and two limbs for each arm and leg.
const LIMBS: [Limb; 10] = [
    limb(0, [0.0, 1.4, 0.0], [0.18, 0.3, 0.1], [0.1, 0.6, 0.1], 0.7),
    limb(0, [0.0, 0.25, 0.0], [0.1, 0.12, 0.1], [0.4, 0.8, 0.2], 0.9),
    limb(0, [0.25, 0.0, 0.0], [0.05, 0.15, 0.05], [2.4, 0.5, 1.2], 1.1),
    limb(2, [0.0, -0.3, 0.0], [0.04, 0.15, 0.04], [1.4, 0.2, 0.6], 1.7),
    limb(0, [-0.25, 0.0, 0.0], [0.05, 0.15, 0.05], [2.4, 0.5, 1.2], 1.3),
    limb(4, [0.0, -0.3, 0.0], [0.04, 0.15, 0.04], [1.4, 0.2, 0.6], 1.9),
    limb(0, [0.1, -0.6, 0.0], [0.07, 0.2, 0.07], [1.3, 0.3, 0.5], 0.8),
    limb(6, [0.0, -0.4, 0.0], [0.05, 0.2, 0.05], [1.5, 0.1, 0.1], 1.5),
    limb(0, [-0.1, -0.6, 0.0], [0.07, 0.2, 0.07], [1.3, 0.3, 0.5], 1.0),
    limb(8, [0.0, -0.4, 0.0], [0.05, 0.2, 0.05], [1.5, 0.1, 0.1], 1.4),
];

/// The lamps of a dancer in a frame, `count` triangles on its limbs, in its own space. `seed` tells dancers
/// apart.
pub fn dancer(seed: u32, count: usize, frame: u32) -> Vec<Light> {
    let time = frame as f32 / RATE + 10.0 * seed as f32;
    let mut poses: Vec<(Mat3, Vec3)> = Vec::new();
    for limb in &LIMBS {
        let turn = std::f32::consts::TAU * limb.rate * time;
        let [x, y, z] = (limb.swing * Vec3::new(turn.sin(), (0.61 * turn).sin(), (0.37 * turn).cos())).to_array();
        let own = Mat3::from_quat(Quat::from_euler(girandole::glam::EulerRot::XYZ, x, y, z));
        let (rotation, joint) = match poses.get(limb.parent) {
            Some((rotation, joint)) => (*rotation * own, *joint + *rotation * limb.joint),
            None => (own, limb.joint),
        };
        poses.push((rotation, joint));
    }
    let mut rng = Rng::new(u64::from(seed), 1);
    let lamp = |i: usize| {
        let index = i % LIMBS.len();
        let (limb, (rotation, joint)) = (&LIMBS[index], poses[index]);
        let mut signed = || 2.0 * rng.unit() - 1.0;
        // A point on one of the six sides of the box, and a small triangle in that side.
        let mut at = Vec3::new(signed(), signed(), signed());
        let axis = (i / LIMBS.len()) % 3;
        at[axis] = at[axis].signum();
        let [mut u, mut v] = [Vec3::ZERO; 2];
        (u[(axis + 1) % 3], v[(axis + 2) % 3]) = (0.01, 0.01 * at[axis]);
        let place = |p: Vec3| joint + rotation * (p - Vec3::Y * limb.half.y);
        let center = at * limb.half;
        let hue = i as f32 * 0.618_034;
        let color = Vec3::new((6.0 * hue).sin(), (6.0 * hue + 2.1).sin(), (6.0 * hue + 4.2).sin()) * 0.4 + 0.6;
        Light::triangle([place(center), place(center + u), place(center + v)], 2.0e4 * color)
    };
    (0..count).map(lamp).collect()
}

/// Lamps that circle an axis, each at its own speed, so that neighbours part.
pub fn swirl(seed: u32, count: usize, frame: u32) -> Vec<Light> {
    let time = frame as f32 / RATE;
    let mut rng = Rng::new(u64::from(seed), 2);
    let lamp = |_| {
        let (radius, speed) = (0.3 + 2.0 * rng.unit(), 0.1 + 0.6 * rng.unit());
        let angle = std::f32::consts::TAU * (rng.unit() + speed * time);
        let at = Vec3::new(radius * angle.cos(), 3.0 * rng.unit(), radius * angle.sin());
        Light::point(at, Vec3::splat(1.0 + 9.0 * rng.unit()))
    };
    (0..count).map(lamp).collect()
}

/// A fire: sparks that rise, drift, cool and die, each of which is born again in its place.
pub struct Fire {
    sparks: Vec<Spark>,
    rng: Rng,
}

#[derive(Clone, Copy)]
struct Spark {
    position: Vec3,
    velocity: Vec3,
    /// From 1 at birth to 0.
    heat: f32,
    is_born: bool,
}

impl Spark {
    fn new(rng: &mut Rng) -> Self {
        let mut signed = || 2.0 * rng.unit() - 1.0;
        let position = Vec3::new(0.6 * signed(), 0.1, 0.6 * signed());
        let velocity = Vec3::new(0.5 * signed(), 2.0 + 1.5 * signed(), 0.5 * signed());
        Self { position, velocity, heat: 1.0, is_born: true }
    }
}

impl Fire {
    /// A fire of so many sparks that has burnt for a while.
    pub fn new(count: usize, seed: u64) -> Self {
        let mut rng = Rng::new(seed, 3);
        let sparks = (0..count).map(|_| Spark::new(&mut rng)).collect();
        let mut fire = Self { sparks, rng };
        (0..120).for_each(|_| fire.advance());
        fire
    }

    /// Goes on by a frame.
    pub fn advance(&mut self) {
        let dt = 1.0 / RATE;
        for spark in &mut self.sparks {
            if self.rng.unit() < TURNOVER {
                *spark = Spark::new(&mut self.rng);
                continue;
            }
            let p = spark.position;
            let drift = Vec3::new((1.3 * p.y + p.z).sin(), 0.3 * (p.x + p.z).sin(), (1.7 * p.y + p.x).cos());
            spark.velocity += dt * (2.0 * drift + Vec3::Y * 1.5 * spark.heat - 0.5 * spark.velocity);
            spark.position += dt * spark.velocity;
            spark.heat *= 1.0 - 0.5 * dt;
            spark.is_born = false;
        }
    }

    /// The sparks as lights, and whether each was born in this frame.
    pub fn lights(&self) -> impl Iterator<Item = (Light, bool)> {
        self.sparks.iter().map(|spark| {
            let color = Vec3::new(1.0, 0.55 * spark.heat, 0.2 * spark.heat.powi(3));
            (Light::point(spark.position, color * spark.heat.powi(4)), spark.is_born)
        })
    }
}
