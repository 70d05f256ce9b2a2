//! Meshes with emissive textures are lights, which follow their images.

use bevy::asset::RenderAssetUsages;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_girandole::GirandoleLight;

use crate::harness::{HEIGHT, Setup, WIDTH, add_scene, app, brightness, pictures, report, settle, single_frames};

/// Frames of which a mean is taken.
const FRAMES: usize = 32;

/// Rows of two texels that are white or black.
fn two_columns(is_white: [bool; 2]) -> Image {
    let size = Extent3d { width: 2, height: 1, depth_or_array_layers: 1 };
    let texel = |is_white: bool| if is_white { [255; 4] } else { [0, 0, 0, 255] };
    let bytes = is_white.map(texel).concat();
    Image::new(size, TextureDimension::D2, bytes, TextureFormat::Rgba8UnormSrgb, RenderAssetUsages::all())
}

fn scene() -> App {
    let mut app = app(Setup { camera: single_frames(), ..default() });
    add_scene(&mut app);
    app
}

/// A quad above the scene that shines down. Its first texture coordinate grows to the right.
fn add_quad(app: &mut App, [left, right]: [f32; 2], texture: Option<Handle<Image>>) -> Entity {
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Rectangle::new(right - left, 1.0));
    let emitting =
        StandardMaterial { emissive: LinearRgba::rgb(60.0, 60.0, 60.0), emissive_texture: texture, ..default() };
    let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(emitting);
    let place = Transform::from_xyz(0.5 * (left + right), 3.0, 0.0).looking_to(Vec3::Y, Vec3::Z);
    let place = place.with_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
    app.world_mut().spawn((Mesh3d(mesh), MeshMaterial3d(material), GirandoleLight, place)).id()
}

fn add_image(app: &mut App, image: Image) -> Handle<Image> {
    app.world_mut().resource_mut::<Assets<Image>>().add(image)
}

/// The mean brightness of the left half and of the right half of the lower half of pictures.
fn halves(app: &mut App) -> [f32; 2] {
    let mut sums = [0.0; 2];
    for picture in pictures(app, FRAMES) {
        for (i, pixel) in (0..).zip(&picture).skip((WIDTH * HEIGHT / 2) as usize) {
            sums[usize::from(i % WIDTH >= WIDTH / 2)] += pixel.element_sum();
        }
    }
    sums.map(|sum| sum / FRAMES as f32)
}

#[test]
fn a_texture_lights_as_the_part_of_the_mesh_that_it_lights() {
    let sides = [[true, false], [false, true]].map(|is_white| {
        let mut app = scene();
        let texture = add_image(&mut app, two_columns(is_white));
        add_quad(&mut app, [-2.0, 2.0], Some(texture));
        let with_texture = halves(&mut app);

        let mut app = scene();
        let [left, right] = if is_white[0] { [-2.0, 0.0] } else { [0.0, 2.0] };
        add_quad(&mut app, [left, right], None);
        let with_half = halves(&mut app);
        for (ours, expected) in with_texture.into_iter().zip(with_half) {
            assert!((ours / expected - 1.0).abs() < 0.05, "{with_texture:?} is not {with_half:?}");
        }
        with_texture
    });
    assert!(sides[0][0] > 1.2 * sides[1][0] && sides[1][1] > 1.2 * sides[0][1], "{sides:?}");
}

#[test]
fn a_light_waits_for_its_texture_and_follows_it() {
    let mut app = scene();
    let texture = app.world().resource::<Assets<Image>>().reserve_handle();
    let entity = add_quad(&mut app, [-2.0, 2.0], Some(texture.clone()));
    settle(&mut app);
    assert_eq!(report(&app).lights, 0, "the image is not loaded");

    let set = |app: &mut App, image: Image| {
        app.world_mut().resource_mut::<Assets<Image>>().insert(texture.id(), image).unwrap();
        settle(app);
    };
    set(&mut app, two_columns([true, false]));
    assert_eq!(report(&app).lights, 1);
    assert!(brightness(&mut app) > 0.1);

    set(&mut app, two_columns([false, false]));
    assert_eq!(brightness(&mut app), 0.0, "all texels are dark");
    set(&mut app, two_columns([true, true]));
    assert!(brightness(&mut app) > 0.1);

    let mut hidden = two_columns([true, true]);
    hidden.asset_usage = RenderAssetUsages::RENDER_WORLD;
    set(&mut app, hidden);
    assert_eq!(brightness(&mut app), 0.0, "the main world does not know the texels");
    set(&mut app, two_columns([true, true]));
    assert!(brightness(&mut app) > 0.1);

    app.world_mut().despawn(entity);
    settle(&mut app);
    assert_eq!((report(&app).lights, report(&app).trees, report(&app).refused), (0, 0, 0));
}
