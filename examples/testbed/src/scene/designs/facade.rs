//! Facades: walls with lit and dark windows, and the shops of a ground floor.

use girandole::glam::{Vec3, vec3};

use super::palette::{COOL, Glow, NEON, NEUTRAL, Palette, SOFT, WARM};
use super::part::Part;
use super::rng::Rng;

/// A vertical plane that a facade is built on. `right` is a unit vector that points right for a
/// viewer in front of it.
#[derive(Clone, Copy)]
pub struct Plane {
    /// The lower left corner.
    pub origin: Vec3,
    /// A horizontal unit vector.
    pub right: Vec3,
    /// Metres.
    pub width: f32,
}

impl Plane {
    /// The point `x` metres to the right, `y` up and `out` in front of the plane.
    pub fn at(&self, x: f32, y: f32, out: f32) -> Vec3 {
        self.origin + self.right * x + Vec3::Y * y + self.right.cross(Vec3::Y) * out
    }

    /// A rectangle that is parallel to the plane.
    pub fn rectangle(&self, part: &mut Part, x: [f32; 2], y: [f32; 2], out: f32, material: u32) {
        part.quad([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])].map(|(x, y)| self.at(x, y, out)), material);
    }

    /// An emissive rectangle and its light.
    pub fn glow(&self, part: &mut Part, x: [f32; 2], y: [f32; 2], out: f32, glow: Glow) {
        let center = self.at((x[0] + x[1]) * 0.5, (y[0] + y[1]) * 0.5, out);
        part.glow(center, self.right * ((x[1] - x[0]) * 0.5), Vec3::Y * ((y[1] - y[0]) * 0.5), glow);
    }

    /// A box between the distances `out[0]` and `out[1]` in front of the plane.
    pub fn relief(&self, part: &mut Part, x: [f32; 2], y: [f32; 2], out: [f32; 2], material: u32) {
        let center = self.at((x[0] + x[1]) * 0.5, (y[0] + y[1]) * 0.5, (out[0] + out[1]) * 0.5);
        let [u, v, w] = [self.right * (x[1] - x[0]), Vec3::Y * (y[1] - y[0]), self.at(0.0, 0.0, out[1] - out[0])];
        part.oriented_box(center, u * 0.5, v * 0.5, (w - self.origin) * 0.5, material);
    }

    /// The four inner sides of an opening of the given depth.
    fn reveal(&self, part: &mut Part, x: [f32; 2], y: [f32; 2], depth: f32, material: u32) {
        let corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])];
        for (i, a) in corners.into_iter().enumerate() {
            let b = corners[(i + 1) % 4];
            part.quad([(a, 0.0), (b, 0.0), (b, -depth), (a, -depth)].map(|((x, y), out)| self.at(x, y, out)), material);
        }
    }
}

/// What all facades of a building have in common. Materials are indices, lengths are metres.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// Material of the wall.
    pub wall: u32,
    /// Material of ledges, window sills and frames.
    pub trim: u32,
    /// Material of dark glass.
    pub glass: u32,
    /// Distance between window centres.
    pub bay: f32,
    /// Height of an upper floor.
    pub floor: f32,
    /// Width of a window as a share of the bay.
    pub window_width: f32,
    /// Height of a window as a share of the floor.
    pub window_height: f32,
    /// Depth of the windows in the wall.
    pub depth: f32,
    /// Probability that a window is lit.
    pub lit: f32,
    /// Whether it is an office: cool light, lit by floors, without curtains.
    pub office: bool,
    /// Whether some bays have balconies.
    pub balconies: bool,
}

/// A building under construction.
pub struct Builder<'a> {
    /// What is built so far.
    pub part: Part,
    /// What all facades have in common.
    pub style: Style,
    /// The materials.
    pub palette: &'a mut Palette,
    /// Random numbers.
    pub rng: &'a mut Rng,
}

impl Builder<'_> {
    /// The colour, radiance in nits and material of a lit room.
    fn room(&mut self) -> (Vec3, f32, Glow) {
        let color = match (self.style.office, self.rng.unit()) {
            (true, roll) if roll < 0.6 => NEUTRAL,
            (true, _) => COOL,
            (false, roll) if roll < 0.45 => WARM,
            (false, roll) if roll < 0.8 => SOFT,
            (false, roll) if roll < 0.93 => NEUTRAL,
            (false, _) => COOL,
        };
        let nits = self.rng.pick(&[1.6, 2.6, 4.0, 6.0, 9.0]);
        (color, nits, self.palette.glow(color, nits))
    }

    fn window(&mut self, plane: &Plane, x: [f32; 2], y: [f32; 2]) {
        let Style { office, depth, .. } = self.style;
        let (color, nits, glow) = self.room();
        let dim = self.palette.glow(color * vec3(1.0, 0.8, 0.65), nits * 0.35);
        let (part, rng, out) = (&mut self.part, &mut *self.rng, -depth);
        match rng.unit() {
            // A curtain covers one side.
            roll if !office && roll < 0.25 => {
                let middle = x[0] + (x[1] - x[0]) * rng.pick(&[0.3, 0.45, 0.65]);
                let (left, right) = if rng.chance(0.5) { (dim, glow) } else { (glow, dim) };
                plane.glow(part, [x[0], middle], y, out, left);
                plane.glow(part, [middle, x[1]], y, out, right);
            }
            // A blind covers the upper part.
            roll if roll < 0.45 => {
                let middle = y[1] - (y[1] - y[0]) * rng.pick(&[0.3, 0.5, 0.7]);
                plane.glow(part, x, [y[0], middle], out, glow);
                plane.glow(part, x, [middle, y[1]], out, dim);
            }
            // The curtains are closed.
            roll if !office && roll < 0.6 => plane.glow(part, x, y, out, dim),
            _ => plane.glow(part, x, y, out, glow),
        }
    }

    /// Rows of windows between the heights `y`. `share` is a factor on the probability that a window is
    /// lit.
    pub fn windows(&mut self, plane: &Plane, y: [f32; 2], share: f32) {
        let style = self.style;
        let floors = ((y[1] - y[0]) / style.floor).round().max(1.0) as usize;
        let bays = (plane.width / style.bay).floor().max(1.0) as usize;
        let (floor, bay) = ((y[1] - y[0]) / floors as f32, plane.width / bays as f32);
        for row in 0..floors {
            let base = y[0] + row as f32 * floor;
            let low = base + (1.0 - style.window_height) * floor * 0.55;
            let high = low + style.window_height * floor;
            plane.rectangle(&mut self.part, [0.0, plane.width], [base, low], 0.0, style.wall);
            plane.rectangle(&mut self.part, [0.0, plane.width], [high, base + floor], 0.0, style.wall);
            // An office floor is mostly lit or mostly dark.
            let lit = match style.office {
                true if self.rng.chance(style.lit) => share * 0.72,
                true => share * 0.1,
                false => share * style.lit,
            };
            let margin = bay * (1.0 - style.window_width) * 0.5;
            for column in 0..bays {
                let x = [column as f32 * bay + margin, (column + 1) as f32 * bay - margin];
                plane.rectangle(&mut self.part, [x[0] - margin, x[0]], [low, high], 0.0, style.wall);
                plane.rectangle(&mut self.part, [x[1], x[1] + margin], [low, high], 0.0, style.wall);
                plane.reveal(&mut self.part, x, [low, high], style.depth, style.trim);
                if self.rng.chance(lit) {
                    self.window(plane, x, [low, high]);
                } else {
                    plane.rectangle(&mut self.part, x, [low, high], -style.depth, style.glass);
                }
                let (part, middle) = (&mut self.part, (x[0] + x[1]) * 0.5);
                plane.rectangle(part, [middle - 0.04, middle + 0.04], [low, high], -style.depth + 0.03, style.trim);
                if !style.office {
                    plane.relief(part, [x[0] - 0.1, x[1] + 0.1], [low - 0.12, low], [0.0, 0.14], style.trim);
                }
                if style.balconies && column % 2 == 1 && row > 0 {
                    balcony(part, plane, [x[0] - 0.3, x[1] + 0.3], base, style.trim);
                }
            }
        }
    }

    /// A ground floor of shops, `height` metres high.
    pub fn shops(&mut self, plane: &Plane, height: f32) {
        let Self { part, style, palette, rng } = self;
        let count = (plane.width / 5.5).round().max(1.0) as usize;
        let width = plane.width / count as f32;
        let frame = palette.metal([0.1, 0.1, 0.1], 0.4);
        for shop in 0..count {
            let x0 = shop as f32 * width;
            let (pane, pane_height) = ([x0 + 0.45, x0 + width - 0.45], [0.5, height - 1.25]);
            let open = rng.chance(0.72);
            let color = rng.pick(&[WARM, SOFT, SOFT, NEUTRAL, NEUTRAL, COOL]);
            let nits = rng.pick(&[8.0, 12.0, 19.0]);
            let glow = palette.glow(color, nits);
            // The wall around the pane.
            plane.rectangle(part, [x0, x0 + width], [0.0, pane_height[0]], 0.0, style.trim);
            plane.rectangle(part, [x0, x0 + width], [pane_height[1], height], 0.0, style.wall);
            plane.rectangle(part, [x0, pane[0]], pane_height, 0.0, style.wall);
            plane.rectangle(part, [pane[1], x0 + width], pane_height, 0.0, style.wall);
            plane.reveal(part, pane, pane_height, 0.35, style.trim);
            if open {
                let split = pane_height[0] + (pane_height[1] - pane_height[0]) * 0.42;
                plane.glow(part, pane, [split, pane_height[1]], -0.35, glow);
                // Goods in front of the light are darker, tinted rectangles.
                for tile in 0..3 {
                    let edge = |i: usize| pane[0] + (pane[1] - pane[0]) * i as f32 / 3.0;
                    let tint = vec3(rng.range(0.6, 1.0), rng.range(0.4, 1.0), rng.range(0.3, 1.0));
                    let tint = (tint * 4.0).round() / 4.0;
                    let goods = palette.glow(color * tint, nits * rng.pick(&[0.2, 0.35, 0.5]));
                    plane.glow(part, [edge(tile), edge(tile + 1)], [pane_height[0], split], -0.35, goods);
                }
            } else {
                plane.rectangle(part, pane, pane_height, -0.35, style.glass);
            }
            for post in 0..=2 {
                let at = pane[0] + (pane[1] - pane[0] - 0.08) * post as f32 / 2.0;
                plane.relief(part, [at, at + 0.08], pane_height, [-0.32, -0.2], frame);
            }
            plane.relief(part, pane, [pane_height[1] - 0.7, pane_height[1] - 0.62], [-0.32, -0.2], frame);
            // The sign above: an emissive strip on a dark board.
            plane.relief(part, [x0 + 0.3, x0 + width - 0.3], [height - 1.1, height - 0.35], [0.0, 0.12], frame);
            if rng.chance(if open { 0.9 } else { 0.35 }) {
                let sign = if rng.chance(0.3) { color } else { rng.pick(&NEON) };
                let glow = palette.glow(sign, rng.pick(&[24.0, 40.0, 60.0]));
                let reach = width * rng.range(0.24, 0.4);
                let middle = x0 + width * 0.5;
                plane.glow(part, [middle - reach, middle + reach], [height - 0.9, height - 0.55], 0.14, glow);
            }
            if rng.chance(0.4) {
                let cloth = rng.pick(&[[0.45, 0.06, 0.05], [0.05, 0.2, 0.1], [0.06, 0.1, 0.3], [0.5, 0.42, 0.3]]);
                let cloth = palette.glossy(cloth, 0.85);
                awning(part, plane, [x0 + 0.35, x0 + width - 0.35], height - 1.15, cloth);
            }
        }
    }
}

fn balcony(part: &mut Part, plane: &Plane, x: [f32; 2], y: f32, material: u32) {
    plane.relief(part, x, [y - 0.05, y + 0.1], [0.0, 1.1], material);
    plane.relief(part, x, [y + 1.0, y + 1.06], [1.04, 1.1], material);
    let bars = ((x[1] - x[0]) / 0.5).ceil() as usize;
    for bar in 0..=bars {
        let at = x[0] + (x[1] - x[0] - 0.04) * bar as f32 / bars as f32;
        plane.relief(part, [at, at + 0.04], [y + 0.1, y + 1.0], [1.04, 1.08], material);
    }
}

fn awning(part: &mut Part, plane: &Plane, x: [f32; 2], y: f32, material: u32) {
    let [a, b] = [plane.at(x[0], y, 0.02), plane.at(x[1], y, 0.02)];
    let [c, d] = [plane.at(x[1], y - 0.6, 1.3), plane.at(x[0], y - 0.6, 1.3)];
    part.quad([d, c, b, a], material);
    let under = Vec3::Y * -0.02;
    part.quad([a, b, c, d].map(|corner| corner + under), material);
    part.quad([d - Vec3::Y * 0.25, c - Vec3::Y * 0.25, c, d], material);
}
