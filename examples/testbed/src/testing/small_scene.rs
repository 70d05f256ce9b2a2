//! A small scene for tests: every kind of light, shared trees, a car that moves, and a string of
//! lights that sways.
//!
//! It is rendered by the code that renders the city.

use crate::scene::assembly::Assembly;
use crate::scene::palette::Palette;
use crate::scene::part::Part;
use crate::scene::{Animation, Camera, Scene, SceneError, Sky, Stage};
use girandole::glam::{Affine3A, Mat3, Quat, Vec3, vec3};
use girandole::{DirectionalLight, InstanceKey, Light, LightTree, LightWorld, Policy, TreeKey};
use std::f32::consts::TAU;

/// Number of lights on the string.
const BULBS: usize = 8;

/// The motion of the car with its lights, and of the lights of the string.
struct Motion {
    is_still: bool,
    car_object: usize,
    car_lights: InstanceKey,
    string: TreeKey,
}

/// Builds the scene, without motion if `is_still` is set.
pub fn stage(is_still: bool) -> Result<Stage, SceneError> {
    let (mut assembly, mut palette) = (Assembly::new(), Palette::default());
    let still = Affine3A::IDENTITY;
    let yard = assembly.design(yard(&mut palette))?;
    assembly.place(yard, still, Policy::Static)?;
    let lamp = assembly.design(lamp(&mut palette))?;
    for i in 0..8 {
        let at = vec3(-10.5 + 3.0 * i as f32, 0.0, if i % 2 == 0 { -5.0 } else { 4.5 });
        let lean = Quat::from_rotation_z(0.05 * i as f32 - 0.2);
        assembly.place(lamp, Affine3A::from_rotation_translation(lean, at), Policy::Static)?;
    }
    let sign = assembly.design(sign(&mut palette))?;
    for (x, mirror) in [(-5.0, 1.0), (0.5, -1.0), (5.5, 1.0)] {
        let linear = Mat3::from_rotation_y(0.2 * x) * Mat3::from_diagonal(vec3(mirror, 1.0, 1.3));
        assembly.place(sign, Affine3A::from_mat3_translation(linear, vec3(x, 3.0, -5.4)), Policy::Static)?;
    }
    let mut bulb = Part::default();
    bulb.bulb(Vec3::ZERO, 1.0, 12, palette.glow(vec3(90.0, 85.0, 70.0), 90.0));
    let bulb = assembly.design(bulb)?;
    for i in 0..6 {
        let (sin, cos) = (i as f32 / 6.0 * TAU).sin_cos();
        let at = vec3(3.0 * cos - 1.0, 0.5 + 0.2 * i as f32, 3.0 * sin + 1.0);
        let size = Vec3::splat(0.12 + 0.02 * i as f32);
        let placement = Affine3A::from_scale_rotation_translation(size, Quat::IDENTITY, at);
        assembly.place(bulb, placement, Policy::Static)?;
    }
    let car = assembly.design(car(&mut palette))?;
    let car = assembly.place(car, still, Policy::default())?;
    let car_lights = car.instance.ok_or_else(|| SceneError("a car without lights".into()))?;

    let Assembly { mut scene, mut world } = assembly;
    let direction = vec3(0.4, -0.8, -0.3).normalize();
    world.add_directional(DirectionalLight { direction, illuminance: vec3(0.3, 0.35, 0.5) })?;
    let string = world.add_tree(LightTree::new(string_lights(0.0))?);
    world.add_instance(string, Affine3A::from_translation(vec3(-4.0, 4.0, -3.0)), Policy::default())?;
    scene.materials = palette.materials;
    scene.camera = Camera { eye: vec3(-9.0, 4.5, 11.0), target: vec3(0.5, 1.2, -1.0), vertical_fov: 0.8, up: Vec3::Y };
    scene.sky = Sky {
        zenith: vec3(0.02, 0.03, 0.08),
        horizon: vec3(0.20, 0.14, 0.12),
        ambient: vec3(0.02, 0.02, 0.03),
        // Both backends look through the same haze.
        haze: 0.01,
        glow: vec3(0.1, 0.05, 0.02),
        sun: vec3(0.6, 0.0, -0.8),
    };
    (scene.lamp_clearance, scene.exposure) = (0.3, 0.12);
    let mut animation = Motion { is_still, car_object: car.object, car_lights, string };
    animation.pose(0.0, &mut scene, &mut world)?;
    Ok(Stage { scene, world, animation: Box::new(animation) })
}

/// The ground, houses, crates, a ball of steel, and a pane that shadow rays pass.
fn yard(palette: &mut Palette) -> Part {
    let mut yard = Part::default();
    yard.floor([-30.0; 2], [30.0; 2], 0.0, palette.glossy([0.12; 3], 0.35));
    let [brick, plaster] = [palette.glossy([0.45, 0.22, 0.16], 0.9), palette.glossy([0.6, 0.58, 0.52], 0.7)];
    for (x, z, turn, half, material) in [
        (-6.0, -8.0, -0.6, vec3(2.5, 4.5, 2.0), brick),
        (1.0, -9.0, 0.1, vec3(2.0, 3.0, 2.0), brick),
        (7.0, -8.0, 0.7, vec3(2.5, 5.5, 2.0), brick),
        (9.0, 3.0, 0.9, vec3(1.5, 2.0, 2.0), brick),
        (-3.0, 1.0, -3.0, Vec3::splat(0.4), plaster),
        (-2.2, 1.6, -2.2, Vec3::splat(0.4), plaster),
        (4.0, -3.0, 4.0, Vec3::splat(0.4), plaster),
    ] {
        let Mat3 { x_axis, y_axis, z_axis } = Mat3::from_rotation_y(turn) * Mat3::from_diagonal(half);
        yard.oriented_box(vec3(x, half.y, z), x_axis, y_axis, z_axis, material);
    }
    yard.ball(vec3(-0.5, 0.9, 3.0), Vec3::splat(0.9), 24, palette.metal([0.8, 0.8, 0.82], 0.25));
    let pane = [(1.5, 0.0), (3.5, 0.0), (3.5, 2.0), (1.5, 2.0)].map(|(x, y)| vec3(x, y, 2.5));
    yard.quad(pane, palette.shadowless([0.9; 3]));
    yard
}

/// A post with a spot light and a point light.
fn lamp(palette: &mut Palette) -> Part {
    let warm = vec3(1.0, 0.75, 0.45);
    let mut lamp = Part::default();
    lamp.cuboid(vec3(-0.06, 0.0, -0.06), vec3(0.06, 3.8, 0.06), palette.metal([0.8, 0.8, 0.82], 0.25));
    lamp.lights.push(Light::spot(Vec3::Y * 4.0, Vec3::NEG_Y, 0.5, 1.1, warm * 120.0).with_range(25.0));
    lamp.lights.push(Light::point(Vec3::Y * 4.2, warm * 15.0));
    lamp
}

/// A sign of two triangle lights and a two-sided rectangle light.
fn sign(palette: &mut Palette) -> Part {
    let [pink, blue] = [vec3(60.0, 6.0, 40.0), vec3(5.0, 25.0, 70.0)].map(|c| palette.glow(c, c.max_element()));
    palette.materials[blue.material as usize].two_sided_emission = true;
    let mut sign = Part::default();
    let [a, b, c, d] = [(-0.9, -0.35), (0.9, -0.35), (0.9, 0.35), (-0.9, 0.35)].map(|(x, y)| vec3(x, y, 0.0));
    for vertices in [[a, b, c], [a, c, d]] {
        sign.triangle(vertices, pink.material);
        sign.lights.push(Light::triangle(vertices, pink.radiance));
    }
    sign.glow(Vec3::Z * 1.2, Vec3::X * 0.45, Vec3::Y * 0.35, blue);
    sign.lights[2] = sign.lights[2].two_sided();
    sign
}

/// A car with two spot lights and two rectangle lights, which face backwards.
fn car(palette: &mut Palette) -> Part {
    let mut car = Part::default();
    car.cuboid(vec3(-2.0, 0.2, -0.9), vec3(2.0, 1.4, 0.9), palette.glossy([0.5, 0.05, 0.04], 0.3));
    let red = palette.glow(vec3(40.0, 1.0, 0.5), 40.0);
    for side in [-0.6, 0.6] {
        let ahead = vec3(1.0, -0.1, 0.0).normalize();
        car.lights.push(Light::spot(vec3(2.1, 0.8, side), ahead, 0.2, 0.6, Vec3::splat(900.0)));
        car.glow(vec3(-2.02, 1.0, side), Vec3::Z * 0.15, Vec3::Y * 0.08, red);
    }
    car
}

/// The lights of the string at a time, in seconds.
fn string_lights(time: f64) -> Vec<Light> {
    let light = |i: usize| {
        let along = i as f32 / (BULBS - 1) as f32;
        let sway = (time as f32 * 2.0 + along * 3.0).sin() * 0.4;
        let sag = 4.0 * along * (1.0 - along);
        Light::point(vec3(8.0 * along, -sag, sway * sag), vec3(6.0, 4.0, 1.5)).with_range(12.0)
    };
    (0..BULBS).map(light).collect()
}

impl Motion {
    /// Moves the car and the string to where they are at a time, in seconds.
    fn pose(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        let at = vec3(-4.0 + 6.0 * time as f32, 0.0, 6.5 - time as f32);
        let placement = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.15), at);
        scene.objects[self.car_object].transform = placement;
        world.move_instance(self.car_lights, placement)?;
        let lights: Vec<(u32, Light)> = (0..).zip(string_lights(time)).collect();
        world.set_lights(self.string, &lights)?;
        Ok(())
    }
}

impl Animation for Motion {
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        if self.is_still { Ok(()) } else { self.pose(time, scene, world) }
    }

    fn is_still(&self) -> bool {
        self.is_still
    }
}
