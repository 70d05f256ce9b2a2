//! The mean of many frames is the sum over all lights.
//!
//! Cells of pixels are compared by the standard error of their mean over independent frames. The
//! sum over all lights draws one point on each triangle, so it has a standard error, too.

use bevy::asset::RenderAssetUsages;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_girandole::{Estimate, GirandoleCamera, GirandoleLight, GirandolePlugin, GirandoleSky};

use crate::harness::{
    HEIGHT, Picture, Setup, WIDTH, add_scene, app, new_pictures, pictures, set_camera, single_frames, start,
};

/// Independent frames of which a mean is taken.
pub const FRAMES: usize = 96;

/// Edge of a cell in pixels.
const CELL: u32 = 4;

/// Standard errors by which a mean may differ. There are 48 cells of three channels. For Student's
/// distribution with 95 degrees of freedom, all 144 stay within in all but 1 of 10,000 seeds.
const LIMIT: f64 = 5.3;

/// The share of a value by which rounding to halves may shift it: each picture is rounded twice, by at
/// most 2⁻¹¹, and the mean of many frames by less.
const ROUNDING: f64 = 1.0 / 1024.0;

/// Frames by which two applications may be apart, and frames that are compared.
const SHIFT: usize = 12;
const COMPARED: usize = 3;

pub struct Means {
    mean: Vec<[f64; 3]>,
    error_sq: Vec<[f64; 3]>,
}

/// The mean brightness of each cell, and the square of its standard error.
pub fn means(frames: &[Picture]) -> Means {
    let cells = (WIDTH / CELL * (HEIGHT / CELL)) as usize;
    let mut sums = vec![[0.0; 3]; cells];
    let mut squares = vec![[0.0; 3]; cells];
    for frame in frames {
        let mut cell_sums = vec![[0.0; 3]; cells];
        for (i, pixel) in (0..).zip(frame) {
            let (x, y) = (i % WIDTH / CELL, i / WIDTH / CELL);
            for (channel, value) in pixel.to_array().into_iter().enumerate() {
                cell_sums[(y * (WIDTH / CELL) + x) as usize][channel] += f64::from(value);
            }
        }
        for (cell, values) in cell_sums.iter().enumerate() {
            for channel in 0..3 {
                sums[cell][channel] += values[channel];
                squares[cell][channel] += values[channel] * values[channel];
            }
        }
    }
    let n = frames.len() as f64;
    let mean: Vec<[f64; 3]> = sums.iter().map(|sum| sum.map(|sum| sum / n)).collect();
    let error_sq = squares
        .iter()
        .zip(&mean)
        .map(|(square, mean)| std::array::from_fn(|i| (square[i] / n - mean[i] * mean[i]).max(0.0) / (n - 1.0)))
        .collect();
    Means { mean, error_sq }
}

pub fn check(name: &str, sampled: &Means, exhaustive: &Means) {
    let brightest = exhaustive.mean.iter().flatten().fold(0.0, |most: f64, &value| most.max(value));
    assert!(brightest > 0.0);
    let mut lit = 0;
    for cell in 0..sampled.mean.len() {
        for channel in 0..3 {
            let [ours, all] = [sampled, exhaustive].map(|means| means.mean[cell][channel]);
            let error = (sampled.error_sq[cell][channel] + exhaustive.error_sq[cell][channel]).sqrt();
            let allowed = LIMIT * error + ROUNDING * all + 1.0e-6 * brightest;
            assert!(
                (ours - all).abs() <= allowed,
                "{name}, cell {cell}, channel {channel}: {ours} is not {all}, standard error {error}"
            );
            lit += usize::from(all > 1.0e-3 * brightest);
            // The test tells little where the error is as large as the value.
            assert!(error <= 0.2 * all.max(0.1 * brightest), "{name}: {error} of {all}");
        }
    }
    assert!(lit > 72, "{name}: {lit} of 144 values are lit");
}

/// Lamps of all kinds around the scene.
fn add_lights(app: &mut App) {
    let (mesh, material) = {
        let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.5, 0.2, 0.3));
        let glowing = StandardMaterial { emissive: LinearRgba::rgb(2.0, 8.0, 3.0), ..default() };
        (mesh, app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(glowing))
    };
    let world = app.world_mut();
    for i in 0..60u32 {
        let [a, b, c] = [7, 11, 5].map(|step| (i * step % 60) as f32 / 60.0);
        let place = Transform::from_xyz(10.0 * a - 5.0, 0.4 + 3.0 * b, 8.0 * c - 5.0);
        let color = Color::linear_rgb(0.2 + a, 0.2 + b, 0.2 + c);
        let intensity = 500.0 + 20_000.0 * a * b;
        if i.is_multiple_of(3) {
            let spot = SpotLight { color, intensity, range: 8.0, outer_angle: 1.2, inner_angle: 0.4, ..default() };
            world.spawn((spot, GirandoleLight, place.looking_at(Vec3::new(a, 0.0, b), Vec3::Y)));
        } else {
            let range = if i.is_multiple_of(2) { 6.0 } else { 20.0 };
            world.spawn((PointLight { color, intensity, range, ..default() }, GirandoleLight, place));
        }
    }
    for i in 0..8u32 {
        let place = Transform::from_xyz(i as f32 - 4.0, 2.5, -1.0).with_rotation(Quat::from_rotation_z(i as f32));
        let place = place.with_scale(Vec3::new(1.0, 0.5 + 0.2 * i as f32, 1.0));
        world.spawn((Mesh3d(mesh.clone()), MeshMaterial3d(material.clone()), GirandoleLight, place));
    }
    let sun = DirectionalLight { illuminance: 40.0, ..default() };
    world.spawn((sun, GirandoleLight, Transform::from_xyz(1.0, 2.0, 1.0).looking_at(Vec3::ZERO, Vec3::Y)));
}

fn scene(plugin: GirandolePlugin, camera: GirandoleCamera) -> App {
    let mut app = app(Setup { plugin, camera, ..default() });
    add_scene(&mut app);
    add_lights(&mut app);
    app
}

#[test]
fn the_mean_of_many_frames_is_the_sum_over_all_lights() {
    let mut app = scene(GirandolePlugin::default(), GirandoleCamera { samples: 4, ..single_frames() });
    set_camera(&mut app, |camera| camera.estimate = Estimate::Exhaustive);
    let exhaustive = means(&pictures(&mut app, FRAMES));
    let [_, single] = [1, 8].map(|candidates| {
        set_camera(&mut app, |camera| {
            camera.estimate = Estimate::Sampled;
            camera.candidates = candidates;
            camera.seed = candidates;
        });
        let sampled = means(&pictures(&mut app, FRAMES));
        check(&format!("{candidates} candidates"), &sampled, &exhaustive);
        sampled
    });

    // The history takes the same mean: of as many frames as have been drawn, it is as near. A rare bright sample may be in
    // one of both means, so no square of a difference in standard errors counts for more than 9.
    set_camera(&mut app, |camera| {
        camera.moving_frames = 12;
        camera.still_frames = 4096;
        camera.history = 1;
        camera.seed = 3;
    });
    let last = pictures(&mut app, FRAMES).pop().expect("there are frames");
    let history = means(&[last.clone(), last]).mean;
    let errors = single.error_sq.iter().flatten().zip(exhaustive.error_sq.iter().flatten());
    let pairs = history.iter().flatten().zip(exhaustive.mean.iter().flatten());
    let squares = pairs.zip(errors).map(|((ours, all), (ours_sq, all_sq))| {
        let error_sq = ours_sq + all_sq + (ROUNDING * all).powi(2);
        ((ours - all).powi(2) / error_sq.max(f64::MIN_POSITIVE)).min(9.0)
    });
    // A mean over 12 frames has 3 in place of 1.
    let mean_square = squares.sum::<f64>() / (3 * history.len()) as f64;
    assert!(mean_square < 2.0, "history: {mean_square}");
}

/// Frames after which lamps are where they were. Pictures come back within as many.
const PERIOD: usize = 8;

/// The means of `runs` periods, while a lamp moves along a path and another one is switched. Each run begins without a
/// last frame.
fn means_in_motion(app: &mut App, lamps: [Entity; 2], path: fn(f32) -> Vec3, runs: u32) -> Means {
    let [moving, switched] = lamps;
    let run = |number| {
        set_camera(app, |camera| camera.history = number);
        let mut frames = Vec::new();
        for frame in 0..2 * PERIOD {
            let phase = frame % PERIOD;
            let world = app.world_mut();
            let mut place = world.get_mut::<Transform>(moving).expect("a lamp");
            place.translation = path(phase as f32 / PERIOD as f32);
            let mut light = world.get_mut::<PointLight>(switched).expect("a lamp");
            light.intensity = if phase < PERIOD / 2 { 60_000.0 } else { 0.0 };
            frames.extend(new_pictures(app));
        }
        let last = &frames[frames.len() - PERIOD..];
        (0..last[0].len()).map(|i| last.iter().map(|frame| frame[i]).sum::<Vec3>() / PERIOD as f32).collect()
    };
    means(&(0..runs).map(run).collect::<Vec<Picture>>())
}

#[test]
fn lights_that_are_reused_while_lamps_move_have_the_same_mean() {
    let camera = GirandoleCamera { reused_frames: 3, samples: 4, candidates: 4, ..single_frames() };
    let mut app = scene(GirandolePlugin { shadows: false, ..default() }, camera);
    let world = app.world_mut();
    let lamps = [0.0, 1.0].map(|x| {
        let light = PointLight { intensity: 60_000.0, range: 20.0, ..default() };
        world.spawn((light, GirandoleLight, Transform::from_xyz(x, 1.0, 1.0))).id()
    });
    start(&mut app);
    let path = |share: f32| {
        let angle = std::f32::consts::TAU * share;
        Vec3::new(2.0 * angle.cos(), 1.5, angle.sin())
    };
    let reused = means_in_motion(&mut app, lamps, path, 32);
    set_camera(&mut app, |camera| camera.estimate = Estimate::Exhaustive);
    check("reuse", &reused, &means_in_motion(&mut app, lamps, path, 8));
}

/// Where the lamp was, its housing is now. Shadow rays know the present scene only, so means are right but for light that
/// comes out of a shadow, which fades in.
#[test]
fn lamps_that_drive_with_their_housings_do_not_shine_brighter() {
    let mut app = scene(GirandolePlugin::default(), GirandoleCamera { reused_frames: 8, ..single_frames() });
    let housing = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.6, 0.6, 0.6));
    let paint = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
    let world = app.world_mut();
    let lamps = [0.0, 1.0].map(|x| {
        let light = PointLight { intensity: 600_000.0, range: 20.0, ..default() };
        let behind = (Mesh3d(housing.clone()), MeshMaterial3d(paint.clone()), Transform::from_xyz(-0.5, 0.0, 0.0));
        world.spawn((light, GirandoleLight, Transform::from_xyz(x, 1.0, 1.0), children![behind])).id()
    });
    start(&mut app);
    let path = |share: f32| Vec3::new(4.0 * share - 2.0, 1.5, 1.0);
    let brightness = |means: Means| means.mean.iter().flatten().sum::<f64>();
    let reused = brightness(means_in_motion(&mut app, lamps, path, 6));
    set_camera(&mut app, |camera| camera.estimate = Estimate::Exhaustive);
    let exact = brightness(means_in_motion(&mut app, lamps, path, 2));
    assert!((0.7..1.05).contains(&(reused / exact)), "{} of the light", reused / exact);
}

#[test]
fn the_same_holds_under_a_sky() {
    let mut app = scene(GirandolePlugin::default(), GirandoleCamera { samples: 4, ..single_frames() });
    // Blue, with a sun in one of 128 texels.
    let mut texels = [Vec3::new(0.2, 0.4, 0.8); 128];
    texels[2 * 16 + 11] = Vec3::new(60.0, 50.0, 40.0);
    let bytes = texels.iter().flat_map(|texel| texel.extend(1.0).to_array()).flat_map(f32::to_le_bytes).collect();
    let size = Extent3d { width: 16, height: 8, depth_or_array_layers: 1 };
    let image =
        Image::new(size, TextureDimension::D2, bytes, TextureFormat::Rgba32Float, RenderAssetUsages::MAIN_WORLD);
    let image = app.world_mut().resource_mut::<Assets<Image>>().add(image);
    app.world_mut().spawn(GirandoleSky { image, intensity: 30.0, rotation: Quat::from_rotation_z(0.3) });
    set_camera(&mut app, |camera| camera.estimate = Estimate::Exhaustive);
    let exhaustive = means(&pictures(&mut app, FRAMES));
    set_camera(&mut app, |camera| camera.estimate = Estimate::Sampled);
    check("sky", &means(&pictures(&mut app, FRAMES)), &exhaustive);
}

#[test]
fn importing_the_modules_gives_the_numbers_of_the_joined_text() {
    // With one candidate, nothing is weighed: both draw the same light by the same numbers.
    let camera = GirandoleCamera { candidates: 1, samples: 2, seed: 9, ..single_frames() };
    let [joined, importing] = [false, true].map(|importing| {
        let mut app = scene(GirandolePlugin { importing, shadows: false, ..default() }, camera);
        pictures(&mut app, 2 * SHIFT + COMPARED)
    });
    assert!(joined[SHIFT] != joined[SHIFT + 1], "frames are independent");
    // Pictures come back some frames late, and not always equally late.
    let middle = &joined[SHIFT..SHIFT + COMPARED];
    let is_equal = importing.windows(COMPARED).any(|frames| frames == middle);
    assert!(is_equal, "the same frames must be the same pictures");

    let mut app =
        scene(GirandolePlugin { importing: true, ..default() }, GirandoleCamera { samples: 4, ..single_frames() });
    let sampled = means(&pictures(&mut app, FRAMES));
    set_camera(&mut app, |camera| camera.estimate = Estimate::Exhaustive);
    check("modules", &sampled, &means(&pictures(&mut app, FRAMES)));
}
