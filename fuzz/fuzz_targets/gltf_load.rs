//! Loads any bytes as glTF, and does with them what the tests do with damaged files.
//!
//! `cargo +nightly fuzz run gltf_load` in the repository, with cargo-fuzz. An artifact is loaded
//! again by `cargo +nightly fuzz run gltf_load fuzz/artifacts/gltf_load/NAME`.

#![no_main]

// By path: the package of the tests is built without sanitizers.
#[path = "../../assets/tests/all/gltf_fuzz/exercise.rs"]
mod exercise;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| drop(exercise::exercise(bytes)));
