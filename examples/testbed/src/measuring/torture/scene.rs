//! A scene of the set, and what scenes are made of.

use crate::common::pcg::Rng;
use girandole::glam::{DVec3, Mat3, Quat, Vec3, vec3};
use girandole::{FrameBudget, Light, LightTree, LightWorld, Placement, Policy, ShadingPoint};
use std::f32::consts::PI;

/// Shading points of each scene.
pub const SHADING_POINTS: usize = 200;

/// Lights in instances, and shading points.
pub struct TortureScene {
    pub name: String,
    pub world: LightWorld,
    pub shading_points: Vec<ShadingPoint>,
}

/// Makes a scene from random numbers of its own.
pub type Make = fn(&mut Parts, &mut Rng);

/// A scene that is being made.
#[derive(Default)]
pub struct Parts {
    pub world: LightWorld,
    pub shading_points: Vec<ShadingPoint>,
}

impl TortureScene {
    /// A scene with the first shading points that it makes.
    pub fn new(name: String, make: &dyn Fn(&mut Parts, &mut Rng), shading_points: usize) -> Self {
        let mut parts = Parts::default();
        // Each scene has a stream of its own, whatever scenes come before it.
        let stream = name.bytes().fold(0_u64, |hash, byte| hash.wrapping_mul(31).wrapping_add(u64::from(byte)));
        make(&mut parts, &mut Rng::new(77, stream));
        // A few, in which all instances are judged.
        for _ in 0..4 {
            parts.world.update(FrameBudget::UNLIMITED);
        }
        parts.shading_points.truncate(shading_points);
        Self { name, world: parts.world, shading_points: parts.shading_points }
    }
}

impl Parts {
    /// Adds lights as instances of one tree. Panics if a light or a placement is invalid: scenes have none.
    fn show(&mut self, lights: Vec<Light>, policy: Policy, places: impl IntoIterator<Item = (Mat3, DVec3)>) {
        let tree = self.world.add_tree(LightTree::new(lights).expect("scenes have valid lights"));
        for (linear, translation) in places {
            let placement = Placement { linear, translation };
            self.world.add_instance(tree, placement, policy).expect("scenes have valid placements");
        }
    }

    /// Adds instances of one tree, which never move.
    pub fn add_all(&mut self, lights: Vec<Light>, places: impl IntoIterator<Item = (Mat3, DVec3)>) {
        self.show(lights, Policy::Static, places);
    }

    /// The same without turns.
    pub fn add_at(&mut self, lights: Vec<Light>, places: impl IntoIterator<Item = DVec3>) {
        self.add_all(lights, places.into_iter().map(|place| (Mat3::IDENTITY, place)));
    }

    /// Adds lights as one instance.
    pub fn add(&mut self, lights: Vec<Light>, linear: Mat3, translation: Vec3) {
        self.show(lights, Policy::Budgeted, [(linear, translation.as_dvec3())]);
    }

    /// Adds lights as one instance in the space of the world.
    pub fn add_here(&mut self, lights: Vec<Light>) {
        self.add(lights, Mat3::IDENTITY, Vec3::ZERO);
    }

    /// Adds shading points on surfaces; `point` returns position and normal.
    pub fn receive(&mut self, mut point: impl FnMut() -> (Vec3, Vec3)) {
        for _ in 0..SHADING_POINTS {
            let (position, normal) = point();
            self.shading_points.push(ShadingPoint::surface(position, normal));
        }
    }
}

/// A point of the box around the origin with these half edges.
pub fn in_box(rng: &mut Rng, half: Vec3) -> Vec3 {
    half * vec3(rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), rng.range(-1.0, 1.0))
}

/// A unit vector.
pub fn direction(rng: &mut Rng) -> Vec3 {
    let z = rng.range(-1.0, 1.0);
    let (s, c) = (2.0 * PI * rng.unit()).sin_cos();
    vec3(c, s, 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z
}

/// A rotation.
pub fn rotation(rng: &mut Rng) -> Mat3 {
    Mat3::from_quat(Quat::from_axis_angle(direction(rng), rng.range(0.0, 2.0 * PI)))
}

/// A lamp of some candela.
pub fn lamp(position: Vec3, candela: f32) -> Light {
    Light::point(position, Vec3::splat(candela))
}

/// A square panel with edges of twice `half` metres that emits along `normal`, with a radiance that
/// gives the flux of a lamp of some candela.
pub fn panel(center: Vec3, normal: Vec3, half: f32, candela: f32) -> Light {
    let u = normal.any_orthonormal_vector();
    let v = normal.cross(u);
    Light::rectangle(center, u * half, v * half, Vec3::splat(candela / (half * half)))
}
