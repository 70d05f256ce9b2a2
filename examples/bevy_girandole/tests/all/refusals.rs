//! Lights that cannot be drawn are dark, are counted, and shine once they can be.

use bevy::prelude::*;
use bevy_girandole::GirandoleLight;

use crate::harness::{Setup, add_scene, app, brightness, report, settle, single_frames};

fn scene() -> App {
    let mut app = app(Setup { camera: single_frames(), ..default() });
    add_scene(&mut app);
    app
}

#[test]
fn a_light_with_negative_brightness_is_dark() {
    let mut app = scene();
    let lamp = PointLight { intensity: -1.0, ..default() };
    let entity = app.world_mut().spawn((lamp, GirandoleLight, Transform::from_xyz(0.0, 3.0, 0.0))).id();
    assert_eq!(brightness(&mut app), 0.0, "the light is refused");
    assert_eq!((report(&app).refused, report(&app).lights), (1, 0));

    app.world_mut().get_mut::<PointLight>(entity).unwrap().intensity = 1.0e5;
    assert!(brightness(&mut app) > 0.1, "the light is right again");
    app.world_mut().get_mut::<PointLight>(entity).unwrap().intensity = f32::NAN;
    assert_eq!(brightness(&mut app), 0.0, "a light that becomes wrong goes dark");
    assert_eq!((report(&app).refused, report(&app).lights), (2, 0));
}

#[test]
fn a_transform_that_is_refused_is_tried_again_when_it_changes() {
    let mut app = scene();
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.4, 0.1, 0.4));
    let glowing = StandardMaterial { emissive: LinearRgba::rgb(300.0, 300.0, 300.0), ..default() };
    let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(glowing);
    // A flat one would hide the light.
    let large = Transform::from_xyz(0.0, 3.0, 0.0).with_scale(Vec3::new(1.0, 1.0e10, 1.0));
    let entity = app.world_mut().spawn((Mesh3d(mesh), MeshMaterial3d(material), GirandoleLight, large)).id();
    settle(&mut app);
    assert_eq!(report(&app).lights, 0);
    assert!(report(&app).refused > 0);

    app.world_mut().get_mut::<Transform>(entity).unwrap().scale = Vec3::ONE;
    settle(&mut app);
    assert_eq!(report(&app).lights, 1);
    assert!(brightness(&mut app) > 0.1);
}
