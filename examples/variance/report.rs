//! The table, for eyes and as CSV.

use super::measure::{Measured, Row};
use super::scene::SceneError;
use std::path::Path;

const COLUMNS: [&str; 7] =
    ["scene", "sampler", "sigma_mean", "sigma_median", "sigma_p95", "ns_per_sample", "bytes_per_light"];

fn numbers(row: &Row) -> [String; 5] {
    let sigmas = [row.sigma.mean, row.sigma.median, row.sigma.p95].map(|sigma| format!("{sigma:.3}"));
    let [mean, median, p95] = sigmas;
    [mean, median, p95, format!("{:.0}", row.ns_per_sample), format!("{:.1}", row.bytes_per_light)]
}

/// Prints one scene's lines as a Markdown table.
pub fn print(measured: &Measured) {
    let Measured { rows, lights, instances, lit_receivers } = measured;
    println!("\n{lights} lights in {instances} instances, {lit_receivers} lit receivers\n");
    println!("| {} | unreached |\n|{}", COLUMNS.join(" | "), "---|".repeat(COLUMNS.len() + 1));
    for row in rows {
        println!("| {} | {} | {} | {} |", row.scene, row.sampler, numbers(row).join(" | "), row.sigma.unreached);
    }
}

/// Writes all scenes' lines.
pub fn write(path: &Path, rows: &[Row]) -> Result<(), SceneError> {
    let refuse = |error: csv::Error| SceneError(format!("cannot write {}: {error}", path.display()));
    let mut table = csv::Writer::from_path(path).map_err(refuse)?;
    table.write_record(COLUMNS).map_err(refuse)?;
    for row in rows {
        let names = [row.scene.clone(), row.sampler.to_owned()];
        table.write_record(names.into_iter().chain(numbers(row))).map_err(refuse)?;
    }
    table.flush().map_err(|error| refuse(error.into()))
}
