//! Where strings of bulbs hang: across streets, and from a mast in the middle of the market.

use girandole::LightWorld;
use girandole::glam::{Affine3A, Vec3, vec3};

use super::assembly::Assembly;
use super::ground::PAVEMENT;
use super::light_string::{LightString, StringKit};
use super::palette::{NEON, Palette, SOFT, WARM};
use super::part::Part;
use super::rng::Rng;
use super::roads::{PITCH, Roads};
use super::{Scene, SceneError};

/// Peak radiance of a bulb, nits.
const BULB_NITS: f32 = 320.0;

/// All strings of bulbs.
pub struct Festoons {
    warm: StringKit,
    mixed: StringKit,
    over_streets: Vec<LightString>,
    over_market: Vec<LightString>,
}

impl Festoons {
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
        let warm = StringKit::new(assembly, &[palette.glow(WARM, BULB_NITS), palette.glow(SOFT, BULB_NITS)], cable);
        let colors = [WARM, NEON[5], NEON[2], NEON[3], vec3(0.2, 0.4, 1.0), NEON[0]];
        let mixed = StringKit::new(assembly, &colors.map(|color| palette.glow(color, BULB_NITS)), cable);
        let mut mast = Part::default();
        mast.column(Vec3::ZERO, 7.6, [0.1, 0.06], 8, steel);
        let mast = assembly.mesh(mast.mesh);
        let pole = |assembly: &mut Assembly, at: Vec3| {
            assembly.object(mast, Affine3A::from_translation(at - Vec3::Y * 7.6));
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
        let mut over_streets = Vec::new();
        for (x, z) in streets {
            let from = roads.position(z * roads.side + x);
            let post = |side: f32, step: usize| {
                let along = 18.0 + step as f32 * 13.6;
                vec3(from.x + side * 7.9, 7.6 + PAVEMENT, from.y + along)
            };
            for step in 0..6 {
                [-1.0, 1.0].into_iter().for_each(|side| pole(assembly, post(side, step)));
                let ends = [post(-1.0, step), post(1.0, step)];
                over_streets.push(LightString::new(assembly, &warm, ends, 22, 1.3, &mut rng)?);
            }
        }
        let mut over_market = Vec::new();
        let market = vec3(PITCH * 0.5, PAVEMENT + 7.6, -PITCH * 0.5);
        pole(assembly, market);
        for spoke in 0..10 {
            let (sin, cos) = (spoke as f32 / 10.0 * std::f32::consts::TAU).sin_cos();
            let end = market + vec3(cos * 33.0, -1.8, sin * 33.0);
            pole(assembly, end);
            over_market.push(LightString::new(assembly, &mixed, [market, end], 34, 2.2, &mut rng)?);
        }
        Ok(Self { warm, mixed, over_streets, over_market })
    }

    /// Moves the strings to where they are at a time, in seconds.
    pub fn swing(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        for string in &mut self.over_streets {
            string.swing(&self.warm, time, scene, world)?;
        }
        for string in &mut self.over_market {
            string.swing(&self.mixed, time, scene, world)?;
        }
        Ok(())
    }
}
