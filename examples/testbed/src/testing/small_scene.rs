//! A small scene for tests: every kind of light, shared trees, a car that moves, and a string of
//! lights that sways.
//!
//! It is rendered by the code that renders the city.

use crate::scene::{Animation, Camera, Material, Mesh, Object, Scene, SceneError, Sky, Stage, Triangle};
use girandole::glam::{Affine3A, Mat3, Quat, Vec3};
use girandole::{DirectionalLight, InstanceKey, Light, LightTree, LightWorld, Policy, TreeKey};
use std::f32::consts::TAU;

/// Number of lights on the string.
const BULBS: usize = 8;

/// Builds the scene, without motion if `is_still` is set.
pub fn stage(is_still: bool) -> Result<Stage, SceneError> {
    build(is_still).map_err(|e| SceneError(e.to_string()))
}

/// The motion of the car with its lights, and of the lights of the string.
struct Motion {
    is_still: bool,
    car_object: usize,
    car_lights: InstanceKey,
    string: TreeKey,
}

fn build(is_still: bool) -> Result<Stage, Box<dyn std::error::Error>> {
    let mut world = LightWorld::new();
    let mut scene = Scene {
        materials: Vec::new(),
        textures: Vec::new(),
        meshes: Vec::new(),
        objects: Vec::new(),
        festival: None,
        camera: Camera {
            eye: Vec3::new(-9.0, 4.5, 11.0),
            target: Vec3::new(0.5, 1.2, -1.0),
            vertical_fov: 0.8,
            up: Vec3::Y,
        },
        sky: Sky {
            zenith: Vec3::new(0.02, 0.03, 0.08),
            horizon: Vec3::new(0.20, 0.14, 0.12),
            ambient: Vec3::new(0.02, 0.02, 0.03),
            // Both backends look through the same haze.
            haze: 0.01,
            glow: Vec3::new(0.1, 0.05, 0.02),
            sun: Vec3::new(0.6, 0.0, -0.8),
        },
        lamp_clearance: 0.3,
        exposure: 0.12,
        is_metered: false,
        warnings: Vec::new(),
    };
    let asphalt = material(&mut scene, Vec3::splat(0.12), 0.35, 0.0);
    let brick = material(&mut scene, Vec3::new(0.45, 0.22, 0.16), 0.9, 0.0);
    let plaster = material(&mut scene, Vec3::new(0.6, 0.58, 0.52), 0.7, 0.0);
    let steel = material(&mut scene, Vec3::new(0.8, 0.8, 0.82), 0.25, 1.0);
    let paint = material(&mut scene, Vec3::new(0.5, 0.05, 0.04), 0.3, 0.0);
    let glass = material(&mut scene, Vec3::splat(0.9), 0.1, 0.0);
    scene.materials[glass as usize].see_through = true;

    let ground = mesh(&mut scene, quad(Vec3::ZERO, Vec3::X * 30.0, Vec3::Z * -30.0, asphalt));
    object(&mut scene, ground, Affine3A::IDENTITY);
    let block = mesh(&mut scene, cube(brick));
    for (x, z, width, height) in
        [(-6.0, -8.0, 5.0, 9.0), (1.0, -9.0, 4.0, 6.0), (7.0, -8.0, 5.0, 11.0), (9.0, 3.0, 3.0, 4.0)]
    {
        let scale = Vec3::new(width, height, 4.0) * 0.5;
        let at = Vec3::new(x, height * 0.5, z);
        object(&mut scene, block, Affine3A::from_scale_rotation_translation(scale, Quat::from_rotation_y(0.1 * x), at));
    }
    let crate_mesh = mesh(&mut scene, cube(plaster));
    for (x, z) in [(-3.0, 1.0), (-2.2, 1.6), (4.0, -3.0)] {
        object(
            &mut scene,
            crate_mesh,
            Affine3A::from_scale_rotation_translation(Vec3::splat(0.4), Quat::from_rotation_y(x), Vec3::new(x, 0.4, z)),
        );
    }
    let ball = mesh(&mut scene, octahedron(steel, 3));
    object(
        &mut scene,
        ball,
        Affine3A::from_translation(Vec3::new(-0.5, 0.9, 3.0)) * Affine3A::from_scale(Vec3::splat(0.9)),
    );
    let pane = mesh(&mut scene, quad(Vec3::new(2.5, 1.0, 2.5), Vec3::X, Vec3::Y, glass));
    object(&mut scene, pane, Affine3A::IDENTITY);

    lamps(&mut scene, &mut world, steel)?;
    signs(&mut scene, &mut world)?;
    bulbs(&mut scene, &mut world)?;
    world.add_directional(DirectionalLight {
        direction: Vec3::new(0.4, -0.8, -0.3).normalize(),
        illuminance: Vec3::new(0.3, 0.35, 0.5),
    })?;

    let string = world.add_tree(LightTree::new(string_lights(0.0))?);
    world.add_instance(string, Affine3A::from_translation(Vec3::new(-4.0, 4.0, -3.0)), Policy::default())?;
    let (car_object, car_lights) = car(&mut scene, &mut world, paint)?;
    let mut animation = Motion { is_still, car_object, car_lights, string };
    animation.pose(0.0, &mut scene, &mut world)?;
    Ok(Stage { scene, world, animation: Box::new(animation) })
}

/// Eight lamps, instances of one tree with a spot light and a point light.
fn lamps(scene: &mut Scene, world: &mut LightWorld, steel: u32) -> Result<(), Box<dyn std::error::Error>> {
    let warm = Vec3::new(1.0, 0.75, 0.45);
    let tree = world.add_tree(LightTree::new(vec![
        Light::spot(Vec3::new(0.0, 4.0, 0.0), Vec3::NEG_Y, 0.5, 1.1, warm * 120.0).with_range(25.0),
        Light::point(Vec3::new(0.0, 4.2, 0.0), warm * 15.0),
    ])?);
    let post = mesh(scene, cube(steel));
    for i in 0..8 {
        let at = Vec3::new(-10.5 + 3.0 * i as f32, 0.0, if i % 2 == 0 { -5.0 } else { 4.5 });
        let lean = Quat::from_rotation_z(0.05 * i as f32 - 0.2);
        world.add_instance(tree, Affine3A::from_rotation_translation(lean, at), Policy::Static)?;
        let size = Vec3::new(0.06, 1.9, 0.06);
        object(scene, post, Affine3A::from_scale_rotation_translation(size, Quat::IDENTITY, at + Vec3::Y * 1.9));
    }
    Ok(())
}

/// Three signs, each of two triangle lights and a two-sided rectangle light, with their geometry.
/// One is mirrored.
fn signs(scene: &mut Scene, world: &mut LightWorld) -> Result<(), Box<dyn std::error::Error>> {
    let pink = Vec3::new(60.0, 6.0, 40.0);
    let blue = Vec3::new(5.0, 25.0, 70.0);
    let pink_paint = emitter(scene, pink, false);
    let blue_paint = emitter(scene, blue, true);
    let (half_u, half_v) = (Vec3::X * 0.9, Vec3::Y * 0.35);
    let front = quad(Vec3::ZERO, half_u, half_v, pink_paint);
    let side = quad(Vec3::Z * 1.2, half_u * 0.5, half_v, blue_paint);
    let lights = front
        .triangles
        .iter()
        .map(|triangle| Light::triangle(triangle.vertices, pink))
        .chain([Light::rectangle(Vec3::Z * 1.2, half_u * 0.5, half_v, blue).two_sided()])
        .collect();
    let shape = mesh(scene, Mesh { triangles: [front.triangles, side.triangles].concat(), ..Default::default() });
    let tree = world.add_tree(LightTree::new(lights)?);
    for (x, mirror) in [(-5.0, 1.0), (0.5, -1.0), (5.5, 1.0)] {
        let placement = Affine3A {
            matrix3: (Mat3::from_rotation_y(0.2 * x) * Mat3::from_diagonal(Vec3::new(mirror, 1.0, 1.3))).into(),
            translation: Vec3::new(x, 3.0, -5.4).into(),
        };
        object(scene, shape, placement);
        world.add_instance(tree, placement, Policy::Static)?;
    }
    Ok(())
}

/// Six spheres of different sizes that share a tree.
fn bulbs(scene: &mut Scene, world: &mut LightWorld) -> Result<(), Box<dyn std::error::Error>> {
    let white = Vec3::new(90.0, 85.0, 70.0);
    let paint = emitter(scene, white, false);
    let shape = mesh(scene, octahedron(paint, 2));
    let tree = world.add_tree(LightTree::new(vec![Light::sphere(Vec3::ZERO, 1.0, white)])?);
    for i in 0..6 {
        let angle = i as f32 / 6.0 * TAU;
        let at = Vec3::new(3.0 * angle.cos() - 1.0, 0.5 + 0.2 * i as f32, 3.0 * angle.sin() + 1.0);
        let size = Vec3::splat(0.12 + 0.02 * i as f32);
        let placement = Affine3A::from_scale_rotation_translation(size, Quat::IDENTITY, at);
        object(scene, shape, placement);
        world.add_instance(tree, placement, Policy::Static)?;
    }
    Ok(())
}

/// A car with two spot lights and two rectangle lights. Returns its object and the instance of its
/// lights.
fn car(
    scene: &mut Scene,
    world: &mut LightWorld,
    paint: u32,
) -> Result<(usize, InstanceKey), Box<dyn std::error::Error>> {
    let red = Vec3::new(40.0, 1.0, 0.5);
    let red_paint = emitter(scene, red, false);
    let mut body = cube(paint);
    for triangle in &mut body.triangles {
        triangle.vertices = triangle.vertices.map(|v| v * Vec3::new(2.0, 0.6, 0.9) + Vec3::Y * 0.8);
    }
    let mut lights = Vec::new();
    for side in [-0.6, 0.6] {
        lights.push(Light::spot(
            Vec3::new(2.1, 0.8, side),
            Vec3::new(1.0, -0.1, 0.0).normalize(),
            0.2,
            0.6,
            Vec3::splat(900.0),
        ));
        // Faces backwards: its front is half_u x half_v.
        let (center, half_u, half_v) = (Vec3::new(-2.02, 1.0, side), Vec3::Z * 0.15, Vec3::Y * 0.08);
        body.triangles.extend(quad(center, half_u, half_v, red_paint).triangles);
        lights.push(Light::rectangle(center, half_u, half_v, red));
    }
    let shape = mesh(scene, body);
    let object = object(scene, shape, Affine3A::IDENTITY);
    let tree = world.add_tree(LightTree::new(lights)?);
    Ok((object, world.add_instance(tree, Affine3A::IDENTITY, Policy::default())?))
}

/// The lights of the string at a time, in seconds.
fn string_lights(time: f64) -> Vec<Light> {
    (0..BULBS)
        .map(|i| {
            let along = i as f32 / (BULBS - 1) as f32;
            let sway = (time as f32 * 2.0 + along * 3.0).sin() * 0.4;
            let sag = 4.0 * along * (1.0 - along);
            Light::point(Vec3::new(8.0 * along, -sag, sway * sag), Vec3::new(6.0, 4.0, 1.5)).with_range(12.0)
        })
        .collect()
}

impl Motion {
    /// Moves the car and the string to where they are at a time, in seconds.
    fn pose(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), Box<dyn std::error::Error>> {
        let placement = Affine3A::from_rotation_translation(
            Quat::from_rotation_y(0.15),
            Vec3::new(-4.0 + 6.0 * time as f32, 0.0, 6.5 - time as f32),
        );
        scene.objects[self.car_object].transform = placement;
        world.move_instance(self.car_lights, placement)?;
        let lights: Vec<(u32, Light)> = (0..).zip(string_lights(time)).collect();
        world.set_lights(self.string, &lights)?;
        Ok(())
    }
}

impl Animation for Motion {
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        if self.is_still { Ok(()) } else { self.pose(time, scene, world).map_err(|e| SceneError(e.to_string())) }
    }

    fn is_still(&self) -> bool {
        self.is_still
    }
}

fn material(scene: &mut Scene, base_color: Vec3, roughness: f32, metallic: f32) -> u32 {
    scene.materials.push(Material { base_color, roughness, metallic, ..Default::default() });
    scene.materials.len() as u32 - 1
}

fn emitter(scene: &mut Scene, emission: Vec3, two_sided_emission: bool) -> u32 {
    let base_color = Vec3::splat(0.1);
    scene.materials.push(Material { base_color, emission, two_sided_emission, ..Default::default() });
    scene.materials.len() as u32 - 1
}

fn mesh(scene: &mut Scene, mesh: Mesh) -> u32 {
    scene.meshes.push(mesh);
    scene.meshes.len() as u32 - 1
}

fn object(scene: &mut Scene, mesh: u32, transform: Affine3A) -> usize {
    scene.objects.push(Object { mesh, transform, emission_scale: 1.0, visible: true });
    scene.objects.len() - 1
}

/// A parallelogram; its front is the side of `half_u` x `half_v`.
fn quad(center: Vec3, half_u: Vec3, half_v: Vec3, material: u32) -> Mesh {
    let [a, b, c, d] = [-half_u - half_v, half_u - half_v, half_u + half_v, -half_u + half_v].map(|v| center + v);
    let triangles = [[a, b, c], [a, c, d]].map(|vertices| Triangle { vertices, material }).to_vec();
    Mesh { triangles, ..Default::default() }
}

/// A cube from -1 to 1.
fn cube(material: u32) -> Mesh {
    let axes = [(Vec3::X, Vec3::Y, Vec3::Z), (Vec3::Y, Vec3::Z, Vec3::X), (Vec3::Z, Vec3::X, Vec3::Y)];
    let sides = axes.into_iter().flat_map(|(n, u, v)| [quad(n, u, v, material), quad(-n, v, u, material)]);
    Mesh { triangles: sides.flat_map(|side| side.triangles).collect(), ..Default::default() }
}

/// A ball of radius 1: an octahedron whose triangles are split into four `levels` times.
fn octahedron(material: u32, levels: u32) -> Mesh {
    let mut faces = Vec::new();
    for (x, y, z) in
        [(1, 1, 1), (1, 1, -1), (1, -1, 1), (1, -1, -1), (-1, 1, 1), (-1, 1, -1), (-1, -1, 1), (-1, -1, -1)]
    {
        let [a, b, c] = [Vec3::X * x as f32, Vec3::Y * y as f32, Vec3::Z * z as f32];
        faces.push(if x * y * z > 0 { [a, b, c] } else { [a, c, b] });
    }
    for _ in 0..levels {
        faces = faces
            .into_iter()
            .flat_map(|[a, b, c]| {
                let [ab, bc, ca] = [a + b, b + c, c + a].map(Vec3::normalize);
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let triangles = faces.into_iter().map(|vertices| Triangle { vertices, material }).collect();
    Mesh { triangles, ..Default::default() }
}
