//! The lamps: where each one is at a time, and the mesh of dots that shows them.

use std::f32::consts::TAU;

use bevy::asset::RenderAssetUsages;
use bevy::camera::visibility::NoFrustumCulling;
use bevy::light::{NotShadowCaster, PointLight};
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_girandole::GirandoleLight;

use crate::options::Options;
use crate::rooms;

/// The seconds by which a frame advances the swarm, however long the frame takes.
const STEP: f32 = 1.0 / 60.0;
/// Arms of the swarm.
const ARMS: u32 = 5;
/// Metres between the edges of a dot.
const DOT: f32 = 0.035;

/// How bright a dot is in the picture.
const GLOW: f32 = 14.0;

pub fn add_systems(app: &mut App) {
    app.init_resource::<Clock>().add_systems(Startup, spawn).add_systems(Update, (tick, fly, show).chain());
}

/// The frames that the swarm has flown.
#[derive(Resource, Default)]
pub struct Clock {
    pub frame: u32,
    pub is_stopped: bool,
}

/// Five pseudo-random numbers in [0, 1) from a seed.
pub fn random(number: u32) -> [f32; 5] {
    let mut state = number;
    std::array::from_fn(|_| {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
        ((word >> 22) ^ word) as f32 / 4_294_967_296.0
    })
}

/// The path of one lamp: a circle around the middle, faster near the middle, with a vertical
/// oscillation.
#[derive(Component, Clone, Copy)]
struct Lamp {
    middle: Vec3,
    radius: f32,
    angle: f32,
    speed: f32,
    height: f32,
    phase: f32,
    color: Vec3,
}

impl Lamp {
    fn new(number: u32) -> Self {
        let [a, b, c, d, e] = random(number);
        let radius = 5.0 + 105.0 * a.powf(0.7);
        let arm = (number % ARMS) as f32;
        // Most lamps lie near the middle of an arm.
        let spread = (b + c - 1.0) * 0.75;
        let warm = Vec3::new(1.0, 0.48, 0.16);
        let cold = Vec3::new(0.25, 0.50, 1.0);
        let rose = Vec3::new(1.0, 0.22, 0.45);
        let mix = (arm / (ARMS - 1) as f32 + 0.5 * (d - 0.5)).clamp(0.0, 1.0);
        let color = if mix < 0.5 { warm.lerp(rose, 2.0 * mix) } else { rose.lerp(cold, 2.0 * mix - 1.0) };
        Self {
            middle: Vec3::ZERO,
            radius,
            angle: TAU * arm / ARMS as f32 + spread + 9.0 / (1.0 + 0.03 * radius),
            speed: 6.0 / (4.0 + radius),
            height: 0.25 + 3.6 * d * d,
            phase: TAU * e,
            color,
        }
    }

    /// A lamp that circles in a room.
    fn in_room(number: u32) -> Self {
        let [a, b, c, d, e] = random(number);
        let room = number % (rooms::SIDE * rooms::SIDE);
        let [hue, ..] = random(9000 + room);
        let color = Color::hsl(360.0 * hue, 0.6, 0.7).to_linear();
        Self {
            middle: rooms::middle(room),
            radius: 1.0 + 1.4 * a,
            angle: TAU * b,
            speed: 0.4 + c,
            height: 0.3 + 1.2 * d,
            phase: TAU * e,
            color: Vec3::new(color.red, color.green, color.blue),
        }
    }

    fn at(&self, seconds: f32) -> Vec3 {
        let (sin, cos) = (self.angle + self.speed * seconds).sin_cos();
        let height = self.height * (1.0 + 0.3 * (self.phase + 2.0 * seconds).sin());
        self.middle + Vec3::new(self.radius * cos, height, self.radius * sin)
    }
}

fn spawn(
    mut commands: Commands,
    options: Res<Options>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let lights = (0..options.lamps).map(|number| {
        let lamp = if options.rooms { Lamp::in_room(number) } else { Lamp::new(number) };
        // Equal but for their colour, so all of them share one tree.
        let color = Color::linear_rgb(lamp.color.x, lamp.color.y, lamp.color.z);
        let intensity = if options.rooms { 2500.0 } else { 160.0 };
        let light = PointLight { color, intensity, range: 7.0, ..default() };
        (lamp, light, Transform::from_translation(lamp.at(0.0)))
    });
    let lights: Vec<_> = lights.collect();
    if options.bevy_lights {
        commands.spawn_batch(lights);
    } else {
        commands.spawn_batch(lights.into_iter().map(|light| (light, GirandoleLight)).collect::<Vec<_>>());
    }
    let dots = Dots { mesh: meshes.add(empty_mesh()) };
    let glow = StandardMaterial { unlit: true, cull_mode: None, ..default() };
    commands.spawn((Mesh3d(dots.mesh.clone()), MeshMaterial3d(materials.add(glow)), NoFrustumCulling, NotShadowCaster));
    commands.insert_resource(dots);
}

/// One mesh with a triangle for each lamp.
#[derive(Resource)]
struct Dots {
    mesh: Handle<Mesh>,
}

fn empty_mesh() -> Mesh {
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::all())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![[0.0_f32; 3]; 3])
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, vec![[0.0_f32, 1.0, 0.0]; 3])
        .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, vec![[0.0_f32; 4]; 3])
        .with_inserted_indices(Indices::U32(vec![0, 1, 2]))
}

fn tick(mut clock: ResMut<Clock>, options: Res<Options>) {
    if clock.frame < options.settle && !clock.is_stopped {
        clock.frame += 1;
    }
}

/// Moves the lamps. Transforms of lamps that stand still are not touched, so change detection finds
/// nothing.
fn fly(clock: Res<Clock>, mut last: Local<u32>, mut lamps: Query<(&Lamp, &mut Transform)>) {
    if clock.frame == std::mem::replace(&mut *last, clock.frame) {
        return;
    }
    let seconds = clock.frame as f32 * STEP;
    lamps.par_iter_mut().for_each(|(lamp, mut transform)| transform.translation = lamp.at(seconds));
}

/// Turns the dots to the camera.
fn show(
    dots: Res<Dots>,
    clock: Res<Clock>,
    mut last: Local<Option<(u32, Transform)>>,
    mut meshes: ResMut<Assets<Mesh>>,
    lamps: Query<(&Lamp, &Transform), Without<Camera3d>>,
    camera: Single<&Transform, With<Camera3d>>,
) {
    let now = (clock.frame, **camera);
    if last.replace(now) == Some(now) {
        return;
    }
    let (right, up) = (camera.right() * DOT, camera.up() * DOT);
    let count = lamps.iter().len();
    let (mut places, mut colors) = (Vec::with_capacity(3 * count), Vec::with_capacity(3 * count));
    for (lamp, transform) in &lamps {
        let middle = transform.translation;
        // Far dots are drawn larger and darker instead, so that none is smaller than a pixel.
        let distance = middle.distance(camera.translation);
        let growth = (distance / 40.0).max(1.0);
        let glow = (lamp.color * (GLOW / (growth * growth))).extend(1.0).to_array();
        for corner in [right - up, up * 1.2, -right - up] {
            places.push((middle + corner * growth).to_array());
            colors.push(glow);
        }
    }
    let Some(mut mesh) = meshes.get_mut(&dots.mesh) else { return };
    let vertices = places.len() as u32;
    mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, vec![[0.0_f32, 1.0, 0.0]; places.len()]);
    mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, places);
    mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, colors);
    mesh.insert_indices(Indices::U32((0..vertices).collect()));
}
