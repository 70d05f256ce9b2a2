//! One light, drawn by Girandole and by Bevy's own renderer: the pictures agree.

use bevy::prelude::*;
use bevy_girandole::{GirandoleLight, GirandolePlugin};

use crate::harness::{PIXELS, Picture, Setup, add_scene, app, pictures};

/// Both pictures are rounded to halves, with 11 bits, once when lit and once when blitted; Bevy
/// stores the direction of a spot with a component that it derives from the others, and brightness
/// with 32 bits. Four roundings, of which each is at most 2⁻¹¹.
const TOLERANCE: f32 = 4.0 / 2048.0;

/// What a pixel that should be black may have, against the brightest pixel.
const BLACK: f32 = 1.0e-4;

fn draw(light: impl Bundle, is_girandole: bool) -> Picture {
    // Bevy's lights cast no shadows unless they are told to.
    let plugin = GirandolePlugin { shadows: false, ..default() };
    let mut app = app(Setup { plugin, ..default() });
    add_scene(&mut app);
    let mut entity = app.world_mut().spawn(light);
    if is_girandole {
        entity.insert(GirandoleLight);
    }
    pictures(&mut app, 1).remove(0)
}

fn compare(name: &str, light: impl Bundle + Clone) {
    let [bevy, girandole] = [false, true].map(|is_girandole| draw(light.clone(), is_girandole));
    let brightest = bevy.iter().map(|pixel| pixel.max_element()).fold(0.0, f32::max);
    let lit = bevy.iter().filter(|pixel| pixel.max_element() > 0.01 * brightest).count();
    assert!(lit > PIXELS / 8, "{name}: the light must be seen, but lights {lit} pixels");
    for (i, (bevy, girandole)) in bevy.iter().zip(&girandole).enumerate() {
        let difference = (*bevy - *girandole).abs().max_element();
        let allowed = TOLERANCE * bevy.max_element() + BLACK * brightest;
        assert!(difference <= allowed, "{name}, pixel {i}: Bevy has {bevy}, Girandole has {girandole}");
    }
}

#[test]
fn a_point_light_is_that_of_bevy() {
    let point = PointLight { intensity: 2.0e5, range: 9.0, color: Color::linear_rgb(1.0, 0.5, 0.2), ..default() };
    compare("point", (point, Transform::from_xyz(0.5, 3.0, 1.0)));
}

#[test]
fn a_point_light_with_a_radius_is_that_of_bevy() {
    let point = PointLight { intensity: 2.0e5, range: 30.0, radius: 0.5, ..default() };
    compare("radius", (point, Transform::from_xyz(0.5, 6.0, 3.0)));
}

#[test]
fn a_spot_is_that_of_bevy() {
    let spot = SpotLight { intensity: 4.0e5, range: 12.0, inner_angle: 0.3, outer_angle: 0.6, ..default() };
    compare("spot", (spot, Transform::from_xyz(1.0, 5.0, 3.0).looking_at(Vec3::new(0.3, 0.0, 0.1), Vec3::Y)));
}

#[test]
fn a_directional_light_is_that_of_bevy() {
    let sun = DirectionalLight { illuminance: 3000.0, color: Color::linear_rgb(0.8, 0.9, 1.0), ..default() };
    compare("directional", (sun, Transform::from_xyz(1.0, 4.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y)));
}
