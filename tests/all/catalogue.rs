//! The catalogue of hard cases names tests that exist.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// The names of all functions in the Rust and WGSL files of a folder.
fn functions(folder: &Path, names: &mut BTreeSet<String>) {
    for entry in fs::read_dir(folder).expect("a folder of the repository") {
        let path = entry.expect("a readable entry").path();
        if path.is_dir() && !path.ends_with("target") {
            functions(&path, names);
        } else if path.extension().is_some_and(|extension| extension == "rs" || extension == "wgsl") {
            let text = fs::read_to_string(&path).expect("a readable file");
            let named = text.split("fn ").skip(1).filter_map(|rest| rest.split('(').next());
            names.extend(named.map(str::to_owned));
        }
    }
}

#[test]
fn tests_that_the_catalogue_of_hard_cases_names_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut known = BTreeSet::new();
    ["assets", "src", "tests", "shaders", "examples"]
        .iter()
        .for_each(|folder| functions(&root.join(folder), &mut known));
    let page = fs::read_to_string(root.join("docs/hard-cases.md")).expect("a readable file");
    // Names of tests are sentences. Few functions have such long names.
    let is_test = |word: &&str| word.matches('_').count() >= 4 && word.chars().all(|c| c == '_' || c.is_alphanumeric());
    let named: BTreeSet<&str> = page.split('`').skip(1).step_by(2).filter(is_test).collect();
    // The page names 138 tests. Fewer than this mean that names are no longer found in it.
    assert!(named.len() > 110, "{} tests", named.len());
    let missing: Vec<_> = named.into_iter().filter(|name| !known.contains(*name)).collect();
    assert!(missing.is_empty(), "{missing:?}");
}
