//! The program that bakes glTF scenes, on the sample file.

use std::path::{Path, PathBuf};

use clap::Parser;

use bake::options::{Options, run};

fn folder(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("girandole_bake_{name}_{}", std::process::id()))
}

fn options(scene: &Path, out: &Path) -> Options {
    Options::try_parse_from([Path::new("bake"), scene, out]).expect("valid options")
}

fn sample() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/small.gltf")
}

#[test]
fn a_scene_is_baked_loaded_and_sampled_as_before() {
    let out = folder("whole");
    run(&options(&sample(), &out)).expect("the program runs");
    let loaded = bake::load::load(&out).expect("files that were just written");
    assert_eq!((loaded.world.trees().len(), loaded.world.instances().len(), loaded.world.light_count()), (3, 4, 6));
    // A folder may be written again.
    run(&options(&sample(), &out)).expect("the program runs again");
    std::fs::remove_dir_all(out).expect("a folder of this test");
}

#[test]
fn a_scene_that_is_missing_and_a_tree_that_was_damaged_are_told_in_one_line_with_the_path() {
    let out = folder("damaged");
    let error = run(&options(Path::new("no.glb"), &out)).expect_err("there is no such scene");
    assert!(error.to_string().starts_with("no.glb: "), "{error}");
    run(&options(&sample(), &out)).expect("the program runs");
    let path = out.join("0001.tree");
    let mut bytes = std::fs::read(&path).expect("a baked tree");
    *bytes.last_mut().expect("bytes") ^= 1;
    std::fs::write(&path, bytes).expect("a file of this test");
    let error = bake::load::load(&out).err().expect("a damaged tree").to_string();
    assert!(
        error.starts_with(&path.display().to_string()) && error.ends_with("the file is damaged or incomplete"),
        "{error}"
    );
    assert!(!error.contains('\n'));
    std::fs::remove_dir_all(out).expect("a folder of this test");
}
