//! Vehicles with cabins, wheels and lights: two white spots in front and two red rectangles at the
//! back. They face -Z.

use girandole::Light;
use girandole::glam::{Affine3A, Quat, Vec2, Vec3, vec3};

use super::SceneError;
use super::assembly::{Assembly, Design};
use super::palette::{NEUTRAL, Palette};
use super::part::Part;

/// The shape of a vehicle's body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Body {
    /// A car with a bonnet and a boot.
    Sedan,
    /// A short car with a steep back.
    Hatch,
    /// A tall box.
    Van,
    /// A sedan with a lit sign.
    Taxi,
    /// 11 m long, lit inside.
    Bus,
}

/// All shapes.
pub const BODIES: [Body; 5] = [Body::Sedan, Body::Hatch, Body::Van, Body::Taxi, Body::Bus];
/// Peak intensity of each of two headlights, candela.
const HEADLIGHT: f32 = 5_000.0;

/// Linear colours of private cars. Taxis and buses have colours of their own.
pub const PAINTS: [[f32; 3]; 8] = [
    [0.55, 0.55, 0.56],
    [0.04, 0.04, 0.045],
    [0.45, 0.03, 0.03],
    [0.03, 0.08, 0.28],
    [0.7, 0.7, 0.68],
    [0.12, 0.13, 0.14],
    [0.05, 0.2, 0.12],
    [0.35, 0.3, 0.22],
];

/// A body and one of its paints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Appearance {
    /// The body.
    pub body: Body,
    /// Index into [`PAINTS`], below [`Body::paints`].
    pub paint: usize,
}

impl Body {
    /// Length from bumper to bumper, metres.
    pub fn length(self) -> f32 {
        match self {
            Body::Sedan | Body::Taxi => 4.6,
            Body::Hatch => 3.9,
            Body::Van => 5.2,
            Body::Bus => 11.0,
        }
    }

    /// Number of [`PAINTS`] that the body comes in.
    pub fn paints(self) -> usize {
        match self {
            Body::Taxi | Body::Bus => 1,
            _ => PAINTS.len(),
        }
    }

    /// Side profile: (z, y) of the upper outline of the lower body and of the cabin, from front to
    /// back.
    fn outline(self) -> (&'static [[f32; 2]], &'static [[f32; 2]]) {
        match self {
            Body::Sedan | Body::Taxi => (
                &[[-2.3, 0.62], [-2.2, 0.78], [-0.95, 0.93], [1.55, 0.97], [2.25, 0.92], [2.3, 0.6]],
                &[[-1.0, 0.93], [-0.3, 1.42], [0.85, 1.44], [1.65, 0.97]],
            ),
            Body::Hatch => (
                &[[-1.95, 0.62], [-1.85, 0.8], [-0.95, 0.96], [1.85, 1.0], [1.95, 0.6]],
                &[[-1.05, 0.96], [-0.35, 1.48], [1.25, 1.5], [1.85, 1.0]],
            ),
            Body::Van => (
                &[[-2.6, 0.7], [-2.5, 0.95], [-1.9, 1.12], [2.55, 1.12], [2.6, 0.6]],
                &[[-1.95, 1.12], [-1.1, 1.95], [2.45, 2.0], [2.55, 1.12]],
            ),
            Body::Bus => (
                &[[-5.5, 0.6], [-5.48, 1.2], [5.48, 1.2], [5.5, 0.6]],
                &[[-5.48, 1.2], [-5.35, 2.8], [5.4, 2.8], [5.48, 1.2]],
            ),
        }
    }
}

/// The designs of each body, one for each paint. All paints of a body share a light tree.
pub fn car_designs(assembly: &mut Assembly, palette: &mut Palette) -> Result<Vec<(Body, Vec<Design>)>, SceneError> {
    let mut kinds = Vec::new();
    for body in BODIES {
        let mut designs: Vec<Design> = Vec::new();
        for &paint in &PAINTS[..body.paints()] {
            let part = vehicle(body, paint, palette);
            designs.push(match designs.first() {
                Some(first) => Design { mesh: assembly.mesh(part.mesh), tree: first.tree },
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

/// Extrudes a side profile, (z, y) from front to back, that a plane at the height `floor` closes
/// below. `half` is the half width at the bottom and at the top: cabins are narrower at the top.
fn extrude(
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

/// A vehicle with its centre above the origin and its wheels on y = 0.
pub fn vehicle(body: Body, paint: [f32; 3], palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let paint = match body {
        Body::Taxi => [0.75, 0.42, 0.02],
        Body::Bus => [0.5, 0.05, 0.04],
        _ => paint,
    };
    let paint = palette.glossy(paint, 0.3);
    let glass = palette.glossy([0.012, 0.014, 0.017], 0.12);
    let rubber = palette.matte(0.02, 0.02, 0.02);
    let rim = palette.metal([0.5, 0.5, 0.52], 0.4);
    let (lower, cabin) = body.outline();
    let big = body == Body::Bus;
    let half_width = if big { 1.25 } else { 0.88 };
    extrude(&mut part, lower, [half_width, half_width - 0.04], 0.28, |_| paint, paint);
    let (base, roof) = (cabin[0][1].min(cabin[cabin.len() - 1][1]), half_width - if big { 0.06 } else { 0.2 });
    let skin = |index: usize| if index == 1 { paint } else { glass };
    if big {
        lit_sides(&mut part, half_width, palette);
        extrude(&mut part, cabin, [half_width - 0.03, roof], base, skin, paint);
    } else {
        extrude(&mut part, cabin, [half_width - 0.05, roof], base, skin, if body == Body::Van { paint } else { glass });
    }
    let half_length = body.length() * 0.5;
    let wheel = if big { 0.48 } else { 0.33 };
    let axle = half_length - if big { 2.4 } else { 0.85 };
    for (x, z) in [(-1.0, -axle), (1.0, -axle), (-1.0, axle), (1.0, axle)] {
        wheel_at(&mut part, vec3(x * (half_width - 0.08), wheel, z), x * 0.12, wheel, [rubber, rim]);
    }
    lights(&mut part, body, half_length, half_width, palette);
    part
}

/// A wheel: a prism of ten sides about the X axis. `half` is half its width, with the sign of x on
/// its outer side.
fn wheel_at(part: &mut Part, center: Vec3, half: f32, radius: f32, [rubber, rim]: [u32; 2]) {
    let at = |side: usize, out: f32, scale: f32| {
        let (sin, cos) = (side as f32 / 10.0 * std::f32::consts::TAU).sin_cos();
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

/// A bus's side windows, lit from inside.
fn lit_sides(part: &mut Part, half_width: f32, palette: &mut Palette) {
    let glow = palette.glow(NEUTRAL, 7.0);
    for (side, right) in [(1.0, Vec3::NEG_Z), (-1.0, Vec3::Z)] {
        for window in 0..4 {
            let z = -3.6 + window as f32 * 2.4;
            part.glow(vec3(side * (half_width + 0.01), 2.0, z), right * 1.05, Vec3::Y * 0.45, glow);
        }
    }
}

fn lights(part: &mut Part, body: Body, half_length: f32, half_width: f32, palette: &mut Palette) {
    let white = palette.glow(vec3(1.0, 0.95, 0.86), 900.0);
    let red = palette.glow(vec3(1.0, 0.03, 0.015), 90.0);
    let height = if body == Body::Bus { 0.8 } else { 0.68 };
    for side in [-1.0, 1.0] {
        let x = side * (half_width - 0.24);
        // The lens is only visible; the spot just in front of it lights the road.
        let lens = vec3(x, height, -half_length - 0.012);
        let corners = [vec3(0.16, -0.07, 0.0), vec3(-0.16, -0.07, 0.0), vec3(-0.16, 0.07, 0.0), vec3(0.16, 0.07, 0.0)];
        part.quad(corners.map(|corner| lens + corner), white.material);
        let beam = vec3(side * 0.05, -0.055, -1.0).normalize();
        let color = white.radiance / white.radiance.max_element();
        part.lights
            .push(Light::spot(lens + vec3(0.0, 0.0, -0.06), beam, 0.06, 0.5, color * HEADLIGHT).with_range(60.0));
        let tail = vec3(x, height + 0.1, half_length + 0.012);
        part.glow(tail, vec3(0.17, 0.0, 0.0), vec3(0.0, 0.075, 0.0), red);
    }
    if body == Body::Taxi {
        let sign = palette.glow(vec3(1.0, 0.75, 0.25), 40.0);
        let board = palette.matte(0.05, 0.05, 0.05);
        part.cuboid(vec3(-0.35, 1.44, 0.18), vec3(0.35, 1.66, 0.38), board);
        part.glow(vec3(0.0, 1.55, 0.385), Vec3::X * 0.33, Vec3::Y * 0.09, sign);
        part.glow(vec3(0.0, 1.55, 0.175), Vec3::NEG_X * 0.33, Vec3::Y * 0.09, sign);
    }
}
