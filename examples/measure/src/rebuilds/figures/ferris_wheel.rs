//! A ferris wheel: rims and spokes that turn together, and gondolas that stay upright.

use super::figure::{Figure, size};
use girandole::glam::{Vec3, vec3};
use std::f32::consts::TAU;
use testbed::scene::rng::Rng;

/// Lamps per gondola.
const GONDOLA: usize = 8;
/// The distance between the two rims, in metres.
const WIDTH: f32 = 2.4;

/// The lamps of both rims, of the spokes, and of the gondolas between the rims.
pub struct FerrisWheel {
    rim: usize,
    spokes: usize,
    gondolas: usize,
    radius: f32,
    /// Radians per second.
    speed: f32,
}

impl FerrisWheel {
    /// A wheel of random size and speed.
    pub fn new(rng: &mut Rng) -> Self {
        let rim = size(rng, 60.0, 300.0);
        let (spokes, gondolas) = (rim / 2, 6 + rng.below(15));
        Self { rim, spokes, gondolas, radius: rng.range(7.0, 18.0), speed: rng.range(0.1, 0.6) }
    }
}

impl Figure for FerrisWheel {
    fn count(&self) -> usize {
        self.rim + self.spokes + self.gondolas * GONDOLA
    }

    fn place(&self, light: usize, time: f32) -> Vec3 {
        let turn = self.speed * time;
        let side = (light % 2) as f32 * WIDTH - 0.5 * WIDTH;
        let at = |share: f32, radius: f32| ((share * TAU + turn).cos() * radius, (share * TAU + turn).sin() * radius);
        if light < self.rim {
            let (x, y) = at((light / 2) as f32 / (self.rim as f32 * 0.5), self.radius);
            return vec3(x, y, side);
        }
        let light = light - self.rim;
        if light < self.spokes {
            let step = light / 12;
            let (x, y) =
                at(step as f32 / (self.spokes as f32 / 12.0).ceil(), self.radius * (light % 12 + 1) as f32 / 13.0);
            return vec3(x, y, side);
        }
        let light = light - self.spokes;
        let (gondola, lamp) = (light / GONDOLA, light % GONDOLA);
        let (x, y) = at(gondola as f32 / self.gondolas as f32, self.radius);
        let corner = |bit: usize| (lamp >> bit & 1) as f32 - 0.5;
        vec3(x + 1.4 * corner(0), y - 1.0 + 1.2 * corner(1), 1.4 * corner(2))
    }
}
