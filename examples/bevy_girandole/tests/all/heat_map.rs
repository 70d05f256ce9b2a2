//! Heat maps show how lights are chosen, in place of the picture.

use bevy::prelude::*;
use bevy_girandole::{Estimate, GirandoleCamera, GirandoleLight};
use girandole::plan::HeatMap;

use crate::harness::{HEIGHT, Picture, Setup, WIDTH, app, new_pictures, pictures, set_camera, settle, single_frames};

/// The colours for 0 and for 1, in `heat.wgsl` of the library.
const LEAST: Vec3 = Vec3::new(0.02, 0.02, 0.25);
const MOST: Vec3 = Vec3::new(1.0, 0.9, 0.2);

/// A pixel of the ground.
const GROUND: usize = ((HEIGHT - 6) * WIDTH + WIDTH / 2) as usize;

fn picture(app: &mut App, estimate: Estimate) -> Picture {
    set_camera(app, |camera| camera.estimate = estimate);
    settle(app);
    pictures(app, 1).swap_remove(0)
}

/// Up to the rounding of the 16-bit floats of a picture.
fn is(color: Vec3, expected: Vec3) -> bool {
    (color - expected).abs().max_element() < 2.0e-3
}

fn ground_and_lamp(app: &mut App) -> Entity {
    let plane = app.world_mut().resource_mut::<Assets<Mesh>>().add(Plane3d::default().mesh().size(12.0, 12.0));
    let grey = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
    app.world_mut().spawn((Mesh3d(plane), MeshMaterial3d(grey)));
    let lamp = PointLight { intensity: 5000.0, range: 30.0, ..default() };
    app.world_mut().spawn((lamp, GirandoleLight, Transform::from_xyz(0.0, 2.0, 0.0))).id()
}

#[test]
fn the_history_grows_to_what_pixels_may_keep_and_is_lost_with_the_view() {
    let camera = GirandoleCamera { reused_frames: 4, ..single_frames() };
    let mut app = app(Setup { camera, ..default() });
    ground_and_lamp(&mut app);
    set_camera(&mut app, |camera| camera.estimate = Estimate::History);
    let shown = pictures(&mut app, 24);
    // Half of what is allowed is the pixel's own. A neighbour may lie beyond the ground.
    let last: Vec<f32> = shown[12..].iter().map(|shown| shown[GROUND].x).collect();
    let [least, most] = [last.iter().copied().reduce(f32::min), last.iter().copied().reduce(f32::max)];
    assert!(least > Some(0.49) && most > Some(0.99) && most < Some(1.01), "{last:?}");
    assert_eq!(shown[12][0], Vec3::ZERO, "no surface");
    // Nothing is kept of another setting.
    set_camera(&mut app, |camera| camera.history = 1);
    let shown: Vec<Picture> = (0..16).flat_map(|_| new_pictures(&mut app)).collect();
    let least = shown.iter().map(|shown| shown[GROUND].x).fold(1.0, f32::min);
    assert!(least == 0.0, "{least}");
}

#[test]
fn heat_maps_show_what_is_known_of_one_lamp() {
    let mut app = app(Setup::default());
    let lamp = ground_and_lamp(&mut app);
    let lit = picture(&mut app, Estimate::Sampled);
    assert!(lit[GROUND].max_element() > 0.0);

    let noise = picture(&mut app, Estimate::HeatMap(HeatMap::Noise));
    assert!(is(noise[GROUND], LEAST), "a single lamp has no noise: {}", noise[GROUND]);
    assert_eq!(noise[0], Vec3::ZERO, "no surface");
    let misses = picture(&mut app, Estimate::HeatMap(HeatMap::Misses));
    assert!(is(misses[GROUND], LEAST), "and is never missed: {}", misses[GROUND]);
    let lights = picture(&mut app, Estimate::HeatMap(HeatMap::Lights));
    assert!(lights[GROUND].min_element() > 0.09, "its colour is one of bright ones: {}", lights[GROUND]);
    let cuts = picture(&mut app, Estimate::HeatMap(HeatMap::Cuts));
    assert!(cuts[GROUND].min_element() > 0.09, "its cell has a cut: {}", cuts[GROUND]);
    assert!(!is(cuts[GROUND], lights[GROUND]) && !is(cuts[GROUND], lit[GROUND]), "{}", cuts[GROUND]);

    app.world_mut().get_mut::<Transform>(lamp).unwrap().translation.y = -2.0;
    let misses = picture(&mut app, Estimate::HeatMap(HeatMap::Misses));
    assert!(is(misses[GROUND], MOST), "below the ground it always is: {}", misses[GROUND]);
    let noise = picture(&mut app, Estimate::HeatMap(HeatMap::Noise));
    assert!(is(noise[GROUND], Vec3::ZERO), "no light arrives: {}", noise[GROUND]);

    app.world_mut().get_mut::<Transform>(lamp).unwrap().translation.y = 2.0;
    let again = picture(&mut app, Estimate::Sampled);
    let difference = lit.iter().zip(&again).map(|(a, b)| (a - b).abs().max_element()).fold(0.0, f32::max);
    assert!(difference < 2.0e-3 * lit[GROUND].max_element(), "no colour stays in the mean: {difference}");
}
