//! The renderer of the city example: both backends agree, and sampling by light trees is unbiased.

use city::app::options::{Options, Parsed};
use city::app::run::run;
use city::app::session::{Frame, Pace, Session};
use std::path::Path;
use testbed::render::backend::{self, BackendChoice};
use testbed::render::geometry::{Geometry, Occluders};
use testbed::render::image::Image;
use testbed::render::settings::{LightChoice, Settings};
use testbed::scene::assembly::Assembly;
use testbed::scene::dusk::{self, Dusk};
use testbed::scene::palette::Palette;
use testbed::scene::part::Part;
use testbed::scene::procedural::{self, CityOptions, Size};
use testbed::scene::{Animation, Camera, Scene, SceneError, Stage, gltf_scene};
use testbed::testing::small_scene;
use testbed::testing::support::Rng;

use girandole::glam::{Affine3A, DVec3, Vec3};
use girandole::{Effects, FrameBudget, InstanceKey, Light, LightWorld, Policy};

pub const PACE: Pace = Pace { fps: 24.0, start: 0.0, budget: FrameBudget::UNLIMITED };

pub fn settings(width: u32, height: u32, spp: u32, seed: u64) -> Settings {
    Settings {
        width,
        height,
        spp,
        splits: 6,
        candidates: 4,
        reused_frames: 0,
        seed,
        light_choice: LightChoice::Girandole,
    }
}

fn small_scene_session(is_still: bool, settings: Settings, choice: BackendChoice) -> Session {
    let stage = small_scene::stage(is_still).expect("the small scene is valid");
    session(stage, settings, choice)
}

pub fn session(stage: Stage, settings: Settings, choice: BackendChoice) -> Session {
    let chosen = backend::choose(choice).unwrap_or_else(|e| panic!("this test needs an adapter: {e}"));
    Session::new(stage, settings, PACE, chosen).expect("a scene that fits any device")
}

pub fn frame(session: &mut Session) -> Frame {
    session.frame(&|_| {}).expect("a scene that renders")
}

/// The mean over all pixels of the squared relative difference. Differences of pixels that are
/// darker than a hundredth of the mean are relative to that hundredth.
pub fn rel_mse(image: &Image, reference: &Image) -> f64 {
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

/// Limit of the relMSE between pictures of both backends from the same seed.
///
/// With equal seeds, samples differ only where rounding changes the choice of a light or the hit of
/// a ray at an edge. Such a sample differs by about its own noise, a relMSE of some 10 for one
/// sample, which is 10 / 16 / 16 for its pixel at 16 samples per pixel. If one sample in a thousand
/// differs, 16 / 1000 of the pixels do: 6e-4. (Lavapipe and x86 round alike: on them the small
/// scene differs by 1e-10.)
const MAX_REL_MSE: f64 = 6e-4;

/// Without cells, whose points are not the same on both sides: see below.
pub fn assert_same_pictures(name: &str, stage: impl Fn() -> Stage, frames: u32) {
    let settings = Settings { light_choice: LightChoice::Roots, ..settings(48, 27, 16, 5) };
    let mut cpu = session(stage(), settings.clone(), BackendChoice::Cpu);
    let mut gpu = session(stage(), settings, BackendChoice::Gpu);
    for number in 0..frames {
        let (on_cpu, on_gpu) = (frame(&mut cpu), frame(&mut gpu));
        assert!(on_cpu.image.pixels.iter().any(|p| p.max_element() > 0.0), "{name} is black");
        let difference = rel_mse(&on_gpu.image, &on_cpu.image);
        assert!(difference < MAX_REL_MSE, "{name}, frame {number}: relMSE {difference}");
        // The numbers of shadow rays differ only by those of samples that differ.
        let [gpu_rays, cpu_rays] = [&on_gpu.stats, &on_cpu.stats].map(|stats| stats.shadow_rays);
        let difference = gpu_rays.traced.abs_diff(cpu_rays.traced) + gpu_rays.skipped.abs_diff(cpu_rays.skipped);
        let is_close = cpu_rays.traced > 1000 && 200 * difference < cpu_rays.traced;
        assert!(is_close, "{name}, frame {number}: {gpu_rays:?} and {cpu_rays:?}");
        assert_eq!(on_gpu.stats.effects, on_cpu.stats.effects);
    }
}

#[test]
fn both_backends_render_the_same_picture() {
    assert_same_pictures("small scene", || small_scene::stage(false).expect("a valid scene"), 3);
}

#[test]
fn both_backends_render_the_same_picture_of_the_city() {
    let options = CityOptions { size: Size::S, cars: None, seed: 1, lamp_profile: None };
    assert_same_pictures("city", || procedural::stage(&options).expect("a valid scene"), 2);
}

#[test]
fn both_backends_render_the_same_picture_at_dusk() {
    let lamp_profile = Some(Dusk::default().profile().expect("a profile"));
    let options = CityOptions { size: Size::S, cars: None, seed: 1, lamp_profile };
    let stage = || {
        let mut stage = procedural::stage(&options).expect("a valid scene");
        dusk::set(&mut stage).expect("a valid sky");
        assert!(stage.world.active_effects().contains(Effects::SKY | Effects::PROFILES));
        stage
    };
    assert_same_pictures("dusk", stage, 1);
}

#[test]
fn a_fire_and_a_dancer_that_the_gpu_moves_light_the_street() {
    let mean = |arguments: &str| {
        let given = "city --camera -2.6,2.1,116.5,0.5,4.3,100 --backend gpu".split(' ').chain(arguments.split(' '));
        let Ok(Parsed::Run(options)) = Options::read(given) else { panic!("valid options") };
        let stage = options.scene.load((48, 27)).expect("a valid scene");
        let mut session = session(stage, settings(48, 27, 4, 5), BackendChoice::Gpu);
        let frames = [frame(&mut session), frame(&mut session)];
        for tree in session.scene().festival.iter().flat_map(|festival| [festival.sparks, festival.suit]) {
            assert_eq!(session.world().refused_writes(tree), 0);
        }
        assert!(!options.fire || frames[0].stats.lights > 100_000, "{} lights", frames[0].stats.lights);
        frames.map(|frame| frame.image.pixels.iter().sum::<Vec3>() / (48.0 * 27.0))
    };
    let [first, second] = mean("--fire");
    let [night, _] = mean("--cars 0");
    assert!(first.is_finite() && second.is_finite() && first != second);
    assert!(first.x > 1.3 * night.x && first.x - night.x > 2.0 * (first.z - night.z), "{first} {night}");
}

/// Which points a cell keeps depends on their places in it, and so on how rays are rounded at the borders between two
/// places. The samples of a cell whose points are others differ by their noise. In a picture this small, cells are
/// smaller than pixels, and 35 % of the pixels have points that share no cut; there each backend has its own way.
#[test]
fn both_backends_render_the_same_picture_from_shared_cuts_where_points_share_them() {
    let options = CityOptions { size: Size::S, cars: None, seed: 1, lamp_profile: None };
    let settings = Settings { light_choice: LightChoice::SharedCuts, ..settings(48, 27, 16, 5) };
    let [cpu, gpu] = [BackendChoice::Cpu, BackendChoice::Gpu].map(|choice| {
        let mut session = session(procedural::stage(&options).expect("a valid scene"), settings.clone(), choice);
        [(); 2].map(|()| frame(&mut session).image)
    });
    let mut without = session(
        procedural::stage(&options).expect("a valid scene"),
        Settings { light_choice: LightChoice::Girandole, ..settings },
        BackendChoice::Cpu,
    );
    for (on_cpu, on_gpu) in cpu.iter().zip(&gpu) {
        let others = |image: &Image| {
            let pixels = image.pixels.iter().zip(&on_cpu.pixels);
            pixels.filter(|(a, b)| (**a - **b).length() > 1.0e-3 * b.length()).count()
        };
        let (count, all) = (others(on_gpu), on_cpu.pixels.len());
        assert!(5 * count < 2 * all, "{count} of {all} pixels differ");
        let without = others(&frame(&mut without).image);
        assert!(2 * without > all, "cuts matter in {without} of {all} pixels");
    }
}

#[test]
fn both_backends_render_the_same_picture_of_a_gltf_scene() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/small.gltf");
    assert_same_pictures("small.gltf", || gltf_scene::stage(&file, None).expect("a valid scene"), 2);
}

#[test]
fn a_frame_in_which_nothing_moves_uploads_nothing() {
    let mut session = small_scene_session(true, settings(16, 9, 1, 1), BackendChoice::Gpu);
    let first = frame(&mut session);
    assert!(first.stats.upload_bytes > 0, "the first frame uploads the lights");
    for _ in 0..2 {
        let Frame { stats, geometry_bytes, .. } = frame(&mut session);
        assert_eq!((stats.upload_bytes, geometry_bytes, stats.moved_instances, stats.refit_trees), (0, 0, 0, 0));
    }
}

#[test]
fn no_shadow_ray_is_traced_in_a_scene_that_casts_no_shadows() {
    for choice in [BackendChoice::Cpu, BackendChoice::Gpu] {
        let mut stage = small_scene::stage(true).expect("the small scene is valid");
        stage.scene.materials.iter_mut().for_each(|material| material.see_through = true);
        let Frame { stats, .. } = frame(&mut session(stage, settings(48, 27, 16, 5), choice));
        assert_eq!(stats.shadow_rays.traced, 0);
        assert!(stats.shadow_rays.skipped > 1000, "{:?}", stats.shadow_rays);
    }
}

#[test]
fn shadow_rays_that_are_skipped_are_not_blocked() {
    let city = procedural::stage(&CityOptions { size: Size::S, cars: None, seed: 1, lamp_profile: None })
        .expect("a valid scene");
    for scene in [city.scene, small_scene::stage(true).expect("the small scene is valid").scene] {
        let geometry = Geometry::new(&scene).expect("a valid scene");
        let mut rng = Rng(91);
        let (mut skipped, mut blocked) = (0, 0);
        for _ in 0..20_000 {
            // Inside the box of all occluders, and outside it near its sides.
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
    let mut session = small_scene_session(false, settings(16, 9, 1, 1), BackendChoice::Gpu);
    let first = frame(&mut session);
    let second = frame(&mut session);
    assert_eq!((second.stats.moved_instances, second.stats.refit_trees), (1, 1));
    assert!(second.stats.upload_bytes > 0 && second.stats.upload_bytes < first.stats.upload_bytes);
    assert!(second.geometry_bytes > 0);
}

/// Seeds for each of which the means over tiles are compared.
const SEEDS: u64 = 24;
/// Tiles across and down the picture.
const TILES: (usize, usize) = (4, 3);
/// The samplers that choose one light, and the samples per pixel that each needs.
const SAMPLERS: [(LightChoice, u32); 3] =
    [(LightChoice::Girandole, 256), (LightChoice::SharedCuts, 256), (LightChoice::Roots, 512)];
/// Student's t for 23 degrees of freedom, which chance exceeds once in 40,000 tries, both sides
/// together. With 117 tries (3 samplers, 12 tiles and the whole picture, 3 channels) one choice of
/// seeds in 340 causes a false alarm; the seeds are fixed.
const T_LIMIT: f64 = 5.26;
/// Limit of the mean standard error of the tiles, relative to their mean brightness.
const MAX_RELATIVE_ERROR: f64 = 0.04;

#[test]
fn every_sampler_agrees_with_the_sum_over_all_lights() {
    let render = |light_choice, spp, seed| {
        let settings = Settings { light_choice, ..settings(32, 18, spp, seed) };
        tile_means(&frame(&mut small_scene_session(true, settings, BackendChoice::Cpu)).image)
    };
    let exhaustive: Vec<_> = (0..SEEDS).map(|seed| render(LightChoice::Exhaustive, 8, seed)).collect();
    let exhaustive_sum: f64 = exhaustive.iter().flatten().map(|mean| f64::from(mean.element_sum())).sum();
    for (choice, spp) in SAMPLERS {
        let mut sums = vec![[DVec3::ZERO; 2]; TILES.0 * TILES.1 + 1];
        for (seed, exhaustive) in (0..).zip(&exhaustive) {
            for ((tile, sampled), all) in sums.iter_mut().zip(render(choice, spp, seed)).zip(exhaustive) {
                let difference = (sampled - all).as_dvec3();
                tile[0] += difference;
                tile[1] += difference * difference;
            }
        }
        let count = SEEDS as f64;
        let mut error_sum = 0.0;
        for (tile, [sum, square_sum]) in sums.iter().enumerate() {
            let mean = *sum / count;
            let variance = (*square_sum - mean * *sum) / (count - 1.0);
            for (channel, (mean, variance)) in mean.to_array().into_iter().zip(variance.to_array()).enumerate() {
                let error = (variance / count).sqrt();
                assert!(
                    mean.abs() <= T_LIMIT * error,
                    "{choice:?}, tile {tile}, channel {channel}: differs by {mean} with a standard error of {error}"
                );
                error_sum += error;
            }
        }
        // With larger errors the test could not fail.
        let relative_error = error_sum * count / exhaustive_sum;
        assert!(
            relative_error < MAX_RELATIVE_ERROR,
            "{choice:?}: the standard error is {relative_error} of the brightness"
        );
    }
}

/// Of so many frames, in which pixels keep lights.
const KEPT_FRAMES: u32 = 8;

fn keeping(width: u32, height: u32, seed: u64) -> Settings {
    let settings = settings(width, height, 1, seed);
    Settings { reused_frames: 20, candidates: 1, light_choice: LightChoice::Roots, ..settings }
}

/// A car that drives through a yard with two lamps. Its headlamp is where its body is in the next frame.
struct Drive {
    car: usize,
    lamp: InstanceKey,
}

impl Animation for Drive {
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        // From the same place for each seed.
        let frame = (time * PACE.fps).round() as u32 % KEPT_FRAMES;
        let place = Affine3A::from_translation(Vec3::new(0.3 * frame as f32 - 1.0, 0.4, 0.0));
        scene.objects[self.car].transform = place;
        Ok(world.move_instance(self.lamp, place)?)
    }
}

fn yard() -> Result<Stage, SceneError> {
    let (mut assembly, mut palette) = (Assembly::new(), Palette::default());
    let gray = palette.matte(0.5, 0.5, 0.5);
    let mut ground = Part::default();
    ground.floor([-4.0, -4.0], [4.0, 4.0], 0.0, gray);
    for x in [-3.0, 3.0] {
        ground.lights.push(Light::point(Vec3::new(x, 3.0, 1.0), Vec3::splat(6.0)));
    }
    let ground = assembly.design(ground)?;
    assembly.place(ground, Affine3A::IDENTITY, Policy::Static)?;
    let mut car = Part::default();
    car.cuboid(Vec3::new(-0.5, -0.15, -0.2), Vec3::new(-0.15, 0.15, 0.2), gray);
    car.lights.push(Light::point(Vec3::ZERO, Vec3::splat(2.0)));
    let car = assembly.design(car)?;
    let placed = assembly.place(car, Affine3A::IDENTITY, Policy::Static)?;
    let lamp = placed.instance.ok_or_else(|| SceneError("a car without a lamp".into()))?;
    assembly.scene.materials = palette.materials;
    assembly.scene.camera =
        Camera { eye: Vec3::new(0.0, 4.0, 4.0), target: Vec3::ZERO, vertical_fov: 0.8, up: Vec3::Y };
    let animation = Box::new(Drive { car: placed.object, lamp });
    Ok(Stage { scene: assembly.scene, world: assembly.world, animation })
}

#[test]
fn kept_lights_lower_the_noise_and_leave_the_means() {
    let [plain, kept] = noise_of_kept_lights(|| small_scene::stage(false));
    assert!(kept < 0.5 * plain, "relMSE {plain}, and {kept} with kept lights");
}

#[test]
fn a_lamp_that_drives_with_its_car_gets_no_brighter_in_pixels_that_keep_it() {
    // Of three lamps hardly anything is to gain.
    noise_of_kept_lights(yard);
}

/// Compares the means of tiles with sums over all lights. Returns the relMSE without kept lights and with them.
fn noise_of_kept_lights(stage: impl Fn() -> Result<Stage, SceneError>) -> [f64; 2] {
    // A session plays the frames of all seeds. The first one of each reuses nothing.
    let session = || session(stage().expect("a valid scene"), keeping(32, 18, 0), BackendChoice::Gpu);
    let last = |session: &mut Session, settings: Settings| {
        let first = Settings { reused_frames: 0, ..keeping(32, 18, settings.seed) };
        session.set_settings(first).expect("the same size");
        frame(session);
        session.set_settings(settings).expect("the same size");
        (2..KEPT_FRAMES).for_each(|_| drop(frame(session)));
        frame(session).image
    };
    // The same rays go through pixels.
    let mut reference = session();
    let all = |seed| Settings { light_choice: LightChoice::Exhaustive, ..keeping(32, 18, seed) };
    let exact: Vec<Image> = (0..SEEDS).map(|seed| last(&mut reference, all(seed))).collect();
    let (mut sums, mut noise) = (vec![[DVec3::ZERO; 2]; TILES.0 * TILES.1 + 1], [0.0; 2]);
    let [mut session, mut plain] = [(); 2].map(|()| session());
    for (seed, exact) in (0..).zip(&exact) {
        let image = last(&mut session, keeping(32, 18, seed));
        let plain = last(&mut plain, Settings { reused_frames: 0, ..keeping(32, 18, seed) });
        for (noise, image) in noise.iter_mut().zip([&plain, &image]) {
            *noise += rel_mse(image, exact) / SEEDS as f64;
        }
        for (tile, (kept, all)) in sums.iter_mut().zip(tile_means(&image).into_iter().zip(tile_means(exact))) {
            let difference = (kept - all).as_dvec3();
            tile[0] += difference;
            tile[1] += difference * difference;
        }
    }
    for (tile, [sum, square_sum]) in sums.iter().enumerate() {
        let mean = *sum / SEEDS as f64;
        let variance = (*square_sum - mean * *sum) / (SEEDS - 1) as f64;
        let error = (variance / SEEDS as f64).map(f64::sqrt);
        assert!(mean.abs().cmple(T_LIMIT * error).all(), "tile {tile}: {mean}, error {error}");
    }
    noise
}

#[test]
fn the_sampler_can_be_switched_between_frames() {
    let render = |backend, choices: [LightChoice; 3]| {
        let mut session = small_scene_session(false, settings(32, 18, 4, 3), backend);
        choices.map(|choice| {
            let settings = Settings { light_choice: choice, ..session.settings().clone() };
            session.set_settings(settings).expect("the same size");
            frame(&mut session)
        })
    };
    // It depends on no frame before.
    let (girandole, all) = (LightChoice::Roots, LightChoice::Exhaustive);
    let [_, expected, _] = render(BackendChoice::Cpu, [girandole, all, girandole]);
    // The CPU renders it while the GPU is the backend, which does not miss what moves.
    let [_, on_gpu, after] = render(BackendChoice::Gpu, [girandole, all, girandole]);
    assert_eq!(on_gpu.image.pixels, expected.image.pixels);
    let [_, other, expected] = render(BackendChoice::Gpu, [girandole; 3]);
    assert_ne!(other.image.pixels, on_gpu.image.pixels);
    assert_eq!(after.image.pixels, expected.image.pixels);
}

/// The means of the tiles, then of the whole picture.
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
fn the_denoiser_reduces_the_error_of_a_noisy_picture() {
    let render = |spp| {
        let mut session = small_scene_session(true, settings(96, 54, spp, 9), BackendChoice::Cpu);
        let image = frame(&mut session).image;
        let filtered = session.denoise(&image);
        (image, filtered)
    };
    let (reference, filtered_reference) = render(512);
    // With more samples this scene is hardly noisy.
    let (noisy, filtered) = render(2);
    let (before, after) = (rel_mse(&noisy, &reference), rel_mse(&filtered, &reference));
    assert!(after < 0.7 * before, "relMSE {before} before, {after} after");
    // It changes a picture with little noise by little.
    let change = rel_mse(&filtered_reference, &reference);
    assert!(
        change < 0.4 * after,
        "relMSE {change} of the filtered reference, {after} of the filtered picture of 2 samples"
    );
}

#[test]
fn invalid_input_gives_one_line_and_creates_no_folder() {
    let temporary = |extension: &str| {
        std::env::temp_dir().join(format!("girandole-city-{}", std::process::id())).with_extension(extension)
    };
    let folder = temporary("out");
    let whole = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/small.gltf"))
        .expect("a readable file");
    let files = [("file", &b"not a folder"[..]), ("gltf", &whole[..whole.len() / 2]), ("csv", b"x_m,watts\n1,3\n")];
    for (extension, bytes) in files {
        std::fs::write(temporary(extension), bytes).expect("a writable temporary folder");
    }
    let with = |option: &str, extension: &str| format!("{option} {}", temporary(extension).display());
    for (bad, out) in [
        ("--size 0x9".into(), &folder),
        ("--spp 0".into(), &folder),
        ("--budget-ms nan".into(), &folder),
        ("--gltf nowhere.glb".into(), &folder),
        ("--lamps nowhere.csv".into(), &folder),
        (with("--gltf", "gltf"), &folder),
        (with("--lamps", "csv"), &folder),
        ("--backend cpu --frames 1 --spp 1 --size 8x8".into(), &temporary("file")),
    ] {
        let args = ["city", "--out", out.to_str().expect("a UTF-8 path")].into_iter().chain(bad.split(' '));
        let error = match Options::read(args) {
            Ok(Parsed::Run(options)) => run(&options, &mut |_| {}).expect_err(&bad),
            Ok(Parsed::Help(text)) => panic!("{bad}: {text}"),
            Err(e) => e,
        };
        assert!(!error.0.is_empty() && !error.0.contains('\n'), "{bad}: {error}");
        assert!(!folder.exists(), "{bad} created the folder");
    }
    for (extension, _) in files {
        std::fs::remove_file(temporary(extension)).expect("a file that exists");
    }
}
