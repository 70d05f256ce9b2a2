//! The table of noise, for the terminal and as CSV.

use super::measure::{Measured, Row};
use testbed::common::table::markdown_head;
use testbed::measuring::sigma::Summary;

/// The columns of the CSV file.
pub const COLUMNS: [&str; 11] = [
    "scene",
    "sampler",
    "sigma_mean",
    "sigma_median",
    "sigma_p95",
    "sigma_p999",
    "sigma_rms",
    "dead",
    "ns_per_sample",
    "ns_with_build",
    "bytes_per_light",
];

/// A row of the CSV file, in the order of [`COLUMNS`].
pub fn fields(row: &Row) -> [String; 11] {
    let Summary { mean, median, p95, p999, rms, .. } = row.sigma;
    let [mean, median, p95, p999, rms] = [mean, median, p95, p999, rms].map(|sigma| format!("{sigma:.3}"));
    let [ns, ns_with_build] = [row.ns_per_sample, row.ns_with_build].map(|ns| format!("{ns:.0}"));
    let (dead, bytes) = (format!("{:.4}", row.dead), format!("{:.1}", row.bytes_per_light));
    [row.scene.clone(), row.sampler.to_owned(), mean, median, p95, p999, rms, dead, ns, ns_with_build, bytes]
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
