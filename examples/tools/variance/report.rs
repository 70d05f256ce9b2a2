//! The table, for eyes and as CSV.

use super::measure::{Measured, Row};
use super::scene::SceneError;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Of the table of noise.
pub const COLUMNS: [&str; 7] =
    ["scene", "sampler", "sigma_mean", "sigma_median", "sigma_p95", "ns_per_sample", "bytes_per_light"];

fn numbers(row: &Row) -> [String; 5] {
    let sigmas = [row.sigma.mean, row.sigma.median, row.sigma.p95].map(|sigma| format!("{sigma:.3}"));
    let [mean, median, p95] = sigmas;
    [mean, median, p95, format!("{:.0}", row.ns_per_sample), format!("{:.1}", row.bytes_per_light)]
}

/// Prints one scene's lines as a Markdown table.
pub fn print(measured: &Measured) {
    let Measured { rows, lights, instances, lit_shading_points } = measured;
    println!("\n{lights} lights in {instances} instances, {lit_shading_points} lit shading_points\n");
    println!("| {} | unreached |\n|{}", COLUMNS.join(" | "), "---|".repeat(COLUMNS.len() + 1));
    for row in rows {
        println!("| {} | {} | {} | {} |", row.scene, row.sampler, numbers(row).join(" | "), row.sigma.unreached);
    }
}

/// The CSV file. To be opened before anything is measured: what cannot be written is better known then.
pub struct Table {
    path: PathBuf,
    writer: csv::Writer<File>,
}

impl Table {
    /// Creates or empties the file, and writes its head.
    pub fn create(path: &Path, columns: &[&str]) -> Result<Self, SceneError> {
        let path = path.to_owned();
        let refuse = |error| refusal(&path, &error);
        let mut writer = csv::Writer::from_path(&path).map_err(refuse)?;
        writer.write_record(columns).map_err(refuse)?;
        writer.flush().map_err(|error| refuse(error.into()))?;
        Ok(Self { path, writer })
    }

    /// Adds a line.
    pub fn line(&mut self, fields: impl IntoIterator<Item = String>) -> Result<(), SceneError> {
        self.writer.write_record(fields).map_err(|error| refusal(&self.path, &error))?;
        self.writer.flush().map_err(|error| refusal(&self.path, &error.into()))
    }
}

fn refusal(path: &Path, error: &csv::Error) -> SceneError {
    SceneError(format!("cannot write {}: {error}", path.display()))
}

/// Writes a scene's lines.
pub fn write(table: &mut Table, rows: &[Row]) -> Result<(), SceneError> {
    rows.iter().try_for_each(|row| {
        let names = [row.scene.clone(), row.sampler.to_owned()];
        table.line(names.into_iter().chain(numbers(row)))
    })
}
