//! A swarm of drones that forms a turning wheel in the sky and folds into a globe. It is one light
//! tree that deforms in every frame.

use std::f32::consts::TAU;

use girandole::glam::{Affine3A, Vec3, vec3};
use girandole::{Light, LightTree, LightWorld, Policy, TreeKey};

use super::assembly::Assembly;
use super::palette::{Glow, Palette};
use super::part::Part;
use super::{Scene, SceneError};

/// Arms of the wheel.
const ARMS: usize = 7;
/// Colours along an arm.
const COLORS: usize = 16;
/// Peak radiance of a drone's lamp, nits.
const NITS: f32 = 170.0;

/// All drones.
pub struct Swarm {
    tree: TreeKey,
    center: Vec3,
    /// Of the wheel, metres.
    radius: f32,
    /// Of a drone's lamp, metres.
    drone_radius: f32,
    /// Of each drone.
    radiance: Vec<Vec3>,
    /// Object of the first drone; the others follow it.
    first_object: usize,
}

/// A saturated colour; `turn` is its hue in turns.
fn hue(turn: f32) -> Vec3 {
    let channel = |shift: f32| 0.5 + 0.5 * ((turn + shift) * TAU).cos();
    vec3(channel(0.0), channel(-0.33), channel(0.33)).powf(1.6) + Vec3::splat(0.02)
}

/// The emissive materials of the swarm, in the order of the colours along an arm.
pub fn glows(palette: &mut Palette) -> Vec<Glow> {
    let color = |i: usize| hue(0.92 + 0.62 * i as f32 / COLORS as f32);
    (0..COLORS).map(|i| palette.glow(color(i), NITS)).collect()
}

impl Swarm {
    /// Adds `count` drones around `center`.
    pub fn new(
        assembly: &mut Assembly,
        glows: &[Glow],
        center: Vec3,
        radius: f32,
        count: usize,
    ) -> Result<Self, SceneError> {
        // The lamps cover about the same share of the wheel whatever their number.
        let drone_radius = (radius * 0.2 / (count.max(1) as f32).sqrt()).clamp(0.05, 0.4);
        let mesh = |glow: &Glow| {
            let mut part = Part::default();
            part.ball(Vec3::ZERO, Vec3::splat(drone_radius), 8, glow.material);
            assembly.mesh(part.mesh)
        };
        let meshes: Vec<u32> = glows.iter().map(mesh).collect();
        let color = |i: usize| (i / ARMS * glows.len() / count.div_ceil(ARMS)).min(glows.len() - 1);
        let first_object = assembly.scene.objects.len();
        (0..count).for_each(|i| {
            assembly.object(meshes[color(i)], Affine3A::IDENTITY);
        });
        let radiance: Vec<Vec3> = (0..count).map(|i| glows[color(i)].radiance).collect();
        let lights = radiance.iter().map(|&radiance| Light::sphere(Vec3::ZERO, drone_radius, radiance)).collect();
        let tree = assembly.world.add_tree(LightTree::new(lights)?);
        assembly.world.add_instance(tree, Affine3A::from_translation(center), Policy::Budgeted)?;
        let mut swarm = Self { tree, center, radius, drone_radius, radiance, first_object };
        swarm.fly(0.0, &mut assembly.scene, &mut assembly.world)?;
        Ok(swarm)
    }

    /// Position of a drone relative to the centre.
    fn position(&self, drone: usize, time: f32) -> Vec3 {
        let (arm, step) = (drone % ARMS, drone / ARMS);
        let along = (step as f32 + 0.5) / self.radiance.len().div_ceil(ARMS) as f32;
        // The wheel: curved arms that open and close, with a wave across the plane of the wheel.
        let radius = self.radius * along.sqrt();
        let angle = arm as f32 / ARMS as f32 * TAU + 1.5 * along + 0.3 * time;
        let spread = 0.16 * (time * 0.8 + along * 9.0).sin();
        let wheel = vec3(
            radius * (angle + spread).cos(),
            radius * (angle + spread).sin(),
            self.radius * 0.12 * (2.0 * angle + time).sin(),
        );
        // The globe: a Fibonacci sphere that turns about the vertical axis.
        let height = 1.0 - 2.0 * (drone as f32 + 0.5) / self.radiance.len() as f32;
        let ring = (1.0 - height * height).sqrt();
        let turn = drone as f32 * 2.399_963 + 0.4 * time;
        let globe = vec3(ring * turn.cos(), height, ring * turn.sin()) * self.radius * 0.8;
        let fold = (0.5 - 0.5 * (time * TAU / 40.0).cos()).powi(2);
        let fold = fold * fold * (3.0 - 2.0 * fold);
        let drift = vec3(3.0 * (0.21 * time).sin(), 2.0 * (0.33 * time).sin(), 3.0 * (0.17 * time).cos());
        wheel.lerp(globe, fold) + drift
    }

    /// Moves drones and lights to where they are at a time, in seconds.
    pub fn fly(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        let mut changes = Vec::with_capacity(self.radiance.len());
        for (drone, &radiance) in self.radiance.iter().enumerate() {
            let position = self.position(drone, time as f32);
            scene.objects[self.first_object + drone].transform = Affine3A::from_translation(self.center + position);
            changes.push((drone as u32, Light::sphere(position, self.drone_radius, radiance)));
        }
        world.set_lights(self.tree, &changes)?;
        Ok(())
    }
}
