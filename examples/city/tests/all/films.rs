//! The films and folders of the city example, and what an interrupted run leaves.

use city::app::options::{Options, Parsed};
use city::app::output::CSV_HEADER;
use city::app::run::run;
use city::app::video::film::Film;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

const GRAY: [u8; 3] = [100; 3];

/// The path of a folder that does not exist, for one test only.
fn fresh_folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("films-{name}-{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    folder
}

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data").join(file)
}

/// Runs the city on a small scene and returns what it prints.
fn render(arguments: &[&OsStr]) -> Vec<String> {
    let scene = data("small.gltf");
    let small = ["city", "--backend", "cpu", "--size", "17x9", "--spp", "2", "--gltf"].map(OsStr::new);
    let all = small.into_iter().chain([scene.as_os_str()]).chain(arguments.iter().copied());
    let Ok(Parsed::Run(options)) = Options::read(all) else { panic!("valid options: {arguments:?}") };
    let mut lines = Vec::new();
    run(&options, &mut |line| lines.push(line.to_owned())).expect("a scene that renders");
    lines
}

/// The names of the files in a folder, sorted.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// The rows of a table of frames, each of which must be complete.
fn rows(folder: &Path) -> Vec<csv::StringRecord> {
    let mut table = csv::Reader::from_path(folder.join("frames.csv")).expect("a table");
    assert_eq!(table.headers().expect("columns"), &CSV_HEADER[..]);
    table.records().map(|row| row.expect("a complete row")).collect()
}

#[test]
fn a_film_has_all_frames_in_the_colours_of_the_pictures() {
    let folder = fresh_folder("y4m");
    let film = folder.join("film.y4m");
    let arguments = ["--frames", "3", "--fps", "12.5", "--video"].map(OsStr::new);
    render(&[&arguments[..], &[film.as_os_str(), OsStr::new("--out"), folder.as_os_str()]].concat());
    let bytes = fs::read(&film).expect("a film");
    let header = b"YUV4MPEG2 W17 H9 F25:2 Ip A1:1 C444 XCOLORRANGE=LIMITED\n";
    let plane = 17 * 9;
    assert_eq!(bytes.len(), header.len() + 3 * (6 + 3 * plane));
    assert!(bytes.starts_with(header));
    for number in 0..3 {
        let frame = &bytes[header.len() + number * (6 + 3 * plane)..];
        assert!(frame.starts_with(b"FRAME\n"));
        let file = fs::File::open(folder.join(format!("frame_{number:04}.png"))).expect("a picture");
        let mut png = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
        let mut picture = vec![0; 3 * plane];
        png.next_frame(&mut picture).expect("a PNG");
        for (place, rgb) in picture.chunks(3).enumerate() {
            let [red, green, blue] = [0, 1, 2].map(|channel| f64::from(rgb[channel]) / 255.0);
            let luma = 16.0 + 219.0 * (0.2126 * red + 0.7152 * green + 0.0722 * blue);
            assert!((f64::from(frame[6 + place]) - luma).abs() < 0.51, "frame {number}, pixel {place}");
        }
    }
    fs::remove_dir_all(&folder).expect("a folder that exists");
}

#[test]
fn a_film_alone_comes_without_pictures_and_table() {
    let folder = fresh_folder("alone");
    let film = folder.join("film.y4m");
    let lines = render(&[OsStr::new("--video"), film.as_os_str()]);
    assert_eq!(names(&folder), ["film.y4m"]);
    assert!(lines.iter().any(|line| line.ends_with("film.y4m") && !line.contains("pictures in")), "{lines:?}");
    fs::remove_dir_all(&folder).expect("a folder that exists");
}

#[cfg(unix)]
#[test]
fn an_encoder_receives_the_stream_and_its_file_gets_the_name_at_the_end() {
    let folder = fresh_folder("encoder");
    let path = folder.join("film: one.mp4");
    let mut film = Film::new(&path, (3, 1), 24.0, data("ffmpeg_that_copies.sh").as_os_str()).expect("an encoder");
    film.add(&GRAY.repeat(3)).expect("an encoder that reads");
    assert!(!path.exists());
    film.finish().expect("an encoder that ends well");
    assert_eq!(names(&folder), ["film: one.mp4"]);
    let bytes = fs::read(&path).expect("a film");
    assert!(bytes.starts_with(b"YUV4MPEG2 W3 H1 F24:1 ") && bytes.ends_with(&[128; 6]));
    fs::remove_dir_all(&folder).expect("a folder that exists");
}

#[cfg(unix)]
#[test]
fn an_encoder_that_fails_is_told_by_its_last_line_and_leaves_no_file() {
    let folder = fresh_folder("failure");
    let path = folder.join("film.mp4");
    let write = || -> Result<(), testbed::scene::SceneError> {
        let mut film = Film::new(&path, (64, 64), 24.0, data("ffmpeg_that_fails.sh").as_os_str())?;
        for _ in 0..100 {
            film.add(&GRAY.repeat(64 * 64))?;
        }
        film.finish()
    };
    let line = write().expect_err("the encoder fails").0;
    assert_eq!(line, format!("cannot write {}: ffmpeg failed: Unable to choose an output format", path.display()));
    assert!(names(&folder).is_empty(), "{:?}", names(&folder));
    fs::remove_dir_all(&folder).expect("a folder that exists");
}

#[test]
fn an_encoder_that_is_not_installed_is_told_in_one_line_and_leaves_no_folder() {
    let folder = fresh_folder("missing");
    let path = folder.join("film.mp4");
    let line = Film::new(&path, (8, 8), 24.0, OsStr::new("no-such-ffmpeg")).err().expect("no such program").0;
    assert!(line.contains("no-such-ffmpeg was not found") && line.contains(".y4m"), "{line}");
    assert!(!line.contains('\n') && !folder.exists());
}

#[test]
fn a_film_that_is_dropped_leaves_no_file() {
    let folder = fresh_folder("dropped");
    let path = folder.join("film.y4m");
    let mut film = Film::new(&path, (2, 2), 24.0, OsStr::new("unused")).expect("a writable folder");
    film.add(&GRAY.repeat(4)).expect("a writable folder");
    drop(film);
    assert!(names(&folder).is_empty(), "{:?}", names(&folder));
    fs::remove_dir_all(&folder).expect("a folder that exists");
}

/// Starts a run that is endless for a test, and waits until it has finished four frames.
fn endless_run(folder: &Path, film: &Path) -> Child {
    let mut city = Command::new(env!("CARGO_BIN_EXE_city"))
        .args(["--backend", "cpu", "--size", "16x9", "--spp", "1", "--frames", "100000", "--gltf"])
        .args([data("small.gltf").as_os_str(), OsStr::new("--out"), folder.as_os_str()])
        .args([OsStr::new("--video"), film.as_os_str()])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("a binary that starts");
    // The limit only ends a test that would hang.
    let limit = Instant::now() + Duration::from_secs(120);
    let has_frames = || fs::read_to_string(folder.join("frames.csv")).is_ok_and(|text| text.lines().count() > 4);
    while !has_frames() && Instant::now() < limit && city.try_wait().expect("a process").is_none() {
        sleep(Duration::from_millis(20));
    }
    city
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_no_incomplete_file() {
    let folder = fresh_folder("interrupted");
    let mut city = endless_run(&folder, &folder.join("film.y4m"));
    assert!(names(&folder).contains(&".part-film.y4m".into()));
    let sent = Command::new("kill").args(["-INT", &city.id().to_string()]).status();
    assert!(sent.expect("a system with signals").success());
    assert_eq!(city.wait().expect("a process that ends").code(), Some(130));
    let names = names(&folder);
    assert!(names.iter().all(|name| name == "frames.csv" || name.starts_with("frame_")), "{names:?}");
    fs::remove_dir_all(&folder).expect("a folder that exists");
}

#[test]
fn a_run_that_is_killed_leaves_a_table_of_the_finished_frames_and_the_next_run_cleans_up() {
    let folder = fresh_folder("killed");
    let film = folder.join("film.y4m");
    let mut city = endless_run(&folder, &film);
    city.kill().expect("a process that runs");
    city.wait().expect("a process that ends");
    let finished = rows(&folder);
    assert!(finished.len() >= 4, "{} rows", finished.len());
    for (number, row) in finished.iter().enumerate() {
        assert_eq!(row[0], number.to_string());
        for extension in ["png", "exr"] {
            assert!(folder.join(format!("frame_{number:04}.{extension}")).exists(), "frame {number}");
        }
    }
    assert!(!film.exists(), "an incomplete film has the final name");

    // Files that this program did not write are left alone.
    fs::write(folder.join("frame_notes.png"), b"mine").expect("a writable folder");
    let lines = render(&[OsStr::new("--frames"), OsStr::new("2"), OsStr::new("--out"), folder.as_os_str()]);
    assert!(lines.iter().any(|line| line.starts_with("removed ") && line.contains("earlier run")), "{lines:?}");
    let mut names = names(&folder);
    names.retain(|name| !name.ends_with("film.y4m"));
    let frames = ["frame_0000.exr", "frame_0000.png", "frame_0001.exr", "frame_0001.png"];
    assert_eq!(names, [&frames[..], &["frame_notes.png", "frames.csv"]].concat());
    assert_eq!(rows(&folder).len(), 2);
    fs::remove_dir_all(&folder).expect("a folder that exists");
}

#[test]
fn the_time_of_a_frame_is_the_sum_of_its_stages() {
    let folder = fresh_folder("times");
    let lines = render(&[OsStr::new("--out"), folder.as_os_str()]);
    assert!(lines.iter().any(|line| line.starts_with("milliseconds per frame: animation ")), "{lines:?}");
    let column = |name: &str| CSV_HEADER.iter().position(|column| *column == name).expect("a column");
    let stages = column("animation_us")..=column("writing_us");
    for row in rows(&folder) {
        let sum: f64 = stages.clone().map(|stage| row[stage].parse::<f64>().expect("a time")).sum();
        let frame: f64 = row[column("frame_ms")].parse().expect("a time");
        // Each of ten stages is rounded to 0.1 µs, and the sum to 0.01 ms.
        assert!((sum * 1e-3 - frame).abs() < 0.006, "{sum} µs, {frame} ms");
        for stage in ["rendering_us", "denoising_us", "tone_mapping_us", "writing_us"] {
            assert!(row[column(stage)].parse::<f64>().expect("a time") > 0.0, "{stage}");
        }
    }
    fs::remove_dir_all(&folder).expect("a folder that exists");
}
