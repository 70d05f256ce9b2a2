//! The noise of one light sample, computed exactly: this library beside published samplers.
//!
//! ```text
//! cargo run --release -p variance -- --out FILE.csv
//!     [--gltf FILE] [--world S|M|L] [--shading-points N]
//! cargo run --release -p variance -- --out FILE.csv --deform [--gltf FILE]
//! cargo run --release -p variance -- --out FILE.csv --candidates [--gltf FILE]
//! cargo run --release -p variance -- --out FILE.csv --torture
//! cargo run --release -p variance -- --out FILE.csv --cliffs
//! cargo run --release -p variance -- --out FILE.csv --gloss [--shading-points N]
//! cargo run --release -p variance -- --out FILE.csv --segments [--gltf FILE]
//!     [--world S|M|L] [--shading-points N]
//! cargo run --release -p variance -- --out FILE.csv --shadows [--gltf FILE]
//! cargo run --release -p variance -- --out FILE.csv --learn
//! cargo run --release -p variance -- --out FILE.csv --sky [--shading-points N]
//! cargo run --release -p variance -- --out FILE.csv --signs
//! cargo run --release -p variance -- --out FILE.csv --kept [--world S|M|L] [--shading-points N]
//! ```
//!
//! `--quick` makes each of them small, to try it out. The first form prints a table and writes it as
//! CSV. For each scene and sampler it has the exact relative standard deviation of one sample over
//! fixed shading points (`examples/testbed/src/measuring/sigma.rs`), the share of draws that end
//! without a light (`dead`), nanoseconds per choice, and bytes of tree per light. Expect the sigma of
//! `girandole` to be well below those of `pbrt` and `cycles`.
//!
//! `--deform` measures how much noise moving lights add to a tree, and what rebuilds cost, in city
//! S (`deform.rs`). `--candidates` measures what choosing one of several candidates gains
//! (`candidates.rs`). `--torture` measures the scenes of `examples/testbed/src/measuring/torture`, which are
//! hard for a choice of lights. `--cliffs` measures scenes in which two levels were far worse than one
//! tree (`torture/cliffs.rs` there), against one tree alone. `--gloss` measures the light that glossy surfaces reflect, by
//! roughness (`gloss.rs`). `--segments` measures the light that fog scatters into camera rays, by
//! the length of their segments (`segments.rs`). `--shadows` measures how much noise with shadows a
//! sampler would lose if it knew which lights are visible (`shadow_oracle/`); it takes some
//! minutes. `--learn` measures how much of that a table of learnt visibility gains, and how fast
//! (`learning.rs`). `--sky` measures a sky beside lamps, chosen together and by halves (`sky.rs`),
//! and a room with a window (`window.rs`). `--signs` measures
//! surfaces that emit an image (`signs.rs`). `--kept` measures cuts of cells that are kept while traffic drives
//! (`kept.rs`). `docs/benchmarks.md` has measured tables and the rules of measurement.

use clap::Parser;
use scene::SceneError;
use scene::procedural::Size;
use std::path::PathBuf;
use std::process::ExitCode;
use testbed::common::table::Table;
use testbed::scene;
use variance::effort::Effort;

/// Measures the noise of one light sample.
#[derive(Parser)]
#[command(name = "variance", version)]
struct Options {
    /// The table, as CSV
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
    /// A glTF scene to measure as well
    #[arg(long, value_name = "FILE")]
    gltf: Option<PathBuf>,
    /// Measure time and noise of trees whose lights move, instead
    #[arg(long, conflicts_with = "world")]
    deform: bool,
    /// Measure samples that are chosen from several candidates, instead
    #[arg(long, conflicts_with = "deform")]
    candidates: bool,
    /// Measure the light that glossy surfaces reflect, instead
    #[arg(long, conflicts_with_all = ["deform", "candidates", "gltf", "torture"])]
    gloss: bool,
    /// Measure the scenes that are hard for a choice of lights, instead
    #[arg(long, conflicts_with_all = ["deform", "candidates", "gltf", "world", "shading_points"])]
    torture: bool,
    /// Measure the scenes in which two levels were far worse than one tree, instead
    #[arg(long, conflicts_with_all = ["deform", "candidates", "gloss", "gltf", "world", "shading_points", "torture"])]
    cliffs: bool,
    /// Measure the light that fog scatters into segments of camera rays, instead
    #[arg(long, conflicts_with_all = ["deform", "candidates", "gloss", "torture", "shadows", "learn"])]
    segments: bool,
    /// Measure what a sampler that knows which lights are visible would gain, instead
    #[arg(long, conflicts_with_all = ["world", "deform", "candidates", "torture"])]
    shadows: bool,
    /// Measure what a table of learnt visibility gains, instead
    #[arg(long, conflicts_with_all = ["gltf", "world", "deform", "candidates", "gloss", "torture", "shadows"])]
    learn: bool,
    /// Measure a sky beside lamps, instead
    #[arg(long, conflicts_with_all = ["gltf", "world", "deform", "candidates", "gloss", "torture", "shadows", "learn", "segments"])]
    sky: bool,
    /// Measure signs and films, instead
    #[arg(long, conflicts_with_all = ["gltf", "world", "deform", "candidates", "gloss", "torture", "shadows", "learn", "segments", "sky"])]
    signs: bool,
    /// Measure cuts of cells that are kept while traffic drives, instead
    #[arg(long, conflicts_with_all = ["gltf", "deform", "candidates", "gloss", "torture", "shadows", "learn", "segments", "sky", "signs"])]
    kept: bool,
    /// Number of shading points
    #[arg(long, default_value_t = 400, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    shading_points: u32,
    /// Few scenes, frames and timed choices: seconds, to try it out
    #[arg(long)]
    quick: bool,
    /// How large the procedural city is
    #[arg(long, value_enum, ignore_case = true, default_value_t = Size::S)]
    world: Size,
}

fn run(options: &Options) -> Result<(), SceneError> {
    let count = options.shading_points as usize;
    let effort = if options.quick { Effort::Quick } else { Effort::Full };
    if options.deform {
        return variance::deform::run(options.gltf.as_deref(), count, effort, &options.out);
    }
    if options.torture {
        return variance::torture::run(effort, &options.out);
    }
    if options.cliffs {
        return variance::torture::run_cliffs(effort, &options.out);
    }
    if options.gloss {
        return variance::gloss::run(options.world, count, effort, &options.out);
    }
    if options.segments {
        return variance::segments::run(options.world, options.gltf.as_deref(), (count, effort), &options.out);
    }
    if options.candidates {
        return variance::candidates::run(options.world, options.gltf.as_deref(), (count, effort), &options.out);
    }
    if options.shadows {
        return variance::shadow_oracle::run(options.gltf.as_deref(), count, &options.out);
    }
    if options.learn {
        return variance::learning::run(count, effort, &options.out);
    }
    if options.sky {
        return variance::sky::run(count, effort, &options.out);
    }
    if options.kept {
        return variance::kept::run(options.world, count, effort, &options.out);
    }
    if options.signs {
        return variance::signs::run(count, effort, &options.out);
    }
    let mut scenes = Vec::from(variance::stages::city(options.world, count)?);
    if let Some(path) = &options.gltf {
        scenes.push(variance::stages::gltf(path, count)?);
    }
    let mut table = Table::create(&options.out, &variance::report::COLUMNS).map_err(SceneError)?;
    scenes.iter().try_for_each(|scene| {
        let measured = variance::measure::measure(scene, effort)?;
        variance::report::print(&measured);
        measured.rows.iter().try_for_each(|row| table.add(variance::report::fields(row))).map_err(SceneError)
    })
}

fn main() -> ExitCode {
    testbed::common::exit::run_program(run)
}
