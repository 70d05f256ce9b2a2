//! The table of all measurements.

use super::measure::Measured;
use std::path::Path;
use testbed::common::table::Table;

/// The columns of `stability.csv`; `main.rs` explains them.
pub const COLUMNS: [&str; 9] =
    ["sweep", "value", "sampler", "sigma", "infinite", "unreached", "nan", "error_mean", "error_99"];

/// Creates the file.
pub fn create(path: &Path) -> Result<Table, String> {
    Table::create(path, &COLUMNS)
}

/// Adds rows to the file.
pub fn add(table: &mut Table, rows: &[Measured]) -> Result<(), String> {
    rows.iter().try_for_each(|row| table.add(fields(row)))
}

fn fields(row: &Measured) -> [String; 9] {
    let or_empty = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.6e}"));
    [
        row.sweep.name().to_owned(),
        format!("{:.6e}", row.value),
        row.sampler.to_owned(),
        or_empty(row.sigma),
        format!("{:.4}", row.infinite),
        format!("{:.4}", row.unreached),
        format!("{:.4}", row.nan),
        or_empty(row.error.map(|error| error.mean)),
        or_empty(row.error.map(|error| error.high)),
    ]
}
