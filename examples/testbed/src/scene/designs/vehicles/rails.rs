//! Trams and trains: carriages in a straight line, with lit windows, three headlights and two tail
//! lights.

use girandole::glam::{Vec3, vec3};

use super::body::Size;
use super::lamps::{self, HEADLIGHT};
use super::palette::{NEUTRAL, Palette};
use super::panels::extrude;
use super::part::Part;

/// What distinguishes trams from trains. Lengths are metres.
struct Stock {
    /// Length of a carriage; the carriages of a vehicle have equal lengths near it.
    carriage: f32,
    /// Distance between carriages.
    gap: f32,
    /// Height of the lower edge.
    floor: f32,
    /// How far the ends lean back.
    nose: f32,
    paint: [f32; 3],
    /// Radiance of the windows, nits.
    window: f32,
    /// Whether the front shows its destination.
    has_sign: bool,
}

/// A tram of short sections.
pub fn tram(size: Size, palette: &mut Palette) -> Part {
    let paint = [0.55, 0.5, 0.1];
    build(
        size,
        &Stock { carriage: 7.5, gap: 0.35, floor: 0.28, nose: 0.6, paint, window: 11.0, has_sign: true },
        palette,
    )
}

/// A train of long carriages.
pub fn train(size: Size, palette: &mut Palette) -> Part {
    let paint = [0.38, 0.05, 0.045];
    let stock = Stock { carriage: 25.0, gap: 0.8, floor: 0.7, nose: 1.3, paint, window: 8.0, has_sign: false };
    build(size, &stock, palette)
}

fn build(size: Size, stock: &Stock, palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let [half_length, half_width, height] = [size.length() * 0.5, size.width() * 0.5, size.height()];
    let count = (size.length() / stock.carriage).round().clamp(1.0, 200.0) as usize;
    let pitch = size.length() / count as f32;
    let gap = stock.gap.min(0.2 * pitch);
    let nose = stock.nose.min(0.2 * pitch);
    let paint = palette.glossy(stock.paint, 0.35);
    let roof = palette.matte(0.22, 0.22, 0.22);
    let glass = palette.glossy([0.012, 0.014, 0.017], 0.12);
    let dark = palette.matte(0.03, 0.03, 0.03);
    let steel = palette.metal([0.3, 0.3, 0.31], 0.45);
    let glow = palette.glow(NEUTRAL, stock.window);
    let sill = 0.5 * (stock.floor + height) - 0.1;
    for carriage in 0..count {
        let (first, last) = (carriage == 0, carriage + 1 == count);
        let begin = -half_length + carriage as f32 * pitch + if first { 0.0 } else { 0.5 * gap };
        let end = -half_length + (carriage + 1) as f32 * pitch - if last { 0.0 } else { 0.5 * gap };
        // Upright up to the sill, then the ends of the whole vehicle lean back.
        let lean = |is_end: bool| if is_end { nose } else { 0.02 };
        let profile = [
            [begin, stock.floor + 0.3],
            [begin + 0.02, sill],
            [begin + 0.02 + lean(first), height - 0.12],
            [begin + 0.3 + lean(first), height],
            [end - 0.3 - lean(last), height],
            [end - 0.02 - lean(last), height - 0.12],
            [end - 0.02, sill],
            [end, stock.floor + 0.3],
        ];
        let skin = |index: usize| match index {
            1 | 5 => glass,
            2..=4 => roof,
            _ => paint,
        };
        extrude(&mut part, &profile, [half_width, half_width - 0.12], stock.floor, skin, paint);
        // The undercarriage.
        let length = end - begin;
        part.cuboid(
            vec3(-half_width + 0.35, 0.05, begin + 0.12 * length),
            vec3(half_width - 0.35, stock.floor, end - 0.12 * length),
            dark,
        );
        if !last {
            let bellows = vec3(half_width - 0.3, 0.0, 0.5 * gap + 0.05);
            let middle = vec3(0.0, 0.0, end + 0.5 * gap);
            part.cuboid(middle - bellows + Vec3::Y * 0.5, middle + bellows + Vec3::Y * (height - 0.3), dark);
        }
        // The windows keep clear of the noses.
        let from = begin + 0.5 + if first { nose } else { 0.0 };
        let to = end - 0.5 - if last { nose } else { 0.0 };
        let windows = ((to - from) / 2.1).floor().clamp(1.0, 400.0);
        let half = 0.5 * (to - from).max(0.2) / windows;
        let size = [half * 0.86, 0.5 * (height - 0.42 - sill - 0.12).max(0.1)];
        let [x, y] = [half_width - 0.02, sill + 0.12 + size[1]];
        lamps::lit_windows(&mut part, [from + half, to - half], windows as usize, size, [x, y], glow);
        if carriage == count / 2 {
            pantograph(&mut part, vec3(0.0, height, 0.5 * (begin + end)), steel);
        }
    }
    ends(&mut part, half_length, half_width, stock, [sill, height], palette);
    part
}

/// A collector on the roof that reaches the contact wire.
fn pantograph(part: &mut Part, at: Vec3, material: u32) {
    part.cuboid(at - vec3(0.7, 0.02, 0.9), at + vec3(0.7, 0.14, 0.9), material);
    for side in [-0.4, 0.4] {
        part.beam(at + vec3(side, 0.1, 0.7), at + vec3(side, 0.75, -0.6), 0.025, material);
        part.beam(at + vec3(side, 0.75, -0.6), at + vec3(side, 1.4, 0.3), 0.02, material);
    }
    part.beam(at + vec3(-0.8, 1.4, 0.3), at + vec3(0.8, 1.4, 0.3), 0.03, material);
}

/// The lamps of both ends.
fn ends(
    part: &mut Part,
    half_length: f32,
    half_width: f32,
    stock: &Stock,
    [sill, height]: [f32; 2],
    palette: &mut Palette,
) {
    let red = lamps::red(palette);
    let low = 0.5 * (stock.floor + sill);
    for side in [-1.0, 1.0] {
        let x = side * (half_width - 0.4);
        let lens = vec3(x, low, -half_length - 0.015);
        lamps::headlight(part, lens, [0.14, 0.09], vec3(side * 0.04, -0.06, -1.0), HEADLIGHT, palette);
        part.glow(vec3(x, low, half_length + 0.015), Vec3::X * 0.14, Vec3::Y * 0.09, red);
    }
    // The upper headlight stands on the front edge of the roof.
    let top = vec3(0.0, height - 0.02, -half_length + stock.nose + 0.2);
    let dark = palette.matte(0.03, 0.03, 0.03);
    part.cuboid(top - vec3(0.2, 0.1, 0.0), top + vec3(0.2, 0.1, 0.3), dark);
    let lens = top - Vec3::Z * 0.012;
    lamps::headlight(part, lens, [0.13, 0.07], vec3(0.0, -0.12, -1.0), HEADLIGHT, palette);
    if stock.has_sign {
        let amber = palette.glow(vec3(1.0, 0.5, 0.06), 45.0);
        let middle = vec3(0.0, height - 0.36, -half_length + 0.5 * stock.nose);
        let half = vec3(0.62, 0.13, 0.5 * stock.nose);
        part.cuboid(middle - half, middle + half, dark);
        part.glow(middle - Vec3::Z * (half.z + 0.01), Vec3::NEG_X * 0.55, Vec3::Y * 0.09, amber);
    }
}
