//! Data moves one way, between modules and between files.
//!
//! A file depends on another if it names an item that the other defines. Names are followed to
//! their definitions, so a re-export is no dependency by itself: `mod.rs` may declare and re-export
//! its children. A file that implements a type depends on the file of the type, as `upload.rs`
//! depends on `gpu/mod.rs`. So what a type consists of lies in files that do not know the type. Two
//! rules follow.
//!
//! 1. A file depends only on modules that `src/lib.rs` lists before its own module.
//! 2. No chain of dependencies leads from a file back to the same file.
//!
//! Code under `#[cfg(test)]` is left out: tests may look at what they test from anywhere.

mod graph;
mod source;

use std::fs;
use std::path::Path;

use graph::{Files, Graph};
use source::Source;

/// The Rust files of the crate.
fn files() -> Files {
    fn add(files: &mut Files, root: &Path, folder: &Path) {
        for entry in fs::read_dir(folder).expect("a folder of the crate") {
            let path = entry.expect("a readable entry").path();
            if path.is_dir() {
                add(files, root, &path);
            } else {
                let name = path.strip_prefix(root).expect("a path in the crate").components();
                let name: Vec<_> = name.map(|part| part.as_os_str().to_string_lossy()).collect();
                files.insert(name.join("/"), fs::read_to_string(&path).expect("a readable file"));
            }
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Files::new();
    add(&mut files, &root, &root);
    files
}

#[test]
fn files_depend_only_on_modules_that_lib_rs_lists_before_their_own() {
    let files = files();
    let order = Source::read(&files["lib.rs"]).children;
    assert!(order.len() > 15, "{order:?}");
    let rank = |file: &str| {
        let module = file.split('/').next().unwrap_or(file).trim_end_matches(".rs");
        order.iter().position(|name| name == module)
    };
    let graph = Graph::new(&files);
    let mut seen = 0;
    for (from, to) in graph.edges().filter(|(from, _)| *from != "lib.rs") {
        let ranks = rank(from).zip(rank(to));
        assert!(ranks.is_some_and(|(own, named)| named <= own), "{from} depends on {to}, whose module comes later");
        seen += 1;
    }
    assert!(seen > 200, "only {seen} dependencies found");
}

#[test]
fn no_dependencies_between_files_form_a_circle() {
    let graph = Graph::new(&files());
    assert!(graph.circles().is_empty(), "circles of files: {:?}", graph.circles());
}

/// Whether a file is compiled outside of tests too.
fn is_of_the_library(files: &Files, file: &str) -> bool {
    let path = file.trim_end_matches("/mod.rs").trim_end_matches(".rs");
    let (parent, name) = path.rsplit_once('/').unwrap_or(("", path));
    let parents = [format!("{parent}/mod.rs"), format!("{parent}.rs"), "lib.rs".into()];
    let Some(parent) = parents.into_iter().find(|parent| files.contains_key(parent)) else { return false };
    let is_declared = Source::read(&files[&parent]).children.iter().any(|child| child == name);
    is_declared && (parent == "lib.rs" || is_of_the_library(files, &parent))
}

/// Every object and pass on the GPU has a name in graphics debuggers.
#[test]
fn descriptors_of_wgpu_have_labels() {
    let files = files();
    assert!(!is_of_the_library(&files, "gpu/tests/mod.rs") && !is_of_the_library(&files, "gpu/cuts/tests.rs"));
    let mut named = 0;
    for (file, text) in files.iter().filter(|(file, _)| file.starts_with("gpu/") && is_of_the_library(&files, file)) {
        let tokens = source::without_tests(text);
        // A type that is only named has neither braces nor a function after it.
        let made = |tokens: &&[String]| tokens[0].ends_with("Descriptor") && ["{", "::"].contains(&tokens[1].as_str());
        for tokens in tokens.windows(5).filter(made) {
            let is_named = tokens[1] == "{" && tokens[2] == "label" && tokens[4] != "None";
            assert!(is_named, "{file}: {}", tokens.join(" "));
            named += 1;
        }
    }
    assert!(named > 10, "only {named} descriptors found");
}

#[test]
fn planted_circles_are_found() {
    let mut files = Files::from(
        [
            ("lib.rs", "mod a; pub mod b;"),
            ("a.rs", "use crate::{b::{self, deep::{C,}}}; fn a(_: C) { b::helper(); }"),
            ("b/mod.rs", "mod deep; mod other; pub(crate) use other::helper;"),
            ("b/deep.rs", "pub struct C; fn c() { super::other::helper() }"),
            ("b/other.rs", "pub(crate) fn helper() { crate::a::a(); }"),
        ]
        .map(|(name, text)| (name.to_owned(), text.to_owned())),
    );
    assert_eq!(Graph::new(&files).circles(), ["a.rs", "b/deep.rs", "b/other.rs"].into());
    files.insert("b/other.rs".to_owned(), "pub(crate) fn helper() {}".to_owned());
    assert!(Graph::new(&files).circles().is_empty());
}
