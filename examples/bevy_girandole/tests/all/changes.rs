//! What the plugin does in a frame follows from what changed in it, counted.

use bevy::camera::visibility::NoFrustumCulling;
use bevy::prelude::*;
use bevy_girandole::{GirandoleLight, GirandolePlugin, GirandoleReport, NoGirandole};

use crate::harness::{Setup, add_scene, app, brightness, pictures, report, set_camera, settle, single_frames};

const LAMPS: usize = 1000;

/// What one instance takes of an upload, in bytes: its record of 160 bytes, and its share of
/// the tables of parts.
const BYTES_PER_MOVE: u64 = 256;

/// What an upload with any change sends beside the instances: parameters, passes of the build.
const BYTES_PER_FRAME: u64 = 4096;

/// The report of the frame in which `change` takes effect.
fn after(app: &mut App, change: impl FnOnce(&mut World)) -> GirandoleReport {
    change(app.world_mut());
    app.update();
    report(app)
}

fn lamps(app: &mut App, count: usize) -> Vec<Entity> {
    let lamp = PointLight { intensity: 5000.0, range: 10.0, ..default() };
    let lights = (0..count).map(|i| {
        let place = Transform::from_xyz((i % 40) as f32 * 0.3 - 6.0, 1.0, (i / 40) as f32 * 0.3 - 4.0);
        (lamp, GirandoleLight, place)
    });
    let lights: Vec<_> = lights.collect();
    app.world_mut().spawn_batch(lights).collect()
}

fn nothing(report: &GirandoleReport) -> bool {
    report.added + report.removed + report.moved + report.changed + report.instances == 0 && report.bytes == 0
}

#[test]
fn a_frame_does_what_changed_in_it_and_nothing_else() {
    let mut app = app(Setup::default());
    add_scene(&mut app);
    let entities = lamps(&mut app, LAMPS);
    let first = after(&mut app, |_| ());
    assert_eq!((first.added, first.lights, first.trees), (LAMPS, LAMPS, 1), "equal lamps share one tree");
    assert_eq!(first.refused, 0);
    settle(&mut app);

    let idle = after(&mut app, |_| ());
    assert!(nothing(&idle), "nothing changed, but {idle:?}");

    let moved = after(&mut app, |world| {
        for &entity in &entities[..10] {
            world.get_mut::<Transform>(entity).unwrap().translation.y += 0.5;
        }
    });
    assert_eq!((moved.moved, moved.instances, moved.added, moved.changed), (10, 10, 0, 0));
    assert!(moved.bytes <= 10 * BYTES_PER_MOVE + BYTES_PER_FRAME, "{moved:?}");
    let idle = after(&mut app, |_| ());
    assert!(nothing(&idle), "a move is sent once, but {idle:?}");

    let dimmed = after(&mut app, |world| world.get_mut::<PointLight>(entities[0]).unwrap().intensity = 100.0);
    assert_eq!((dimmed.changed, dimmed.instances, dimmed.trees), (1, 1, 1), "the dimmed lamp keeps its tree");

    let other = after(&mut app, |world| world.get_mut::<PointLight>(entities[0]).unwrap().range = 5.0);
    assert_eq!((other.changed, other.trees), (1, 2), "a lamp with another range is of another kind");
    let back = after(&mut app, |world| world.get_mut::<PointLight>(entities[0]).unwrap().range = 10.0);
    assert_eq!((back.changed, back.trees), (1, 1), "a kind without lamps goes");

    let hidden = after(&mut app, |world| {
        world.entity_mut(entities[1]).insert(Visibility::Hidden);
    });
    assert_eq!((hidden.changed, hidden.instances), (1, 1));

    let fewer = after(&mut app, |world| {
        world.despawn(entities[2]);
        world.entity_mut(entities[3]).remove::<PointLight>();
        world.entity_mut(entities[4]).remove::<GirandoleLight>();
    });
    assert_eq!(fewer.removed + after(&mut app, |_| ()).removed, 3);
    assert_eq!(report(&app).lights, LAMPS - 3);
    settle(&mut app);
    assert!(nothing(&after(&mut app, |_| ())));
}

#[test]
fn the_same_holds_with_pipelined_rendering() {
    let mut app = app(Setup { is_pipelined: true, ..default() });
    add_scene(&mut app);
    let entities = lamps(&mut app, LAMPS);
    settle(&mut app);
    let frames = 20;
    let mut moved = 0;
    for _ in 0..frames {
        // The render world draws the frame before at the same time, so reports come one frame late.
        moved += after(&mut app, |world| {
            for &entity in &entities {
                world.get_mut::<Transform>(entity).unwrap().translation.y += 0.01;
            }
        })
        .moved;
    }
    assert!(moved >= (frames - 2) * LAMPS, "{moved} moves arrived");
    settle(&mut app);
    assert!(nothing(&report(&app)), "{:?}", report(&app));
    assert_eq!(report(&app).lights, LAMPS);
}

#[test]
fn lights_of_all_kinds_come_and_go_with_their_entities() {
    let mut app = app(Setup { camera: single_frames(), ..default() });
    add_scene(&mut app);
    set_camera(&mut app, |camera| camera.candidates = 4);
    let (mesh, material) = {
        let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.4, 0.1, 0.4));
        let glowing = StandardMaterial { emissive: LinearRgba::rgb(300.0, 300.0, 300.0), ..default() };
        let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(glowing);
        (mesh, material)
    };
    let above = Transform::from_xyz(0.0, 3.0, 0.0);
    let world = app.world_mut();
    let spot = SpotLight { intensity: 1.0e5, ..default() };
    let down = Transform::from_xyz(0.0, 3.0, 0.0).looking_at(Vec3::ZERO, Vec3::Z);
    let all = [
        world.spawn((PointLight { intensity: 1.0e5, ..default() }, GirandoleLight, above)).id(),
        world.spawn((spot, GirandoleLight, down)).id(),
        world.spawn((DirectionalLight { illuminance: 100.0, ..default() }, GirandoleLight, down)).id(),
        world.spawn((Mesh3d(mesh), MeshMaterial3d(material.clone()), GirandoleLight, above)).id(),
    ];
    for &entity in &all {
        app.world_mut().entity_mut(entity).insert(Visibility::Hidden);
    }
    assert_eq!(brightness(&mut app), 0.0, "all lights are hidden");
    for &entity in &all {
        app.world_mut().entity_mut(entity).insert(Visibility::Visible);
        assert!(brightness(&mut app) > 0.1, "{entity} must shine");
        app.world_mut().entity_mut(entity).insert(Visibility::Hidden);
        assert_eq!(brightness(&mut app), 0.0, "{entity} is hidden again");
    }
    app.world_mut().entity_mut(all[3]).insert(Visibility::Visible);
    app.world_mut().resource_mut::<Assets<StandardMaterial>>().get_mut(&material).unwrap().emissive = LinearRgba::BLACK;
    assert_eq!(brightness(&mut app), 0.0, "the material went dark");
    app.world_mut().resource_mut::<Assets<StandardMaterial>>().get_mut(&material).unwrap().emissive = LinearRgba::WHITE;
    assert!(brightness(&mut app) > 0.0, "the material shines again");
    for entity in all {
        app.world_mut().despawn(entity);
    }
    assert_eq!(brightness(&mut app), 0.0);
    assert_eq!((report(&app).lights, report(&app).trees), (0, 0));
}

#[test]
fn bevy_lights_with_what_is_not_marked() {
    let camera = single_frames();
    let mut app = app(Setup { plugin: GirandolePlugin::default(), camera, ..default() });
    add_scene(&mut app);
    let light = PointLight { intensity: 1.0e5, ..default() };
    let entity = app.world_mut().spawn((light, NoGirandole, Transform::from_xyz(0.0, 3.0, 0.0))).id();
    let sum = |app: &mut App| pictures(app, 1).remove(0).iter().map(|pixel| pixel.element_sum()).sum::<f32>();
    let of_bevy = sum(&mut app);
    assert_eq!(report(&app).lights, 0);
    // A pass without samples adds nothing, so what remains in the picture is Bevy's.
    set_camera(&mut app, |camera| camera.samples = 0);
    assert_eq!(sum(&mut app), of_bevy);
    app.world_mut().entity_mut(entity).insert(GirandoleLight);
    assert_eq!(sum(&mut app), 0.0, "Bevy does not light with a light that is marked later");
    app.world_mut().entity_mut(entity).remove::<GirandoleLight>();
    assert_eq!(sum(&mut app), of_bevy, "and lights with it again when the marker goes");

    // Bevy has to see an entity with a mesh, so it keeps the light of that entity, too.
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Sphere::new(0.01));
    app.world_mut().entity_mut(entity).insert(GirandoleLight);
    settle(&mut app);
    app.world_mut().entity_mut(entity).insert((Mesh3d(mesh), NoFrustumCulling));
    assert_eq!(sum(&mut app), of_bevy);
    assert_eq!(report(&app).lights, 0);
}
