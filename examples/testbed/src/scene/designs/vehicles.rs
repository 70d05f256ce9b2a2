//! Cars, vans, taxis and buses: two white spots in front and two red rectangles at the back. They face -Z and stand
//! on y = 0, and the middle of their length and width is above the origin.

use std::f32::consts::TAU;

use girandole::Light;
use girandole::glam::{Affine3A, Quat, Vec2, Vec3, vec3};

use super::SceneError;
use super::assembly::{Assembly, Design};
use super::palette::{NEUTRAL, Palette};
use super::part::Part;

/// A shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Body {
    /// A car with a bonnet and a boot.
    Sedan,
    /// A short car with a steep back.
    Hatch,
    /// A tall box.
    Van,
    /// A sedan with a lit sign.
    Taxi,
    /// Lit inside.
    Bus,
}

const BODIES: [Body; 5] = [Body::Sedan, Body::Hatch, Body::Van, Body::Taxi, Body::Bus];

/// Linear colours of private cars.
const PAINTS: [[f32; 3]; 8] = [
    [0.55, 0.55, 0.56],
    [0.04, 0.04, 0.045],
    [0.45, 0.03, 0.03],
    [0.03, 0.08, 0.28],
    [0.7, 0.7, 0.68],
    [0.12, 0.13, 0.14],
    [0.05, 0.2, 0.12],
    [0.35, 0.3, 0.22],
];

/// Peak intensity of each headlight, candela.
const HEADLIGHT: f32 = 5_000.0;
/// Colours of headlights and of tail lights, and the nits of the lenses of headlights.
const WHITE: Vec3 = vec3(1.0, 0.95, 0.86);
const RED: Vec3 = vec3(1.0, 0.03, 0.015);
const LENS_NITS: f32 = 900.0;

impl Body {
    /// Length from bumper to bumper, width without mirrors, and height, metres.
    pub fn size(self) -> [f32; 3] {
        match self {
            Body::Sedan | Body::Taxi => [4.6, 1.76, 1.44],
            Body::Hatch => [3.9, 1.76, 1.5],
            Body::Van => [5.2, 1.76, 2.0],
            Body::Bus => [11.0, 2.5, 2.8],
        }
    }

    /// The colours that it comes in.
    fn paints(self) -> &'static [[f32; 3]] {
        match self {
            Body::Taxi => &[[0.75, 0.42, 0.02]],
            Body::Bus => &[[0.5, 0.05, 0.04]],
            _ => &PAINTS,
        }
    }

    /// Side profile: (z, y) of the upper outline of the lower body and of the cabin, from front to back.
    fn outline(self) -> [&'static [[f32; 2]]; 2] {
        match self {
            Body::Hatch => [
                &[[-1.95, 0.62], [-1.85, 0.8], [-0.95, 0.96], [1.85, 1.0], [1.95, 0.6]],
                &[[-1.05, 0.96], [-0.35, 1.48], [1.25, 1.5], [1.85, 1.0]],
            ],
            Body::Van => [
                &[[-2.6, 0.7], [-2.5, 0.95], [-1.9, 1.12], [2.55, 1.12], [2.6, 0.6]],
                &[[-1.95, 1.12], [-1.1, 1.95], [2.45, 2.0], [2.55, 1.12]],
            ],
            Body::Bus => [
                &[[-5.5, 0.6], [-5.48, 1.2], [5.48, 1.2], [5.5, 0.6]],
                &[[-5.48, 1.2], [-5.35, 2.8], [5.4, 2.8], [5.48, 1.2]],
            ],
            _ => [
                &[[-2.3, 0.62], [-2.2, 0.78], [-0.95, 0.93], [1.55, 0.97], [2.25, 0.92], [2.3, 0.6]],
                &[[-1.0, 0.93], [-0.3, 1.42], [0.85, 1.44], [1.65, 0.97]],
            ],
        }
    }
}

/// The designs of each body, one for each paint. All paints of a body share a light tree.
pub fn car_designs(assembly: &mut Assembly, palette: &mut Palette) -> Result<Vec<(Body, Vec<Design>)>, SceneError> {
    let mut kinds = Vec::new();
    for body in BODIES {
        let mut designs: Vec<Design> = Vec::new();
        for &paint in body.paints() {
            let part = car(body, paint, palette);
            designs.push(match designs.first() {
                Some(first) => Design { mesh: assembly.mesh(part.mesh), ..*first },
                None => assembly.design(part)?,
            });
        }
        kinds.push((body, designs));
    }
    Ok(kinds)
}

/// The transform of a car at (x, z) that is turned by `angle` radians about +Y.
pub fn car_transform(position: Vec2, angle: f32) -> Affine3A {
    Affine3A::from_rotation_translation(Quat::from_rotation_y(angle), vec3(position.x, 0.0, position.y))
}

fn car(body: Body, paint: [f32; 3], palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let paint = palette.glossy(paint, 0.3);
    let glass = palette.glossy([0.012, 0.014, 0.017], 0.12);
    let rubber = palette.matte(0.02, 0.02, 0.02);
    let rim = palette.metal([0.5, 0.5, 0.52], 0.4);
    let [lower, cabin] = body.outline();
    let ([length, width, height], is_bus) = (body.size(), body == Body::Bus);
    let (half_length, half_width) = (length * 0.5, width * 0.5);
    extrude(&mut part, lower, [half_width, half_width - 0.04], 0.28, [paint; 3]);
    let base = cabin[0][1].min(cabin[cabin.len() - 1][1]);
    if is_bus {
        let glow = palette.glow(NEUTRAL, 7.0);
        let end = 3.0 * 1.2;
        for (side, right) in [(1.0, Vec3::NEG_Z), (-1.0, Vec3::Z)] {
            for window in 0..4 {
                let z = -end + 2.0 * end * (window as f32 / 3.0);
                part.glow(vec3(side * (half_width + 0.01), 2.0, z), right * 1.05, Vec3::Y * 0.45, glow);
            }
        }
        extrude(&mut part, cabin, [half_width - 0.03, half_width - 0.06], base, [paint, glass, paint]);
    } else {
        let side = if body == Body::Van { paint } else { glass };
        extrude(&mut part, cabin, [half_width - 0.05, half_width - 0.2], base, [paint, glass, side]);
    }
    let [wheel, overhang, lamp] = if is_bus { [0.48, 2.4, 0.8] } else { [0.33, 0.85, 0.68] };
    for z in [overhang - half_length, half_length - overhang] {
        for side in [-1.0, 1.0] {
            let center = vec3(side * (half_width - 0.12 * 0.7), wheel, z);
            self::wheel(&mut part, center, side * 0.12, wheel, [rubber, rim]);
        }
    }
    lights(&mut part, half_length, half_width, lamp, palette);
    if body == Body::Taxi {
        let sign = palette.glow(vec3(1.0, 0.75, 0.25), 40.0);
        let board = palette.matte(0.05, 0.05, 0.05);
        part.cuboid(vec3(-0.35, height, 0.18), vec3(0.35, height + 0.22, 0.38), board);
        part.glow(vec3(0.0, height + 0.11, 0.385), Vec3::X * 0.33, Vec3::Y * 0.09, sign);
        part.glow(vec3(0.0, height + 0.11, 0.175), Vec3::NEG_X * 0.33, Vec3::Y * 0.09, sign);
    }
    part
}

/// Headlights at the given height, and tail lights. The lens of a headlight is visible but is no light; a spot just in
/// front of it lights the road.
fn lights(part: &mut Part, half_length: f32, half_width: f32, height: f32, palette: &mut Palette) {
    let (red, white) = (palette.glow(RED, 90.0), palette.glow(WHITE, LENS_NITS));
    for side in [-1.0, 1.0] {
        let x = side * (half_width - 0.24);
        let lens = vec3(x, height, -half_length - 0.012);
        let corners = [vec3(0.16, -0.07, 0.0), vec3(-0.16, -0.07, 0.0), vec3(-0.16, 0.07, 0.0), vec3(0.16, 0.07, 0.0)];
        part.quad(corners.map(|corner| lens + corner), white.material);
        let (beam, color) = (vec3(side * 0.05, -0.055, -1.0), white.radiance / white.radiance.max_element());
        let spot = Light::spot(lens - Vec3::Z * 0.06, beam.normalize(), 0.06, 0.5, color * HEADLIGHT);
        part.lights.push(spot.with_range(60.0));
        let tail = vec3(x, height + 0.1, half_length + 0.012);
        part.glow(tail, Vec3::X * 0.17, Vec3::Y * 0.075, red);
    }
}

/// Extrudes a side profile, (z, y) from front to back, that a plane at the height `floor` closes
/// below. `half` is the half width at the bottom and at the top: cabins are narrower at the top. The material `roof` is
/// that of the second piece of the profile.
fn extrude(part: &mut Part, profile: &[[f32; 2]], half: [f32; 2], floor: f32, [roof, ends, side]: [u32; 3]) {
    let top = profile.iter().map(|p| p[1]).fold(floor, f32::max);
    let at = |p: [f32; 2], sign: f32| {
        let blend = (p[1] - floor) / (top - floor);
        vec3(sign * (half[0] + (half[1] - half[0]) * blend), p[1], p[0])
    };
    for (index, pair) in profile.windows(2).enumerate() {
        let [a, b] = [pair[0], pair[1]];
        part.quad([at(a, -1.0), at(b, -1.0), at(b, 1.0), at(a, 1.0)], if index == 1 { roof } else { ends });
        let (low_a, low_b) = ([a[0], floor], [b[0], floor]);
        part.quad([at(low_b, 1.0), at(low_a, 1.0), at(a, 1.0), at(b, 1.0)], side);
        part.quad([at(low_a, -1.0), at(low_b, -1.0), at(b, -1.0), at(a, -1.0)], side);
    }
    for (end, sign) in [(profile[0], 1.0), (profile[profile.len() - 1], -1.0)] {
        let low = [end[0], floor];
        part.quad([at(low, -sign), at(end, -sign), at(end, sign), at(low, sign)], side);
    }
}

/// A wheel: a prism of ten sides about the X axis. `half` is half its width, with the sign of x on
/// its outer side.
fn wheel(part: &mut Part, center: Vec3, half: f32, radius: f32, [rubber, rim]: [u32; 2]) {
    let at = |side: usize, out: f32, scale: f32| {
        let (sin, cos) = (side as f32 / 10.0 * TAU).sin_cos();
        center + vec3(out, sin * radius * scale, cos * radius * scale)
    };
    for side in 0..10 {
        // The right wheel is the mirror image of the left one.
        let (a, b) = if half > 0.0 { (side + 1, side) } else { (side, side + 1) };
        part.quad([at(b, half, 1.0), at(b, -half, 1.0), at(a, -half, 1.0), at(a, half, 1.0)], rubber);
        part.triangle([center + Vec3::X * half, at(a, half, 1.0), at(b, half, 1.0)], rubber);
        part.triangle([center + Vec3::X * half * 1.1, at(a, half * 1.05, 0.6), at(b, half * 1.05, 0.6)], rim);
    }
}

#[cfg(test)]
mod tests {
    use girandole::Shape;

    use super::*;

    #[test]
    fn vehicles_have_the_stated_length_and_width_and_stand_on_the_ground() {
        for body in BODIES {
            let part = car(body, PAINTS[0], &mut Palette::default());
            let vertices = part.mesh.triangles.iter().flat_map(|triangle| triangle.vertices);
            let [low, high] = vertices.fold([Vec3::MAX, Vec3::MIN], |[low, high], at| [low.min(at), high.max(at)]);
            let [length, width, _] = body.size();
            // Lamps stick out.
            let ends = [low.z + 0.5 * length, high.z - 0.5 * length];
            assert!(ends.iter().all(|end| end.abs() < 0.03 * length + 0.1), "{body:?}: {ends:?}");
            let sides = [low.x + 0.5 * width, high.x - 0.5 * width];
            assert!(sides.iter().all(|side| side.abs() < 0.3), "{body:?}: {sides:?}");
            assert!(low.y > -0.02 && low.y < 0.1, "{body:?}: {}", low.y);
        }
    }

    #[test]
    fn lights_are_as_large_as_the_emissive_faces_and_each_body_has_two_headlights() {
        for body in BODIES {
            let mut palette = Palette::default();
            let part = car(body, PAINTS[0], &mut palette);
            let (mut faces, mut lenses) = (0.0, 0.0);
            let lens = palette.glow(WHITE, LENS_NITS).material;
            for triangle in &part.mesh.triangles {
                let emission = palette.materials[triangle.material as usize].emission.element_sum();
                let [a, b, c] = triangle.vertices;
                let power = emission * 0.5 * (b - a).cross(c - a).length();
                // The lenses of headlights have spots in place of area lights.
                *if triangle.material == lens { &mut lenses } else { &mut faces } += power;
            }
            let area = |shape: &Shape| match shape {
                Shape::Rectangle { half_u, half_v, .. } => 4.0 * half_u.cross(*half_v).length(),
                _ => 0.0,
            };
            let lights: f32 = part.lights.iter().map(|light| area(&light.shape) * light.emission.element_sum()).sum();
            let spots = part.lights.iter().filter(|light| area(&light.shape) == 0.0).count();
            assert!((0.999..1.001).contains(&(faces / lights)), "{body:?}: {faces} of faces, {lights} of lights");
            assert!(spots == 2 && lenses > 0.0, "{body:?}");
        }
    }

    #[test]
    fn paints_of_a_body_share_a_tree() {
        let (mut assembly, mut palette) = (Assembly::new(), Palette::default());
        let kinds = car_designs(&mut assembly, &mut palette).expect("valid lights");
        assert!(kinds.iter().all(|(_, designs)| designs.iter().all(|design| design.tree == designs[0].tree)));
        assert_eq!(assembly.world.trees().len(), BODIES.len());
    }
}
