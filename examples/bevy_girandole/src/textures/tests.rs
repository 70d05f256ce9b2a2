use std::f32::consts::PI;

use bevy::asset::{Assets, RenderAssetUsages};
use bevy::ecs::system::SystemState;
use bevy::ecs::world::World;
use bevy::math::Vec2;
use bevy::prelude::{Color, Handle, Meshable, Rectangle};
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};

use super::*;
use crate::kinds::KindKey;
use crate::rigs::{PosedMeshes, Rig};
use crate::settings::RayTraced;

/// A share by which a flux may differ: parts add up in f32.
const TOLERANCE: f32 = 1e-5;

/// A world with a quad of 2 m x 1 m.
struct Scene {
    world: World,
    quad: Handle<Mesh>,
}

impl Scene {
    fn new() -> Self {
        let mut world = World::new();
        world.init_resource::<Assets<Mesh>>();
        world.init_resource::<Assets<Image>>();
        world.insert_resource(DefaultWrap([TextureWrap::Clamp; 2]));
        world.insert_resource(RayTraced(false));
        let quad = world.resource_mut::<Assets<Mesh>>().add(Rectangle::new(2.0, 1.0).mesh());
        Self { world, quad }
    }

    fn add(&mut self, image: Image) -> Handle<Image> {
        self.world.resource_mut::<Assets<Image>>().add(image)
    }

    fn parts(&mut self, material: &StandardMaterial) -> Option<Vec<Light>> {
        let key = KindKey::Mesh {
            mesh: self.quad.id(),
            texture: TextureKey::of(material),
            two_sided: false,
            weight: 0,
            ev100: 0,
            rig: Rig::Rigid,
        };
        let mut state = SystemState::<Sources>::new(&mut self.world);
        let sources = state.get(&self.world).expect("the resources are there");
        key.tree(&sources, &mut PosedMeshes::default()).map(|tree| {
            assert_eq!(tree.record.lights as usize, tree.lights.len());
            tree.lights
        })
    }

    /// The mean colour that the quad emits; `None` if it is not a light.
    fn mean(&mut self, material: &StandardMaterial) -> Option<Vec3> {
        let lights = self.parts(material)?;
        let flux = lights.iter().map(|light| light.area().unwrap_or(0.0) * light.emission).sum::<Vec3>();
        let total: f32 = lights.iter().map(Light::flux).sum();
        let luminance = flux.dot(Vec3::new(0.2126, 0.7152, 0.0722));
        assert!((total - PI * luminance).abs() <= 1e-3 * total, "{total} {luminance}");
        Some(flux / (2.0 * UNIT))
    }
}

fn image(width: u32, format: TextureFormat, bytes: Vec<u8>) -> Image {
    let height = bytes.len() as u32 / (4 * width);
    let size = Extent3d { width, height, depth_or_array_layers: 1 };
    Image::new(size, TextureDimension::D2, bytes, format, RenderAssetUsages::MAIN_WORLD)
}

/// White texels and black ones, all of them opaque.
fn white_and_black(width: u32, is_white: &[u8]) -> Image {
    let bytes = is_white.iter().flat_map(|white| [255 * white, 255 * white, 255 * white, 255]);
    image(width, TextureFormat::Rgba8UnormSrgb, bytes.collect())
}

fn showing(texture: &Handle<Image>) -> StandardMaterial {
    StandardMaterial { emissive_texture: Some(texture.clone()), ..Default::default() }
}

fn assert_near(mean: Option<Vec3>, expected: Vec3) {
    let mean = mean.expect("it is a light");
    assert!((mean - expected).abs().max_element() <= TOLERANCE * expected.max_element(), "{mean} is not {expected}");
}

#[test]
fn parts_emit_the_texture() {
    let mut scene = Scene::new();
    let bytes = vec![255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 128, 128, 128, 255];
    let grey = 0.215_860_5;
    for (format, grey) in [(TextureFormat::Rgba8UnormSrgb, grey), (TextureFormat::Rgba8Unorm, 128.0 / 255.0)] {
        let texture = scene.add(image(2, format, bytes.clone()));
        assert_near(scene.mean(&showing(&texture)), Vec3::splat((1.0 + grey) / 4.0));
    }
    let parts = {
        let texture = scene.add(white_and_black(4, &[1, 0, 0, 0]));
        scene.parts(&showing(&texture)).expect("it is a light")
    };
    assert!(parts.len() > 2 && parts.len() <= 2 + MAX_ADDED_PARTS, "{}", parts.len());
    let centers = parts.iter().filter(|part| part.emission.x == UNIT).map(|part| match part.shape {
        girandole::Shape::Triangle { vertices, .. } => vertices.iter().sum::<Vec3>() / 3.0,
        _ => unreachable!("parts of triangles are triangles"),
    });
    // The first column of four.
    assert!(centers.into_iter().all(|center| center.x < -0.5));
}

#[test]
fn ray_tracers_get_whole_triangles() {
    let mut scene = Scene::new();
    let texture = scene.add(white_and_black(4, &[1, 0, 0, 0]));
    scene.world.insert_resource(RayTraced(true));
    let parts = scene.parts(&showing(&texture)).expect("it is a light");
    assert_eq!(parts.len(), 2);
    assert_near(scene.mean(&showing(&texture)), Vec3::splat(0.25));
}

#[test]
fn the_transform_and_the_wrap_count() {
    let mut scene = Scene::new();
    // A quad that shows the image twice over, or what is beyond its right side.
    let twice = |texture: &Handle<Image>| StandardMaterial {
        uv_transform: Affine2::from_scale(Vec2::new(2.0, 1.0)),
        ..showing(texture)
    };
    let texture = scene.add(white_and_black(2, &[1, 0]));
    assert_near(scene.mean(&showing(&texture)), Vec3::splat(0.5));
    assert_near(scene.mean(&twice(&texture)), Vec3::splat(0.25));
    for (mode, beyond) in
        [(ImageAddressMode::Repeat, 1.0), (ImageAddressMode::MirrorRepeat, 0.0), (ImageAddressMode::ClampToEdge, 0.0)]
    {
        let mut image = white_and_black(2, &[1, 0]);
        image.sampler.get_or_init_descriptor().set_address_mode(mode);
        let texture = scene.add(image);
        let shift = |by| StandardMaterial {
            uv_transform: Affine2::from_scale_angle_translation(Vec2::new(0.5, 1.0), 0.0, Vec2::new(by, 0.0)),
            ..showing(&texture)
        };
        assert_near(scene.mean(&shift(0.0)), Vec3::ONE);
        let mean = scene.mean(&shift(1.0)).expect("dark lights are lights");
        assert!((mean - Vec3::splat(beyond)).abs().max_element() < TOLERANCE, "{mode:?}: {mean}");
    }
}

#[test]
fn what_a_mask_cuts_out_is_dark() {
    let mut scene = Scene::new();
    let texture = scene.add(white_and_black(2, &[1, 0]));
    // Alpha of 0.8 above, and of 0.4 below; finer than what is emitted.
    let alphas = [204, 204, 204, 204, 102, 102, 102, 102].into_iter().flat_map(|alpha| [255, 255, 255, alpha]);
    let cut = scene.add(image(4, TextureFormat::Rgba8UnormSrgb, alphas.collect()));
    let masked = |cutoff| StandardMaterial {
        base_color_texture: Some(cut.clone()),
        alpha_mode: AlphaMode::Mask(cutoff),
        ..showing(&texture)
    };
    assert_near(scene.mean(&masked(0.3)), Vec3::splat(0.5));
    assert_near(scene.mean(&masked(0.5)), Vec3::splat(0.25));
    let fainter = StandardMaterial { base_color: Color::linear_rgba(1.0, 1.0, 1.0, 0.5), ..masked(0.3) };
    assert_near(scene.mean(&fainter), Vec3::splat(0.25));
    let opaque = StandardMaterial { alpha_mode: AlphaMode::Opaque, ..masked(0.5) };
    assert_near(scene.mean(&opaque), Vec3::splat(0.5));
    let other = StandardMaterial { base_color_channel: UvChannel::Uv1, ..masked(0.5) };
    assert_near(scene.mean(&other), Vec3::splat(0.5));
}

#[test]
fn what_cannot_be_read_is_no_light() {
    let mut scene = Scene::new();
    let texture = scene.add(white_and_black(2, &[1, 0]));
    let missing = scene.world.resource::<Assets<Image>>().reserve_handle();
    assert_eq!(scene.parts(&showing(&missing)), None);
    let masked = StandardMaterial {
        base_color_texture: Some(missing.clone()),
        alpha_mode: AlphaMode::Mask(0.5),
        ..showing(&texture)
    };
    assert_eq!(scene.parts(&masked), None, "the mask is not loaded");
    scene.world.resource_mut::<Assets<Image>>().insert(missing.id(), white_and_black(1, &[1])).expect("it is new");
    assert_near(scene.mean(&showing(&missing)), Vec3::ONE);

    let mut hidden = white_and_black(2, &[1, 0]);
    hidden.asset_usage = RenderAssetUsages::RENDER_WORLD;
    let hidden = scene.add(hidden);
    assert_eq!(scene.parts(&showing(&hidden)), None);
    let odd = StandardMaterial { uv_transform: Affine2::from_scale(Vec2::NAN), ..showing(&texture) };
    assert_eq!(scene.parts(&odd), None);
}

#[test]
fn a_mesh_without_texture_coordinates_shows_no_texture() {
    let mut scene = Scene::new();
    let texture = scene.add(white_and_black(2, &[1, 0]));
    let mesh = Mesh::from(Rectangle::new(2.0, 1.0)).with_removed_attribute(Mesh::ATTRIBUTE_UV_0);
    scene.quad = scene.world.resource_mut::<Assets<Mesh>>().add(mesh);
    assert_near(scene.mean(&showing(&texture)), Vec3::ONE);
}
