//! Lamps that vehicles carry.

use girandole::Light;
use girandole::glam::{Vec3, vec3};

use super::palette::{Glow, Palette};
use super::part::Part;

/// Peak intensity of each headlight of a car, candela.
pub const HEADLIGHT: f32 = 5_000.0;
/// Colours of lamps.
const WHITE: Vec3 = vec3(1.0, 0.95, 0.86);
const RED: Vec3 = vec3(1.0, 0.03, 0.015);
const BLUE: Vec3 = vec3(0.04, 0.16, 1.0);

/// A red lamp at the back, such as that of a car.
pub fn red(palette: &mut Palette) -> Glow {
    palette.glow(RED, 90.0)
}

/// The lens of a headlight.
pub fn lens(palette: &mut Palette) -> Glow {
    palette.glow(WHITE, 900.0)
}

/// A headlight that faces -Z. `lens` is the middle of its lens, `half` half the width and half the
/// height of the lens, and `beam` the direction of the light.
///
/// The lens is visible but is no light; a spot just in front of it lights the road.
pub fn headlight(part: &mut Part, lens: Vec3, half: [f32; 2], beam: Vec3, candela: f32, palette: &mut Palette) {
    let white = self::lens(palette);
    let [x, y] = half;
    let corners = [vec3(x, -y, 0.0), vec3(-x, -y, 0.0), vec3(-x, y, 0.0), vec3(x, y, 0.0)];
    part.quad(corners.map(|corner| lens + corner), white.material);
    let color = white.radiance / white.radiance.max_element();
    let spot = Light::spot(lens + vec3(0.0, 0.0, -0.06), beam.normalize(), 0.06, 0.5, color * candela);
    part.lights.push(spot.with_range(60.0));
}

/// A bar of blue beacons on a roof: its middle at the bottom, half its length across the vehicle.
pub fn beacons(part: &mut Part, at: Vec3, half: f32, palette: &mut Palette) {
    let board = palette.matte(0.05, 0.05, 0.05);
    let blue = palette.glow(BLUE, 1_500.0);
    part.cuboid(at - vec3(half, 0.0, 0.12), at + vec3(half, 0.14, 0.12), board);
    for side in [-1.0, 1.0] {
        let middle = at + vec3(side * half * 0.65, 0.075, 0.0);
        for (out, right) in [(Vec3::Z, Vec3::X), (Vec3::NEG_Z, Vec3::NEG_X)] {
            part.glow(middle + out * 0.13, right * half * 0.33, Vec3::Y * 0.05, blue);
        }
    }
}

/// A row of lit windows on both sides. `z` holds the middles of the first window and of the last,
/// `half` half the length and half the height of a window, `x` the distance from the middle of the
/// vehicle, and `y` the height of the middle.
pub fn lit_windows(part: &mut Part, z: [f32; 2], count: usize, half: [f32; 2], [x, y]: [f32; 2], glow: Glow) {
    for (side, right) in [(1.0, Vec3::NEG_Z), (-1.0, Vec3::Z)] {
        for window in 0..count {
            let share = if count > 1 { window as f32 / (count - 1) as f32 } else { 0.5 };
            let at = vec3(side * x, y, z[0] + (z[1] - z[0]) * share);
            part.glow(at, right * half[0], Vec3::Y * half[1], glow);
        }
    }
}
