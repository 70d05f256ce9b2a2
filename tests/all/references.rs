//! Comments and texts name only files that exist.

use std::fs;
use std::path::{Path, PathBuf};

/// Folders whose files are searched, and whose names begin a path.
const FOLDERS: [&str; 7] = ["src", "shaders", "tests", "benches", "examples", "scripts", "docs"];

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
fn every_file_that_a_source_names_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut count = 0;
    let mut missing = Vec::new();
    // The documents are for people, and link to other places too.
    for folder in &FOLDERS[..6] {
        for path in files(&root.join(folder)) {
            // Pictures and data are no text.
            let Ok(text) = fs::read_to_string(&path) else { continue };
            for named in paths(&text) {
                count += 1;
                if !root.join(named).is_file() {
                    missing.push(format!("{} names {named}", path.strip_prefix(root).expect("inside").display()));
                }
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
    assert!(count > 50, "only {count} names were found");
}
