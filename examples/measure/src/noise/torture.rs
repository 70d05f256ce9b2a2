//! The noise on scenes that are hard for a choice of lights.

use super::effort::Effort;
use std::path::Path;
use testbed::common::table::{Table, markdown_head};
use testbed::measuring::torture;
use testbed::measuring::torture::cliffs;
use testbed::measuring::torture::table::{TortureRow, rows};
use testbed::scene::SceneError;

const COLUMNS: [&str; 8] =
    ["scene", "sampler", "sigma_mean", "sigma_median", "sigma_p95", "sigma_p999", "sigma_rms", "dead"];
/// The columns of the summary in the terminal: sigma of the library in two levels, in one, and
/// with shared cuts, the least sigma of the others, and the ratios of the first to those and to one tree.
const SUMMARY: [&str; 11] = [
    "scene",
    "two levels",
    "rms",
    "p999",
    "dead",
    "flat",
    "shared cuts",
    "their p999",
    "others",
    "of others",
    "of flat",
];

fn fields(row: &TortureRow) -> [String; 8] {
    let sigma = &row.sigma;
    let [mean, median, p95, p999, rms] =
        [sigma.mean, sigma.median, sigma.p95, sigma.p999, sigma.rms].map(|sigma| format!("{sigma:.3}"));
    [row.scene.clone(), row.sampler.to_owned(), mean, median, p95, p999, rms, format!("{:.4}", row.dead)]
}

/// One line of the summary. The rows are those of [`rows`].
fn summary(rows: &[TortureRow]) -> Option<String> {
    let [others @ .., two, flat, shared] = rows else { return None };
    let other = others.iter().map(|row| row.sigma.mean).fold(f64::INFINITY, f64::min);
    let sigma = two.sigma;
    let numbers =
        [sigma.mean, sigma.rms, sigma.p999, two.dead, flat.sigma.mean, shared.sigma.mean, shared.sigma.p999, other];
    let ratios = [sigma.mean / other, sigma.mean / flat.sigma.mean];
    let cells = numbers.map(|x| format!("{x:.3}")).into_iter().chain(ratios.map(|x| format!("{x:.2}")));
    Some(format!("| {} | {} |", two.scene, cells.collect::<Vec<_>>().join(" | ")))
}

/// Measures, prints the summary and writes the table.
pub fn run(effort: Effort, out: &Path) -> Result<(), SceneError> {
    let mut table = Table::create(out, &COLUMNS).map_err(SceneError)?;
    testbed::say!("{}", markdown_head(&SUMMARY));
    for scene in torture::scenes().iter().take(effort.select(usize::MAX, 1)) {
        let measured = rows(scene, false)?;
        measured.iter().try_for_each(|row| table.add(fields(row))).map_err(SceneError)?;
        summary(&measured).iter().for_each(|line| testbed::say!("{line}"));
    }
    Ok(())
}

/// The columns of [`run_cliffs`] in the terminal.
const CLIFF_SUMMARY: [&str; 5] = ["scene", "two levels", "flat", "shared cuts", "of flat"];

/// As [`run`], for the scenes in which two levels were far worse than one tree.
pub fn run_cliffs(effort: Effort, out: &Path) -> Result<(), SceneError> {
    let mut table = Table::create(out, &COLUMNS).map_err(SceneError)?;
    testbed::say!("{}", markdown_head(&CLIFF_SUMMARY));
    for scene in cliffs::scenes().iter().take(effort.select(usize::MAX, 1)) {
        let measured = rows(scene, true)?;
        measured.iter().try_for_each(|row| table.add(fields(row))).map_err(SceneError)?;
        let [two, flat, shared] = [0, 1, 2].map(|own: usize| measured[own].sigma.mean);
        testbed::say!("| {} | {two:.3} | {flat:.3} | {shared:.3} | {:.2} |", scene.name, two / flat);
    }
    Ok(())
}
