//! Tables as CSV files and as Markdown.

use std::fs::File;
use std::path::{Path, PathBuf};

/// A CSV file. A program creates it before it measures, so that a path that cannot be written is
/// reported early.
pub struct Table {
    path: PathBuf,
    writer: csv::Writer<File>,
}

impl Table {
    /// Creates or empties the file and writes the names of its columns. An error is one line for
    /// the user.
    pub fn create(path: &Path, columns: &[&str]) -> Result<Self, String> {
        let writer = csv::Writer::from_path(path).map_err(|error| refusal(path, &error))?;
        let mut table = Self { path: path.to_owned(), writer };
        table.add(columns)?;
        Ok(table)
    }

    /// Adds a row, which is in the file when this returns.
    pub fn add(&mut self, fields: impl IntoIterator<Item = impl AsRef<[u8]>>) -> Result<(), String> {
        let written = self.writer.write_record(fields).and_then(|()| Ok(self.writer.flush()?));
        written.map_err(|error| refusal(&self.path, &error))
    }
}

fn refusal(path: &Path, error: &csv::Error) -> String {
    format!("cannot write {}: {error}", path.display())
}

/// The first two lines of a Markdown table.
pub fn markdown_head(columns: &[&str]) -> String {
    format!("| {} |\n|{}", columns.join(" | "), "---|".repeat(columns.len()))
}

/// A number with two significant digits.
pub fn short(value: f64) -> String {
    let digits = (1.0 - value.abs().max(1.0e-9).log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{value:.digits$}")
}
