//! Street furniture: lamps, traffic lights, trees, benches and market stalls.

use girandole::Light;
use girandole::glam::{Quat, Vec3, vec3};

use super::palette::{COOL, NEUTRAL, Palette, SODIUM, SOFT};
use super::part::Part;
use super::rng::Rng;

/// Height of a street lamp's light above the pavement, metres.
pub const LAMP_HEIGHT: f32 = 8.2;

/// Kinds of lamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lamp {
    /// A sodium lamp on an arm over the road.
    Sodium,
    /// White LEDs on an arm over the road.
    Led,
    /// A globe on a post, for squares and parks.
    Globe,
}

/// A lamp that emits `lumens` at a height of `height` metres. Its post stands on the origin and its
/// arm points along +Z.
pub fn lamp(kind: Lamp, height: f32, lumens: f32, palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let steel = palette.metal([0.2, 0.21, 0.22], 0.5);
    let color = match kind {
        Lamp::Sodium => SODIUM,
        Lamp::Led => NEUTRAL.lerp(COOL, 0.4),
        Lamp::Globe => SOFT,
    };
    let luminance = color.dot(vec3(0.2126, 0.7152, 0.0722)) / color.max_element();
    let nits = |area: f32| lumens / (std::f32::consts::PI * area * luminance);
    part.column(Vec3::ZERO, 0.9, [0.16, 0.13], 8, steel);
    if kind == Lamp::Globe {
        let radius = 0.22;
        part.column(Vec3::Y * 0.9, height - radius - 0.95, [0.07, 0.05], 8, steel);
        part.column(Vec3::Y * (height - radius - 0.1), 0.08, [0.12, 0.16], 8, steel);
        let area = 4.0 * std::f32::consts::PI * radius * radius;
        part.bulb(Vec3::Y * height, radius, 12, palette.glow(color, nits(area)));
        return part;
    }
    let reach = (height * 0.24).clamp(0.6, 2.2);
    part.column(Vec3::Y * 0.9, height - 0.9, [0.09, 0.055], 8, steel);
    part.beam(vec3(0.0, height - 0.3, 0.0), vec3(0.0, height + 0.16, reach), 0.04, steel);
    let (half_x, half_z) = (0.16, 0.38);
    let head = vec3(0.0, height + 0.12, reach + 0.25);
    part.cuboid(
        head - vec3(half_x + 0.04, 0.11, half_z + 0.05),
        head + vec3(half_x + 0.04, 0.09, half_z + 0.05),
        steel,
    );
    // The light lies just below its housing and faces down.
    let glow = palette.glow(color, nits(4.0 * half_x * half_z));
    part.glow(vec3(0.0, height, head.z), Vec3::X * half_x, Vec3::Z * half_z, glow);
    if let Some(profile) = palette.lamp_profile {
        // C0 is along the road, and C270 over it.
        let down = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2);
        let factor = color / color.dot(vec3(0.2126, 0.7152, 0.0722)) * (lumens / profile.flux().max(1.0e-6));
        part.lights = vec![Light::profile(vec3(0.0, height - 0.02, head.z), down, profile, factor)];
    }
    part
}

/// Height of the middle lens of a traffic light, metres.
const SIGNAL_HEIGHT: f32 = 4.1;
/// Offsets of the red, amber and green lens from the middle one, metres.
const LENS_OFFSETS: [f32; 3] = [0.36, 0.0, -0.36];

/// Pole and housing of a traffic light that faces +Z. The pole stands on the origin.
pub fn signal_body(palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let steel = palette.metal([0.2, 0.21, 0.22], 0.5);
    let dark = palette.matte(0.02, 0.022, 0.02);
    part.column(Vec3::ZERO, SIGNAL_HEIGHT + 0.6, [0.08, 0.06], 8, steel);
    part.cuboid(vec3(-0.2, SIGNAL_HEIGHT - 0.58, 0.08), vec3(0.2, SIGNAL_HEIGHT + 0.58, 0.3), dark);
    for offset in LENS_OFFSETS {
        let y = SIGNAL_HEIGHT + offset + 0.17;
        part.cuboid(vec3(-0.16, y, 0.3), vec3(0.16, y + 0.02, 0.5), dark);
    }
    part
}

/// The red, amber or green lens of a traffic light, for an `index` of 0, 1 or 2.
pub fn signal_lens(index: usize, palette: &mut Palette) -> Part {
    let color = [vec3(1.0, 0.04, 0.02), vec3(1.0, 0.45, 0.02), vec3(0.03, 1.0, 0.45)][index];
    let glow = palette.glow(color, 130.0);
    let mut part = Part::default();
    part.bulb(vec3(0.0, SIGNAL_HEIGHT + LENS_OFFSETS[index], 0.33), 0.13, 10, glow);
    part
}

/// A street tree, 5 to 8 m high.
pub fn tree(palette: &mut Palette, rng: &mut Rng) -> Part {
    let mut part = Part::default();
    let bark = palette.matte(0.09, 0.06, 0.04);
    let leaves = [palette.matte(0.05, 0.11, 0.03), palette.matte(0.07, 0.13, 0.04), palette.matte(0.04, 0.09, 0.035)];
    let height = rng.range(2.2, 3.0);
    part.column(Vec3::ZERO, height + 0.6, [0.17, 0.1], 7, bark);
    // Leaves are small triangles near the surfaces of a few balls, so that light falls through the
    // crown.
    for _ in 0..5 {
        let center = vec3(rng.range(-0.9, 0.9), height + rng.range(0.4, 2.6), rng.range(-0.9, 0.9));
        let radius = rng.range(0.9, 1.5);
        for _ in 0..110 {
            let mut point = || vec3(rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), rng.range(-1.0, 1.0));
            let direction = point().normalize_or(Vec3::Y);
            let (u, v) = (point().normalize_or(Vec3::X) * 0.26, point().normalize_or(Vec3::Z) * 0.26);
            let at = center + direction * radius * rng.range(0.75, 1.0);
            part.triangle([at, at + u, at + v], rng.pick(&leaves));
        }
    }
    part
}

/// A bench that faces +Z.
pub fn bench(palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let wood = palette.matte(0.25, 0.14, 0.07);
    let iron = palette.metal([0.15, 0.15, 0.15], 0.5);
    for z in [-0.2, 0.0, 0.2] {
        part.cuboid(vec3(-0.9, 0.42, z - 0.08), vec3(0.9, 0.46, z + 0.08), wood);
    }
    for y in [0.62, 0.8] {
        part.cuboid(vec3(-0.9, y, -0.34), vec3(0.9, y + 0.12, -0.3), wood);
    }
    for x in [-0.75, 0.75] {
        part.cuboid(vec3(x - 0.03, 0.0, -0.3), vec3(x + 0.03, 0.42, 0.25), iron);
        part.cuboid(vec3(x - 0.03, 0.42, -0.36), vec3(x + 0.03, 0.95, -0.33), iron);
    }
    part
}

/// A market stall, open towards +Z, with a lamp under its roof and goods on its table.
pub fn stall(palette: &mut Palette, rng: &mut Rng) -> Part {
    let mut part = Part::default();
    let wood = palette.matte(0.28, 0.17, 0.09);
    let cloth = rng.pick(&[[0.5, 0.07, 0.05], [0.55, 0.45, 0.12], [0.08, 0.25, 0.3], [0.5, 0.48, 0.42]]);
    let cloth = palette.matte(cloth[0], cloth[1], cloth[2]);
    for (x, z) in [(-1.5, -1.0), (1.5, -1.0), (-1.5, 1.0), (1.5, 1.0)] {
        part.beam(vec3(x, 0.0, z), vec3(x, 2.5, z), 0.04, wood);
    }
    let (eaves, ridge) = (2.4, 3.1);
    for side in [1.0, -1.0] {
        let [a, b] = [vec3(-1.8 * side, eaves, 1.4 * side), vec3(1.8 * side, eaves, 1.4 * side)];
        let [c, d] = [vec3(1.8 * side, ridge, 0.0), vec3(-1.8 * side, ridge, 0.0)];
        part.quad([a, b, c, d], cloth);
    }
    part.cuboid(vec3(-1.5, 0.75, 0.1), vec3(1.5, 0.85, 1.0), wood);
    part.cuboid(vec3(-1.5, 0.0, 0.9), vec3(1.5, 0.75, 0.96), cloth);
    for item in 0..6 {
        let color = [[0.6, 0.1, 0.05], [0.6, 0.35, 0.05], [0.15, 0.4, 0.08], [0.5, 0.45, 0.3]][rng.below(4)];
        let goods = palette.matte(color[0], color[1], color[2]);
        let x = -1.3 + item as f32 * 0.47;
        part.cuboid(vec3(x, 0.85, 0.2), vec3(x + 0.36, 0.85 + rng.range(0.12, 0.3), 0.85), goods);
    }
    part.bulb(vec3(0.0, 2.35, 0.2), 0.09, 8, palette.glow(SOFT, 5200.0));
    part
}
