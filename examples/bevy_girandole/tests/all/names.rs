//! Scenes that another renderer draws by ray tracing: the names of lights.

use bevy::camera::visibility::ViewVisibility;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy_girandole::{GirandoleLight, GirandoleName, GirandoleNames, GirandolePlugin};

use crate::harness::{Setup, app, report, settle};

/// `LIGHT_DIRECTIONAL` of the library's WGSL.
const DIRECTIONAL: u32 = u32::MAX;

/// The names, and how often they have changed.
fn names(app: &App) -> (Vec<GirandoleName>, u64) {
    let names = app.sub_app(RenderApp).world().resource::<GirandoleNames>();
    (names.lights().to_vec(), names.changes())
}

#[test]
fn lights_have_names_while_they_are_there() {
    let plugin = GirandolePlugin { ray_traced: true, ..default() };
    let mut app = app(Setup { plugin, ..default() });
    let world = app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::default());
    let glowing = StandardMaterial { emissive: LinearRgba::rgb(1.0, 2.0, 3.0), ..default() };
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(glowing);
    let add_cube =
        |world: &mut World| world.spawn((Mesh3d(mesh.clone()), MeshMaterial3d(material.clone()), GirandoleLight)).id();
    let (first, second) = (add_cube(world), add_cube(world));
    let sun = world.spawn((DirectionalLight::default(), GirandoleLight)).id();
    settle(&mut app);
    assert_eq!(report(&app).lights, 2);
    let (found, changes) = names(&app);
    let mut entities: Vec<_> = found.iter().map(|name| name.entity).collect();
    entities.sort_unstable();
    let mut expected = vec![first, second, sun];
    expected.sort_unstable();
    assert_eq!(entities, expected);
    assert!(found[0].instance != found[1].instance && found[1].instance != DIRECTIONAL, "{found:?}");
    assert_eq!((found[2].instance, found[2].light, found[2].entity), (DIRECTIONAL, 0, sun));
    assert!(app.world().get::<ViewVisibility>(sun).is_some(), "Bevy keeps it");

    app.world_mut().get_mut::<Transform>(first).expect("it is there").translation.x = 5.0;
    settle(&mut app);
    assert_eq!(names(&app), (found.clone(), changes), "a move changes no name");
    app.world_mut().despawn(first);
    app.world_mut().despawn(sun);
    settle(&mut app);
    let kept: Vec<_> = found.into_iter().filter(|name| name.entity == second).collect();
    assert_eq!(names(&app), (kept, changes + 1));
    let third = add_cube(app.world_mut());
    settle(&mut app);
    assert!(names(&app).0.iter().any(|name| name.entity == third));
}
