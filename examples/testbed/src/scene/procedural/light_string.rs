//! A string of bulbs between two points that swings in the wind. Each string is one light tree that
//! deforms.

use girandole::glam::{Affine3A, Mat3, Vec3};
use girandole::{Light, LightTree, LightWorld, Policy, TreeKey};

use super::assembly::Assembly;
use super::palette::Glow;
use super::part::Part;
use super::rng::Rng;
use super::{Scene, SceneError};

/// Radius of a bulb, metres.
pub const BULB_RADIUS: f32 = 0.065;
/// Distance of a bulb's centre below its cable, metres.
const HANG: f32 = 0.12;

/// Meshes that strings share: one for each colour of bulbs, and the cable.
pub struct StringKit {
    bulbs: Vec<(u32, Glow)>,
    cable: u32,
}

impl StringKit {
    /// Adds the shared meshes.
    pub fn new(assembly: &mut Assembly, glows: &[Glow], cable_material: u32) -> Self {
        let bulb = |glow: &Glow| {
            let mut part = Part::default();
            part.ball(Vec3::ZERO, Vec3::splat(BULB_RADIUS), 8, glow.material);
            (assembly.mesh(part.mesh), *glow)
        };
        let bulbs = glows.iter().map(bulb).collect();
        // One metre along +Z; objects stretch it.
        let mut part = Part::default();
        part.beam(Vec3::ZERO, Vec3::Z, 0.014, cable_material);
        Self { bulbs, cable: assembly.mesh(part.mesh) }
    }
}

/// A string of bulbs.
pub struct LightString {
    tree: TreeKey,
    /// Translation of its instance. Lights are relative to it.
    middle: Vec3,
    /// Points of the cable at rest: both ends, and one for each bulb.
    rest: Vec<Vec3>,
    /// A horizontal unit vector across the string.
    across: Vec3,
    /// Of the swing, radians.
    phase: f32,
    /// Colour of each bulb: index into the kit's bulbs.
    colors: Vec<usize>,
    /// Object of the first bulb; the others follow it.
    first_bulb: usize,
    /// Object of the first piece of cable; the others follow it.
    first_cable: usize,
}

impl LightString {
    /// Hangs `bulbs` bulbs between two points. The cable sags by `sag` metres in the middle.
    pub fn new(
        assembly: &mut Assembly,
        kit: &StringKit,
        ends: [Vec3; 2],
        bulbs: usize,
        sag: f32,
        rng: &mut Rng,
    ) -> Result<Self, SceneError> {
        let point = |i: usize| {
            let t = i as f32 / (bulbs + 1) as f32;
            ends[0].lerp(ends[1], t) - Vec3::Y * (sag * 4.0 * t * (1.0 - t))
        };
        let rest: Vec<Vec3> = (0..bulbs + 2).map(point).collect();
        let middle = (ends[0] + ends[1]) * 0.5;
        let across = (ends[1] - ends[0]).cross(Vec3::Y).normalize_or(Vec3::X);
        let colors: Vec<usize> = (0..bulbs).map(|_| rng.below(kit.bulbs.len())).collect();
        let place = |assembly: &mut Assembly, color: &usize| assembly.object(kit.bulbs[*color].0, Affine3A::IDENTITY);
        let first_bulb = assembly.scene.objects.len();
        colors.iter().for_each(|color| {
            place(assembly, color);
        });
        let first_cable = assembly.scene.objects.len();
        (0..bulbs + 1).for_each(|_| {
            assembly.object(kit.cable, Affine3A::IDENTITY);
        });
        let glow = |i: usize| kit.bulbs[colors[i]].1.radiance;
        let lights = (0..bulbs).map(|i| Light::sphere(rest[i + 1] - middle, BULB_RADIUS, glow(i))).collect();
        let tree = assembly.world.add_tree(LightTree::new(lights)?);
        assembly.world.add_instance(tree, Affine3A::from_translation(middle), Policy::Budgeted)?;
        let phase = rng.range(0.0, std::f32::consts::TAU);
        let mut string = Self { tree, middle, rest, across, phase, colors, first_bulb, first_cable };
        string.swing(kit, 0.0, &mut assembly.scene, &mut assembly.world)?;
        Ok(string)
    }

    /// Moves bulbs, cable and lights to where they are at a time, in seconds.
    pub fn swing(
        &mut self,
        kit: &StringKit,
        time: f64,
        scene: &mut Scene,
        world: &mut LightWorld,
    ) -> Result<(), SceneError> {
        let last = self.rest.len() - 1;
        let moved = |i: usize| {
            let (t, time) = (i as f32 / last as f32, time as f32);
            let slack = 4.0 * t * (1.0 - t);
            let wave = (time * 1.7 + self.phase + t * 2.5).sin() + 0.4 * (time * 4.1 + self.phase - t * 7.0).sin();
            let side = 0.32 * slack * wave;
            self.rest[i] + self.across * side + Vec3::Y * (0.25 * side * side)
        };
        let points: Vec<Vec3> = (0..=last).map(moved).collect();
        let mut changes = Vec::with_capacity(self.colors.len());
        for (i, &color) in self.colors.iter().enumerate() {
            let bulb = points[i + 1] - Vec3::Y * HANG;
            scene.objects[self.first_bulb + i].transform = Affine3A::from_translation(bulb);
            changes.push((i as u32, Light::sphere(bulb - self.middle, BULB_RADIUS, kit.bulbs[color].1.radiance)));
        }
        for (i, pair) in points.windows(2).enumerate() {
            let along = pair[1] - pair[0];
            let (x, y) = along.normalize_or(Vec3::Z).any_orthonormal_pair();
            scene.objects[self.first_cable + i].transform =
                Affine3A::from_mat3_translation(Mat3::from_cols(x, y, along), pair[0]);
        }
        world.set_lights(self.tree, &changes)?;
        Ok(())
    }
}
