//! The field: a ground, and columns and balls of six materials.

use bevy::prelude::*;

use crate::lamps::random;
use crate::options::Options;
use crate::rooms;

/// Metres from the middle to where the field ends.
const RADIUS: f32 = 115.0;
/// Metres between columns.
const SPACING: f32 = 5.0;

pub fn add_systems(app: &mut App) {
    let has_rooms = app.world().resource::<Options>().rooms;
    if has_rooms {
        app.add_systems(Startup, rooms::build);
    } else {
        app.add_systems(Startup, build);
    }
}

fn material(color: [f32; 3], metallic: f32, rough: f32, clearcoat: f32) -> StandardMaterial {
    let [r, g, b] = color;
    StandardMaterial {
        base_color: Color::linear_rgb(r, g, b),
        metallic,
        perceptual_roughness: rough,
        clearcoat,
        clearcoat_perceptual_roughness: 0.2,
        ..default()
    }
}

fn build(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>, mut materials: ResMut<Assets<StandardMaterial>>) {
    let kinds = [
        material([0.95, 0.70, 0.33], 1.0, 0.32, 0.0),
        material([0.90, 0.52, 0.40], 1.0, 0.45, 0.0),
        material([0.62, 0.63, 0.66], 1.0, 0.38, 0.0),
        material([0.75, 0.74, 0.70], 0.0, 0.55, 0.0),
        material([0.10, 0.18, 0.50], 0.0, 0.35, 1.0),
        material([0.45, 0.05, 0.04], 0.0, 0.35, 1.0),
    ]
    .map(|material| materials.add(material));
    let ground = materials.add(material([0.12, 0.12, 0.13], 0.0, 0.42, 0.0));
    let plane = meshes.add(Plane3d::default().mesh().size(4.0 * RADIUS, 4.0 * RADIUS));
    commands.spawn((Mesh3d(plane), MeshMaterial3d(ground)));

    let column = meshes.add(Cylinder::new(0.5, 1.0).mesh().resolution(20));
    let block = meshes.add(Cuboid::new(1.0, 1.0, 1.0));
    let ball = meshes.add(Sphere::new(0.5).mesh().uv(24, 12));
    let steps = (RADIUS / SPACING) as i32;
    for x in -steps..=steps {
        for z in -steps..=steps {
            let number = (x + 1000) as u32 * 4096 + (z + 1000) as u32;
            let [a, b, c, d, e] = random(number);
            let at = Vec3::new(x as f32 + 0.7 * (a - 0.5), 0.0, z as f32 + 0.7 * (b - 0.5)) * SPACING;
            let distance = at.length();
            if !(4.0..RADIUS).contains(&distance) {
                continue;
            }
            let width = 0.8 + 1.6 * c * c;
            let height = 1.0 + 5.0 * d * d;
            let (mesh, size) = match (e * 10.0) as u32 {
                0..=3 => (&column, Vec3::new(width, height, width)),
                4..=6 => (&block, Vec3::new(width, 0.7 * height, width)),
                _ => (&ball, Vec3::splat(width)),
            };
            let place = Transform::from_translation(at + 0.5 * size.y * Vec3::Y)
                .with_rotation(Quat::from_rotation_y(6.0 * b))
                .with_scale(size);
            let kind = kinds[(number.wrapping_mul(0x9e37_79b9) >> 16) as usize % kinds.len()].clone();
            commands.spawn((Mesh3d(mesh.clone()), MeshMaterial3d(kind), place));
        }
    }
    // The ball in the middle, which reflects the swarm.
    let middle = Transform::from_xyz(0.0, 2.4, 0.0).with_scale(Vec3::splat(4.8));
    let fine = meshes.add(Sphere::new(0.5).mesh().uv(64, 32));
    commands.spawn((Mesh3d(fine), MeshMaterial3d(materials.add(material([0.9, 0.9, 0.92], 1.0, 0.25, 0.0))), middle));
}
