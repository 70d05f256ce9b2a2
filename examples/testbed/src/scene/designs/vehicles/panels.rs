//! Extruded side profiles, wheels and rings.

use std::f32::consts::TAU;

use girandole::glam::{Vec3, vec3};

use super::part::Part;

/// Extrudes a side profile, (z, y) from front to back, that a plane at the height `floor` closes
/// below. `half` is the half width at the bottom and at the top: cabins are narrower at the top.
pub fn extrude(
    part: &mut Part,
    profile: &[[f32; 2]],
    half: [f32; 2],
    floor: f32,
    material: impl Fn(usize) -> u32,
    side: u32,
) {
    let top = profile.iter().map(|p| p[1]).fold(floor, f32::max);
    let at = |p: [f32; 2], sign: f32| {
        let blend = if top > floor { (p[1] - floor) / (top - floor) } else { 0.0 };
        vec3(sign * (half[0] + (half[1] - half[0]) * blend), p[1], p[0])
    };
    for (index, pair) in profile.windows(2).enumerate() {
        let [a, b] = [pair[0], pair[1]];
        part.quad([at(a, -1.0), at(b, -1.0), at(b, 1.0), at(a, 1.0)], material(index));
        let (low_a, low_b) = ([a[0], floor], [b[0], floor]);
        part.quad([at(low_b, 1.0), at(low_a, 1.0), at(a, 1.0), at(b, 1.0)], side);
        part.quad([at(low_a, -1.0), at(low_b, -1.0), at(b, -1.0), at(a, -1.0)], side);
    }
    let (first, last) = (profile[0], profile[profile.len() - 1]);
    let ends = [
        [at([first[0], floor], -1.0), at(first, -1.0), at(first, 1.0), at([first[0], floor], 1.0)],
        [at([last[0], floor], 1.0), at(last, 1.0), at(last, -1.0), at([last[0], floor], -1.0)],
    ];
    ends.into_iter().for_each(|end| part.quad(end, side));
}

/// A wheel: a prism of ten sides about the X axis. `half` is half its width, with the sign of x on
/// its outer side.
pub fn wheel(part: &mut Part, center: Vec3, half: f32, radius: f32, [rubber, rim]: [u32; 2]) {
    let at = |side: usize, out: f32, scale: f32| {
        let (sin, cos) = (side as f32 / 10.0 * TAU).sin_cos();
        center + vec3(out, sin * radius * scale, cos * radius * scale)
    };
    for side in 0..10 {
        let tread = [at(side, half, 1.0), at(side, -half, 1.0), at(side + 1, -half, 1.0), at(side + 1, half, 1.0)];
        let face = [center + Vec3::X * half, at(side, half, 1.0), at(side + 1, half, 1.0)];
        let hub = [center + Vec3::X * half * 1.1, at(side, half * 1.05, 0.6), at(side + 1, half * 1.05, 0.6)];
        let flip = |t: [Vec3; 3]| if half > 0.0 { [t[0], t[2], t[1]] } else { t };
        part.quad(if half > 0.0 { tread } else { [tread[3], tread[2], tread[1], tread[0]] }, rubber);
        part.triangle(flip(face), rubber);
        part.triangle(flip(hub), rim);
    }
}

/// Two wheels of an axle at the length `z`. `half_width` is half that of the vehicle, and `half` half
/// that of a tyre.
pub fn axle(part: &mut Part, z: f32, half_width: f32, half: f32, radius: f32, materials: [u32; 2]) {
    for side in [-1.0, 1.0] {
        wheel(part, vec3(side * (half_width - half * 0.7), radius, z), side * half, radius, materials);
    }
}

/// The tyre of a wheel that one sees through: a ring of twelve beams about the X axis.
pub fn ring(part: &mut Part, center: Vec3, radius: f32, half: f32, material: u32) {
    let at = |side: usize| {
        let (sin, cos) = (side as f32 / 12.0 * TAU).sin_cos();
        center + vec3(0.0, sin, cos) * radius
    };
    for side in 0..12 {
        part.beam(at(side), at(side + 1), half, material);
    }
}
