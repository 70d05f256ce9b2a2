//! Dumps of light worlds: what the city writes, it shows.

use city::app::options::{Options, Parsed};
use city::app::run::run;
use city::app::session::Session;
use city::window::controls::{Controls, ViewKind};
use city::window::drawing::{Drawn, draw};
use city::window::looseness::looseness;
use city::window::overlay::Overlay;
use city::window::still;
use city::window::viewer::{Viewer, Wish};
use girandole::LightWorld;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use testbed::render::backend;
use testbed::render::settings::LightChoice;
use testbed::render::shading::View;
use testbed::scene::{Camera, SceneError, dump};

const SIZE: (u32, u32) = (160, 90);

/// The path of a folder that does not exist, for one test only.
fn fresh_folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("dump-{name}-{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    folder
}

fn options(arguments: &[&str]) -> Options {
    let all = ["city", "--backend", "cpu"].iter().chain(arguments);
    match Options::read(all) {
        Ok(Parsed::Run(options)) => *options,
        Ok(Parsed::Help(text)) => panic!("{text}"),
        Err(error) => panic!("{error}"),
    }
}

/// Opens a dump without a window, and returns what it prints.
fn open(file: &Path, folder: &Path, level: i32) -> Result<Vec<String>, SceneError> {
    let [file, folder] = [file, folder].map(|path| path.to_str().expect("UTF-8"));
    let level = level.to_string();
    let options = options(&["--open", file, "--out", folder, "--size", "160x90", "--level", &level]);
    let mut lines = Vec::new();
    still::run(&options, &mut |line| lines.push(line.to_owned()))?;
    Ok(lines)
}

fn drawing(world: &LightWorld, camera: &Camera, level: i32) -> Overlay {
    let looseness = looseness(world);
    let drawn = Drawn { level, has_lights: true, looseness: Some(&looseness) };
    draw(world, &View::new(camera, SIZE.0, SIZE.1), SIZE, &drawn)
}

fn pixels(path: &Path) -> Vec<u8> {
    let file = std::io::BufReader::new(File::open(path).expect("a picture"));
    let mut reader = png::Decoder::new(file).read_info().expect("a PNG file");
    let mut bytes = vec![0; reader.output_buffer_size().expect("a small picture")];
    reader.next_frame(&mut bytes).expect("a whole picture");
    bytes
}

#[test]
fn a_dump_of_a_session_shows_the_boxes_and_lights_of_its_world() {
    let folder = fresh_folder("session");
    fs::create_dir_all(&folder).expect("a writable folder");
    let file = folder.join("city.dump");
    let options = options(&["--size", "16x9", "--spp", "1", "--cars", "60", "--start", "20"]);
    let stage = options.scene.load(options.size).expect("the city is valid");
    let chosen = backend::choose(options.backend).expect("a CPU");
    let mut session = Session::new(stage, options.settings(), options.pace(), chosen).expect("a valid scene");
    for _ in 0..12 {
        session.frame(&|_| {}).expect("a scene that renders");
    }
    let world = session.world();
    world.write_dump(&mut File::create(&file).expect("a writable folder")).expect("room");
    let camera = dump::stage(&file, 16.0 / 9.0).expect("a dump").scene.camera;
    // Of the top level a dump has no partition, so its nodes depend on the moves before.
    for level in [0, 2] {
        let lines = open(&file, &folder, level).expect("a dump");
        let lights = format!("{} lights in {} instances", world.light_count(), world.instances().len());
        assert!(lines.last().is_some_and(|line| line.starts_with(&lights)), "{lines:?}");
        let expected = still::paint(&drawing(world, &camera, level), SIZE);
        assert!(expected.chunks(3).filter(|pixel| *pixel != [0; 3]).count() > 2000);
        assert!(pixels(&folder.join("dump.png")) == expected, "level {level}");
    }
    // Another world has another picture.
    session.frame(&|_| {}).expect("a scene that renders");
    let later = still::paint(&drawing(session.world(), &camera, 2), SIZE);
    assert!(pixels(&folder.join("dump.png")) != later);
}

#[test]
fn the_program_writes_a_dump_after_the_last_frame_and_refuses_other_files() {
    let folder = fresh_folder("program");
    fs::create_dir_all(&folder).expect("a writable folder");
    let file = folder.join("city.dump");
    let [out, path] = [&folder, &file].map(|path| path.to_str().expect("UTF-8"));
    run(&options(&["--size", "16x9", "--spp", "1", "--frames", "1", "--out", out, "--dump", path]), &mut |_| {})
        .expect("a scene that renders");
    open(&file, &folder, 0).expect("a dump");
    let bytes = fs::read(&file).expect("a dump");
    for (content, fault) in [(&bytes[..bytes.len() - 1], "damaged or incomplete"), (b"glTF", "not those of a dump")] {
        fs::write(&file, content).expect("a writable folder");
        let error = open(&file, &folder, 0).expect_err("it is damaged").to_string();
        assert!(error.contains(path) && error.contains(fault), "{error}");
    }
    assert!(open(&folder.join("none"), &folder, 0).is_err());
}

#[test]
fn the_window_shows_a_dump_without_surfaces() {
    let folder = fresh_folder("window");
    fs::create_dir_all(&folder).expect("a writable folder");
    let file = folder.join("city.dump");
    let city = options(&["--size", "16x9"]).scene.load((16, 9)).expect("the city is valid");
    city.world.write_dump(&mut File::create(&file).expect("a writable folder")).expect("room");
    let controls = Controls {
        view: ViewKind::Trees,
        level: 0,
        has_lights: true,
        sampler: LightChoice::Girandole,
        budget_ms: 1.0,
        splits: 6,
        candidates: 4,
        spp: 1,
        cars: None,
        exposure_ev: 0.0,
        pixel_size: 4,
        is_filtered: false,
        is_reused: false,
        is_accumulated: false,
        is_frozen: false,
    };
    let options = options(&["--window", "--open", file.to_str().expect("UTF-8")]);
    let mut viewer = Viewer::new(&options, &controls).expect("a dump");
    let mut shown =
        |controls| viewer.frame(&Wish { controls, camera: None, size: (48, 27) }, false).expect("a picture");
    let [boxes, both, below] = [(0, false), (0, true), (1, true)].map(|(level, has_lights)| {
        shown(Controls { level, has_lights, ..controls }).overlay.expect("a drawing").lines.len()
    });
    assert!(boxes > 1000 && both > boxes + 10_000 && below > both, "{boxes} {both} {below}");
    let picture = shown(Controls { view: ViewKind::Picture, ..controls });
    assert!(picture.pixels.iter().all(|byte| *byte == 0), "there are no surfaces");
}
