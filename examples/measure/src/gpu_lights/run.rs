//! The command line, and the whole run.

use super::cost;
use super::noise::{self, Engine};
use clap::Parser;
use std::path::PathBuf;
use testbed::common::gpu::{HOW_TO_GET_AN_ADAPTER, find_adapter, large_buffers, open_device};
use testbed::common::table::{Table, markdown_head};
use testbed::scene::SceneError;

/// Measures lights that kernels write on the GPU.
#[derive(Debug, Parser)]
pub struct Options {
    /// The table, as CSV
    #[arg(long, value_name = "FILE.csv")]
    pub out: PathBuf,
    /// Measure what a refit costs, and not the noise of samples
    #[arg(long)]
    pub cost: bool,
    /// Few lights and frames: seconds, to try it out
    #[arg(long)]
    pub quick: bool,
    /// The best adapter whose name or driver contains this [default: the best of all]
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
}

const NOISE: [&str; 6] = ["scene", "policy", "rebuilds", "sigma_mean", "over_fresh", "most_over_fresh"];
const COST: [&str; 8] = ["scene", "trees", "lights", "dispatches", "bytes_per_copy", "refit_ms", "copy_ms", "cpu_us"];

/// Measures, prints the table and writes it. An error is one line for the user.
pub fn run(options: &Options) -> Result<(), SceneError> {
    let columns: &[&str] = if options.cost { &COST } else { &NOISE };
    let mut table = Table::create(&options.out, columns).map_err(SceneError)?;
    let adapter = find_adapter(options.adapter.as_deref())
        .map_err(|error| SceneError(format!("{error}; {HOW_TO_GET_AN_ADAPTER}")))?;
    let stamps = wgpu::Features::TIMESTAMP_QUERY;
    if options.cost && !adapter.features().contains(stamps) {
        return Err(SceneError(format!("{} has no timestamps", adapter.get_info().name)));
    }
    let features = if options.cost { stamps } else { wgpu::Features::empty() };
    let (device, queue) = open_device(&adapter, features, large_buffers(&adapter)).map_err(SceneError)?;
    testbed::say!("{}", adapter.get_info().name);
    testbed::say!("{}", markdown_head(columns));
    let mut add = |fields: Vec<String>| {
        testbed::say!("| {} |", fields.join(" | "));
        table.add(fields).map_err(SceneError)
    };
    if options.cost {
        let effort = if options.quick { cost::Effort::QUICK } else { cost::Effort::FULL };
        for (scene, effort) in [("dancers", effort), ("small dancers", effort.with_small_trees())] {
            let cost::Row { trees, lights, dispatches, bytes_per_copy, refit_ms, copy_ms, cpu_us } =
                cost::measure(&device, &queue, effort)?;
            let counts = [scene.into(), trees.to_string(), lights.to_string(), dispatches.to_string()];
            let numbers = [bytes_per_copy, refit_ms, copy_ms, cpu_us].map(|number| format!("{number:.3}"));
            add(counts.into_iter().chain(numbers).collect())?;
        }
        return Ok(());
    }
    let effort = if options.quick { noise::Effort::QUICK } else { noise::Effort::FULL };
    let engine = Engine { device: &device, queue: &queue };
    let mut rows = noise::deformed(&engine, effort)?;
    rows.extend(noise::sparks(&engine, effort)?);
    for noise::Row { scene, policy, rebuilds, sigma, over_fresh, most_over_fresh } in rows {
        let numbers = [rebuilds, sigma, over_fresh, most_over_fresh].map(|number| format!("{number:.3}"));
        add([scene, policy].map(String::from).into_iter().chain(numbers).collect())?;
    }
    Ok(())
}
