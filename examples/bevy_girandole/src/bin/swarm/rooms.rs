//! A hundred rooms without a roof, in each of which ten lamps circle around a column. Walls keep their light apart.

use bevy::prelude::*;

use crate::lamps::random;

/// Rooms along each side.
pub const SIDE: u32 = 10;
/// Metres between the middles of rooms.
pub const SPACING: f32 = 6.0;
/// The width of a doorway, and the height and thickness of a wall.
const DOOR: f32 = 1.2;
const HEIGHT: f32 = 2.6;
const THICKNESS: f32 = 0.2;

/// The middle of a room.
pub fn middle(room: u32) -> Vec3 {
    let half = 0.5 * (SIDE - 1) as f32;
    Vec3::new((room % SIDE) as f32 - half, 0.0, (room / SIDE) as f32 - half) * SPACING
}

pub fn build(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let mut plain = |color| {
        materials.add(StandardMaterial { base_color: color, perceptual_roughness: 0.7, reflectance: 0.2, ..default() })
    };
    let [floor, wall, column] =
        [[0.45, 0.42, 0.38], [0.7, 0.7, 0.68], [0.75, 0.72, 0.65]].map(|[r, g, b]| plain(Color::linear_rgb(r, g, b)));
    let edge = SIDE as f32 * SPACING;
    let plane = meshes.add(Plane3d::default().mesh().size(edge, edge));
    commands.spawn((Mesh3d(plane), MeshMaterial3d(floor)));
    let block = meshes.add(Cuboid::default());
    let pillar = meshes.add(Cylinder::new(0.5, 1.0));
    let mut put = |mesh: &Handle<Mesh>, material: &Handle<StandardMaterial>, at: Vec3, size: Vec3| {
        let placed = Transform::from_translation(at + 0.5 * size.y * Vec3::Y).with_scale(size);
        commands.spawn((Mesh3d(mesh.clone()), MeshMaterial3d(material.clone()), placed));
    };
    for room in 0..SIDE * SIDE {
        let [a, b, c, ..] = random(7000 + room);
        let at = middle(room);
        put(&pillar, &column, at + Vec3::new(a - 0.5, 0.0, b - 0.5), Vec3::new(0.4 + 0.4 * c, 1.0 + c, 0.4 + 0.4 * c));
        put(&block, &column, at + Vec3::new(1.6 * (b - 0.5), 0.0, 1.4), Vec3::new(1.2, 0.7, 0.6));
    }
    // Walls between rooms have a doorway, and those around all rooms have none.
    let length = 0.5 * (SPACING - DOOR);
    for line in 0..=SIDE {
        let across = (line as f32 - 0.5 * SIDE as f32) * SPACING;
        if line == 0 || line == SIDE {
            put(&block, &wall, Vec3::new(across, 0.0, 0.0), Vec3::new(THICKNESS, HEIGHT, edge));
            put(&block, &wall, Vec3::new(0.0, 0.0, across), Vec3::new(edge, HEIGHT, THICKNESS));
            continue;
        }
        for room in 0..SIDE {
            for side in [-1.0, 1.0] {
                let along = (room as f32 - 0.5 * (SIDE - 1) as f32) * SPACING + side * 0.5 * (DOOR + length);
                put(&block, &wall, Vec3::new(across, 0.0, along), Vec3::new(THICKNESS, HEIGHT, length));
                put(&block, &wall, Vec3::new(along, 0.0, across), Vec3::new(length, HEIGHT, THICKNESS));
            }
        }
    }
}
