//! Shadows are where geometry says they are.

use std::f32::consts::FRAC_PI_4;

use bevy::light::NotShadowCaster;
use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy_girandole::{Estimate, GirandoleCamera, GirandoleLight, GirandolePlugin};

use crate::harness::{HEIGHT, Picture, Setup, WIDTH, app, pictures, report, settle};

pub const LAMP: Vec3 = Vec3::new(-1.0, 4.0, 0.5);

/// What casts a shadow, in its own space.
#[derive(Clone, Copy)]
pub enum Solid {
    /// A cube with edges of 1.
    Cube,
    /// A sphere with a radius of 1, whose triangles lie between this radius and 1.
    Sphere(f32),
}

impl Solid {
    /// Whether the way from one point to another leads through the solid, made smaller or larger by a share.
    pub fn is_met(self, placed: &Affine3A, from: Vec3, to: Vec3, share: f32) -> bool {
        let inverse = placed.inverse();
        let [from, to] = [from, to].map(|point| inverse.transform_point3(point));
        let way = to - from;
        match self {
            Self::Cube => {
                let [a, b] = [-0.5, 0.5].map(|side| (Vec3::splat(side * share) - from) / way);
                let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
                enter.max(0.0) <= leave.min(1.0)
            }
            Self::Sphere(inner) => {
                let radius = if share < 1.0 { inner * share } else { share };
                let nearest = from + way * (-from.dot(way) / way.length_squared()).clamp(0.0, 1.0);
                nearest.length() <= radius
            }
        }
    }
}

fn camera() -> (Vec3, Transform) {
    let eye = Vec3::new(0.0, 3.0, 6.0);
    (eye, Transform::from_translation(eye).looking_at(Vec3::ZERO, Vec3::Y))
}

/// The point of the floor in a place of the picture.
fn floor_at(x: f32, y: f32) -> Option<Vec3> {
    let (eye, placed) = camera();
    let (width, height) = (WIDTH as f32, HEIGHT as f32);
    let half = (0.5 * FRAC_PI_4).tan();
    let across = (2.0 * x / width - 1.0) * half * width / height;
    let direction = placed.rotation * Vec3::new(across, (1.0 - 2.0 * y / height) * half, -1.0);
    let point = eye - direction * (eye.y / direction.y);
    (direction.y < 0.0 && point.x.abs() < 6.0 && point.z.abs() < 6.0).then_some(point)
}

/// Whether all of a pixel of the floor is in the shadow of a solid, or none of it; `None` where that is not so, and
/// where the camera sees no floor.
fn is_dark(solid: Solid, placed: &Affine3A, x: u32, y: u32) -> Option<bool> {
    let (eye, _) = camera();
    let mut count = 0;
    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.5)] {
        let floor = floor_at(x as f32 + dx, y as f32 + dy)?;
        let [least, most] = [0.97, 1.03].map(|share| solid.is_met(placed, floor, LAMP, share));
        if least != most || solid.is_met(placed, eye, floor, 1.03) {
            return None;
        }
        count += usize::from(most);
    }
    (count % 5 == 0).then_some(count == 5)
}

/// Compares a picture with one without shadows.
fn check(name: &str, (solid, placed): (Solid, &Transform), shadowed: &Picture, plain: &Picture) {
    let mut counts = [0; 2];
    for (i, (with, without)) in (0..).zip(shadowed.iter().zip(plain)) {
        let Some(is_dark) = is_dark(solid, &placed.compute_affine(), i % WIDTH, i / WIDTH) else { continue };
        counts[usize::from(is_dark)] += 1;
        let expected = if is_dark { Vec3::ZERO } else { *without };
        // Halves are rounded alike in both pictures.
        assert_eq!(*with, expected, "{name}, pixel {} {}: dark is {is_dark}", i % WIDTH, i / WIDTH);
        assert!(without.min_element() > 0.0, "the lamp lights all of the floor");
    }
    assert!(counts[0] > 100 && counts[1] > 10, "{name}: {counts:?} pixels tell");
}

/// A floor and a lamp, whose sums over all lights are drawn. The mean is of thousands of frames unless something
/// changes, so a change that did not restart it would be seen to lag.
fn floor(shadows: bool) -> App {
    floor_of(Setup { plugin: GirandolePlugin { shadows, ..default() }, ..default() })
}

/// The same in another application.
pub fn floor_of(setup: Setup) -> App {
    let camera = GirandoleCamera { estimate: Estimate::Exhaustive, moving_frames: 1, ..default() };
    let mut app = app(Setup { camera, ..setup });
    let world = app.world_mut();
    let plane = world.resource_mut::<Assets<Mesh>>().add(Plane3d::default().mesh().size(12.0, 12.0));
    let plastic = world.resource_mut::<Assets<StandardMaterial>>().add(Color::WHITE);
    world.spawn((Mesh3d(plane), MeshMaterial3d(plastic)));
    let lamp = PointLight { intensity: 100_000.0, range: 50.0, ..default() };
    world.spawn((lamp, GirandoleLight, Transform::from_translation(LAMP)));
    app
}

pub fn add(app: &mut App, mesh: impl Into<Mesh>, placed: Transform) -> Entity {
    let world = app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(Color::BLACK);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), placed)).id()
}

pub fn picture(app: &mut App) -> Picture {
    pictures(app, 1).remove(0)
}

pub fn turned() -> Transform {
    let rotation = Quat::from_euler(EulerRot::XYZ, 0.4, 0.9, -0.3);
    Transform::from_xyz(-0.6, 1.6, 0.2).with_rotation(rotation).with_scale(Vec3::new(1.5, 0.4, 2.0))
}

#[test]
fn shadows_are_where_geometry_says_and_follow_what_casts_them() {
    let plain = picture(&mut floor(false));
    let mut app = floor(true);
    assert_eq!(picture(&mut app), plain, "the floor casts no shadow on itself");

    let cube = add(&mut app, Cuboid::default(), turned());
    settle(&mut app);
    check("a turned cube", (Solid::Cube, &turned()), &picture(&mut app), &plain);
    assert_eq!((report(&app).casters, report(&app).bytes), (2, 0), "a still frame uploads nothing");

    // Moved, turned again, and sheared by a parent.
    for step in 1..4 {
        let step = step as f32;
        let placed = turned().with_translation(Vec3::new(0.5 * step - 1.0, 1.5, 0.3 * step));
        *app.world_mut().get_mut::<Transform>(cube).expect("it has one") = placed;
        settle(&mut app);
        check("moved", (Solid::Cube, &placed), &picture(&mut app), &plain);
    }

    // Another mesh, of which the triangles are within a hundredth of the sphere.
    let sphere = app.world_mut().resource_mut::<Assets<Mesh>>().add(Sphere::new(1.0).mesh().ico(12).expect("small"));
    let placed = Transform::from_xyz(-0.5, 1.5, 0.5).with_scale(Vec3::new(0.7, 0.5, 0.9));
    app.world_mut().entity_mut(cube).insert((Mesh3d(sphere), placed));
    settle(&mut app);
    let round = picture(&mut app);
    check("a sphere", (Solid::Sphere(0.99), &placed), &round, &plain);

    let mut unlearnt = floor_of(Setup { plugin: GirandolePlugin { learning: None, ..default() }, ..default() });
    add(&mut unlearnt, Sphere::new(1.0).mesh().ico(12).expect("small"), placed);
    settle(&mut unlearnt);
    assert_eq!(picture(&mut unlearnt), round);
}

#[test]
fn what_is_hidden_exempt_or_clear_casts_no_shadow() {
    let plain = picture(&mut floor(false));
    let mut app = floor(true);
    let cube = add(&mut app, Cuboid::default(), turned());
    settle(&mut app);
    let dark = picture(&mut app);
    check("solid", (Solid::Cube, &turned()), &dark, &plain);
    let material = app.world().get::<MeshMaterial3d<StandardMaterial>>(cube).expect("it has one").0.clone();
    let set_alpha = |app: &mut App, mode| {
        let mut materials = app.world_mut().resource_mut::<Assets<StandardMaterial>>();
        materials.get_mut(&material).expect("it is there").alpha_mode = mode;
    };
    let casters = |app: &mut App| {
        settle(app);
        report(app).casters
    };
    assert_eq!(casters(&mut app), 2);
    app.world_mut().entity_mut(cube).insert(Visibility::Hidden);
    assert_eq!(picture(&mut app), plain, "hidden");
    app.world_mut().entity_mut(cube).insert(Visibility::Visible);
    assert_eq!(picture(&mut app), dark, "shown again");
    app.world_mut().entity_mut(cube).insert(NotShadowCaster);
    assert_eq!(casters(&mut app), 1, "exempt");
    app.world_mut().entity_mut(cube).remove::<NotShadowCaster>();
    assert_eq!(casters(&mut app), 2);
    set_alpha(&mut app, AlphaMode::Blend);
    assert_eq!(casters(&mut app), 1, "clear");
    set_alpha(&mut app, AlphaMode::Mask(0.5));
    assert_eq!(casters(&mut app), 2, "with holes");
    app.world_mut().entity_mut(cube).remove::<Mesh3d>();
    assert_eq!(casters(&mut app), 1, "without a mesh");
    app.world_mut().entity_mut(cube).despawn();
    assert_eq!(picture(&mut app), plain, "gone");
}
