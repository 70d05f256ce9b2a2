//! Damaged glTF files: none makes the loader panic, or take more memory than it estimates.
//!
//! `cargo test -p girandole-assets --test all gltf_fuzz -- --ignored` loads 200,000 mutants of a fresh seed.
//! `cargo +nightly fuzz run gltf_load`, with cargo-fuzz, searches for more from the files in
//! `fuzz/corpus/gltf_load`, which `GIRANDOLE_WRITE_CORPUS=1 cargo test -p girandole-assets corpus` writes.

mod exercise;
mod files;
mod hostile;
mod mutate;

use std::collections::BTreeMap;
use std::fs;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use girandole_assets::AssetError;
use girandole_assets::gltf::{GltfOptions, load_bytes, scene_nodes};

use exercise::{exercise, options};
use files::{Parts, large, small_binary, small_text};
use hostile::hostile;
use mutate::mutant;
use testbed::testing::counting::{peak_bytes, requested_bytes};
use testbed::testing::support::Rng;

/// What a load takes besides what it estimates: lists of one element that have room for four, and
/// the texts of errors.
const SLACK: usize = 16_384;

/// A bound on the memory of a load, by the estimate that it makes: that of the document, and that of
/// the buffers.
fn most_bytes(bytes: &[u8]) -> usize {
    match load_bytes(bytes, &GltfOptions { max_bytes: 0, ..options() }) {
        Err(AssetError::Limit { needed, limit: 0, .. }) => needed as usize + 2 * bytes.len() + SLACK,
        // The header of a binary file is refused before anything is estimated.
        Err(_) => SLACK,
        Ok(_) => panic!("a load takes memory"),
    }
}

/// Loads mutants, and returns how many were loaded. Fails at the first that panics or that takes too
/// much memory, and keeps it in a file.
fn load_mutants(files: &[Parts], seed: u64, count: usize) -> usize {
    let mut rng = Rng(seed);
    let mut loaded = 0;
    for number in 0..count {
        let bytes = mutant(files, &mut rng);
        let peak = catch_unwind(|| peak_bytes(|| drop(load_bytes(&bytes, &options()))));
        let result = catch_unwind(|| exercise(&bytes).is_ok());
        let bound = most_bytes(&bytes);
        match (peak, result) {
            (Ok(peak), Ok(is_loaded)) if peak <= bound => loaded += usize::from(is_loaded),
            (peak, result) => {
                let path = std::env::temp_dir().join(format!("girandole_mutant_{seed:x}_{number}"));
                fs::write(&path, bytes).expect("a writable folder");
                let (path, panicked) = (path.display(), result.is_err());
                panic!("seed {seed:#x}, mutant {number}, {path}: panicked {panicked}, memory {peak:?} of {bound}");
            }
        }
    }
    loaded
}

/// The valid files.
fn valid() -> [Parts; 3] {
    [small_text(), small_binary(), large()]
}

#[test]
fn the_files_that_are_damaged_are_valid() {
    // Each instance counts its lights.
    assert_eq!(valid().map(|file| exercise(&file.to_bytes())), [Ok(6), Ok(6), Ok(120)]);
}

#[test]
fn mutants_of_a_fixed_seed_never_panic() {
    let (loaded, count) = (load_mutants(&valid(), 0x617f, 6000), 6000);
    // Both what is refused and what is loaded are tried.
    assert!(loaded > count / 10 && loaded < count / 2, "{loaded}");
}

#[test]
#[ignore = "takes a minute"]
fn mutants_of_a_fresh_seed_never_panic() {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).expect("a time after 1970");
    load_mutants(&valid(), now.as_nanos() as u64, 200_000);
}

#[test]
fn malformed_files_are_refused_or_load_nothing_of_what_is_wrong() {
    let files = hostile();
    for file in &files {
        let result = exercise(&file.bytes);
        assert_eq!(result.as_ref().copied().map_err(|error| error.code()), file.outcome, "{}: {result:?}", file.name);
        let line = result.err().map(|error| error.to_string()).unwrap_or_default();
        assert!(line.len() < 300 && !line.contains(char::is_control), "{}: {line:?}", file.name);
        assert!(peak_bytes(|| drop(load_bytes(&file.bytes, &options()))) <= most_bytes(&file.bytes), "{}", file.name);
    }
}

#[test]
fn a_chain_of_100_000_nodes_is_loaded() {
    let chain: String = (1..100_000).map(|i| format!("{{\"children\":[{i}]}},")).collect();
    let document = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"nodes\":[{chain}{{}}]}}");
    let file = load_bytes(document.as_bytes(), &GltfOptions::default()).expect("a valid document");
    let nodes = scene_nodes(&file.document).expect("a tree");
    assert_eq!((nodes.len(), nodes[99_999].node, nodes[99_999].parent), (100_000, 99_999, Some(99_998)));
}

#[test]
fn no_list_takes_more_memory_than_is_estimated() {
    let accessor = "\"count\":0,\"componentType\":0,\"type\":\"\"";
    let attributes = "{\"primitives\":[{\"attributes\":{\"_\":0}}]}";
    let lists = [
        ("nodes", "{}".into()),
        ("materials", "{}".into()),
        ("materials", "{\"extensions\":{},\"normalTexture\":{\"index\":0},\"pbrMetallicRoughness\":{}}".into()),
        ("buffers", "{}".into()),
        ("images", "{}".into()),
        ("samplers", "{}".into()),
        ("textures", "{}".into()),
        ("scenes", "{\"nodes\":[]}".into()),
        ("skins", "{\"joints\":[]}".into()),
        ("cameras", "{\"type\":\"\"}".into()),
        ("bufferViews", "{\"buffer\":0,\"byteLength\":0}".into()),
        ("animations", "{\"channels\":[],\"samplers\":[]}".into()),
        ("accessors", format!("{{{accessor}}}")),
        ("accessors", format!("{{{accessor},\"min\":[{{\"\":[{{\"\":0}}]}}]}}")),
        ("accessors", format!("{{{accessor},\"min\":[[0]]}}")),
        ("meshes", "{\"primitives\":[]}".into()),
        ("meshes", attributes.into()),
        ("nodes", "{\"extensions\":{\"\":0}}".into()),
        ("nodes", "{\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":{}}}}".into()),
        ("materials", "{\"extensions\":{\"\":{}},\"emissiveTexture\":{\"index\":0,\"extensions\":{\"\":0}}}".into()),
        ("extensionsUsed", "\"\"".into()),
        ("extensionsRequired", "\"a\"".into()),
    ];
    let mut tried = 0;
    let mut check = |document: String| {
        let (peak, bound) =
            (peak_bytes(|| drop(load_bytes(document.as_bytes(), &options()))), most_bytes(document.as_bytes()));
        assert!(peak <= bound, "{peak} of {bound} bytes: {}", &document[..200]);
        // An estimate that is always met would refuse too much.
        tried += usize::from(peak * 50 > bound);
    };
    for (name, element) in lists {
        // One more than a power of two, so that the list has just doubled.
        let list = vec![element; 4097].join(",");
        check(format!("{{\"asset\":{{\"version\":\"2.0\"}},\"{name}\":[{list}]}}"));
    }
    let names: String = (0..5000).map(|i| format!("\"{i}\":0,")).collect();
    // Not a document, so that its required extensions are sought.
    check(format!("{{{names}\"asset\":0}}"));
    check(format!("{{\"asset\":{{\"version\":\"2.0\"}},\"nodes\":[{{\"extensions\":{{{names}\"a\":0}}}}]}}"));
    check(format!("{{\"asset\":{{\"version\":\"2.0\"}},\"nodes\":[{{\"extensions\":{{\"a\":{{{names}\"a\":0}}}}}}]}}"));
    let numbers = "0,".repeat(4096);
    check(format!("{{\"asset\":{{\"version\":\"2.0\"}},\"nodes\":[{{\"children\":[{numbers}0]}}]}}"));
    check(format!("{{\"asset\":{{\"version\":\"2.0\"}},\"accessors\":[{{{accessor},\"min\":[{numbers}0]}}]}}"));
    assert!(tried > 15, "only {tried} documents come near the estimate");
}

#[test]
fn long_bounds_that_many_primitives_share_are_not_copied_for_each() {
    let primitives = vec!["{\"attributes\":{\"POSITION\":0}}"; 1000].join(",");
    let bounds = vec!["0"; 1000].join(",");
    let document = format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},\"meshes\":[{{\"primitives\":[{primitives}]}}],\"buffers\":[{{}}],\
         \"bufferViews\":[{{\"buffer\":0,\"byteLength\":0}}],\"accessors\":[{{\"bufferView\":0,\"count\":1,\
         \"componentType\":5126,\"type\":\"VEC3\",\"min\":[{bounds}],\"max\":[{bounds}]}}]}}"
    );
    let asked = requested_bytes(|| assert!(load_bytes(document.as_bytes(), &options()).is_err()));
    assert!(asked < 2_000_000, "{asked} bytes for a file of {}", document.len());
}

/// The files from which the fuzzer starts, by name.
fn corpus() -> BTreeMap<String, Vec<u8>> {
    let [text, binary, large] = valid().map(|file| file.to_bytes());
    let valid = [("small.gltf", text), ("small.glb", binary), ("large.glb", large)];
    let valid = valid.into_iter().map(|(name, bytes)| (name.to_owned(), bytes));
    valid.chain(hostile().into_iter().map(|file| (format!("hostile_{}", file.name), file.bytes))).collect()
}

#[test]
fn the_corpus_of_the_fuzzer_holds_these_files() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus/gltf_load");
    let corpus = corpus();
    assert!(corpus.values().map(Vec::len).sum::<usize>() < 100_000);
    if std::env::var_os("GIRANDOLE_WRITE_CORPUS").is_some() {
        fs::create_dir_all(&folder).expect("a writable folder");
        corpus.iter().for_each(|(name, bytes)| fs::write(folder.join(name), bytes).expect("a writable folder"));
    }
    for (name, bytes) in corpus {
        let path: PathBuf = folder.join(name);
        // The fuzzer adds files of its own, which git ignores.
        assert!(fs::read(&path).is_ok_and(|stored| stored == bytes), "{} is not up to date", path.display());
    }
}
