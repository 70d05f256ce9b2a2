//! The whole comparison: load a scene, render, write files.

use super::measure::{Comparison, Plan, SAMPLERS};
use super::options::Options;
use super::report::{name, write_all};
use super::session::Session;
use std::fs;
use std::path::Path;
use testbed::common::progress::progress;
use testbed::common::table::short;
use testbed::render::backend;
use testbed::scene::SceneError;

/// Steps of the progress bar.
const TICKS: u64 = 1000;

/// Compares the samplers at the first frame. `print` receives lines for the user. Invalid input is
/// refused before the folder is created.
pub fn compare(options: &Options, print: &mut dyn FnMut(&str)) -> Result<Comparison, SceneError> {
    let stage = options.scene.load(options.size)?;
    stage.scene.warnings.iter().for_each(|warning| print(&format!("warning: {warning}")));
    let chosen = backend::cpu("--compare renders on the CPU");
    print(&chosen.to_string());
    let plan = Plan::new(&options.settings(), stage.world.light_count());
    let mut session = Session::new(stage, options.settings(), options.pace(), chosen)?;
    let folder = options.folder().unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(|e| SceneError(format!("cannot write to {}: {e}", folder.display())))?;

    let bar = progress("compare", TICKS);
    session.advance()?;
    let comparison = plan.run(&mut session, &|share| bar.set_position((share * TICKS as f64) as u64))?;
    bar.finish_and_clear();
    write_all(folder, &comparison, session.scene().exposure)?;
    for (((row, _), sampler), build) in comparison.equal_time.iter().zip(SAMPLERS).zip(comparison.builds) {
        print(&format!(
            "{}: {} samples per pixel in {:.0} ms, relMSE {}, MAPE {}; built in {:.1} ms",
            name(sampler),
            row.samples,
            row.time.as_secs_f64() * 1e3,
            short(row.score.rel_mse),
            short(row.score.mape),
            build.as_secs_f64() * 1e3,
        ));
    }
    print(&format!(
        "reference: {}, with a relMSE of about {} itself; table, plot and pictures in {}",
        comparison.reference_name,
        short(comparison.reference_error),
        folder.display(),
    ));
    Ok(comparison)
}
