//! Comments and texts name only files that exist.

use std::fs;
use std::path::{Path, PathBuf};

/// Folders whose files are searched, and whose names begin a path.
const FOLDERS: [&str; 8] = ["assets", "src", "shaders", "tests", "benches", "examples", "scripts", "docs"];

/// The files of a folder and of those in it. `target` folders of the packages in `examples` are left out.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder of the crate").map(|entry| entry.expect("readable").path());
    let sources = entries.filter(|path| !path.ends_with("target"));
    sources.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

/// The words of a text that look like the path of a file from the root of the crate.
fn paths(text: &str) -> impl Iterator<Item = &str> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
    let words = text.split(move |c| !is_part(c)).map(|word| word.trim_end_matches('.'));
    words.filter(|word| {
        let is_file = [".rs", ".wgsl", ".md", ".sh"].iter().any(|end| word.ends_with(end));
        is_file && word.split_once('/').is_some_and(|(first, _)| FOLDERS.contains(&first))
    })
}

#[test]
fn every_file_that_a_text_names_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut count = 0;
    let mut missing = Vec::new();
    for path in FOLDERS.iter().flat_map(|folder| files(&root.join(folder))) {
        // Pictures and data are no text.
        let Ok(text) = fs::read_to_string(&path) else { continue };
        let path = path.strip_prefix(root).expect("inside");
        // Packages name their own files.
        let package: PathBuf = path.iter().take(2).collect();
        // Other projects have files of such names too.
        for named in text.lines().filter(|line| !line.contains("https://")).flat_map(paths) {
            count += 1;
            if !root.join(named).is_file() && !root.join(&package).join(named).is_file() {
                missing.push(format!("{} names {named}", path.display()));
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
    assert!(count > 50, "only {count} names were found");
}

/// The name of a heading in links, as GitHub makes it.
fn anchor(heading: &str) -> String {
    let heading = heading.trim().to_lowercase();
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// The text of a page outside of code.
fn prose(page: &str) -> String {
    page.split("```").step_by(2).collect()
}

/// All pages for people.
fn pages() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = ["docs", "examples"].iter().flat_map(|folder| files(&root.join(folder)));
    let pages = folders.filter(|path| path.extension().is_some_and(|end| end == "md"));
    pages.chain(["README.md", "CHANGELOG.md"].map(|name| root.join(name))).collect()
}

#[test]
fn every_link_of_a_page_leads_to_a_file_and_a_heading() {
    let mut count = 0;
    let mut broken = Vec::new();
    for path in pages() {
        let text = prose(&fs::read_to_string(&path).expect("a page"));
        for target in text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target) {
            if target.starts_with("http") {
                continue;
            }
            count += 1;
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let to = if file.is_empty() { path.clone() } else { path.with_file_name("").join(file) };
            let is_there = to.exists()
                && (heading.is_empty() || {
                    let page = prose(&fs::read_to_string(&to).expect("a page"));
                    page.lines().any(|line| line.starts_with('#') && anchor(line.trim_start_matches('#')) == heading)
                });
            if !is_there {
                broken.push(format!("{} links to {target}", path.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
    assert!(count > 300, "only {count} links were found");
}

#[test]
fn every_page_with_rust_is_compiled() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let compiled =
        ["src/lib.rs", "assets/src/lib.rs"].map(|file| fs::read_to_string(root.join(file)).expect("a library"));
    let compiled = compiled.concat();
    for path in files(&root.join("docs")).iter().filter(|path| path.extension().is_some_and(|end| end == "md")) {
        // A package of its own compiles the page on Bevy.
        let is_compiled = fs::read_to_string(path).expect("a page").contains("```rust\n");
        let name = path.file_name().expect("a file").to_string_lossy();
        assert!(!is_compiled || compiled.contains(&format!("../docs/{name}")), "{name} is in no lib.rs");
    }
}
