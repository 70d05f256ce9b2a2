//! Strings of bulbs that swing in the wind: across streets, and from a mast in the middle of the market. Each string is
//! one light tree that deforms.

use std::f32::consts::TAU;

use girandole::glam::{Affine3A, Mat3, Vec3, vec3};
use girandole::{Light, LightTree, LightWorld, Policy, TreeKey};

use super::assembly::Assembly;
use super::ground::PAVEMENT;
use super::palette::{Glow, NEON, Palette, SOFT, WARM};
use super::part::Part;
use super::rng::Rng;
use super::roads::{PITCH, Roads};
use super::{Scene, SceneError};

/// Peak radiance of a bulb, nits.
const BULB_NITS: f32 = 320.0;
/// Radius of a bulb, metres.
const BULB_RADIUS: f32 = 0.065;
/// Distance of a bulb's centre below its cable, metres.
const HANG: f32 = 0.12;
/// Height of the posts, metres.
const POST: f32 = 7.6;

/// Meshes that strings share: one for each colour of bulbs, and the cable.
struct Kit {
    bulbs: Vec<(u32, Glow)>,
    cable: u32,
}

impl Kit {
    fn new(assembly: &mut Assembly, palette: &mut Palette, colors: &[Vec3], cable_material: u32) -> Self {
        let bulb = |color: &Vec3| {
            let (mut part, glow) = (Part::default(), palette.glow(*color, BULB_NITS));
            part.ball(Vec3::ZERO, Vec3::splat(BULB_RADIUS), 8, glow.material);
            (assembly.mesh(part.mesh), glow)
        };
        let bulbs = colors.iter().map(bulb).collect();
        // One metre along +Z; objects stretch it.
        let mut part = Part::default();
        part.beam(Vec3::ZERO, Vec3::Z, 0.014, cable_material);
        Self { bulbs, cable: assembly.mesh(part.mesh) }
    }
}

/// A string of bulbs.
struct LightString {
    tree: TreeKey,
    /// Translation of its instance. Lights are relative to it.
    middle: Vec3,
    /// Points of the cable at rest: both ends, and one for each bulb.
    rest: Vec<Vec3>,
    /// A horizontal unit vector across the string.
    across: Vec3,
    /// Of the swing, radians.
    phase: f32,
    /// Of each bulb.
    radiance: Vec<Vec3>,
    /// Object of the first bulb; the other bulbs and the pieces of cable follow it.
    first_object: usize,
}

/// All strings of bulbs.
pub struct Strings(Vec<LightString>);

impl Strings {
    /// Hangs strings across `street_count` streets of a city of `blocks` blocks a side, and over
    /// the market.
    pub fn new(
        assembly: &mut Assembly,
        palette: &mut Palette,
        roads: &Roads,
        blocks: usize,
        street_count: usize,
        seed: u64,
    ) -> Result<Self, SceneError> {
        let mut rng = Rng::new(seed, 0xfe57);
        let cable = palette.matte(0.02, 0.02, 0.02);
        let steel = palette.metal([0.2, 0.21, 0.22], 0.5);
        let warm = Kit::new(assembly, palette, &[WARM, SOFT], cable);
        let colors = [WARM, NEON[5], NEON[2], NEON[3], vec3(0.2, 0.4, 1.0), NEON[0]];
        let mixed = Kit::new(assembly, palette, &colors, cable);
        let mut mast = Part::default();
        mast.column(Vec3::ZERO, POST, [0.1, 0.06], 8, steel);
        let mast = assembly.mesh(mast.mesh);
        let pole = |assembly: &mut Assembly, top: Vec3| {
            assembly.object(mast, Affine3A::from_translation(top - Vec3::Y * POST));
        };
        // Streets along Z, from a crossing to the next: the first is the avenue in front of the
        // camera.
        let home = blocks as u32 / 2 - 1;
        let mut streets = vec![(home, home)];
        while streets.len() < street_count {
            let street = (rng.below(roads.side as usize) as u32, rng.below(roads.side as usize - 1) as u32);
            if !streets.contains(&street) {
                streets.push(street);
            }
        }
        let mut strings = Vec::new();
        for ((x, z), step) in streets.into_iter().flat_map(|street| (0..6).map(move |step| (street, step))) {
            let from = roads.position(z * roads.side + x);
            let along = 18.0 + step as f32 * 13.6;
            let ends = [-1.0, 1.0].map(|side| vec3(from.x + side * 7.9, POST + PAVEMENT, from.y + along));
            ends.into_iter().for_each(|end| pole(assembly, end));
            strings.push(LightString::new(assembly, &warm, ends, 22, 1.3, &mut rng)?);
        }
        let market = vec3(PITCH * 0.5, PAVEMENT + POST, -PITCH * 0.5);
        pole(assembly, market);
        for spoke in 0..10 {
            let (sin, cos) = (spoke as f32 / 10.0 * TAU).sin_cos();
            let end = market + vec3(cos * 33.0, -1.8, sin * 33.0);
            pole(assembly, end);
            strings.push(LightString::new(assembly, &mixed, [market, end], 34, 2.2, &mut rng)?);
        }
        Ok(Self(strings))
    }

    /// Moves the strings to where they are at a time, in seconds.
    pub fn swing(&self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        self.0.iter().try_for_each(|string| string.swing(time as f32, scene, world))
    }
}

impl LightString {
    /// Hangs `bulbs` bulbs between two points. The cable sags by `sag` metres in the middle.
    fn new(
        assembly: &mut Assembly,
        kit: &Kit,
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
        let bulbs: Vec<(u32, Glow)> = (0..bulbs).map(|_| rng.pick(&kit.bulbs)).collect();
        let first_object = assembly.scene.objects.len();
        for mesh in bulbs.iter().map(|(mesh, _)| *mesh).chain(vec![kit.cable; bulbs.len() + 1]) {
            assembly.object(mesh, Affine3A::IDENTITY);
        }
        let radiance: Vec<Vec3> = bulbs.iter().map(|(_, glow)| glow.radiance).collect();
        let light = |(at, radiance): (&Vec3, &Vec3)| Light::sphere(*at - middle, BULB_RADIUS, *radiance);
        let lights = rest[1..].iter().zip(&radiance).map(light).collect();
        let tree = assembly.world.add_tree(LightTree::new(lights)?);
        assembly.world.add_instance(tree, Affine3A::from_translation(middle), Policy::Budgeted)?;
        let phase = rng.range(0.0, TAU);
        let string = Self { tree, middle, rest, across, phase, radiance, first_object };
        string.swing(0.0, &mut assembly.scene, &mut assembly.world)?;
        Ok(string)
    }

    /// Moves bulbs, cable and lights to where they are at a time, in seconds.
    fn swing(&self, time: f32, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        let last = self.rest.len() - 1;
        let moved = |i: usize| {
            let t = i as f32 / last as f32;
            let slack = 4.0 * t * (1.0 - t);
            let wave = (time * 1.7 + self.phase + t * 2.5).sin() + 0.4 * (time * 4.1 + self.phase - t * 7.0).sin();
            let side = 0.32 * slack * wave;
            self.rest[i] + self.across * side + Vec3::Y * (0.25 * side * side)
        };
        let points: Vec<Vec3> = (0..=last).map(moved).collect();
        let objects = &mut scene.objects[self.first_object..];
        let mut changes = Vec::with_capacity(self.radiance.len());
        for (i, &radiance) in self.radiance.iter().enumerate() {
            let bulb = points[i + 1] - Vec3::Y * HANG;
            objects[i].transform = Affine3A::from_translation(bulb);
            changes.push((i as u32, Light::sphere(bulb - self.middle, BULB_RADIUS, radiance)));
        }
        for (object, pair) in objects[self.radiance.len()..].iter_mut().zip(points.windows(2)) {
            let along = pair[1] - pair[0];
            let (x, y) = along.normalize_or(Vec3::Z).any_orthonormal_pair();
            object.transform = Affine3A::from_mat3_translation(Mat3::from_cols(x, y, along), pair[0]);
        }
        Ok(world.set_lights(self.tree, &changes)?)
    }
}
