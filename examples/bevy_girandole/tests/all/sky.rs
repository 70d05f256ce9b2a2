//! The sky lights the scene from where Bevy's environment map does, and comes and goes with its component.

use bevy::asset::RenderAssetUsages;
use bevy::light::EnvironmentMapLight;
use bevy::prelude::*;
use bevy::render::render_resource::{
    Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
use bevy_girandole::{GirandoleCamera, GirandolePlugin, GirandoleSky};

use crate::harness::{PIXELS, Setup, add_scene, app, brightness, pictures, report, settle, single_frames};

/// Frames of which a mean is taken.
const FRAMES: usize = 8;

/// A cubemap with one texel on each face, of which one is white.
fn white_face(white: usize) -> Image {
    let size = Extent3d { width: 1, height: 1, depth_or_array_layers: 6 };
    let texel = |face: usize| if face == white { [255; 4] } else { [0, 0, 0, 255] };
    let bytes = (0..6).flat_map(texel).collect();
    let format = TextureFormat::Rgba8UnormSrgb;
    let mut image = Image::new(size, TextureDimension::D2, bytes, format, RenderAssetUsages::all());
    image.texture_view_descriptor =
        Some(TextureViewDescriptor { dimension: Some(TextureViewDimension::Cube), ..default() });
    image
}

fn scene() -> App {
    // Bevy's environment maps cast no shadows.
    let plugin = GirandolePlugin { shadows: false, ..default() };
    let mut app = app(Setup { plugin, camera: GirandoleCamera { samples: 4, ..single_frames() }, ..default() });
    add_scene(&mut app);
    app
}

fn add_image(app: &mut App, image: Image) -> Handle<Image> {
    app.world_mut().resource_mut::<Assets<Image>>().add(image)
}

/// The luminance of each pixel, as the mean of some frames.
fn mean(app: &mut App) -> Vec<f32> {
    let mut sums = vec![0.0; PIXELS];
    for picture in pictures(app, FRAMES) {
        sums.iter_mut().zip(&picture).for_each(|(sum, pixel)| *sum += pixel.element_sum());
    }
    sums
}

/// The cosine between two pictures.
fn likeness(a: &[f32], b: &[f32]) -> f32 {
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
    dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
}

#[test]
fn the_faces_of_a_cubemap_are_where_bevy_has_them() {
    let mut app = scene();
    let camera = app.world_mut().query_filtered::<Entity, With<GirandoleCamera>>().single(app.world()).unwrap();
    let rotation = Quat::from_euler(EulerRot::XYZ, 0.7, 0.4, -0.3);
    let of_face = |app: &mut App, face: usize| {
        let image = add_image(app, white_face(face));
        let light = EnvironmentMapLight {
            diffuse_map: image.clone(),
            specular_map: image,
            intensity: 500.0,
            rotation,
            ..default()
        };
        let sky = GirandoleSky::from(&light);
        app.world_mut().entity_mut(camera).insert(light);
        let bevys = mean(app);
        app.world_mut().entity_mut(camera).remove::<EnvironmentMapLight>().insert(sky);
        let ours = mean(app);
        app.world_mut().entity_mut(camera).remove::<GirandoleSky>();
        [bevys, ours]
    };
    let faces: Vec<[Vec<f32>; 2]> = (0..6).map(|face| of_face(&mut app, face)).collect();
    for (face, [_, ours]) in faces.iter().enumerate() {
        let likeness: Vec<f32> = faces.iter().map(|[bevys, _]| likeness(bevys, ours)).collect();
        let best = (0..6).max_by(|a, b| likeness[*a].total_cmp(&likeness[*b]));
        assert_eq!(best, Some(face), "{likeness:?}");
    }
}

#[test]
fn a_sky_comes_and_goes_with_its_component() {
    let mut app = scene();
    assert_eq!(brightness(&mut app), 0.0);
    let image = app.world().resource::<Assets<Image>>().reserve_handle();
    let sky = GirandoleSky { image: image.clone(), intensity: 500.0, ..default() };
    let entity = app.world_mut().spawn(sky).id();
    assert_eq!(brightness(&mut app), 0.0, "the image is not loaded");
    app.world_mut().resource_mut::<Assets<Image>>().insert(image.id(), white_face(2)).unwrap();
    let bright = brightness(&mut app);
    assert!(bright > 0.1, "the sky is above");
    assert_eq!((report(&app).lights, report(&app).trees), (1, 1));

    let set = |app: &mut App, change: fn(&mut GirandoleSky)| {
        change(&mut app.world_mut().get_mut::<GirandoleSky>(entity).unwrap());
        settle(app);
    };
    set(&mut app, |sky| sky.intensity = 250.0);
    assert!((brightness(&mut app) / bright - 0.5).abs() < 0.1);
    set(&mut app, |sky| sky.rotation = Quat::from_rotation_x(std::f32::consts::PI));
    assert!(brightness(&mut app) < 0.1 * bright, "the sky is below");
    set(&mut app, |sky| *sky = GirandoleSky { intensity: f32::NAN, image: sky.image.clone(), ..default() });
    assert_eq!(brightness(&mut app), 0.0, "the sky is refused");
    assert_eq!(report(&app).refused, 1);
    set(&mut app, |sky| sky.intensity = 500.0);
    assert!(brightness(&mut app) > 0.5 * bright);

    app.world_mut().entity_mut(entity).remove::<GirandoleSky>();
    assert_eq!(brightness(&mut app), 0.0);
    assert_eq!((report(&app).lights, report(&app).trees), (0, 0));
}
