//! The whole run.

use super::charts;
use super::crops::crops;
use super::extracts;
use super::front::Front;
use super::measured::{Measured, measure};
use super::options::Options;
use super::table::COLUMNS;
use std::fs;
use testbed::common::table::Table;
use testbed::scene::SceneError;

/// Measures and writes all files. An error is one line for the user.
pub fn run(options: &Options) -> Result<Measured, SceneError> {
    let out = &options.out;
    fs::create_dir_all(out).map_err(|error| SceneError(format!("cannot create {}: {error}", out.display())))?;
    let measured = measure(options)?;
    // Only now, so that a refused scene leaves the table of an earlier run. A folder that cannot be
    // written to was refused with the first pass of the reference.
    let mut table = Table::create(&out.join("accuracy.csv"), &COLUMNS).map_err(SceneError)?;
    measured.rows.iter().try_for_each(|row| table.add(row.fields())).map_err(SceneError)?;

    let front = Front::new(&measured.rows).ok_or_else(|| SceneError("the default was not measured".into()))?;
    let plot = charts::error_over_time(&measured.rows, &front)
        .map_err(|error| SceneError(format!("cannot draw a plot: {error}")))?;
    let crops = crops(&measured, measured.view.scene.exposure)
        .map_err(|error| SceneError(format!("cannot encode a picture: {error}")))?;
    for (name, text) in [("error_over_time.svg", plot), ("equal_time.svg", crops.svg())] {
        let path = out.join(name);
        fs::write(&path, text).map_err(|error| SceneError(format!("cannot write {}: {error}", path.display())))?;
    }
    extracts::write(out, &measured, &front).map_err(SceneError)?;
    testbed::say!("\n{} settings of {}: {}", measured.rows.len(), options.scene.name(), out.display());
    Ok(measured)
}
