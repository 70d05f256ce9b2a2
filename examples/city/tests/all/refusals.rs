//! Invalid input gives one line that names the fault, exit code 2, and no
//! files.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Runs the program.
fn city(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_city")).args(arguments).output().expect("a binary that starts")
}

/// The path of a folder that does not exist, for one test only.
fn fresh_folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("refusal-{name}-{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    folder
}

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data").join(file)
}

/// Runs the city with an output folder, and asserts that it fails with one line that contains
/// `hint` and writes no file.
fn assert_refused(name: &str, arguments: &[&str], hint: &str) {
    let out = fresh_folder(&format!("{name}-out"));
    let small = ["--backend", "cpu", "--frames", "1", "--size", "16x9", "--spp", "1", "--out"];
    let given = |option: &str| arguments.contains(&option);
    let mut all: Vec<&str> = arguments.to_vec();
    for pair in small.chunks(2).filter(|pair| !given(pair[0])) {
        all.extend(if pair[0] == "--out" { ["--out", out.to_str().expect("UTF-8")] } else { [pair[0], pair[1]] });
    }
    let output = city(&all);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{name}: {message}");
    let lines: Vec<_> = message.lines().filter(|line| line.starts_with("error: ")).collect();
    assert!(lines.len() == 1 && message.lines().count() == 1, "{name}: {message}");
    assert!(lines[0].contains(hint), "{name}: `{}` does not contain `{hint}`", lines[0]);
    let files = fs::read_dir(&out).map_or(0, Iterator::count);
    assert_eq!(files, 0, "{name} wrote files");
}

/// Writes a file into a folder of its own and returns its path.
fn file(name: &str, content: &[u8]) -> String {
    let folder = fresh_folder(name);
    fs::create_dir_all(&folder).expect("a writable target folder");
    let path = folder.join(name);
    fs::write(&path, content).expect("a writable target folder");
    path.to_str().expect("UTF-8").to_owned()
}

#[test]
fn invalid_options_are_refused() {
    assert_refused("size", &["--size", "0x9"], "size");
    assert_refused("huge", &["--size", "99999x9"], "size");
    assert_refused("word", &["--size", "large"], "size");
    assert_refused("spp", &["--spp", "0"], "spp");
    assert_refused("frames", &["--frames", "0"], "frames");
    assert_refused("nan", &["--budget-ms", "nan"], "budget");
    assert_refused("negative", &["--budget-ms", "-1"], "budget");
    assert_refused("camera", &["--camera", "1,2,3"], "camera");
    assert_refused("blind", &["--camera", "1,2,3,1,2,3"], "camera");
    assert_refused("inf", &["--camera", "1,2,inf,1,2,3"], "camera");
    assert_refused("formless", &["--video", "film"], "extension");
    assert_refused("exposure", &["--exposure", "20.5"], "exposure");
    assert_refused("exposure-nan", &["--exposure", "nan"], "exposure");
    assert_refused("fire", &["--fire", "--backend", "cpu"], "--backend cpu");
    assert_refused("unknown", &["--colour", "red"], "--colour");
}

#[test]
fn an_output_folder_that_cannot_be_created_is_refused() {
    let taken = file("taken", b"a file with the name of the folder");
    assert_refused("folder", &["--out", &taken], "taken");
}

/// The bytes of a text with one passage replaced.
fn replaced(text: &[u8], from: &str, to: &str) -> Vec<u8> {
    let text = std::str::from_utf8(text).expect("UTF-8");
    assert!(text.contains(from), "the test file does not contain {from}");
    text.replacen(from, to, 1).into_bytes()
}

#[test]
fn malformed_gltf_files_are_refused() {
    assert_refused("missing", &["--gltf", "no-such-file.glb"], "no-such-file.glb");
    let whole = fs::read(data("small.gltf")).expect("a test file");
    let cut = file("cut.gltf", &whole[..whole.len() / 2]);
    assert_refused("truncated", &["--gltf", &cut], "cut.gltf");
    let lonely = file("lonely.gltf", &whole);
    assert_refused("no-buffer", &["--gltf", &lonely], "lonely.gltf");
    let outside = file("outside.gltf", &replaced(&whole, "\"uri\": \"small.bin\"", "\"uri\": \"../small.bin\""));
    assert_refused("outside", &["--gltf", &outside], "has .. in it");
    let required = "\"extensionsRequired\": [\"EXT_a\", \"EXT_a\", \"EXT_b\"], \"extensionsUsed\"";
    let required = file("required.gltf", &replaced(&whole, "\"extensionsUsed\"", required));
    assert_refused("required", &["--gltf", &required], "not supported: EXT_a, EXT_b");
    let glb = file("short.glb", b"glTF\x02\x00\x00\x00\xff\xff\x00\x00");
    assert_refused("short", &["--gltf", &glb], "short.glb");
}

#[test]
fn malformed_lamp_tables_are_refused() {
    assert_refused("missing-csv", &["--lamps", "no-such-file.csv"], "no-such-file.csv");
    assert_refused("columns", &["--lamps", &file("columns.csv", b"x_m,east\n1,2\n")], "\"y_m\"");
    let nan = b"x_m,y_m,est_height_m,est_lumens\n1,2,9,8000\n1,NaN,9,8000\n";
    assert_refused("nan-csv", &["--lamps", &file("nan.csv", nan)], "y_m");
    let word = b"x_m,y_m,est_height_m,est_lumens\n1,2,high,8000\n";
    assert_refused("word-csv", &["--lamps", &file("word.csv", word)], "est_height_m");
    let ragged = b"x_m,y_m,est_height_m,est_lumens\n1,2\n";
    assert_refused("ragged", &["--lamps", &file("ragged.csv", ragged)], "ragged.csv");
}

#[test]
fn gltf_files_with_infinite_numbers_are_refused() {
    let text = fs::read_to_string(data("small.gltf")).expect("a test file");
    let folder = fresh_folder("infinite");
    fs::create_dir_all(&folder).expect("a writable target folder");
    for entry in fs::read_dir(data("")).expect("test data").map(|e| e.expect("readable").path()) {
        if entry.extension().is_some_and(|e| e == "bin") {
            fs::copy(&entry, folder.join(entry.file_name().expect("a name"))).expect("a writable target folder");
        }
    }
    // 1e39 exceeds the range of f32 and is read as infinity, in a transform and in a light.
    for (name, from, to) in [
        ("transform", "\"translation\"", "\"scale\":[1e39,1,1],\"translation\""),
        ("light", "\"intensity\"", "\"color\":[1e39,1,1],\"intensity\""),
    ] {
        assert!(text.contains(from), "the test file does not contain {from}");
        let path = folder.join(format!("{name}.gltf"));
        fs::write(&path, text.replacen(from, to, 1)).expect("a writable target folder");
        assert_refused(name, &["--gltf", path.to_str().expect("UTF-8")], &format!("{name}.gltf"));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_reader_that_has_gone_and_a_full_disk_end_the_program_without_a_panic() {
    let run = |stdout: Stdio| {
        let mut city = Command::new(env!("CARGO_BIN_EXE_city"));
        let output = city.arg("--help").stdout(stdout).output().expect("a binary that starts");
        (output.status.code(), String::from_utf8(output.stderr).expect("text"))
    };
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    assert_eq!(run(writer.into()), (Some(141), String::new()));
    let full = fs::File::options().write(true).open("/dev/full").expect("Linux has it");
    let (code, error) = run(full.into());
    assert_eq!((code, error.lines().count()), (Some(2), 1), "{error}");
    assert!(error.starts_with("error: cannot write to stdout: No space left"), "{error}");
}
