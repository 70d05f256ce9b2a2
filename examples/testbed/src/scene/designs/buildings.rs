//! Buildings for the lots of a block: street corners, and narrow and wide houses in a row.

use std::f32::consts::FRAC_PI_2;

use girandole::glam::{Quat, Vec3, vec3};

use super::facade::{Builder, Plane, Style};
use super::palette::{NEON, Palette, WALLS};
use super::part::Part;
use super::rng::Rng;

/// The lot that a building fills. Its front is the +Z edge of the lot; corner buildings have a
/// second one on +X.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lot {
    /// 24 m by 24 m, from (-24, -24) to (0, 0) in (x, z). The street corner is the origin.
    Corner,
    /// 16 m wide and 24 m deep, from (-8, -24) to (8, 0).
    Narrow,
    /// 32 m wide and 24 m deep, from (-16, -24) to (16, 0).
    Wide,
}

/// Depth of every lot and width of a corner lot, metres.
pub const LOT_DEPTH: f32 = 24.0;

/// A box of a building: the corners of its plan in (x, z), and the heights of its bottom and top.
struct Volume {
    min: [f32; 2],
    max: [f32; 2],
    y: [f32; 2],
}

impl Volume {
    /// The side whose outward normal is +Z, +X, -Z or -X, for a `quarter` of 0 to 3.
    fn side(&self, quarter: usize) -> Plane {
        let right = Quat::from_rotation_y(quarter as f32 * FRAC_PI_2) * Vec3::X;
        let (x, z, width) = match quarter {
            0 => (self.min[0], self.max[1], self.max[0] - self.min[0]),
            1 => (self.max[0], self.max[1], self.max[1] - self.min[1]),
            2 => (self.max[0], self.min[1], self.max[0] - self.min[0]),
            _ => (self.min[0], self.min[1], self.max[1] - self.min[1]),
        };
        Plane { origin: vec3(x, 0.0, z), right: right.round(), width }
    }
}

fn style(rng: &mut Rng, floors: usize, palette: &mut Palette) -> Style {
    let office = floors > 9 || rng.chance(0.12);
    let office_walls = [[0.12, 0.13, 0.15], [0.3, 0.3, 0.31], [0.22, 0.2, 0.19], [0.4, 0.39, 0.37]];
    let wall = palette.glossy(if office { rng.pick(&office_walls) } else { rng.pick(&WALLS) }, 0.85);
    let trim = if office { palette.metal([0.35, 0.36, 0.38], 0.45) } else { palette.matte(0.45, 0.43, 0.4) };
    let glass = palette.glossy([0.015, 0.02, 0.028], 0.12);
    Style {
        wall,
        trim,
        glass,
        bay: rng.pick(if office { &[2.0, 2.6, 3.2] } else { &[2.4, 2.7, 3.1] }),
        floor: if office { 3.6 } else { 3.2 },
        window_width: if office { 0.9 } else { rng.pick(&[0.46, 0.52, 0.6]) },
        window_height: if office { rng.pick(&[0.6, 0.7, 0.8]) } else { rng.pick(&[0.52, 0.58]) },
        depth: if office { 0.15 } else { 0.24 },
        lit: rng.range(if office { 0.2 } else { 0.22 }, 0.4),
        office,
        balconies: !office && rng.chance(0.35),
    }
}

fn roof(builder: &mut Builder<'_>, volume: &Volume) {
    let Builder { part, style, palette, rng } = builder;
    let tar = palette.matte(0.07, 0.07, 0.075);
    let metal = palette.metal([0.45, 0.46, 0.47], 0.55);
    let (min, max, y) = (volume.min, volume.max, volume.y[1]);
    part.floor(min, max, y, tar);
    // The parapet and its cornice, four boxes each.
    let (h, t) = (0.9, 0.35);
    let edges = [
        ([min[0], max[1] - t], [max[0], max[1]]),
        ([min[0], min[1]], [max[0], min[1] + t]),
        ([min[0], min[1]], [min[0] + t, max[1]]),
        ([max[0] - t, min[1]], [max[0], max[1]]),
    ];
    for (low, high) in edges {
        part.cuboid(vec3(low[0], y, low[1]), vec3(high[0], y + h, high[1]), style.wall);
        let grow = 0.2;
        let [low, high] =
            [vec3(low[0] - grow, y + h, low[1] - grow), vec3(high[0] + grow, y + h + 0.18, high[1] + grow)];
        part.cuboid(low, high, style.trim);
    }
    let (width, depth) = (max[0] - min[0], max[1] - min[1]);
    for _ in 0..2 + rng.below(4) {
        let size = vec3(rng.range(1.2, 3.0), rng.range(0.8, 1.8), rng.range(1.2, 3.0));
        let at = vec3(
            min[0] + 1.0 + rng.unit() * (width - 5.0).max(0.5),
            y,
            min[1] + 1.0 + rng.unit() * (depth - 5.0).max(0.5),
        );
        part.cuboid(at, at + size, metal);
    }
    // The exit of the stairs.
    let at = vec3(min[0] + width * 0.4, y, min[1] + depth * 0.35);
    part.cuboid(at, at + vec3(3.5, 2.8, 4.0), style.wall);
    if volume.y[1] < 40.0 && rng.chance(0.35) {
        let wood = palette.matte(0.2, 0.12, 0.07);
        let base = vec3(min[0] + width * 0.7, y, min[1] + depth * 0.6);
        for (x, z) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
            part.beam(base + vec3(x, 0.0, z), base + vec3(x * 0.8, 2.2, z * 0.8), 0.09, metal);
        }
        part.column(base + Vec3::Y * 2.2, 2.8, [1.5, 1.5], 10, wood);
        part.column(base + Vec3::Y * 5.0, 0.9, [1.6, 0.05], 10, metal);
    } else if volume.y[1] >= 40.0 {
        let base = vec3(min[0] + width * 0.5, y, min[1] + depth * 0.5);
        part.beam(base, base + Vec3::Y * 14.0, 0.12, metal);
        let red = palette.glow(NEON[5], 150.0);
        part.bulb(base + Vec3::Y * 14.3, 0.22, 6, red);
    }
}

/// A building with `floors` floors above a ground floor of shops.
pub fn building(lot: Lot, floors: usize, palette: &mut Palette, rng: &mut Rng) -> Part {
    let style = style(rng, floors, palette);
    let mut builder = Builder { part: Part::default(), style, palette, rng };
    let ground = 4.8;
    let plan = match lot {
        Lot::Corner => ([-LOT_DEPTH, -LOT_DEPTH], [0.0, 0.0]),
        Lot::Narrow => ([-8.0, -LOT_DEPTH], [8.0, 0.0]),
        Lot::Wide => ([-16.0, -LOT_DEPTH], [16.0, 0.0]),
    };
    // A tower is set back above a base of five floors, so that facades along the street have
    // similar heights.
    let tower = floors > 10;
    let base_floors = if tower { 5 } else { floors };
    let base = Volume { min: plan.0, max: plan.1, y: [ground, ground + base_floors as f32 * style.floor] };
    let fronts: &[usize] = if lot == Lot::Corner { &[0, 1] } else { &[0] };
    for quarter in 0..4 {
        let plane = base.side(quarter);
        if fronts.contains(&quarter) {
            builder.shops(&plane, ground);
            builder.windows(&plane, base.y, 1.0);
        } else if quarter == 2 && lot != Lot::Corner {
            plane.rectangle(&mut builder.part, [0.0, plane.width], [0.0, ground], 0.0, style.wall);
            builder.windows(&plane, base.y, 0.7);
        } else {
            // Walls between neighbours have no windows.
            plane.rectangle(&mut builder.part, [0.0, plane.width], [0.0, base.y[1]], 0.0, style.wall);
        }
    }
    for &quarter in fronts {
        let (plane, y) = (base.side(quarter), [ground - 0.15, ground + 0.15]);
        plane.relief(&mut builder.part, [0.0, plane.width], y, [0.0, 0.3], style.trim);
    }
    roof(&mut builder, &base);
    if tower {
        let inset = builder.rng.pick(&[2.0, 3.0, 4.0]);
        let y = [base.y[1], base.y[1] + (floors - base_floors) as f32 * style.floor];
        let shaft = Volume { min: plan.0.map(|v| v + inset), max: plan.1.map(|v| v - inset), y };
        for quarter in 0..4 {
            builder.windows(&shaft.side(quarter), y, 1.0);
        }
        roof(&mut builder, &shaft);
    }
    builder.part
}
