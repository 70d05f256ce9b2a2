//! The command line, and the whole run.

use super::machine::Machine;
use super::timer::Effort;
use super::{checks, goals, report, sampling, top_level, uploads};
use clap::{Parser, ValueEnum};
use serde_json::json;
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;
use testbed::common::origin;
use testbed::scene::SceneError;
use testbed::scene::procedural::Size;

/// Measures upload, top level and sampling on a GPU.
#[derive(Debug, Parser)]
pub struct Options {
    /// All numbers, as JSON
    #[arg(long, value_name = "FILE.json")]
    pub out: PathBuf,
    /// Small sizes and few repetitions
    #[arg(long)]
    pub quick: bool,
    /// Only these tables; may be given several times
    #[arg(long, value_enum, value_name = "TABLE")]
    pub only: Vec<Part>,
    /// The best adapter whose name or driver contains this [default: the best of all]
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
}

/// A table of the report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Part {
    Upload,
    TopLevel,
    Sampling,
}

/// The sizes that are measured.
struct Plan {
    effort: Effort,
    /// Instances of the comparisons.
    compared: u32,
    /// Instances of each top-level build.
    top_sizes: &'static [u32],
    /// Instances of the world of uploads.
    moving: u32,
    cities: &'static [Size],
    /// Pixels, width and height.
    picture: (u32, u32),
}

/// A whole run: at most a second for each measurement.
const FULL: Plan = Plan {
    effort: Effort { warm_up: Duration::from_millis(300), least: 3, most: 41, time: Duration::from_secs(1) },
    compared: 20_000,
    top_sizes: &[1_000, 10_000, 100_000, 1_000_000],
    moving: 100_000,
    cities: &[Size::S, Size::M, Size::L],
    picture: (1920, 1080),
};

/// A run that only shows that everything works.
const QUICK: Plan = Plan {
    effort: Effort { warm_up: Duration::ZERO, least: 3, most: 3, time: Duration::ZERO },
    compared: 1_000,
    top_sizes: &[100, 1_000],
    moving: 1_000,
    cities: &[Size::S],
    picture: (64, 32),
};

/// A picture that a software adapter samples in minutes.
const SOFTWARE_PICTURE: (u32, u32) = (384, 216);

/// Measures everything, prints the tables and writes the file. An error is one line for the user.
pub fn run(options: &Options) -> Result<(), SceneError> {
    let refuse = |error: std::io::Error| SceneError(format!("cannot write {}: {error}", options.out.display()));
    // A path that cannot be written is reported before anything is measured.
    let mut file = File::create(&options.out).map_err(refuse)?;
    let machine = Machine::open(options.adapter.as_deref())?;
    let plan = if options.quick { QUICK } else { FULL };
    let picture = if machine.is_software() && !options.quick { SOFTWARE_PICTURE } else { plan.picture };
    let timer = machine.timer(plan.effort);
    report::head(&machine);

    let checks = checks::run(&machine, &timer, plan.compared)?;
    report::checks(&checks);
    let failed = checks.iter().filter(|check| !check.has_passed).count();
    let has = |part| failed == 0 && (options.only.is_empty() || options.only.contains(&part));

    let mut uploads = Vec::new();
    if has(Part::Upload) {
        uploads = uploads::measure(&machine, &timer, plan.moving)?;
        report::uploads(plan.moving, &uploads);
    }
    let mut tops = Vec::new();
    if has(Part::TopLevel) {
        for count in plan.top_sizes {
            tops.push(top_level::measure(&machine, &timer, *count)?);
        }
        report::top_levels(&tops);
    }
    let mut samplings = Vec::new();
    if has(Part::Sampling) {
        report::sampling_head();
        for size in plan.cities {
            let rows = sampling::measure(&machine, &timer, *size, picture)?;
            rows.iter().for_each(report::sampling);
            samplings.extend(rows);
        }
    }
    let verdicts = goals::verdicts(&tops, &samplings);
    report::verdicts(&machine, &verdicts);

    let all = json!({
        "adapter": machine.to_json(),
        "date": origin::date(),
        "commit": origin::commit(),
        "timing": machine.timing(),
        "quick": options.quick,
        "checks": checks.iter().map(checks::Check::to_json).collect::<Vec<_>>(),
        "upload": uploads.iter().map(|row| row.to_json(plan.moving)).collect::<Vec<_>>(),
        "top_level": tops.iter().map(top_level::Row::to_json).collect::<Vec<_>>(),
        "sampling": samplings.iter().map(sampling::Row::to_json).collect::<Vec<_>>(),
        "verdicts": verdicts.iter().map(|verdict| verdict.to_json(&machine)).collect::<Vec<_>>(),
    });
    writeln!(file, "{all:#}").map_err(refuse)?;
    match failed {
        0 => Ok(()),
        _ => Err(SceneError(format!("{failed} of {} comparisons failed, so no time was taken", checks.len()))),
    }
}
