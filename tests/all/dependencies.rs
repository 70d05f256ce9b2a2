//! Data moves one way: a module imports only from modules that `src/lib.rs` lists before it.

use std::fs;
use std::path::{Path, PathBuf};

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder of the crate").map(|e| e.expect("readable").path());
    let all = entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] });
    // Tests may look at what they test from anywhere.
    all.filter(|path| !path.ends_with("tests.rs")).collect()
}

/// The module list of lib.rs, in order.
fn modules(root: &Path) -> Vec<String> {
    let text = fs::read_to_string(root.join("lib.rs")).expect("lib.rs");
    let declared = text.lines().filter_map(|line| line.trim_start_matches("pub ").strip_prefix("mod "));
    declared.filter_map(|line| Some(line.strip_suffix(';')?.to_owned())).collect()
}

/// Every `crate::name` outside of tests.
fn imports(text: &str) -> impl Iterator<Item = &str> {
    let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or("");
    code.split("crate::")
        .skip(1)
        .map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or(""))
}

#[test]
fn imports_point_up_the_module_list() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let order = modules(&root);
    assert!(order.len() > 15, "{order:?}");
    let rank = |name: &str| order.iter().position(|m| m == name);
    let mut seen = 0;
    for path in files(&root) {
        let relative = path.strip_prefix(&root).expect("inside");
        let first = relative.components().next().expect("a name").as_os_str().to_string_lossy().replace(".rs", "");
        let Some(own) = rank(&first) else {
            assert_eq!(first, "lib", "{} belongs to no listed module", relative.display());
            continue;
        };
        let text = fs::read_to_string(&path).expect("readable");
        // `use crate::{a, b}` names modules that this test would miss.
        assert!(!text.contains("crate::{"), "{}: import modules one by one", relative.display());
        for name in imports(&text).filter(|name| rank(name).is_some()) {
            assert!(rank(name) <= Some(own), "{} imports from {name}, which comes later", relative.display());
            seen += 1;
        }
    }
    assert!(seen > 50, "only {seen} imports seen");
}
