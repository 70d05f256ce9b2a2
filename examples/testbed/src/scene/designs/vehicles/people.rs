//! People: on foot, and seated on what they ride.

use girandole::glam::{Vec3, vec3};

use super::body::Size;
use super::palette::{COOL, Palette};
use super::part::Part;

/// Materials of a person.
#[derive(Clone, Copy)]
pub struct Clothes {
    coat: u32,
    trousers: u32,
    skin: u32,
    hair: u32,
}

/// Clothes whose coat has the given colour.
pub fn clothes(coat: [f32; 3], palette: &mut Palette) -> Clothes {
    Clothes {
        coat: palette.matte(coat[0], coat[1], coat[2]),
        trousers: palette.matte(0.05, 0.055, 0.075),
        skin: palette.matte(0.45, 0.28, 0.2),
        hair: palette.matte(0.05, 0.035, 0.025),
    }
}

/// A head of the given radius, with its middle at `at`.
fn head(part: &mut Part, at: Vec3, radius: f32, clothes: Clothes) {
    part.ball(at, vec3(0.85, 1.15, 1.0) * radius, 8, clothes.skin);
    part.ball(at + vec3(0.0, 0.35, 0.2) * radius, vec3(0.95, 0.95, 1.0) * radius, 8, clothes.hair);
}

/// A person who walks. A glowing telephone is held in front of the chest if `has_phone` is set.
pub fn pedestrian(size: Size, coat: [f32; 3], has_phone: bool, palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let clothes = clothes(coat, palette);
    let [tall, wide] = [size.height(), size.width() * 0.5];
    let at = |x: f32, y: f32, z: f32| vec3(x * wide, y * tall, z * tall);
    for (side, step) in [(-1.0, -0.1), (1.0, 0.1)] {
        let [hip, knee, ankle] =
            [at(0.38 * side, 0.5, 0.0), at(0.4 * side, 0.27, 0.6 * step - 0.02), at(0.4 * side, 0.04, step + 0.01)];
        part.beam(hip, knee, 0.042 * tall, clothes.trousers);
        part.beam(knee, ankle, 0.034 * tall, clothes.trousers);
        part.beam(ankle + vec3(0.0, -0.015, 0.02), ankle + vec3(0.0, -0.015, -0.1) * tall, 0.025 * tall, clothes.hair);
        let shoulder = at(0.75 * side, 0.8, 0.0);
        let (elbow, hand) = if has_phone {
            (at(0.85 * side, 0.63, 0.0), at(0.25 * side, 0.68, -0.14))
        } else {
            (at(0.92 * side, 0.63, -step * 0.3), at(0.9 * side, 0.48, -step - 0.03))
        };
        part.beam(shoulder, elbow, 0.03 * tall, clothes.coat);
        part.beam(elbow, hand, 0.024 * tall, clothes.coat);
    }
    part.ball(at(0.0, 0.66, 0.0), vec3(0.8 * wide, 0.2 * tall, 0.075 * tall), 10, clothes.coat);
    part.ball(at(0.0, 0.52, 0.0), vec3(0.68 * wide, 0.1 * tall, 0.07 * tall), 8, clothes.coat);
    head(&mut part, at(0.0, 0.925, -0.01), 0.065 * tall, clothes);
    if has_phone {
        let screen = palette.glow(COOL, 150.0);
        let case = palette.matte(0.02, 0.02, 0.02);
        let middle = at(0.0, 0.71, -0.17);
        // It leans back, towards the face.
        let [right, up] = [Vec3::X * 0.035, vec3(0.0, 0.06, -0.04)];
        let toward = right.cross(up).normalize() * 0.004;
        part.oriented_box(middle - toward, right * 1.05, up * 1.05, toward * 0.5, case);
        part.glow(middle, right, up, screen);
    }
    part
}

/// A person who sits at `seat`, holds handlebars at `bar` and has the feet at `feet`. `half` is half
/// the distance between the hands, and `reach` the length of the back, metres.
pub fn rider(part: &mut Part, [seat, bar, feet]: [Vec3; 3], half: f32, reach: f32, clothes: Clothes) {
    let lean = (bar - seat).z.min(0.0) * 0.42;
    let shoulders = seat + vec3(0.0, (reach * reach - lean * lean).max(0.01).sqrt(), lean);
    part.oriented_box(
        (seat + shoulders) * 0.5,
        Vec3::X * 0.32 * reach,
        (shoulders - seat) * 0.52,
        Vec3::X.cross(shoulders - seat).normalize() * 0.2 * reach,
        clothes.coat,
    );
    head(part, shoulders + vec3(0.0, 0.36, -0.08) * reach, 0.2 * reach, clothes);
    for side in [-1.0, 1.0] {
        let out = Vec3::X * side;
        let (shoulder, hand) = (shoulders + out * 0.36 * reach, bar + out * half);
        let elbow = (shoulder + hand) * 0.5 + vec3(0.04 * side, -0.08, 0.03);
        part.beam(shoulder, elbow, 0.085 * reach, clothes.coat);
        part.beam(elbow, hand, 0.07 * reach, clothes.coat);
        // One foot is above the other, as on pedals.
        let foot = feet + out * 0.22 * reach + Vec3::Y * side * 0.12 * reach;
        let hip = seat + out * 0.16 * reach;
        let knee = (hip + foot) * 0.5 + vec3(0.02 * side, 0.12, -0.32) * reach;
        part.beam(hip, knee, 0.12 * reach, clothes.trousers);
        part.beam(knee, foot, 0.09 * reach, clothes.trousers);
        part.beam(foot, foot + Vec3::NEG_Z * 0.25 * reach, 0.06 * reach, clothes.hair);
    }
}
