//! The city example's renderer on a small scene: both backends agree, and light trees bring no bias.

use crate::city::app::frames::{Frame, Session};
use crate::city::app::options::{Options, Parsed};
use crate::city::app::run::run;
use crate::city::render::backend::{self, BackendChoice};
use crate::city::render::geometry::{Geometry, Occluders};
use crate::city::render::image::Image;
use crate::city::render::settings::{LightChoice, Settings};
use crate::city::scene::procedural::{self, CityOptions, Size};
use crate::city::scene::{Stage, gltf_scene};
use crate::small_scene;
use crate::support::Rng;
use std::path::Path;

use girandole::FrameBudget;
use girandole::glam::{DVec3, Vec3};

fn settings(width: u32, height: u32, spp: u32, seed: u64) -> Settings {
    Settings { width, height, spp, seed, budget: FrameBudget::UNLIMITED, fps: 24.0, light_choice: LightChoice::Tree }
}

fn session(still: bool, settings: Settings, choice: BackendChoice) -> Session {
    let stage = small_scene::stage(still).expect("the small scene is sound");
    session_of(stage, settings, choice)
}

fn session_of(stage: Stage, settings: Settings, choice: BackendChoice) -> Session {
    let chosen = backend::choose(choice).unwrap_or_else(|e| panic!("this test needs an adapter: {e}"));
    Session::new(stage, settings, chosen).expect("the scene fits any device")
}

fn frame(session: &mut Session) -> Frame {
    session.frame(&|_| {}).expect("the scene renders")
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

/// Same seeds pick the same lights but where rounding tips a choice, or a ray at an edge. Such a sample then differs by
/// about its own noise, a relMSE of some 10 for one sample, so 10 / 16 / 16 for its pixel at 16 samples a pixel. If one
/// sample in a thousand tips that is 16 / 1000 of it: 6e-4. (Lavapipe and x86 round alike: the small scene differs by 1e-10.)
const SAME_PICTURE: f64 = 6e-4;

/// Returns how many picks the light world was told of before each frame, by either backend.
fn assert_same_pictures(name: &str, stage: impl Fn() -> Stage, frames: u32) -> Vec<[u64; 2]> {
    let settings = settings(48, 27, 16, 5);
    let mut cpu = session_of(stage(), settings.clone(), BackendChoice::Cpu);
    let mut gpu = session_of(stage(), settings, BackendChoice::Gpu);
    let same_picture = |number| {
        let (on_cpu, on_gpu) = (frame(&mut cpu), frame(&mut gpu));
        assert!(on_cpu.image.pixels.iter().any(|p| p.max_element() > 0.0), "{name} is black");
        let difference = rel_mse(&on_gpu.image, &on_cpu.image);
        assert!(difference < SAME_PICTURE, "{name}, frame {number}: relMSE {difference}");
        // As many shadow rays, but where a sample tipped.
        let [there, here] = [&on_gpu.record, &on_cpu.record].map(|record| record.shadow_rays);
        let apart = there.traced.abs_diff(here.traced) + there.skipped.abs_diff(here.skipped);
        assert!(here.traced > 1000 && 200 * apart < here.traced, "{name}, frame {number}: {there:?} and {here:?}");
        assert_eq!(on_gpu.record.effects, on_cpu.record.effects);
        [on_cpu.noted_picks, on_gpu.noted_picks]
    };
    (0..frames).map(same_picture).collect()
}

#[test]
fn both_backends_give_the_same_picture() {
    let noted = assert_same_pictures("small scene", || small_scene::stage(false).expect("sound"), 3);
    // Counts come a frame later from the CPU and two from the GPU, each of a sixteenth of the same picks.
    let [cpu, gpu] = [noted[1][0], noted[2][1]];
    assert_eq!([noted[0], noted[1]], [[0, 0], [cpu, 0]]);
    // With 48 * 27 * 16 samples the difference has a standard deviation of at most 50: one false alarm in 5 million
    // choices of a seed, which is fixed. Half of all samples at least meet a surface that light reaches.
    assert!(cpu > 600 && cpu.abs_diff(gpu) < 260, "{cpu} and {gpu} of 20736 / 16");
}

#[test]
fn both_backends_give_the_same_picture_of_the_city() {
    let options = CityOptions { size: Size::S, cars: None, seed: 1 };
    assert_same_pictures("city", || procedural::stage(&options).expect("sound"), 2);
}

#[test]
fn both_backends_give_the_same_picture_of_a_gltf_scene() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/small.gltf");
    assert_same_pictures("small.gltf", || gltf_scene::stage(&file, None).expect("sound"), 2);
}

#[test]
fn a_frame_in_which_nothing_moves_uploads_nothing() {
    let mut session = session(true, settings(16, 9, 1, 1), BackendChoice::Gpu);
    let first = frame(&mut session);
    assert!(first.record.upload_bytes > 0, "the first frame brings the lights");
    for _ in 0..2 {
        let Frame { record, geometry_bytes, .. } = frame(&mut session);
        assert_eq!((record.upload_bytes, geometry_bytes, record.moved_instances, record.refit_trees), (0, 0, 0, 0));
        assert_eq!(record.top_build, None);
    }
}

#[test]
fn where_nothing_casts_shadows_no_shadow_ray_is_traced() {
    for choice in [BackendChoice::Cpu, BackendChoice::Gpu] {
        let mut stage = small_scene::stage(true).expect("the small scene is sound");
        stage.scene.materials.iter_mut().for_each(|material| material.see_through = true);
        let Frame { record, .. } = frame(&mut session_of(stage, settings(48, 27, 16, 5), choice));
        assert_eq!(record.shadow_rays.traced, 0);
        assert!(record.shadow_rays.skipped > 1000, "{:?}", record.shadow_rays);
    }
}

#[test]
fn no_shadow_ray_that_is_skipped_would_have_met_anything() {
    let city = procedural::stage(&CityOptions { size: Size::S, cars: None, seed: 1 }).expect("sound");
    for scene in [city.scene, small_scene::stage(true).expect("the small scene is sound").scene] {
        let geometry = Geometry::new(&scene).expect("a sound scene");
        let mut rng = Rng(91);
        let (mut skipped, mut blocked) = (0, 0);
        for _ in 0..20_000 {
            // About as often inside the box of all occluders as beside it, and close to its sides.
            let Occluders { min, max } = geometry.occluders;
            let share = Vec3::from([0; 3].map(|_| rng.between(-0.3, 1.3)));
            let (origin, direction) = (min + (max - min) * share, rng.direction());
            let limit = 10.0_f32.powf(rng.between(-2.0, 4.0));
            let is_blocked = geometry.occluded(origin, direction, limit);
            let is_skipped = !geometry.occluders.may_block(origin, direction, limit);
            assert!(!(is_blocked && is_skipped), "from {origin} along {direction} for {limit}");
            skipped += usize::from(is_skipped);
            blocked += usize::from(is_blocked);
        }
        assert!(skipped > 2000 && blocked > 1000, "{skipped} skipped, {blocked} blocked");
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
fn the_filter_for_the_eye_brings_a_noisy_picture_closer_to_the_truth() {
    let render = |spp| {
        let mut session = session(true, settings(96, 54, spp, 9), BackendChoice::Cpu);
        let image = frame(&mut session).image;
        let filtered = session.denoise(&image);
        (image, filtered)
    };
    let (truth, filtered_truth) = render(512);
    let (noisy, filtered) = render(8);
    let (before, after) = (rel_mse(&noisy, &truth), rel_mse(&filtered, &truth));
    assert!(after < 0.7 * before, "relMSE {before} before, {after} after");
    // Where there is little noise the filter does little.
    let change = rel_mse(&filtered_truth, &truth);
    assert!(change < 0.4 * after, "relMSE {change} from filtering what had converged, {after} from 8 samples");
}

#[test]
fn bad_input_is_one_line_and_leaves_no_folder() {
    let temporary = |extension: &str| {
        std::env::temp_dir().join(format!("girandole-city-{}", std::process::id())).with_extension(extension)
    };
    let folder = temporary("out");
    let whole = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/small.gltf")).expect("readable");
    let files = [
        ("file", &b"not a folder"[..]),
        ("gltf", &whole[..whole.len() / 2]),
        ("csv", b"x_m,y_m,watts\n1,2,3\n"),
        ("xml", b"<fcd-export><timestep time=\"0.00\"><vehicle id=\"a\" x=\"1\""),
    ];
    for (extension, bytes) in files {
        std::fs::write(temporary(extension), bytes).expect("the temporary folder can be written to");
    }
    let with = |option: &str, extension: &str| format!("{option} {}", temporary(extension).display());
    for (bad, out) in [
        ("--size 0x9".into(), &folder),
        ("--spp 0".into(), &folder),
        ("--budget-ms nan".into(), &folder),
        ("--gltf nowhere.glb".into(), &folder),
        ("--lamps nowhere.csv".into(), &folder),
        ("--traffic nowhere.xml".into(), &folder),
        (with("--gltf", "gltf"), &folder),
        (with("--lamps", "csv"), &folder),
        (with("--traffic", "xml"), &folder),
        ("--backend cpu --frames 1 --spp 1 --size 8x8".into(), &temporary("file")),
    ] {
        let args = ["city", "--out", out.to_str().expect("a plain path")].into_iter().chain(bad.split(' '));
        let error = match Options::read(args) {
            Ok(Parsed::Run(options)) => run(&options, &mut |_| {}).expect_err(&bad),
            Ok(Parsed::Help(text)) => panic!("{bad}: {text}"),
            Err(e) => e,
        };
        assert!(!error.0.is_empty() && !error.0.contains('\n'), "{bad}: {error}");
        assert!(!folder.exists(), "{bad} wrote something");
    }
    for (extension, _) in files {
        std::fs::remove_file(temporary(extension)).expect("it is still there");
    }
}
