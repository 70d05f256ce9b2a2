//! The command line, and the whole run.

use super::device::Device;
use super::flight::{Flight, FlightError};
use super::record::{Row, us, write};
use super::settings::Settings;
use super::sizes;
use super::summary::{self, Ends, Spread, Summary};
use clap::Parser;
use girandole::plan::UploadReport;
use std::fs;
use std::path::PathBuf;
use testbed::common::progress::progress;

/// Flies over a streaming world, and measures each frame.
#[derive(Clone, Debug, Parser)]
pub struct Options {
    /// The folder of the tables and pictures
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// A smaller world and 600 frames: some seconds
    #[arg(long)]
    pub quick: bool,
    /// Only measure frames in worlds of several sizes
    #[arg(long)]
    pub scale: bool,
    /// How often to fly; each frame counts in the run in which it took the least time
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    pub runs: u32,
    /// Seeds the lights and the traffic
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// Frames for which the camera rests before and after the flight, until all trees are built and
/// frozen.
const REST: u32 = 400;

/// The number of frames that `worst.csv` lists.
const WORST: usize = 20;

/// Flies, and writes what was measured.
pub fn run(options: &Options) -> Result<(), String> {
    fs::create_dir_all(&options.out).map_err(|error| format!("cannot make {}: {error}", options.out.display()))?;
    // One thread, so that its CPU time is that of the whole frame.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|error| error.to_string())?;
    if options.scale {
        let path = options.out.join("scale.csv");
        let lines = pool.install(|| sizes::measure(&path, options.seed, options.quick))?;
        lines.iter().for_each(|line| testbed::say!("{line}"));
        return Ok(());
    }
    let settings = if options.quick { Settings::quick(options.seed) } else { Settings::full(options.seed) };
    let (mut rows, ends, flight) = pool.install(|| fly(&settings)).map_err(|FlightError(text)| text)?;
    let tell_run = |rows: &[Row]| {
        let spread = Spread::of(rows.iter().map(|row| us(row.costs.frame)));
        let Spread { median, high, worst } = spread;
        testbed::say!("one run: median {median:.0} us, 99.9 % {high:.0}, worst {worst:.0} ({:.2} x)", worst / median);
        spread
    };
    let mut runs = vec![tell_run(&rows)];
    for _ in 1..options.runs {
        let (others, ..) = pool.install(|| fly(&settings)).map_err(|FlightError(text)| text)?;
        runs.push(tell_run(&others));
        for (row, other) in rows.iter_mut().zip(others) {
            if other.costs.frame < row.costs.frame {
                *row = other;
            }
        }
    }
    write(&options.out.join("flight.csv"), &rows)?;
    summary::write(&options.out.join("summary.csv"), &rows, &runs)?;
    let mut worst = rows.clone();
    worst.sort_by_key(|row| std::cmp::Reverse(row.costs.frame));
    worst.truncate(WORST);
    write(&options.out.join("worst.csv"), &worst)?;
    testbed::say!("{}", Summary::new(&settings, &flight, &rows, &ends));
    Ok(())
}

/// The rows of all frames, and the state before and after them.
fn fly(settings: &Settings) -> Result<(Vec<Row>, [Ends; 2], Flight), FlightError> {
    let bar = progress("flight", u64::from(settings.frames + 2 * REST));
    let mut device = Device::default();
    let mut flight = Flight::start(settings.clone(), |plan| device.play(plan))?;
    for _ in 0..REST {
        flight.hover(|plan| device.play(plan))?;
        bar.inc(1);
    }
    let start = Ends::of(&flight);
    let mut rows = Vec::with_capacity(settings.frames as usize);
    for frame in 0..settings.frames {
        let mut upload = UploadReport::default();
        let costs = flight.fly(|plan| {
            upload = plan.report;
            device.play(plan);
        })?;
        rows.push(Row::new(frame, &flight, costs, upload));
        bar.inc(1);
    }
    for _ in 0..REST {
        flight.hover(|plan| device.play(plan))?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    assert_eq!(device.bytes_of_all(), flight.planner.memory().buffers, "the planner knows its buffers");
    let end = Ends::of(&flight);
    Ok((rows, [start, end], flight))
}
