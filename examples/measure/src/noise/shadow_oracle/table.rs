//! The table, for the terminal and as CSV.

use super::measure::{Knowledge, Measured};

/// The columns: `gain_mean` and `gain_rms` are the mean and the root mean square of the library's
/// sigma over those of the row. `shadowed` is the share of the illuminance that is shadowed, and
/// `neighbours` the mean number of surfaces in a cell from which its visibility is known.
pub const COLUMNS: [&str; 13] = [
    "scene",
    "knows",
    "clusters",
    "cell_m",
    "sigma_mean",
    "sigma_median",
    "sigma_p95",
    "sigma_rms",
    "gain_mean",
    "gain_rms",
    "shadowed",
    "shading_points",
    "neighbours",
];

/// The rows of a scene, in the order of [`COLUMNS`]. Fields that do not apply hold a dash.
pub fn rows(measured: &Measured) -> Vec<[String; COLUMNS.len()]> {
    let Some(library) = measured.rows.first().map(|row| row.sigma) else { return Vec::new() };
    let none = || "-".to_owned();
    let row = |row: &super::measure::Row| {
        let [knows, clusters, cell, neighbours] = match row.knowledge {
            Knowledge::Library => ["nothing (the library)".to_owned(), none(), none(), none()],
            Knowledge::Normalised => ["nothing, normalised".to_owned(), none(), none(), none()],
            Knowledge::Lights => ["lights".to_owned(), none(), none(), none()],
            Knowledge::Clusters { kind, count } => [format!("clusters by {kind}"), count.to_string(), none(), none()],
            Knowledge::Cells { kind, count, edge } => {
                let found = measured.neighbours.iter().find(|(own, _)| *own == edge).map(|(_, found)| *found);
                let found = found.map_or_else(none, |found| format!("{found:.1}"));
                [format!("clusters by {kind} in cells"), count.to_string(), edge.to_string(), found]
            }
        };
        let sigma = row.sigma;
        let [mean, median, p95, rms] = [sigma.mean, sigma.median, sigma.p95, sigma.rms].map(|v| format!("{v:.3}"));
        let gains = [library.mean / sigma.mean, library.rms / sigma.rms].map(|gain| format!("{gain:.2}"));
        let [gain_mean, gain_rms] = gains;
        let (shadowed, points) = (format!("{:.3}", measured.shadowed), measured.shading_points.to_string());
        let scene = measured.scene.clone();
        [scene, knows, clusters, cell, mean, median, p95, rms, gain_mean, gain_rms, shadowed, points, neighbours]
    };
    measured.rows.iter().map(row).collect()
}
