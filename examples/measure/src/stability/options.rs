//! The command line, and the whole run.

use super::measure::{Measured, measure};
use super::record;
use super::summary::summary;
use super::sweep::Sweep;
use clap::Parser;
use std::fs;
use std::path::PathBuf;
use testbed::common::progress::progress;
use testbed::measuring::street::Street;

/// Measures noise and rounding errors over scale, distance from the origin and contrast.
#[derive(Clone, Debug, Parser)]
pub struct Options {
    /// The folder of the table and the picture
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Fewer steps and shading points: some seconds
    #[arg(long)]
    pub quick: bool,
    /// Seeds the scene
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// Shading points of a whole and of a quick run.
const SHADING_POINTS: [usize; 2] = [200, 32];

/// Measures all steps of all sweeps, and writes the table.
pub fn run(options: &Options) -> Result<(), String> {
    testbed::say!("{}", summary(&measure_all(options)?));
    Ok(())
}

/// [`run`] without the summary.
pub fn measure_all(options: &Options) -> Result<Vec<Measured>, String> {
    fs::create_dir_all(&options.out).map_err(|error| format!("cannot make {}: {error}", options.out.display()))?;
    let mut table = record::create(&options.out.join("stability.csv"))?;
    let street = Street::new(options.seed, SHADING_POINTS[usize::from(options.quick)]);
    let steps = Sweep::ALL.map(|sweep| sweep.values(options.quick).into_iter().map(move |value| (sweep, value)));
    let steps: Vec<(Sweep, f64)> = steps.into_iter().flatten().collect();
    let bar = progress("stability", steps.len() as u64);
    let mut rows = Vec::new();
    for (sweep, value) in steps {
        let step = measure(&street, sweep, value).map_err(|error| error.to_string())?;
        record::add(&mut table, &step)?;
        rows.extend(step);
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(rows)
}
