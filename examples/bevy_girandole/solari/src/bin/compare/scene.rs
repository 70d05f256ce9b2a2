//! Two scenes: that of Bevy's example with many lights, and an interior.

use std::f32::consts::{FRAC_PI_2, TAU};

use bevy::prelude::*;
use bevy::solari::prelude::RaytracingMesh3d;

/// Which scene is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneName {
    /// 441 glowing spheres over 8,000 boxes on a plane, as in Bevy's example `solari --many-lights`.
    Spheres,
    /// A hall with rooms on both sides, and 8,880 emissive triangles.
    Interior,
}

impl SceneName {
    /// Corners of the part of the floor around the camera.
    pub fn floor(self) -> [Vec3; 2] {
        match self {
            Self::Spheres => [Vec3::new(-60.0, 0.0, -100.0), Vec3::new(60.0, 0.0, 40.0)],
            Self::Interior => [Vec3::new(-8.0, 0.0, -30.0), Vec3::new(8.0, 0.0, 1.0)],
        }
    }
}

/// Random numbers in [0, 1), always the same.
pub struct Random(u32);

impl Random {
    pub fn new(seed: u32) -> Self {
        Self(seed)
    }

    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((self.0 >> ((self.0 >> 28) + 4)) ^ self.0).wrapping_mul(277_803_737);
        ((word >> 22 ^ word) >> 8) as f32 / 16_777_216.0
    }

    fn between(&mut self, least: f32, most: f32) -> f32 {
        least + (most - least) * self.next()
    }
}

/// Adds a scene. Returns where the camera stands.
pub fn add(world: &mut World, name: SceneName) -> Transform {
    match name {
        SceneName::Spheres => add_spheres(world),
        SceneName::Interior => add_interior(world),
    }
}

fn add_mesh(world: &mut World, mesh: Mesh) -> Handle<Mesh> {
    let mesh = mesh.with_generated_tangents().expect("it has normals and texture coordinates");
    world.resource_mut::<Assets<Mesh>>().add(mesh)
}

/// An entity that rays hit, and that the deferred renderer draws.
fn spawn(world: &mut World, mesh: &Handle<Mesh>, material: StandardMaterial, transform: Transform) {
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
    world.spawn((Mesh3d(mesh.clone()), RaytracingMesh3d(mesh.clone()), MeshMaterial3d(material), transform));
}

fn add_spheres(world: &mut World) -> Transform {
    let mut random = Random::new(42);
    let plane = add_mesh(world, Plane3d::default().mesh().size(400.0, 400.0).build());
    let cube = add_mesh(world, Cuboid::default().mesh().build());
    let sphere = add_mesh(world, Sphere::new(1.0).mesh().build());
    let grey =
        StandardMaterial { base_color: Color::linear_rgb(0.5, 0.5, 0.5), perceptual_roughness: 0.5, ..default() };
    spawn(world, &plane, grey, Transform::default());
    for _ in 0..8000 {
        let base_color = Color::srgb(random.next(), random.next(), random.next());
        let material = StandardMaterial { base_color, perceptual_roughness: random.next(), ..default() };
        let scale = Vec3::from_array(std::array::from_fn(|_| random.between(0.2, 2.0)));
        let place = Vec3::new(random.between(-180.0, 180.0), 0.2, random.between(-180.0, 180.0));
        spawn(world, &cube, material, Transform::from_translation(place).with_scale(scale));
    }
    for x in -10..=10 {
        for z in -10..=10 {
            let [red, green, blue] = std::array::from_fn(|_| 60_000.0 * random.next());
            let material = StandardMaterial { emissive: LinearRgba::rgb(red, green, blue), ..default() };
            spawn(world, &sphere, material, Transform::from_xyz(20.0 * x as f32, 7.0, 20.0 * z as f32));
        }
    }
    Transform::from_xyz(-3.0, 9.0, 40.0).looking_at(Vec3::new(0.0, 0.0, 0.0), Vec3::Y)
}

/// Rooms on each side of the hall.
const ROOMS: usize = 5;

fn add_interior(world: &mut World) -> Transform {
    let mut random = Random::new(7);
    let cube = add_mesh(world, Cuboid::default().mesh().build());
    let bulb = add_mesh(world, Sphere::new(0.06).mesh().ico(1).expect("it is not too fine"));
    let tube = add_mesh(world, Cylinder::new(0.02, 1.2).mesh().resolution(12).build());
    let length = 6.0 * ROOMS as f32;
    let block = |world: &mut World, color: Vec3, roughness, center: Vec3, size: Vec3| {
        let base_color = Color::linear_rgb(color.x, color.y, color.z);
        let material = StandardMaterial { base_color, perceptual_roughness: roughness, ..default() };
        spawn(world, &cube, material, Transform::from_translation(center).with_scale(size));
    };
    let (white, wood) = (Vec3::new(0.75, 0.73, 0.7), Vec3::new(0.4, 0.25, 0.15));
    block(world, wood, 0.3, Vec3::new(0.0, -0.1, -length / 2.0), Vec3::new(16.0, 0.2, length + 4.0));
    block(world, white, 0.9, Vec3::new(0.0, 3.1, -length / 2.0), Vec3::new(16.0, 0.2, length + 4.0));
    for side in [-1.0, 1.0] {
        block(world, white, 0.9, Vec3::new(8.1 * side, 1.5, -length / 2.0), Vec3::new(0.2, 3.4, length + 4.0));
        for room in 0..ROOMS {
            let z = -6.0 * room as f32;
            // A wall between rooms, and one to the hall with a door.
            block(world, white, 0.9, Vec3::new(5.1 * side, 1.5, z), Vec3::new(5.8, 3.0, 0.2));
            block(world, white, 0.9, Vec3::new(2.2 * side, 1.5, z - 3.9), Vec3::new(0.2, 3.0, 4.0));
            block(world, white, 0.9, Vec3::new(2.2 * side, 2.6, z - 1.0), Vec3::new(0.2, 0.8, 1.8));
            let hue = Vec3::from_array(std::array::from_fn(|_| random.between(0.2, 0.8)));
            block(world, hue, 0.6, Vec3::new(6.0 * side, 0.4, z - 3.5), Vec3::new(1.6, 0.8, 2.4));
        }
    }
    block(world, white, 0.9, Vec3::new(0.0, 1.5, -length - 1.0), Vec3::new(16.0, 3.4, 0.2));
    block(world, white, 0.9, Vec3::new(0.0, 1.5, 2.0), Vec3::new(16.0, 3.4, 0.2));
    let lamp = |world: &mut World, random: &mut Random, mesh: &Handle<Mesh>, nits: f32, transform: Transform| {
        let tint = Vec3::from_array(std::array::from_fn(|_| random.between(0.3, 1.0)));
        let emissive = LinearRgba::rgb(nits * tint.x, nits * tint.y, nits * tint.z);
        spawn(world, mesh, StandardMaterial { emissive, ..default() }, transform);
    };
    // Strings of bulbs in the rooms: 80 triangles each.
    for side in [-1.0, 1.0] {
        for room in 0..ROOMS {
            for bulb_number in 0..10 {
                let angle = TAU * bulb_number as f32 / 10.0;
                let place =
                    Vec3::new(5.1 * side + 2.0 * angle.cos(), 2.5, -6.0 * room as f32 - 3.0 + 2.0 * angle.sin());
                lamp(world, &mut random, &bulb, 20_000.0, Transform::from_translation(place));
            }
        }
    }
    // Tubes under the ceiling of the hall.
    for number in 0..4 * ROOMS {
        let place = Vec3::new(0.0, 2.9, -1.5 * number as f32 - 0.5);
        let along = Quat::from_rotation_x(FRAC_PI_2);
        lamp(world, &mut random, &tube, 6_000.0, Transform::from_translation(place).with_rotation(along));
    }
    Transform::from_xyz(0.3, 1.6, 1.5).looking_at(Vec3::new(-0.6, 1.2, -8.0), Vec3::Y)
}
