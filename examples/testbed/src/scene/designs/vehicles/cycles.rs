//! Bicycles and motorcycles with their riders.

use girandole::glam::{Vec3, vec3};

use super::body::{Body, Size};
use super::lamps;
use super::palette::Palette;
use super::panels::{ring, wheel};
use super::part::Part;
use super::people::{clothes, rider};

/// Peak intensity of the front light of a bicycle, candela.
const BICYCLE_LIGHT: f32 = 300.0;
/// Peak intensity of the headlight of a motorcycle, candela.
const MOTORCYCLE_LIGHT: f32 = 4_000.0;

/// Maps positions in a vehicle of the usual size to one of another size.
fn scaled(body: Body, size: Size) -> Vec3 {
    let usual = body.size();
    vec3(size.width() / usual.width(), size.height() / usual.height(), size.length() / usual.length())
}

/// A bicycle with a small white light in front and a red one at the back.
pub fn bicycle(size: Size, coat: [f32; 3], palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let scale = scaled(Body::Bicycle, size);
    let at = |x: f32, y: f32, z: f32| vec3(x, y, z) * scale;
    let frame = palette.glossy([0.08, 0.2, 0.12], 0.35);
    let rubber = palette.matte(0.02, 0.02, 0.02);
    let radius = 0.34 * scale.y.min(scale.z);
    let [front, back] = [-0.5, 0.52].map(|z| vec3(0.0, radius, z * scale.z));
    for hub in [front, back] {
        ring(&mut part, hub, radius - 0.02, 0.02, rubber);
        // Four crossed spokes.
        for (y, z) in [(1.0, 0.0), (0.0, 1.0), (0.7, 0.7), (0.7, -0.7)] {
            let spoke = vec3(0.0, y, z) * (radius - 0.03);
            part.beam(hub - spoke, hub + spoke, 0.003, frame);
        }
    }
    let [seat, head, crank] = [at(0.0, 0.88, 0.28), at(0.0, 0.86, -0.36), at(0.0, 0.3, 0.06)];
    for (a, b) in [(crank, seat), (crank, head), (seat, head), (crank, back), (seat, back), (head, front)] {
        part.beam(a, b, 0.016, frame);
    }
    let bar = at(0.0, 1.02, -0.36);
    part.beam(head, bar, 0.014, frame);
    part.beam(bar - Vec3::X * 0.26 * scale.x, bar + Vec3::X * 0.26 * scale.x, 0.014, frame);
    part.cuboid(seat + vec3(-0.07, 0.0, -0.12), seat + vec3(0.07, 0.05, 0.13), rubber);
    let clothes = clothes(coat, palette);
    rider(&mut part, [seat + Vec3::Y * 0.08, bar, crank], 0.22 * scale.x, 0.5 * scale.y, clothes);
    // The lamp hangs below the handlebars, and the tail light below the seat.
    let lamp = at(0.0, 0.9, -0.44);
    part.cuboid(lamp - vec3(0.025, 0.025, 0.0), lamp + vec3(0.025, 0.025, 0.08), rubber);
    let lens = lamp - Vec3::Z * 0.004;
    lamps::headlight(&mut part, lens, [0.022, 0.022], vec3(0.0, -0.14, -1.0), BICYCLE_LIGHT, palette);
    let tail = seat + vec3(0.0, -0.08, 0.16);
    part.cuboid(tail - vec3(0.025, 0.02, 0.03), tail + vec3(0.025, 0.02, 0.0), rubber);
    let red = lamps::red(palette);
    part.glow(tail + Vec3::Z * 0.004, Vec3::X * 0.022, Vec3::Y * 0.018, red);
    part
}

/// A motorcycle or moped with one headlight and one tail light.
pub fn motorcycle(size: Size, paint: [f32; 3], palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let scale = scaled(Body::Motorcycle, size);
    let at = |x: f32, y: f32, z: f32| vec3(x, y, z) * scale;
    let enamel = palette.glossy(paint, 0.25);
    let steel = palette.metal([0.35, 0.35, 0.36], 0.35);
    let rubber = palette.matte(0.02, 0.02, 0.02);
    let radius = 0.31 * scale.y.min(scale.z);
    let [front, back] = [-0.74, 0.7].map(|z| vec3(0.0, radius, z * scale.z));
    for hub in [front, back] {
        for side in [-1.0, 1.0] {
            wheel(&mut part, hub + Vec3::X * side * 0.03, side * 0.04, radius, [rubber, steel]);
        }
    }
    let (bar, seat) = (at(0.0, 1.0, -0.45), at(0.0, 0.76, 0.22));
    for side in [-1.0, 1.0] {
        part.beam(front + Vec3::X * side * 0.09, bar + Vec3::X * side * 0.07, 0.022, steel);
        part.beam(back + Vec3::X * side * 0.09, at(0.09 * side, 0.42, 0.0), 0.022, steel);
    }
    part.beam(bar - Vec3::X * 0.36 * scale.x, bar + Vec3::X * 0.36 * scale.x, 0.016, steel);
    part.cuboid(at(-0.16, 0.22, -0.35), at(0.16, 0.56, 0.22), steel);
    part.ball(at(0.0, 0.76, -0.16), vec3(0.16, 0.16, 0.32) * scale, 10, enamel);
    part.cuboid(at(-0.13, 0.62, 0.0), at(0.13, 0.76, 0.72), enamel);
    part.cuboid(at(-0.14, 0.74, 0.02), at(0.14, 0.8, 0.68), rubber);
    part.cuboid(at(-0.1, 0.6, -0.98), at(0.1, 0.66, -0.5), enamel);
    let clothes = clothes([0.05, 0.05, 0.055], palette);
    rider(&mut part, [seat + Vec3::Y * 0.06, bar, at(0.0, 0.32, 0.05)], 0.3 * scale.x, 0.52 * scale.y, clothes);
    let lamp = at(0.0, 0.86, -0.62);
    part.cuboid(lamp - vec3(0.1, 0.09, 0.0), lamp + vec3(0.1, 0.09, 0.16), enamel);
    let lens = lamp - Vec3::Z * 0.006;
    lamps::headlight(&mut part, lens, [0.085, 0.07], vec3(0.0, -0.06, -1.0), MOTORCYCLE_LIGHT, palette);
    let tail = at(0.0, 0.69, 0.72) + Vec3::Z * 0.008;
    let red = lamps::red(palette);
    part.glow(tail, Vec3::X * 0.09, Vec3::Y * 0.035, red);
    part
}
