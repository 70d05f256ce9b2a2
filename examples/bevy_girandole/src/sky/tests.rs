use bevy::app::{App, Update};
use bevy::asset::RenderAssetUsages;
use bevy::math::Quat;
use bevy::prelude::Handle;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};

use super::*;
use crate::edits::Edit;

/// A share by which radiances may differ: they are stored with nine bits.
const ROUNDING: f32 = 1.0 / 256.0;

fn image([width, height, layers]: [u32; 3], texels: &[Vec3]) -> Image {
    let size = Extent3d { width, height, depth_or_array_layers: layers };
    let bytes = texels.iter().flat_map(|texel| texel.extend(1.0).to_array()).flat_map(f32::to_le_bytes).collect();
    Image::new(size, TextureDimension::D2, bytes, TextureFormat::Rgba32Float, RenderAssetUsages::MAIN_WORLD)
}

fn assert_near(found: Vec3, expected: Vec3) {
    let difference = (found / UNIT - expected).abs().max_element();
    assert!(difference <= ROUNDING * expected.max_element(), "{} is not {expected}", found / UNIT);
}

#[test]
fn an_equirectangular_image_is_the_map() {
    let texels: Vec<Vec3> = (0..32).map(|i| Vec3::new(1.0, i as f32, 32.0 - i as f32)).collect();
    let sky = map(&image([8, 4, 1], &texels)).expect("it is readable");
    assert_eq!(sky.size(), [8, 4]);
    // A little beyond the middle of the image is +X, then +Z.
    assert_near(sky.radiance(Vec3::new(1.0, -0.1, 0.1)), texels[2 * 8 + 4]);
    assert_near(sky.radiance(Vec3::new(0.1, -0.1, 1.0)), texels[2 * 8 + 5]);
    assert_near(sky.radiance(Vec3::new(0.1, 1.0, 0.01)), texels[4]);
}

#[test]
fn the_faces_of_a_cubemap_are_those_of_bevy() {
    // Each face is a colour, and is brighter in the first of its four texels.
    let colors = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.0, 1.0, 1.0), Vec3::ONE];
    let texels: Vec<Vec3> = colors.iter().flat_map(|color| [*color, 0.5 * color, 0.5 * color, 0.5 * color]).collect();
    let sky = map(&image([2, 2, 6], &texels)).expect("it is readable");
    assert_eq!(sky.size(), [64, 32]);
    // The axes of faces in a right-handed world, and their upper left corners: seen from inside with up at the top,
    // +X has -Z on its left. As Bevy negates z, the layers of +Z and -Z change places, and faces are mirrored.
    let faces = [
        (Vec3::X, Vec3::new(0.0, 1.0, -1.0)),
        (Vec3::NEG_X, Vec3::new(0.0, 1.0, 1.0)),
        (Vec3::Y, Vec3::new(-1.0, 0.0, 1.0)),
        (Vec3::NEG_Y, Vec3::new(-1.0, 0.0, -1.0)),
        (Vec3::NEG_Z, Vec3::new(-1.0, 1.0, 0.0)),
        (Vec3::Z, Vec3::new(1.0, 1.0, 0.0)),
    ];
    for ((axis, corner), color) in faces.into_iter().zip(colors) {
        assert_near(sky.radiance(axis + 0.5 * corner), color);
        assert_near(sky.radiance(axis - 0.5 * corner), 0.5 * color);
    }
}

#[test]
fn a_cubemap_keeps_its_light() {
    // One bright texel: at the corner of a face, where it spans the smallest solid angle, within a face, and within one
    // that is reduced.
    for (edge, x, y) in [(64, 0, 0), (64, 40, 31), (515, 250, 150)] {
        let mut image = image([1, 1, 6], &[Vec3::ZERO; 6]);
        image.resize(Extent3d { width: edge, height: edge, depth_or_array_layers: 6 });
        let texel = Vec3::splat(1000.0).extend(1.0).to_array();
        let bytes = texel.into_iter().flat_map(f32::to_le_bytes);
        let start = 16 * (y * edge + x) as usize;
        image.data.as_mut().expect("it has texels").splice(start..start + 16, bytes);
        let sky = map(&image).expect("it is readable");
        let [width, height] = sky.size();
        let pixel = (PI / height as f32) * (2.0 * PI / width as f32);
        let mut found = 0.0;
        for row in 0..height {
            let theta = PI * (row as f32 + 0.5) / height as f32;
            for column in 0..width {
                let phi = 2.0 * PI * ((column as f32 + 0.5) / width as f32 - 0.5);
                let direction = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
                found += sky.radiance(direction).x / UNIT * theta.sin() * pixel;
            }
        }
        let [across, down] = [x, y].map(|place| 2.0 * (place as f32 + 0.5) / edge as f32 - 1.0);
        let expected = 1000.0 * (2.0 / edge as f32).powi(2) / (1.0 + across * across + down * down).powf(1.5);
        assert!((found / expected - 1.0).abs() < 0.25, "{edge}, {x}, {y}: {found} of {expected}");
    }
}

#[test]
fn what_is_no_map_is_no_sky() {
    assert!(map(&image([2, 1, 2], &[Vec3::ONE; 4])).is_none());
    assert!(map(&image([2, 1, 6], &[Vec3::ONE; 12])).is_none());
    assert!(map(&image([1, 6, 1], &[Vec3::ONE; 6])).is_none(), "a cubemap that is still stacked");
    assert!(map(&image([2, 1, 1], &[Vec3::splat(1.0e20); 2])).is_none());
    let mut hidden = image([2, 1, 1], &[Vec3::ONE; 2]);
    hidden.asset_usage = RenderAssetUsages::RENDER_WORLD;
    assert!(map(&hidden).is_none());
    assert!(map(&image([2, 1, 1], &[Vec3::NAN, Vec3::NEG_ONE])).is_some(), "these texels are black");
}

/// An application without anything but skies.
fn app() -> App {
    let mut app = App::new();
    app.init_resource::<Changes>().init_resource::<Assets<Image>>().add_message::<AssetEvent<Image>>();
    app.add_systems(Update, gather);
    app
}

/// What the next frame sends, as letters.
fn sent(app: &mut App) -> String {
    app.update();
    let edits = app.world_mut().resource_mut::<Changes>().take().edits;
    let letter = |edit| match edit {
        Edit::SetSky { .. } => 'S',
        Edit::AdjustSky { .. } => 'A',
        Edit::RemoveSky => 'R',
        _ => '?',
    };
    edits.into_iter().map(letter).collect()
}

fn set(app: &mut App, handle: &Handle<Image>, image: Image) {
    app.world_mut().resource_mut::<Assets<Image>>().insert(handle.id(), image).expect("the handle is in use");
    app.world_mut().write_message(AssetEvent::Modified { id: handle.id() });
}

#[test]
fn a_frame_sends_what_changed() {
    let mut app = app();
    let handle = app.world().resource::<Assets<Image>>().reserve_handle();
    let sky = GirandoleSky { image: handle.clone(), intensity: 100.0, ..Default::default() };
    let entity = app.world_mut().spawn(sky.clone()).id();
    assert_eq!(sent(&mut app), "", "the image is not loaded");
    set(&mut app, &handle, image([2, 1, 1], &[Vec3::ONE; 2]));
    assert_eq!(sent(&mut app), "SA");
    assert_eq!(sent(&mut app), "");

    app.world_mut().get_mut::<GirandoleSky>(entity).expect("it is there").intensity = f32::NAN;
    assert_eq!([sent(&mut app), sent(&mut app)], ["A", ""]);
    app.world_mut().get_mut::<GirandoleSky>(entity).expect("it is there").rotation = Quat::from_rotation_x(1.0);
    assert_eq!([sent(&mut app), sent(&mut app)], ["A", ""]);
    set(&mut app, &handle, image([2, 1, 1], &[Vec3::X; 2]));
    assert_eq!([sent(&mut app), sent(&mut app)], ["SA", ""]);
    set(&mut app, &handle, image([2, 1, 2], &[Vec3::X; 4]));
    assert_eq!([sent(&mut app), sent(&mut app)], ["R", ""]);
    set(&mut app, &handle, image([2, 1, 1], &[Vec3::X; 2]));
    assert_eq!(sent(&mut app), "SA");

    // A second one waits until the first one is gone.
    let other = app.world_mut().resource_mut::<Assets<Image>>().add(image([2, 1, 1], &[Vec3::Z; 2]));
    let second = app.world_mut().spawn(GirandoleSky { image: other, ..sky }).id();
    assert_eq!(sent(&mut app), "");
    app.world_mut().despawn(entity);
    assert_eq!([sent(&mut app), sent(&mut app)], ["SA", ""]);
    app.world_mut().despawn(second);
    assert_eq!([sent(&mut app), sent(&mut app)], ["R", ""]);
}
