//! An application without a window, the mean of its pictures, and the error of a mean.

use std::sync::{Arc, Mutex};

use bevy::asset::RenderAssetUsages;
use bevy::camera::{CameraMainTextureUsages, RenderTarget};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::{Extent3d, PollType, TextureDimension, TextureFormat, TextureUsages};
use bevy::render::renderer::RenderDevice;
use bevy::solari::SolariPlugins;
use bevy::solari::pathtracer::{Pathtracer, PathtracingPlugin};
use bevy::solari::prelude::SolariLighting;
use bevy::window::{ExitCondition, WindowPlugin};
use bevy::winit::WinitPlugin;

use bevy_girandole_solari::GirandoleSolariPlugin;

use crate::options::Options;

pub type Picture = Vec<Vec3>;

#[derive(Resource, Clone, Default)]
struct Pictures(Arc<Mutex<Vec<Picture>>>);

/// An application that draws with Solari.
pub fn app(options: &Options) -> Result<App, String> {
    let mut app = App::new();
    let window = WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
    let render = RenderPlugin { synchronous_pipeline_compilation: true, ..default() };
    let plugins = DefaultPlugins.set(window).set(render).disable::<WinitPlugin>().disable::<PipelinedRenderingPlugin>();
    app.add_plugins(plugins);
    if !options.uniform {
        app.add_plugins(GirandoleSolariPlugin);
    }
    app.add_plugins(SolariPlugins).insert_resource(ClearColor(Color::BLACK)).init_resource::<Pictures>();
    if options.path_tracer {
        app.add_plugins(PathtracingPlugin);
    }
    app.finish();
    app.cleanup();
    let missing = SolariPlugins::required_wgpu_features() - app.world().resource::<RenderDevice>().features();
    if !missing.is_empty() {
        return Err(format!("the device lacks what ray tracing needs: {missing:?}"));
    }
    Ok(app)
}

/// Adds a camera whose pictures are kept.
pub fn add_camera(app: &mut App, options: &Options, transform: Transform) {
    let [width, height] = options.size;
    let target = {
        let mut image = Image::new_target_texture(width, height, TextureFormat::Rgba16Float, None);
        image.asset_usage = RenderAssetUsages::RENDER_WORLD;
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        app.world_mut().resource_mut::<Assets<Image>>().add(image)
    };
    let mut camera = app.world_mut().spawn((
        Camera3d::default(),
        RenderTarget::Image(target.clone().into()),
        CameraMainTextureUsages::default().with(TextureUsages::STORAGE_BINDING),
        Msaa::Off,
        Tonemapping::None,
        DebandDither::Disabled,
        transform,
    ));
    if options.path_tracer {
        camera.insert(Pathtracer::default());
    } else {
        camera.insert(SolariLighting {
            restir: options.restir,
            primary_di_samples: options.samples,
            max_bounces: options.bounces,
            ..default()
        });
    }
    app.world_mut().spawn(Readback::texture(target)).observe(receive);
}

fn receive(picture: On<ReadbackComplete>, pictures: Res<Pictures>) {
    let halves: &[u8] = &picture.data;
    let pixels = halves.chunks_exact(8).map(|texel| {
        let channel = |i: usize| half(u16::from_le_bytes([texel[2 * i], texel[2 * i + 1]]));
        Vec3::new(channel(0), channel(1), channel(2))
    });
    pictures.0.lock().expect("no thread has panicked").push(pixels.collect());
}

/// The value of an IEEE half.
fn half(bits: u16) -> f32 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023));
    match exponent {
        0 => sign * fraction * (-24f32).exp2(),
        31 => f32::NAN,
        _ => sign * (1.0 + fraction / 1024.0) * ((exponent - 15) as f32).exp2(),
    }
}

/// Frames within which the shaders are compiled and the scene is there.
const MAX_START_FRAMES: usize = 200;

/// The frames of a batch. In real time, the world cache keeps light for about as many frames, so frames depend on each
/// other, and batches of them much less.
const BATCH: usize = 32;

/// The mean over the pixels of all frames.
pub struct Brightness {
    pub mean: f64,
    /// From the means of batches; 0 for a single one.
    pub standard_error: f64,
}

impl Brightness {
    /// Of the means over the pixels of each frame. Frames beyond whole batches are left out.
    fn new(frames: &[f64]) -> Self {
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
        let batches: Vec<f64> = frames.chunks_exact(BATCH).map(mean).collect();
        let batches = if batches.is_empty() { vec![mean(frames)] } else { batches };
        let (count, mean) = (batches.len() as f64, mean(&batches));
        let squares: f64 = batches.iter().map(|batch| (batch - mean).powi(2)).sum();
        Self { mean, standard_error: (squares / (count * (count - 1.0).max(1.0))).sqrt() }
    }
}

/// The mean of the pictures of so many frames, from the first one on that is not black.
pub fn mean(app: &mut App, options: &Options) -> Result<(Picture, Brightness), String> {
    let received = app.world().resource::<Pictures>().clone();
    let mut pictures: Vec<Picture> = Vec::new();
    let (mut sum, mut means): (Picture, Vec<f64>) = Default::default();
    for frame in 0.. {
        app.update();
        let device = app.world().resource::<RenderDevice>();
        device.poll(PollType::wait_indefinitely()).map_err(|error| error.to_string())?;
        pictures.append(&mut received.0.lock().expect("no thread has panicked"));
        for picture in pictures.drain(..) {
            if means.is_empty() && picture.iter().all(|pixel| *pixel == Vec3::ZERO) {
                continue;
            }
            sum.resize(picture.len(), Vec3::ZERO);
            // The path tracer takes the mean itself.
            let (kept, weight) = if options.path_tracer { (0.0, means.len() as f32 + 1.0) } else { (1.0, 1.0) };
            let before = brightness(&sum);
            sum.iter_mut().zip(&picture).for_each(|(sum, pixel)| *sum = kept * *sum + weight * *pixel);
            means.push(brightness(&sum) - before);
            if means.len() == options.frames as usize {
                let mean = sum.into_iter().map(|pixel| pixel / options.frames as f32).collect();
                return Ok((mean, Brightness::new(&means)));
            }
        }
        if means.is_empty() && frame > MAX_START_FRAMES {
            return Err("nothing is drawn".into());
        }
    }
    unreachable!("the loop ends with a picture")
}

/// The mean over all pixels and colours.
fn brightness(picture: &[Vec3]) -> f64 {
    picture.iter().map(|pixel| f64::from(pixel.element_sum())).sum::<f64>() / (3 * picture.len()) as f64
}

/// The mean absolute error by the mean of the reference, and the relative mean square error.
pub fn error(picture: &[Vec3], reference: &[Vec3]) -> Result<(f32, f32), String> {
    if picture.len() != reference.len() {
        return Err("the reference has another size".into());
    }
    let pixels = || picture.iter().zip(reference);
    let mean = reference.iter().map(|pixel| pixel.element_sum()).sum::<f32>() / reference.len() as f32;
    let absolute: f32 = pixels().map(|(a, b)| (*a - *b).abs().element_sum()).sum();
    let squares: f32 =
        pixels().map(|(a, b)| (*a - *b).element_sum().powi(2) / (b.element_sum().powi(2) + 1e-4 * mean * mean)).sum();
    Ok((absolute / reference.len() as f32 / mean, squares / reference.len() as f32))
}

pub fn write_raw(file: &str, picture: &[Vec3]) -> Result<(), String> {
    let floats: Vec<f32> = picture.iter().flat_map(|pixel| pixel.to_array()).collect();
    std::fs::write(file, bytemuck::cast_slice(&floats)).map_err(|error| format!("{file}: {error}"))
}

pub fn read_raw(file: &str) -> Result<Picture, String> {
    let bytes = std::fs::read(file).map_err(|error| format!("{file}: {error}"))?;
    let float = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    Ok(bytes.chunks_exact(12).map(|of| Vec3::from_array(std::array::from_fn(|i| float(&of[4 * i..])))).collect())
}

/// Writes a picture with Reinhard's curve.
pub fn write_png(file: &str, picture: &[Vec3], [width, height]: [u32; 2]) -> Result<(), String> {
    let byte = |value: f32| (255.0 * Color::linear_rgb(value / (1.0 + value), 0.0, 0.0).to_srgba().red) as u8;
    let bytes = picture.iter().flat_map(|pixel| [byte(pixel.x), byte(pixel.y), byte(pixel.z), 255]).collect();
    let size = Extent3d { width, height, depth_or_array_layers: 1 };
    let image =
        Image::new(size, TextureDimension::D2, bytes, TextureFormat::Rgba8UnormSrgb, RenderAssetUsages::MAIN_WORLD);
    let image = image.try_into_dynamic().map_err(|error| error.to_string())?;
    image.save(file).map_err(|error| format!("{file}: {error}"))
}
