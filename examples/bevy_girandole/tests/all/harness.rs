//! An application without a window that draws one small camera, and the pixels that it draws.

use std::sync::{Arc, Mutex};

use bevy::asset::RenderAssetUsages;
use bevy::camera::RenderTarget;
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::pbr::DefaultOpaqueRendererMethod;
use bevy::prelude::*;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::{PollType, TextureFormat, TextureUsages, WgpuFeatures};
use bevy::render::renderer::RenderDevice;
use bevy::render::{RenderPlugin, settings::WgpuSettings};
use bevy::window::{ExitCondition, WindowPlugin};
use bevy::winit::WinitPlugin;
use bevy_girandole::{GirandoleCamera, GirandolePlugin, GirandoleReport, GirandoleStats};

pub const WIDTH: u32 = 32;
pub const HEIGHT: u32 = 24;
pub const PIXELS: usize = (WIDTH * HEIGHT) as usize;

/// Frames after which the pictures of former frames have come back.
const WARM_UP: usize = 6;

pub type Picture = Vec<Vec3>;

#[derive(Resource, Clone, Default)]
struct Pictures(Arc<Mutex<Vec<Picture>>>);

/// How an application is made.
#[derive(Clone, Copy, Debug, Default)]
pub struct Setup {
    pub plugin: GirandolePlugin,
    pub is_pipelined: bool,
    /// Whether the device has no ray queries, even if it could.
    pub no_ray_queries: bool,
    pub camera: GirandoleCamera,
}

/// A camera that takes the mean of nothing and reuses nothing, so that frames are independent.
pub fn single_frames() -> GirandoleCamera {
    GirandoleCamera { still_frames: 1, moving_frames: 1, reused_frames: 0, ..default() }
}

/// An application whose camera stands at (0, 3, 6) and looks at the origin.
pub fn app(setup: Setup) -> App {
    let mut app = App::new();
    let window = WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
    let disabled_features = setup.no_ray_queries.then_some(WgpuFeatures::EXPERIMENTAL_RAY_QUERY);
    let render = RenderPlugin {
        synchronous_pipeline_compilation: true,
        render_creation: WgpuSettings { disabled_features, ..default() }.into(),
        ..default()
    };
    let mut plugins = DefaultPlugins.set(window).set(render).disable::<WinitPlugin>();
    if !setup.is_pipelined {
        plugins = plugins.disable::<PipelinedRenderingPlugin>();
    }
    app.add_plugins(plugins)
        .add_plugins(setup.plugin)
        .insert_resource(DefaultOpaqueRendererMethod::deferred())
        .insert_resource(ClearColor(Color::BLACK))
        .insert_resource(GlobalAmbientLight { brightness: 0.0, ..default() })
        .init_resource::<Pictures>();
    app.finish();
    app.cleanup();
    let target = {
        let mut image = Image::new_target_texture(WIDTH, HEIGHT, TextureFormat::Rgba16Float, None);
        image.asset_usage = RenderAssetUsages::RENDER_WORLD;
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        app.world_mut().resource_mut::<Assets<Image>>().add(image)
    };
    app.world_mut().spawn((
        Camera3d::default(),
        RenderTarget::Image(target.clone().into()),
        setup.camera,
        Msaa::Off,
        Tonemapping::None,
        DebandDither::Disabled,
        Transform::from_xyz(0.0, 3.0, 6.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    app.world_mut().spawn(Readback::texture(target)).observe(receive);
    app
}

fn receive(picture: On<ReadbackComplete>, pictures: Res<Pictures>) {
    let halves: &[u8] = &picture.data;
    let pixels = halves.chunks_exact(8).map(|texel| {
        let channel = |i: usize| half(u16::from_le_bytes([texel[2 * i], texel[2 * i + 1]]));
        Vec3::new(channel(0), channel(1), channel(2))
    });
    pictures.0.lock().unwrap().push(pixels.collect());
}

/// The value of an IEEE half.
fn half(bits: u16) -> f32 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let exponent = i32::from(bits >> 10 & 31);
    let fraction = f32::from(bits & 1023);
    match exponent {
        0 => sign * fraction * (-24f32).exp2(),
        31 => f32::NAN,
        _ => sign * (1.0 + fraction / 1024.0) * ((exponent - 15) as f32).exp2(),
    }
}

/// Frames within which the shaders of the pass are found and compiled.
const MAX_START_FRAMES: usize = 1000;

/// Draws one frame, and waits until the device has done so. Pictures then come back equally late.
pub fn frame(app: &mut App) {
    app.update();
    app.world().resource::<RenderDevice>().poll(PollType::wait_indefinitely()).expect("the device must answer");
}

/// Runs until the pass is drawn, with the shadows of all meshes.
pub fn start(app: &mut App) {
    for _ in 0..MAX_START_FRAMES {
        if report(app).passes > 0 && report(app).waiting_meshes == 0 {
            return;
        }
        frame(app);
    }
    panic!("the pass is not drawn");
}

/// Runs until `count` more pictures have come back. Returns them.
pub fn pictures(app: &mut App, count: usize) -> Vec<Picture> {
    start(app);
    let received = app.world().resource::<Pictures>().clone();
    received.0.lock().unwrap().clear();
    for _ in 0..10 * (count + WARM_UP) {
        frame(app);
        let mut received = received.0.lock().unwrap();
        if received.len() >= count + WARM_UP {
            return received.drain(WARM_UP..).take(count).collect();
        }
    }
    panic!("pictures do not come back");
}

/// Runs a frame. Returns the pictures that have come back, which are of earlier ones.
pub fn new_pictures(app: &mut App) -> Vec<Picture> {
    let received = app.world().resource::<Pictures>().clone();
    frame(app);
    received.0.lock().unwrap().drain(..).collect()
}

/// Runs some frames, after which everything that was changed before is drawn.
pub fn settle(app: &mut App) {
    for _ in 0..WARM_UP {
        frame(app);
    }
}

pub fn report(app: &App) -> GirandoleReport {
    app.world().resource::<GirandoleStats>().report()
}

/// Changes the settings of the camera.
pub fn set_camera(app: &mut App, change: impl FnOnce(&mut GirandoleCamera)) {
    let mut cameras = app.world_mut().query::<&mut GirandoleCamera>();
    let mut camera = cameras.single_mut(app.world_mut()).expect("there is one camera");
    change(&mut camera);
}

/// A ground and two balls: plastic, metal and a coat.
pub fn add_scene(app: &mut App) {
    let world = app.world_mut();
    let [plane, ball] = {
        let mut meshes = world.resource_mut::<Assets<Mesh>>();
        [meshes.add(Plane3d::default().mesh().size(12.0, 12.0)), meshes.add(Sphere::new(1.0))]
    };
    let [plastic, metal, coated] = {
        let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
        let plastic =
            StandardMaterial { base_color: Color::linear_rgb(0.5, 0.6, 0.7), perceptual_roughness: 0.6, ..default() };
        let metal = StandardMaterial {
            base_color: Color::linear_rgb(0.9, 0.7, 0.4),
            metallic: 1.0,
            perceptual_roughness: 0.4,
            ..default()
        };
        let coated = StandardMaterial {
            base_color: Color::linear_rgb(0.7, 0.1, 0.1),
            clearcoat: 1.0,
            clearcoat_perceptual_roughness: 0.3,
            perceptual_roughness: 0.8,
            ..default()
        };
        [plastic, metal, coated].map(|material| materials.add(material))
    };
    world.spawn((Mesh3d(plane), MeshMaterial3d(plastic)));
    world.spawn((Mesh3d(ball.clone()), MeshMaterial3d(metal), Transform::from_xyz(-1.5, 1.0, 0.0)));
    world.spawn((Mesh3d(ball), MeshMaterial3d(coated), Transform::from_xyz(1.5, 1.0, 0.0)));
}

/// The sum over the lower half of a picture, where a mesh above the balls is not seen.
pub fn brightness(app: &mut App) -> f32 {
    let picture = pictures(app, 1).remove(0);
    picture[picture.len() / 2..].iter().map(|pixel| pixel.element_sum()).sum()
}
