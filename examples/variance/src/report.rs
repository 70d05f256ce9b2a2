//! The table of noise, for the terminal and as CSV.

use super::measure::{Measured, Row};
use testbed::common::table::markdown_head;
use testbed::measuring::sigma::Summary;

/// The columns of the CSV file.
pub const COLUMNS: [&str; 10] = [
    "scene",
    "sampler",
    "sigma_mean",
    "sigma_median",
    "sigma_p95",
    "sigma_p999",
    "sigma_rms",
    "dead",
    "ns_per_sample",
    "bytes_per_light",
];

/// A row of the CSV file, in the order of [`COLUMNS`].
pub fn fields(row: &Row) -> [String; 10] {
    let Summary { mean, median, p95, p999, rms, .. } = row.sigma;
    let [mean, median, p95, p999, rms] = [mean, median, p95, p999, rms].map(|sigma| format!("{sigma:.3}"));
    let (ns, bytes) = (format!("{:.0}", row.ns_per_sample), format!("{:.1}", row.bytes_per_light));
    [row.scene.clone(), row.sampler.to_owned(), mean, median, p95, p999, rms, format!("{:.4}", row.dead), ns, bytes]
}

/// Prints one scene's rows as a Markdown table. Its last column counts the shading points where
/// some light contributes and is never chosen.
pub fn print(measured: &Measured) {
    let Measured { rows, lights, instances, lit_shading_points } = measured;
    testbed::say!("\n{lights} lights in {instances} instances, {lit_shading_points} lit shading points\n");
    let columns: Vec<&str> = COLUMNS.into_iter().chain(["unreached"]).collect();
    testbed::say!("{}", markdown_head(&columns));
    for row in rows {
        testbed::say!("| {} | {} |", fields(row).join(" | "), row.sigma.unreached);
    }
}
