//! Trucks, with and without a semi-trailer, and containers.

use girandole::glam::{Vec3, vec3};

use super::body::Size;
use super::lamps::{self, HEADLIGHT};
use super::palette::Palette;
use super::panels::{axle, extrude};
use super::part::Part;

/// Materials of a truck.
struct Materials {
    paint: u32,
    cargo: u32,
    glass: u32,
    dark: u32,
    wheel: [u32; 2],
}

fn materials(paint: [f32; 3], palette: &mut Palette) -> Materials {
    Materials {
        paint: palette.glossy(paint, 0.3),
        cargo: palette.glossy([0.42, 0.42, 0.4], 0.5),
        glass: palette.glossy([0.012, 0.014, 0.017], 0.12),
        dark: palette.matte(0.03, 0.03, 0.03),
        wheel: [palette.matte(0.02, 0.02, 0.02), palette.metal([0.5, 0.5, 0.52], 0.4)],
    }
}

/// A cab that reaches `depth` metres back from `front`.
fn cab(part: &mut Part, front: f32, depth: f32, half_width: f32, height: f32, materials: &Materials) {
    let (back, sill) = (front + depth, 0.5 * height + 0.1);
    let lower = [[front, 0.6], [front + 0.02, sill], [back - 0.02, sill], [back, 0.6]];
    extrude(part, &lower, [half_width, half_width], 0.42, |_| materials.paint, materials.paint);
    let upper = [[front + 0.02, sill], [front + 0.22, height], [back - 0.02, height], [back, sill]];
    let skin = |index: usize| if index == 0 { materials.glass } else { materials.paint };
    extrude(part, &upper, [half_width, half_width - 0.1], sill, skin, materials.paint);
    // The side windows lie on the cab, which leans inwards.
    for side in [-1.0_f32, 1.0] {
        let at = |z: f32, share: f32| {
            let y = sill + (height - sill) * share;
            vec3(side * (half_width - 0.1 * share + 0.01), y, z)
        };
        let [a, b] = [at(front + 0.25, 0.08), at(front + 0.62 * depth, 0.08)];
        let [c, d] = [at(front + 0.62 * depth, 0.75), at(front + 0.35, 0.75)];
        part.quad(if side > 0.0 { [b, a, d, c] } else { [a, b, c, d] }, materials.glass);
    }
}

/// Headlights, tail lights, and amber lamps along the sides at the height `y`.
fn lights(part: &mut Part, half_length: f32, half_width: f32, y: f32, palette: &mut Palette) {
    let red = lamps::red(palette);
    let amber = palette.glow(vec3(1.0, 0.42, 0.03), 60.0);
    for side in [-1.0, 1.0] {
        let x = side * (half_width - 0.28);
        let lens = vec3(x, 0.72, -half_length - 0.012);
        lamps::headlight(part, lens, [0.17, 0.08], vec3(side * 0.05, -0.06, -1.0), HEADLIGHT, palette);
        part.glow(vec3(x, 0.85, half_length + 0.012), Vec3::X * 0.18, Vec3::Y * 0.07, red);
        let count = (half_length / 1.6) as usize;
        for lamp in 1..=count {
            let z = half_length * (2.0 * lamp as f32 / (count + 1) as f32 - 1.0);
            part.glow(vec3(side * (half_width + 0.012), y, z), Vec3::Z * -side * 0.06, Vec3::Y * 0.03, amber);
        }
    }
}

/// A cab with a box on one chassis.
pub fn truck(size: Size, paint: [f32; 3], palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let materials = materials(paint, palette);
    let [half_length, half_width, height] = [size.length() * 0.5, size.width() * 0.5, size.height()];
    let depth = (0.27 * size.length()).min(2.0);
    cab(&mut part, -half_length, depth, half_width - 0.05, (0.85 * height).min(2.9), &materials);
    let (front, back) = (-half_length + depth + 0.12, half_length);
    part.cuboid(vec3(-0.4, 0.5, -half_length + 0.5), vec3(0.4, 0.95, back - 0.1), materials.dark);
    part.cuboid(vec3(-half_width, 0.95, front), vec3(half_width, height.max(1.2), back), materials.cargo);
    part.cuboid(vec3(-half_width + 0.1, 0.6, back - 0.1), vec3(half_width - 0.1, 0.95, back), materials.dark);
    for z in [-half_length + 0.62 * depth, half_length - 0.22 * size.length()] {
        axle(&mut part, z, half_width - 0.05, 0.15, 0.46, materials.wheel);
    }
    lights(&mut part, half_length, half_width, 1.02, palette);
    part
}

/// A tractor with a semi-trailer, which do not bend.
pub fn semi_trailer(size: Size, paint: [f32; 3], palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let materials = materials(paint, palette);
    let [half_length, half_width, height] = [size.length() * 0.5, size.width() * 0.5, size.height()];
    let depth = (0.16 * size.length()).min(2.3);
    cab(&mut part, -half_length, depth, half_width - 0.05, (0.92 * height).min(3.6), &materials);
    let front = -half_length + depth + 0.6;
    part.cuboid(vec3(-0.45, 0.5, -half_length + 0.5), vec3(0.45, 0.95, front + 0.22 * size.length()), materials.dark);
    part.cuboid(vec3(-half_width, 1.15, front), vec3(half_width, height.max(1.4), half_length), materials.cargo);
    part.cuboid(vec3(-0.5, 0.85, 0.0), vec3(0.5, 1.15, half_length - 0.1), materials.dark);
    let bumper = [vec3(-half_width + 0.1, 0.62, half_length - 0.1), vec3(half_width - 0.1, 1.15, half_length)];
    part.cuboid(bumper[0], bumper[1], materials.dark);
    let back = half_length - 0.12 * size.length();
    let axles = [-half_length + 0.55 * depth, front + 0.12 * size.length(), back - 2.5, back - 1.25, back];
    for z in axles {
        axle(&mut part, z, half_width - 0.05, 0.16, 0.5, materials.wheel);
    }
    lights(&mut part, half_length, half_width, 1.22, palette);
    part
}

/// A box of steel with ribs, without lights.
pub fn container(size: Size, paint: [f32; 3], palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let steel = palette.glossy(paint, 0.55);
    let half = vec3(size.width(), size.height(), size.length()) * 0.5;
    let middle = Vec3::Y * half.y;
    let rib = 0.04_f32.min(half.min_element() * 0.1);
    let inner = half - vec3(rib, 0.0, rib);
    part.cuboid(middle - inner, middle + inner, steel);
    let count = ((size.length() / 0.5) as usize).clamp(2, 200);
    for index in 0..=count {
        let z = (half.z - 0.5 * rib) * (2.0 * index as f32 / count as f32 - 1.0);
        let slab = vec3(half.x, half.y, rib.min(0.25 * half.z));
        part.cuboid(middle - slab + Vec3::Z * z, middle + slab + Vec3::Z * z, steel);
    }
    part
}
