//! The command line, and the whole run.

use super::document::{block, names, replaced};
use super::draw::{compare, draw};
use super::figure::{Body, Figure, Run, Scene};
use super::list::{FIGURES, RUNS};
use super::measure::{self, GPU, Workshop, take_gpu};
use super::sheet::Sheet;
use clap::Parser;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use testbed::common::origin;

/// Measures every figure of the documents, and writes it into its document.
#[derive(Clone, Debug, Parser)]
pub struct Options {
    /// Only these figures
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Only list the figures
    #[arg(long)]
    pub list: bool,
    /// The folder of raw files [default: target/figures, or target/figures-quick]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// The Bistro
    #[arg(long, value_name = "FILE")]
    pub gltf: Option<PathBuf>,
    /// What `measure gpu` wrote on a machine with a GPU
    #[arg(long, value_name = "FILE.json")]
    pub gpu: Option<PathBuf>,
    /// How many programs that measure no time run at once
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=256))]
    pub jobs: u32,
    /// How many programs that measure time run at once: more than one only with many idle cores
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub timed_jobs: u32,
    /// Small versions of the figures of pages, to compare columns and names of rows with those of the pages
    #[arg(long, conflicts_with_all = ["measure", "gpu"])]
    pub quick: bool,
    /// Only call the programs
    #[arg(long)]
    pub measure: bool,
    /// Only draw, from raw files that are there
    #[arg(long, conflicts_with = "measure")]
    pub draw: bool,
    /// The folder of the programs [default: that of this program]
    #[arg(long, value_name = "DIR")]
    pub programs: Option<PathBuf>,
    /// The repository
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub root: PathBuf,
    /// The commit of the programs [default: the environment's GIRANDOLE_COMMIT, or what git says]
    #[arg(long, value_name = "ID")]
    pub commit: Option<String>,
}

/// Measures and draws. An error is one line for the user.
pub fn run(options: &Options) -> Result<(), String> {
    let mut figures = chosen(&options.only)?;
    figures.retain(|figure| !(options.quick && figure.is_file()));
    if options.list {
        figures.iter().for_each(|figure| {
            testbed::say!("{:24} {:20} {}", figure.name, figure.document(), figure.runs().join(", "));
        });
        return Ok(());
    }
    let folder = if options.quick { "target/figures-quick" } else { "target/figures" };
    let out = options.out.clone().unwrap_or_else(|| options.root.join(folder));
    let mut failed = Vec::new();
    if let Some(file) = &options.gpu {
        take_gpu(&out, file)?;
    }
    if !options.draw {
        let needed = |run: &&Run| figures.iter().any(|figure| figure.runs().contains(&run.name));
        let runs: Vec<&Run> = RUNS.iter().filter(needed).filter(|run| is_possible(options, run)).collect();
        let own = std::env::current_exe().map_err(|error| format!("cannot find this program: {error}"))?;
        let workshop = Workshop {
            programs: options.programs.as_deref().or(own.parent()).unwrap_or(Path::new(".")),
            out: &out,
            gltf: options.gltf.as_deref(),
            commit: &options.commit.clone().unwrap_or_else(origin::commit),
            is_quick: options.quick,
        };
        let timed_jobs = if options.quick { options.jobs } else { options.timed_jobs };
        failed = measure::all(&workshop, &runs, [options.jobs, timed_jobs].map(|jobs| jobs as usize));
    }
    if !options.measure {
        failed.extend(write(options, &figures, &out)?);
    }
    match &failed[..] {
        [] => Ok(()),
        [one] => Err(one.clone()),
        _ => Err(format!("{} figures or programs failed: {}", failed.len(), failed.join("; "))),
    }
}

/// The figures with these names; all without names.
fn chosen(only: &[String]) -> Result<Vec<&'static Figure>, String> {
    if let Some(unknown) = only.iter().find(|name| !FIGURES.iter().any(|figure| figure.name == *name)) {
        return Err(format!("there is no figure {unknown:?}; --list has the names"));
    }
    Ok(FIGURES.iter().filter(|figure| only.is_empty() || only.iter().any(|name| name == figure.name)).collect())
}

/// Draws into the documents, or into copies of them. Returns one line for each figure that failed.
fn write(options: &Options, figures: &[&Figure], out: &Path) -> Result<Vec<String>, String> {
    let mut failed = Vec::new();
    let mut documents: BTreeMap<String, String> = BTreeMap::new();
    for figure in FIGURES {
        let document = figure.document();
        let path = options.root.join(&document);
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(_) if figure.is_file() => String::new(),
            Err(error) => return Err(format!("cannot read {}: {error}", path.display())),
        };
        documents.insert(document, text);
    }
    for (document, text) in documents.iter().filter(|(document, _)| document.ends_with(".md")) {
        let there = names(text).map_err(|error| format!("{document}: {error}"))?;
        let own = || FIGURES.iter().filter(|figure| figure.page == document.as_str()).map(|figure| figure.name);
        failed.extend(
            there
                .iter()
                .filter(|name| !own().any(|own| own == *name))
                .map(|name| format!("{document}: the block \"{name}\" has no figure")),
        );
        failed.extend(
            own()
                .filter(|own| !there.iter().any(|name| name == own))
                .map(|name| format!("{document}: the figure \"{name}\" has no block")),
        );
    }
    let copies = if options.quick { out.join("documents") } else { options.root.clone() };
    for figure in figures {
        let Some(text) = documents.get_mut(&figure.document()) else { continue };
        let Some(old) = (if figure.is_file() { Some("") } else { block(text, figure.name) }) else { continue };
        if let Some(reason) = missing(options, figure, out) {
            testbed::say!("{}: kept, {reason}", figure.name);
            continue;
        }
        let of = |error: String| format!("{}: {error}", figure.name);
        let drawn = match draw(figure, out, RUNS) {
            Ok(drawn) => drawn,
            Err(error) => {
                failed.push(of(error));
                continue;
            }
        };
        if let (true, Some(table)) = (options.quick, &drawn.table) {
            let is_short = RUNS.iter().any(|run| run.has_fewer_rows && figure.runs().contains(&run.name));
            let absent = options.gltf.is_none().then_some("Bistro");
            let old = Sheet::from_markdown(old);
            let compared = match figure.has_varying_rows {
                true => compare(&old, &super::view::Rendered { rows: Vec::new(), ..table.clone() }, absent, false),
                false => compare(&old, table, absent, !is_short),
            };
            failed.extend(compared.err().map(of));
        }
        if let Body::Picture { from, to, .. } = figure.body {
            let to = copies.join(figure.page).with_file_name("").join(to);
            let copied = to.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::copy(out.join(from), &to));
            failed.extend(copied.err().map(|error| of(format!("cannot copy {from} to {}: {error}", to.display()))));
        }
        if figure.is_file() {
            *text = drawn.content;
        } else if let Some(new) = replaced(text, figure.name, &drawn.content) {
            *text = new;
        }
    }
    for (document, text) in documents.iter().filter(|(_, text)| !text.is_empty()) {
        let path = copies.join(document);
        let written = path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(&path, text));
        written.map_err(|error| format!("cannot write {}: {error}", path.display()))?;
    }
    Ok(failed)
}

/// Whether a run has a small version where one is asked for, and the scene that it needs.
fn is_possible(options: &Options, run: &Run) -> bool {
    match (run.scene, options.quick) {
        (_, true) if run.quick.is_none() => false,
        (Scene::Own, _) | (Scene::Added, true) => true,
        _ => options.gltf.is_some(),
    }
}

/// Why a figure cannot be drawn: what it is drawn from was not measured.
fn missing(options: &Options, figure: &Figure, out: &Path) -> Option<String> {
    for name in figure.runs() {
        let run = RUNS.iter().find(|run| run.name == name);
        // Small versions of an earlier run may have had the Bistro.
        let is_stale = options.quick && run.is_some_and(|run| !is_possible(options, run));
        if measure::origin_of(out, name).is_some() && !is_stale {
            continue;
        }
        return Some(match run {
            None if name == GPU => "for it needs --gpu FILE.json".into(),
            Some(run) if options.quick && run.quick.is_none() => format!("for \"{name}\" has no small version"),
            Some(run) if !is_possible(options, run) => "for it needs --gltf FILE".into(),
            _ => format!("for the run \"{name}\" is missing"),
        });
    }
    None
}
