//! Cars, vans and buses: two white spots in front and two red rectangles at the back.

use girandole::glam::{Vec3, vec3};

use super::body::{Body, Size};
use super::lamps::{self, HEADLIGHT};
use super::palette::{NEUTRAL, Palette};
use super::panels::{axle, extrude};
use super::part::Part;

/// A bus that is longer than this has a third axle, metres.
const ARTICULATED: f32 = 14.5;

/// Side profile: (z, y) of the upper outline of the lower body and of the cabin, from front to
/// back, of a body of the usual size.
fn outline(body: Body) -> (&'static [[f32; 2]], &'static [[f32; 2]]) {
    match body {
        Body::Hatch => (
            &[[-1.95, 0.62], [-1.85, 0.8], [-0.95, 0.96], [1.85, 1.0], [1.95, 0.6]],
            &[[-1.05, 0.96], [-0.35, 1.48], [1.25, 1.5], [1.85, 1.0]],
        ),
        Body::Van | Body::Ambulance => (
            &[[-2.6, 0.7], [-2.5, 0.95], [-1.9, 1.12], [2.55, 1.12], [2.6, 0.6]],
            &[[-1.95, 1.12], [-1.1, 1.95], [2.45, 2.0], [2.55, 1.12]],
        ),
        Body::Bus => (
            &[[-5.5, 0.6], [-5.48, 1.2], [5.48, 1.2], [5.5, 0.6]],
            &[[-5.48, 1.2], [-5.35, 2.8], [5.4, 2.8], [5.48, 1.2]],
        ),
        _ => (
            &[[-2.3, 0.62], [-2.2, 0.78], [-0.95, 0.93], [1.55, 0.97], [2.25, 0.92], [2.3, 0.6]],
            &[[-1.0, 0.93], [-0.3, 1.42], [0.85, 1.44], [1.65, 0.97]],
        ),
    }
}

/// A car, van or bus of the given size.
pub fn car(body: Body, size: Size, paint: [f32; 3], palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let paint = match body {
        Body::Taxi => [0.75, 0.42, 0.02],
        Body::Bus => [0.5, 0.05, 0.04],
        Body::Police => [0.03, 0.05, 0.12],
        Body::Ambulance => [0.7, 0.69, 0.62],
        _ => paint,
    };
    let paint = palette.glossy(paint, 0.3);
    let glass = palette.glossy([0.012, 0.014, 0.017], 0.12);
    let rubber = palette.matte(0.02, 0.02, 0.02);
    let rim = palette.metal([0.5, 0.5, 0.52], 0.4);
    // An ambulance is an enlarged van, and others are enlarged from their usual sizes.
    let usual = if body == Body::Ambulance { Body::Van.size() } else { body.size() };
    let scale = vec3(size.width() / usual.width(), size.height() / usual.height(), size.length() / usual.length());
    let (lower, cabin) = outline(body);
    let [lower, cabin] = [lower, cabin].map(|line| line.iter().map(|[z, y]| [z * scale.z, y * scale.y]).collect());
    let (lower, cabin): (Vec<[f32; 2]>, Vec<[f32; 2]>) = (lower, cabin);
    let big = body == Body::Bus;
    let half_width = size.width() * 0.5;
    extrude(&mut part, &lower, [half_width, half_width - 0.04], 0.28 * scale.y, |_| paint, paint);
    let base = cabin[0][1].min(cabin[cabin.len() - 1][1]);
    let roof = half_width - if big { 0.06 } else { 0.2 * scale.x };
    let skin = |index: usize| if index == 1 { paint } else { glass };
    let is_box = matches!(body, Body::Van | Body::Ambulance);
    if big {
        // One window for each 2.4 m.
        let count = ((size.length() - 1.4) / 2.4).round().max(1.0);
        let end = (count - 1.0) * 1.2;
        let glow = palette.glow(NEUTRAL, 7.0);
        let half = [1.05, 0.45 * scale.y];
        lamps::lit_windows(&mut part, [-end, end], count as usize, half, [half_width + 0.01, 2.0 * scale.y], glow);
        extrude(&mut part, &cabin, [half_width - 0.03, roof], base, skin, paint);
    } else {
        extrude(&mut part, &cabin, [half_width - 0.05, roof], base, skin, if is_box { paint } else { glass });
    }
    let half_length = size.length() * 0.5;
    let wheel = if big { 0.48 } else { 0.33 * scale.y.clamp(0.5, 1.25) };
    let end = half_length - if big { 2.4 } else { 0.85 * scale.z };
    let middle = if big && size.length() > ARTICULATED { Some(0.1 * size.length()) } else { None };
    for z in [-end, end].into_iter().chain(middle) {
        axle(&mut part, z, half_width, 0.12, wheel, [rubber, rim]);
    }
    lights(&mut part, half_length, half_width, if big { 0.8 } else { 0.68 * scale.y }, palette);
    match body {
        Body::Taxi => sign(&mut part, size.height(), palette),
        Body::Police => lamps::beacons(&mut part, vec3(0.0, 1.42 * scale.y, 0.1), half_width * 0.55, palette),
        Body::Ambulance => {
            let z = -0.75 * scale.z;
            lamps::beacons(&mut part, vec3(0.0, 1.94 * scale.y, z), half_width * 0.6, palette);
            let red = palette.glossy([0.5, 0.04, 0.02], 0.4);
            for side in [-1.0, 1.0] {
                let at = vec3(side * half_width, 0.8 * scale.y, 0.0);
                let half = vec3(0.005, 0.09 * scale.y, half_length * 0.9);
                part.cuboid(at - half, at + half, red);
            }
        }
        _ => {}
    }
    part
}

/// Headlights at the given height, and tail lights.
fn lights(part: &mut Part, half_length: f32, half_width: f32, height: f32, palette: &mut Palette) {
    let red = lamps::red(palette);
    for side in [-1.0, 1.0] {
        let x = side * (half_width - 0.24);
        let lens = vec3(x, height, -half_length - 0.012);
        lamps::headlight(part, lens, [0.16, 0.07], vec3(side * 0.05, -0.055, -1.0), HEADLIGHT, palette);
        let tail = vec3(x, height + 0.1, half_length + 0.012);
        part.glow(tail, vec3(0.17, 0.0, 0.0), vec3(0.0, 0.075, 0.0), red);
    }
}

/// The lit sign on a roof at the given height.
fn sign(part: &mut Part, roof: f32, palette: &mut Palette) {
    let sign = palette.glow(vec3(1.0, 0.75, 0.25), 40.0);
    let board = palette.matte(0.05, 0.05, 0.05);
    part.cuboid(vec3(-0.35, roof, 0.18), vec3(0.35, roof + 0.22, 0.38), board);
    part.glow(vec3(0.0, roof + 0.11, 0.385), Vec3::X * 0.33, Vec3::Y * 0.09, sign);
    part.glow(vec3(0.0, roof + 0.11, 0.175), Vec3::NEG_X * 0.33, Vec3::Y * 0.09, sign);
}
