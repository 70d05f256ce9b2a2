//! The graph of a crate's files: which of them names items of which other.

use std::collections::{BTreeMap, BTreeSet};

use super::source::{Path, Source};

/// The text of each file by its path in `src`.
pub type Files = BTreeMap<String, String>;

pub struct Graph {
    edges: BTreeMap<String, BTreeSet<String>>,
}

impl Graph {
    /// Starts at `lib.rs` and follows `mod` declarations, so files of tests are not part of it.
    pub fn new(files: &Files) -> Self {
        let mut modules = Modules::default();
        modules.add(files, Vec::new(), "lib.rs".to_owned());
        let edges = modules.0.keys().map(|path| (modules.0[path].file.clone(), modules.dependencies(path)));
        Self { edges: edges.collect() }
    }

    /// Pairs of files of which the first depends on the second.
    pub fn edges(&self) -> impl Iterator<Item = (&str, &str)> {
        self.edges.iter().flat_map(|(from, all)| all.iter().map(move |to| (from.as_str(), to.as_str())))
    }

    /// The files on circles of dependencies, and those on the way from one circle to another.
    pub fn circles(&self) -> BTreeSet<&str> {
        let mut left: BTreeSet<&str> = self.edges.keys().map(String::as_str).collect();
        loop {
            let between = self.edges().filter(|(from, to)| left.contains(from) && left.contains(to));
            let (from, to): (BTreeSet<&str>, BTreeSet<&str>) = between.unzip();
            let rest: BTreeSet<&str> = from.intersection(&to).copied().collect();
            if rest.len() == left.len() {
                return rest;
            }
            left = rest;
        }
    }
}

/// The modules that are files, by their paths; the path of `lib.rs` is empty.
#[derive(Default)]
struct Modules(BTreeMap<Path, Module>);

struct Module {
    file: String,
    source: Source,
}

/// What a path names.
enum Target {
    Module(Path),
    /// An item, by the module that defines it.
    Item(Path),
}

impl Modules {
    fn add(&mut self, files: &Files, path: Path, file: String) {
        let source = Source::read(&files[&file]);
        for child in &source.children {
            let path: Path = path.iter().chain([child]).cloned().collect();
            let flat = format!("{}.rs", path.join("/"));
            let file = if files.contains_key(&flat) { flat } else { format!("{}/mod.rs", path.join("/")) };
            self.add(files, path, file);
        }
        self.0.insert(path, Module { file, source });
    }

    /// The files that a module depends on.
    fn dependencies(&self, path: &Path) -> BTreeSet<String> {
        let Module { file, source } = &self.0[path];
        let names: BTreeSet<&String> = source.paths.iter().map(|path| &path[0]).collect();
        let used = source.imports.iter().filter(|import| !import.is_reexport || names.contains(&import.name));
        let mut files = BTreeSet::new();
        for named in used.map(|import| &import.path).chain(&source.paths) {
            let Some(Target::Item(module)) = self.resolve(path, named) else { continue };
            if self.0[&module].file != *file {
                files.insert(self.0[&module].file.clone());
            }
        }
        for glob in source.imports.iter().filter(|import| import.name == "*") {
            assert!(self.resolve(path, &glob.path).is_none(), "{file}: import the names of {:?} one by one", glob.path);
        }
        files
    }

    /// What a path names in a module; `None` for local names and for items of other crates.
    fn resolve(&self, from: &Path, path: &[String]) -> Option<Target> {
        let (first, rest) = path.split_first()?;
        let mut module = match first.as_str() {
            "crate" => Path::new(),
            "self" => from.clone(),
            "super" => from[..from.len() - 1].to_vec(),
            name => match self.look_up(from, name)? {
                Target::Module(module) => module,
                item @ Target::Item(..) => return Some(item),
            },
        };
        for name in rest {
            if name == "super" {
                module.pop();
                continue;
            }
            match self.look_up(&module, name) {
                Some(Target::Module(inner)) => module = inner,
                Some(item) => return Some(item),
                // Neither a child nor an import: the module defines it.
                None => return Some(Target::Item(module)),
            }
        }
        Some(Target::Module(module))
    }

    /// A child module or an import of this name.
    fn look_up(&self, module: &Path, name: &str) -> Option<Target> {
        let source = &self.0[module].source;
        if source.children.iter().any(|child| child == name) {
            return Some(Target::Module(module.iter().cloned().chain([name.to_owned()]).collect()));
        }
        let import = source.imports.iter().find(|import| import.name == name)?;
        // `use name;` imports another crate.
        if import.path[0] == name { None } else { self.resolve(module, &import.path) }
    }
}
