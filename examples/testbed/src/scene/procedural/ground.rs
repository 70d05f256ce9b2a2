//! The ground of a block: the nearer half of the surrounding streets, kerbs, pavements, and the
//! area within.
//!
//! A tile is centred on its block and one [`PITCH`] wide, so that adjacent tiles form whole
//! streets.

use std::f32::consts::FRAC_PI_2;

use girandole::glam::{Affine3A, Vec3, vec3};

use super::palette::Palette;
use super::part::Part;
use super::rng::Rng;
use super::roads::{APPROACH, LANES, PITCH};

/// Distance from the middle of a block to the kerb, metres.
pub const KERB: f32 = PITCH * 0.5 - 7.0;
/// Distance from the middle of a block to the facades, metres.
pub const FRONT: f32 = KERB - 5.0;
/// Height of the pavement above the road, metres.
pub const PAVEMENT: f32 = 0.15;

/// What a block is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LandUse {
    /// Houses around a courtyard.
    Houses,
    /// Lawn, paths and trees.
    Park,
    /// A paved square with stalls.
    Market,
}

/// A tile for one land use.
pub fn tile(land_use: LandUse, palette: &mut Palette, rng: &mut Rng) -> Part {
    let mut part = Part::default();
    let side = side(palette, rng);
    for quarter in 0..4 {
        part.add_moved(&side, Affine3A::from_rotation_y(quarter as f32 * FRAC_PI_2));
    }
    let paving = palette.matte(0.13, 0.125, 0.12);
    match land_use {
        LandUse::Houses => part.floor([-FRONT; 2], [FRONT; 2], PAVEMENT, palette.matte(0.13, 0.13, 0.13)),
        LandUse::Park => {
            part.floor([-FRONT; 2], [FRONT; 2], PAVEMENT, palette.matte(0.045, 0.09, 0.025));
            part.floor([-FRONT, -2.0], [FRONT, 2.0], PAVEMENT + 0.01, paving);
            part.floor([-2.0, -FRONT], [2.0, FRONT], PAVEMENT + 0.01, paving);
        }
        LandUse::Market => {
            let slabs = [paving, palette.glossy([0.11, 0.1, 0.09], 0.45), palette.matte(0.15, 0.14, 0.13)];
            let (count, size) = (20, FRONT * 2.0 / 20.0);
            for (x, z) in (0..count).flat_map(|x| (0..count).map(move |z| (x, z))) {
                let min = [x as f32 * size - FRONT, z as f32 * size - FRONT];
                part.floor(min, min.map(|v| v + size), PAVEMENT, rng.pick(&slabs));
            }
        }
    }
    part
}

/// The +X side of a tile. The cars on its lanes drive towards +Z.
fn side(palette: &mut Palette, rng: &mut Rng) -> Part {
    let mut part = Part::default();
    let edge = PITCH * 0.5;
    // Wet patches are less rough than dry ones.
    let asphalt = [0.30, 0.36, 0.42, 0.5].map(|roughness| palette.glossy([0.042, 0.042, 0.046], roughness));
    let count = 26;
    let step = (edge + KERB) / count as f32;
    for (lane, x) in [[KERB, LANES_EDGE], [LANES_EDGE, edge]].into_iter().enumerate() {
        for patch in 0..count {
            let z = -edge + patch as f32 * step;
            let tone = asphalt[(patch / 2 + lane * 3 + rng.below(2)) % asphalt.len()];
            part.floor([x[0], z], [x[1], z + step], 0.0, tone);
        }
    }
    markings(&mut part, palette);
    // Pavement slabs, the pentagon at the corner, and the kerb.
    let slabs =
        [palette.matte(0.17, 0.165, 0.16), palette.glossy([0.14, 0.137, 0.133], 0.5), palette.matte(0.2, 0.195, 0.19)];
    let cells = 32;
    for (row, cell) in (0..2).flat_map(|row| (0..cells).map(move |cell| (row, cell))) {
        let size = [(KERB - FRONT) * 0.5, FRONT * 2.0 / cells as f32];
        let min = [FRONT + row as f32 * size[0], -FRONT + cell as f32 * size[1]];
        part.floor(min, [min[0] + size[0], min[1] + size[1]], PAVEMENT, rng.pick(&slabs));
    }
    let cut = KERB - 3.0;
    let at = |x: f32, z: f32| vec3(x, PAVEMENT, z);
    part.quad([at(FRONT, KERB), at(cut, KERB), at(KERB, cut), at(KERB, FRONT)], slabs[0]);
    part.triangle([at(FRONT, KERB), at(KERB, FRONT), at(FRONT, FRONT)], slabs[0]);
    let stone = palette.matte(0.36, 0.35, 0.34);
    let line = [at(KERB, -cut), at(KERB, cut), at(cut, KERB)];
    for pair in line.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        let down = Vec3::Y * -PAVEMENT;
        part.quad([b + down, a + down, a, b], stone);
        let inward = Vec3::Y.cross(b - a).normalize() * -0.3;
        let lift = Vec3::Y * 0.004;
        part.quad([a + lift, a + inward + lift, b + inward + lift, b + lift], stone);
    }
    part
}

/// Distance from the middle of a block to the line between the two lanes of a direction, metres.
const LANES_EDGE: f32 = PITCH * 0.5 - (LANES[0] + LANES[1]) * 0.5;

fn markings(part: &mut Part, palette: &mut Palette) {
    let (white, yellow) = (palette.glossy([0.62, 0.62, 0.6], 0.6), palette.glossy([0.65, 0.42, 0.04], 0.6));
    let (edge, y) = (PITCH * 0.5, 0.006);
    let stop = edge - APPROACH;
    part.floor([edge - 0.2, -stop], [edge - 0.08, stop], y, yellow);
    let (dash, gap) = (3.0, 4.5);
    let mut z = -stop + 2.0;
    while z + dash < stop {
        part.floor([LANES_EDGE - 0.07, z], [LANES_EDGE + 0.07, z + dash], y, white);
        z += dash + gap;
    }
    part.floor([KERB + 0.3, stop - 0.5], [edge - 0.3, stop], y, white);
    // Zebra crossings at both ends.
    for z in [stop + 1.0, -stop - 4.0] {
        for stripe in 0..7 {
            let x = KERB + 0.35 + stripe as f32;
            part.floor([x, z], [x + 0.5, z + 3.0], y, white);
        }
    }
    // Arrows: straight on in the inner lane, straight on and right in the kerb lane.
    for (lane, right) in LANES.into_iter().zip([true, false]) {
        let (x, z) = (edge - lane, stop - 9.0);
        part.floor([x - 0.08, z], [x + 0.08, z + 2.6], y, white);
        let tip = |dx: f32, dz: f32| vec3(x + dx, y, z + dz);
        part.triangle([tip(0.3, 2.6), tip(-0.3, 2.6), tip(0.0, 3.8)], white);
        if right {
            part.floor([x - 0.7, z + 0.9], [x, z + 1.06], y, white);
            part.triangle([tip(-0.7, 1.28), tip(-0.7, 0.68), tip(-1.3, 0.98)], white);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn horizontal_faces_of_the_ground_face_up() {
        let mut palette = Palette::default();
        for land_use in [LandUse::Houses, LandUse::Park, LandUse::Market] {
            let part = tile(land_use, &mut palette, &mut Rng::new(1, 1));
            for triangle in &part.mesh.triangles {
                let [a, b, c] = triangle.vertices;
                let normal = (b - a).cross(c - a).normalize();
                assert!(normal.y > 0.99 || normal.y.abs() < 1e-3, "{triangle:?}");
            }
        }
    }
}
