//! The whole run.

use super::answers::Answers;
use super::charts;
use super::crops::crops;
use super::extracts;
use super::measured::{Measured, measure};
use super::options::Options;
use super::page::{FRONT_COLUMNS, Plots, front, page};
use super::settings::{self, Sampler};
use super::table::COLUMNS;
use std::fs;
use testbed::common::table::{Table, markdown_head};
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

    let answers = Answers::new(&measured.rows).ok_or_else(|| SceneError("the default was not measured".into()))?;
    let draw = |plot: Result<String, String>| plot.map_err(|error| SceneError(format!("cannot draw a plot: {error}")));
    let others: Vec<Sampler> = settings::others().collect();
    let shown = measured.equal_time.iter().map(|panel| panel.row.setting.sampler);
    let others: Vec<Sampler> = shown.filter(|sampler| others.contains(sampler)).collect();
    let plots = Plots {
        error_over_time: draw(charts::error_over_time(&measured.rows, &answers))?,
        alternatives: draw(charts::alternatives(&measured.rows, &others, &answers, options.quick))?,
        stages: draw(charts::stages(&measured.rows, &others, measured.shaded_pixels, options.quick))?,
    };
    let crops = crops(&measured, measured.view.scene.exposure)
        .map_err(|error| SceneError(format!("cannot encode a picture: {error}")))?;
    let write = |name: &str, text: &str| {
        let path = out.join(name);
        fs::write(&path, text).map_err(|error| SceneError(format!("cannot write {}: {error}", path.display())))
    };
    write("error_over_time.svg", &plots.error_over_time)?;
    write("alternatives.svg", &plots.alternatives)?;
    write("stages.svg", &plots.stages)?;
    write("equal_time.svg", &crops.svg())?;
    write("accuracy.html", &page(options, &measured, &answers, &plots, &crops))?;
    extracts::write(out, &measured, &answers).map_err(SceneError)?;
    testbed::say!("The front of least error:\n\n{}", markdown_head(&FRONT_COLUMNS));
    front(&answers).iter().for_each(|fields| testbed::say!("| {} |", fields.join(" | ")));
    testbed::say!(
        "\n{} settings of {}: open {}",
        measured.rows.len(),
        options.scene.name(),
        out.join("accuracy.html").display()
    );
    Ok(measured)
}
