//! Components, assets and cameras come and go in any order.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use bevy_girandole::{Estimate, GirandoleCamera, GirandoleLight};

use crate::harness::{Setup, add_scene, app, brightness, frame, report, set_camera, settle, single_frames};

fn lights(app: &mut App) -> usize {
    settle(app);
    report(app).lights
}

struct Glowing {
    app: App,
    entity: Entity,
    mesh: Handle<Mesh>,
    material: Handle<StandardMaterial>,
}

/// One marked mesh, which shines.
fn glowing() -> Glowing {
    let mut app = app(Setup { camera: single_frames(), ..default() });
    add_scene(&mut app);
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.4, 0.1, 0.4));
    let emitting = StandardMaterial { emissive: LinearRgba::rgb(300.0, 300.0, 300.0), ..default() };
    let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(emitting);
    let parts = (Mesh3d(mesh.clone()), MeshMaterial3d(material.clone()), GirandoleLight);
    let entity = app.world_mut().spawn((parts, Transform::from_xyz(0.0, 3.0, 0.0))).id();
    assert_eq!(lights(&mut app), 1);
    Glowing { app, entity, mesh, material }
}

#[test]
fn a_light_survives_a_mesh_on_its_entity() {
    let mut app = app(Setup::default());
    add_scene(&mut app);
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Sphere::new(0.01));
    let entity = app.world_mut().spawn((PointLight::default(), GirandoleLight)).id();
    assert_eq!(lights(&mut app), 1);
    app.world_mut().entity_mut(entity).insert(Mesh3d(mesh));
    assert_eq!(lights(&mut app), 0, "Bevy keeps an entity with both");
    app.world_mut().entity_mut(entity).remove::<Mesh3d>();
    assert_eq!(lights(&mut app), 1, "the mesh is gone");

    app.world_mut().entity_mut(entity).insert(SpotLight::default());
    assert_eq!(lights(&mut app), 1);
    app.world_mut().entity_mut(entity).remove::<PointLight>();
    assert_eq!((lights(&mut app), report(&app).trees), (1, 1), "the spot is left");
}

#[test]
fn an_emissive_mesh_survives_a_light_on_its_entity() {
    let Glowing { mut app, entity, .. } = glowing();
    app.world_mut().entity_mut(entity).insert(PointLight::default());
    assert_eq!(lights(&mut app), 0, "Bevy keeps an entity with both");
    app.world_mut().entity_mut(entity).remove::<PointLight>();
    assert_eq!(lights(&mut app), 1, "the light component is gone");
}

#[test]
fn a_mesh_without_its_material_or_triangles_is_dark() {
    let Glowing { mut app, entity, mesh, material } = glowing();
    app.world_mut().entity_mut(entity).remove::<MeshMaterial3d<StandardMaterial>>();
    assert_eq!(lights(&mut app), 0, "the component is gone");
    app.world_mut().entity_mut(entity).insert(MeshMaterial3d(material.clone()));
    assert_eq!(lights(&mut app), 1);

    let empty = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::all())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, Vec::<[f32; 3]>::new());
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(mesh.id(), empty).unwrap();
    assert_eq!(brightness(&mut app), 0.0, "the mesh has no triangles");
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(mesh.id(), Cuboid::new(0.4, 0.1, 0.4).into()).unwrap();
    assert!(brightness(&mut app) > 0.1, "the mesh has triangles again");

    app.world_mut().resource_mut::<Assets<StandardMaterial>>().remove(material.id());
    assert_eq!(lights(&mut app), 0, "the material is gone");
}

#[test]
fn an_event_without_a_change_sends_nothing() {
    let Glowing { mut app, material, .. } = glowing();
    let lamp = app.world_mut().spawn((PointLight::default(), GirandoleLight)).id();
    settle(&mut app);
    app.world_mut().get_mut::<PointLight>(lamp).unwrap().set_changed();
    app.world_mut().resource_mut::<Assets<StandardMaterial>>().get_mut(&material).unwrap().perceptual_roughness = 0.9;
    // The event of the material arrives within two frames.
    for _ in 0..3 {
        app.update();
        assert_eq!(report(&app).changed, 0);
    }
}

#[test]
fn the_mean_starts_anew_after_frames_without_the_camera() {
    let mut app = app(Setup::default());
    add_scene(&mut app);
    set_camera(&mut app, |camera| *camera = GirandoleCamera { moving_frames: 1000, still_frames: 1000, ..*camera });
    let lamp = PointLight { intensity: 1.0e5, ..default() };
    let entity = app.world_mut().spawn((lamp, GirandoleLight, Transform::from_xyz(0.0, 3.0, 0.0))).id();
    assert!(brightness(&mut app) > 0.1);
    let set_active = |app: &mut App, is_active| {
        let mut cameras = app.world_mut().query::<&mut Camera>();
        cameras.single_mut(app.world_mut()).unwrap().is_active = is_active;
    };
    set_active(&mut app, false);
    settle(&mut app);
    app.world_mut().despawn(entity);
    settle(&mut app);
    set_active(&mut app, true);
    assert_eq!(brightness(&mut app), 0.0, "nothing of the light is left in the mean");
}

#[test]
fn the_mean_forgets_surfaces_as_they_were() {
    // With the sum over all lights, pictures differ by surfaces alone.
    let camera = GirandoleCamera { estimate: Estimate::Exhaustive, reused_frames: 0, ..default() };
    let mut app = app(Setup { camera, ..default() });
    add_scene(&mut app);
    let lamp = (PointLight { intensity: 1.0e5, ..default() }, GirandoleLight, Transform::from_xyz(0.0, 3.0, 0.0));
    app.world_mut().spawn(lamp);
    (0..40).for_each(|_| frame(&mut app));
    let bright = brightness(&mut app);
    let mut materials = app.world_mut().resource_mut::<Assets<StandardMaterial>>();
    let all: Vec<_> = materials.ids().collect();
    all.into_iter().for_each(|id| materials.get_mut(id).unwrap().base_color = Color::linear_rgb(0.1, 0.1, 0.1));
    (0..100).for_each(|_| frame(&mut app));
    let mean = brightness(&mut app);
    set_camera(&mut app, |camera| camera.history += 1);
    let dark = brightness(&mut app);
    assert!(dark < 0.5 * bright, "{dark} {bright}");
    assert!((mean - dark).abs() < 0.01 * dark, "{mean} in place of {dark}");
}
