//! The city example's renderer on a small scene: both backends agree, and light trees bring no bias.

use crate::city::app::{Frame, Image, Session, Settings};
use crate::city::backend;
use crate::city::options::{BackendChoice, Options, Parsed};
use crate::city::render_cpu::LightChoice;
use crate::city::run::run;
use crate::city::small_scene;
use girandole::FrameBudget;
use girandole::glam::{DVec3, Vec3};

fn settings(width: u32, height: u32, spp: u32, seed: u64) -> Settings {
    Settings { width, height, spp, seed, budget: FrameBudget::UNLIMITED, fps: 24.0, light_choice: LightChoice::Tree }
}

fn session(still: bool, settings: Settings, choice: BackendChoice) -> Session {
    let stage = small_scene::stage(still).expect("the small scene is sound");
    let chosen = backend::choose(choice).unwrap_or_else(|e| panic!("this test needs an adapter: {e}"));
    Session::new(stage, settings, chosen).expect("the small scene fits any device")
}

fn frame(session: &mut Session) -> Frame {
    session.frame(&|_| {}).expect("the small scene renders")
}

/// Mean over pixels of the squared relative difference; pixels darker than a hundredth of the mean count as that.
fn rel_mse(image: &Image, reference: &Image) -> f64 {
    let luminance = |p: Vec3| f64::from(p.dot(Vec3::new(0.2126, 0.7152, 0.0722)));
    let count = reference.pixels.len() as f64;
    let mean = reference.pixels.iter().map(|&p| luminance(p)).sum::<f64>() / count;
    let sum: f64 = image
        .pixels
        .iter()
        .zip(&reference.pixels)
        .map(|(&a, &b)| {
            let (a, b) = (luminance(a), luminance(b));
            (a - b).powi(2) / b.max(mean * 0.01).powi(2)
        })
        .sum();
    sum / count
}

#[test]
fn both_backends_give_the_same_picture() {
    let settings = settings(48, 27, 16, 5);
    let mut cpu = session(false, settings.clone(), BackendChoice::Cpu);
    let mut gpu = session(false, settings, BackendChoice::Gpu);
    for number in 0..3 {
        let (on_cpu, on_gpu) = (frame(&mut cpu), frame(&mut gpu));
        let difference = rel_mse(&on_gpu.image, &on_cpu.image);
        println!("frame {number}: relMSE {difference:e}");
        assert!(difference < SAME_PICTURE, "frame {number}: relMSE {difference}");
    }
}

/// Same seeds pick the same lights but where rounding tips a choice or a ray at an edge. Such a sample then differs by
/// about its own noise, which at 16 samples a pixel is a relMSE of about 0.3; one in a thousand tips at most.
const SAME_PICTURE: f64 = 3e-4;

#[test]
fn a_frame_in_which_nothing_moves_uploads_nothing() {
    let mut session = session(true, settings(16, 9, 1, 1), BackendChoice::Gpu);
    let first = frame(&mut session);
    assert!(first.record.upload_bytes > 0, "the first frame brings the lights");
    for _ in 0..2 {
        let Frame { record, geometry_bytes, .. } = frame(&mut session);
        assert_eq!((record.upload_bytes, geometry_bytes, record.moved_instances, record.refit_trees), (0, 0, 0, 0));
    }
}

#[test]
fn a_frame_in_which_a_car_moves_uploads_less_than_the_first() {
    let mut session = session(false, settings(16, 9, 1, 1), BackendChoice::Gpu);
    let first = frame(&mut session);
    let second = frame(&mut session);
    assert_eq!((second.record.moved_instances, second.record.refit_trees), (1, 1));
    assert!(second.record.upload_bytes > 0 && second.record.upload_bytes < first.record.upload_bytes);
    assert!(second.geometry_bytes > 0);
}

/// Differences of means over tiles of the picture, tree less exhaustive, one a seed.
const SEEDS: u64 = 24;
const TILES: (usize, usize) = (4, 3);
/// Student's t for 23 degrees of freedom: exceeded by chance once in 10 000 tries, both sides together. With 39 tries
/// (12 tiles and the whole, 3 channels) that is one false alarm in 250 choices of seeds, and the seeds are fixed.
const T_LIMIT: f64 = 4.69;
/// Mean standard error of the tiles over their mean brightness.
const WIDEST: f64 = 0.04;

#[test]
fn picking_one_light_agrees_with_summing_over_all() {
    let (width, height) = (32, 18);
    let mut sums = vec![[DVec3::ZERO; 2]; TILES.0 * TILES.1 + 1];
    let mut exhaustive_sum = 0.0;
    for seed in 0..SEEDS {
        let of = |light_choice, spp| {
            let settings = Settings { light_choice, ..settings(width, height, spp, seed) };
            tile_means(&frame(&mut session(true, settings, BackendChoice::Cpu)).image)
        };
        let exhaustive = of(LightChoice::Exhaustive, 8);
        for ((tile, tree), all) in sums.iter_mut().zip(of(LightChoice::Tree, 256)).zip(exhaustive) {
            let difference = (tree - all).as_dvec3();
            tile[0] += difference;
            tile[1] += difference * difference;
            exhaustive_sum += f64::from(all.element_sum());
        }
    }
    let count = SEEDS as f64;
    let mut error_sum = 0.0;
    for (tile, [sum, square_sum]) in sums.iter().enumerate() {
        let mean = *sum / count;
        let variance = (*square_sum - mean * *sum) / (count - 1.0);
        for (channel, (mean, variance)) in mean.to_array().into_iter().zip(variance.to_array()).enumerate() {
            let error = (variance / count).sqrt();
            assert!(mean.abs() <= T_LIMIT * error, "tile {tile}, channel {channel}: off by {mean} with error {error}");
            error_sum += error;
        }
    }
    // Intervals as wide as the picture is bright would pass anything.
    let width = error_sum * count / exhaustive_sum;
    assert!(width < WIDEST, "the intervals are too wide to tell: {width} of the brightness");
}

/// Means of the tiles, then of the whole.
fn tile_means(image: &Image) -> Vec<Vec3> {
    let (tile_width, tile_height) = (image.width as usize / TILES.0, image.height as usize / TILES.1);
    let mut means: Vec<Vec3> = (0..TILES.0 * TILES.1)
        .map(|tile| {
            let (left, top) = (tile % TILES.0 * tile_width, tile / TILES.0 * tile_height);
            let rows = (top..top + tile_height).map(|y| y * image.width as usize + left);
            let sum: Vec3 = rows.flat_map(|start| &image.pixels[start..start + tile_width]).sum();
            sum / (tile_width * tile_height) as f32
        })
        .collect();
    means.push(means.iter().sum::<Vec3>() / means.len() as f32);
    means
}

#[test]
fn bad_input_is_one_line_and_leaves_no_folder() {
    let folder = std::env::temp_dir().join(format!("girandole-city-{}", std::process::id()));
    let in_the_way = folder.with_extension("file");
    std::fs::write(&in_the_way, "not a folder").expect("the temporary folder can be written to");
    for (bad, out) in [
        ("--size 0x9", &folder),
        ("--spp 0", &folder),
        ("--gltf nowhere.glb", &folder),
        ("--lamps nowhere.csv", &folder),
        ("--traffic nowhere.xml", &folder),
        ("--backend cpu --frames 1 --spp 1 --size 8x8", &in_the_way),
    ] {
        let args = ["city", "--out", out.to_str().expect("a plain path")].into_iter().chain(bad.split(' '));
        let error = match Options::read(args) {
            Ok(Parsed::Run(options)) => run(&options, &mut |_| {}).expect_err(bad),
            Ok(Parsed::Help(text)) => panic!("{bad}: {text}"),
            Err(e) => e,
        };
        assert!(!error.0.is_empty() && !error.0.contains('\n'), "{bad}: {error}");
        assert!(!folder.exists(), "{bad} wrote something");
    }
    std::fs::remove_file(in_the_way).expect("it is still there");
}
