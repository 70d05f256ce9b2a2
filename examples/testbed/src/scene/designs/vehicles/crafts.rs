//! Ships, aircraft and drones with navigation lights: red to the left, green to the right, and
//! white.

use girandole::glam::{Vec3, vec3};

use super::body::Size;
use super::palette::{Glow, NEUTRAL, Palette};
use super::panels::wheel;
use super::part::Part;

/// How far above the ground drones fly, metres.
const HOVER: f32 = 12.0;

/// Lights for the left side, the right side and the top or back.
fn navigation(palette: &mut Palette, nits: f32) -> [Glow; 3] {
    [vec3(1.0, 0.04, 0.02), vec3(0.03, 1.0, 0.3), NEUTRAL].map(|color| palette.glow(color, nits))
}

/// A boat whose keel is cut off at y = 0.
pub fn ship(size: Size, palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let half = vec3(size.width(), size.height(), size.length()) * 0.5;
    let hull = palette.glossy([0.04, 0.06, 0.09], 0.4);
    let deck = palette.matte(0.25, 0.17, 0.1);
    let white = palette.glossy([0.5, 0.5, 0.48], 0.4);
    let board = 0.38 * size.height();
    // The outline of the deck, from the bow along the right side to the left side.
    let outline = [(0.0, -1.0), (0.72, -0.55), (1.0, -0.05), (0.92, 1.0), (-0.92, 1.0), (-1.0, -0.05), (-0.72, -0.55)];
    let at = |(x, z): (f32, f32), y: f32, narrow: f32| vec3(x * half.x * narrow, y, z * half.z * narrow);
    for (index, &point) in outline.iter().enumerate() {
        let next = outline[(index + 1) % outline.len()];
        part.quad([at(next, 0.0, 0.86), at(point, 0.0, 0.86), at(point, board, 1.0), at(next, board, 1.0)], hull);
        part.triangle([at(point, board, 1.0), Vec3::Y * board, at(next, board, 1.0)], deck);
    }
    let top = 0.8 * size.height();
    let (low, high) = (vec3(-0.62 * half.x, board, -0.1 * half.z), vec3(0.62 * half.x, top, 0.7 * half.z));
    part.cuboid(low, high, white);
    let lit = palette.glow(NEUTRAL, 9.0);
    let count = ((high.z - low.z) / 1.5).clamp(1.0, 200.0) as usize;
    let step = (high.z - low.z) / count as f32;
    for window in 0..count {
        let z = low.z + (window as f32 + 0.5) * step;
        let y = 0.5 * (board + top) + 0.06;
        for (side, along) in [(1.0, Vec3::NEG_Z), (-1.0, Vec3::Z)] {
            part.glow(vec3(side * (high.x + 0.01), y, z), along * step * 0.3, Vec3::Y * 0.16 * (top - board), lit);
        }
    }
    part.beam(vec3(0.0, top, 0.1 * half.z), vec3(0.0, size.height(), 0.1 * half.z), 0.05, white);
    let [red, green, mast] = navigation(palette, 900.0);
    part.bulb(vec3(0.0, size.height() + 0.05, 0.1 * half.z), 0.07, 8, mast);
    part.bulb(vec3(-0.7 * half.x, top, -0.1 * half.z), 0.07, 8, red);
    part.bulb(vec3(0.7 * half.x, top, -0.1 * half.z), 0.07, 8, green);
    part.bulb(vec3(0.0, board + 0.3, half.z), 0.06, 8, mast);
    part
}

/// An airliner on its wheels.
pub fn aircraft(size: Size, palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let half = vec3(size.width(), size.height(), size.length()) * 0.5;
    let skin = palette.glossy([0.6, 0.6, 0.62], 0.35);
    let metal = palette.metal([0.5, 0.5, 0.52], 0.4);
    let rubber = palette.matte(0.02, 0.02, 0.02);
    let radius = 0.055 * size.length();
    let middle = 1.7 * radius;
    part.ball(Vec3::Y * middle, vec3(radius, radius, half.z), 24, skin);
    // Each wing is a box that is sheared back.
    let plate = |part: &mut Part, root: Vec3, tip: Vec3, chord: f32, thick: f32| {
        let along = (tip - root) * 0.5;
        let up = if along.x.abs() > along.y.abs() { Vec3::Y } else { Vec3::X };
        let (u, v) = (along, up * thick);
        let w = Vec3::Z * chord * 0.5;
        let is_right_handed = u.cross(v).dot(w) > 0.0;
        part.oriented_box((root + tip) * 0.5, u, v, if is_right_handed { w } else { -w }, skin);
    };
    let [red, green, white] = navigation(palette, 2_500.0);
    for (side, light) in [(-1.0, red), (1.0, green)] {
        let (root, tip) =
            (vec3(side * 0.4 * radius, middle - 0.4 * radius, 0.0), vec3(side * half.x, middle, 0.3 * half.z));
        plate(&mut part, root, tip, 0.22 * half.z, 0.012 * half.z);
        part.bulb(tip + vec3(side * 0.08, 0.0, -0.11 * half.z), 0.1, 8, light);
        let tail = vec3(side * 0.33 * half.x, middle + 0.3 * radius, 0.95 * half.z);
        plate(
            &mut part,
            vec3(side * 0.2 * radius, middle + 0.2 * radius, 0.85 * half.z),
            tail,
            0.12 * half.z,
            0.008 * half.z,
        );
        let engine = vec3(side * 0.33 * half.x, middle - 1.0 * radius, 0.02 * half.z);
        part.ball(engine, vec3(0.45, 0.45, 1.3) * radius, 12, metal);
        let gear = vec3(side * 0.18 * half.x, 0.25 * radius, 0.1 * half.z);
        part.beam(gear, vec3(gear.x, middle, gear.z), 0.08 * radius, metal);
        wheel(&mut part, gear, side * 0.15 * radius, 0.25 * radius, [rubber, metal]);
    }
    plate(
        &mut part,
        vec3(0.0, middle, 0.82 * half.z),
        vec3(0.0, size.height(), 0.98 * half.z),
        0.16 * half.z,
        0.01 * half.z,
    );
    part.bulb(vec3(0.0, middle, half.z), 0.1, 8, white);
    let nose = vec3(0.0, 0.2 * radius, -0.72 * half.z);
    part.beam(nose, vec3(0.0, middle, nose.z), 0.07 * radius, metal);
    wheel(&mut part, nose, 0.12 * radius, 0.2 * radius, [rubber, metal]);
    let lit = palette.glow(NEUTRAL, 6.0);
    let count = (size.length() / 1.6).clamp(1.0, 400.0) as usize;
    for window in 0..count {
        let share = 1.2 * (window as f32 + 0.5) / count as f32 - 0.6;
        // The distance of the hull from the middle at this length and height.
        let x = radius * (1.0 - share * share - 0.04).max(0.0).sqrt() + 0.015;
        for (side, along) in [(1.0, Vec3::NEG_Z), (-1.0, Vec3::Z)] {
            let at = vec3(side * x, middle + 0.2 * radius, share * half.z);
            part.glow(at, along * 0.006 * size.length(), Vec3::Y * 0.08 * radius, lit);
        }
    }
    part
}

/// A drone of four rotors that flies [`HOVER`] metres above the ground.
pub fn drone(size: Size, palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let half = vec3(size.width(), size.height(), size.length()) * 0.5;
    let middle = Vec3::Y * (HOVER + half.y);
    let dark = palette.glossy([0.06, 0.06, 0.065], 0.4);
    let rotor = palette.matte(0.12, 0.12, 0.12);
    part.cuboid(middle - half * vec3(0.35, 0.5, 0.45), middle + half * vec3(0.35, 0.5, 0.45), dark);
    let [red, green, white] = navigation(palette, 2_500.0);
    for (x, z) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let tip = middle + vec3(0.7 * x, 0.2, 0.7 * z) * half;
        part.beam(middle, tip, 0.08 * half.y, dark);
        part.column(tip, 0.15 * half.y, [0.28 * half.x; 2], 10, rotor);
        let radius = 0.18 * half.y;
        part.bulb(tip - Vec3::Y * (0.1 * half.y + radius), radius, 6, if x < 0.0 { red } else { green });
    }
    part.bulb(middle - Vec3::Y * 0.75 * half.y, 0.2 * half.y, 6, white);
    part
}
