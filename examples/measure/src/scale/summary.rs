//! The figures of a flight.

use super::flight::Flight;
use super::record::{Row, us};
use super::settings::Settings;
use girandole::WorldMemory;
use girandole::plan::GpuMemory;
use std::fmt;
use std::path::Path;
use testbed::common::table::Table;

/// The state while the camera rested, before or after the flight.
#[derive(Clone, Copy, Debug)]
pub struct Ends {
    pub lights: usize,
    pub regions: usize,
    pub cpu: WorldMemory,
    pub gpu: GpuMemory,
}

impl Ends {
    pub fn of(flight: &Flight) -> Self {
        let world = &flight.world;
        let (cpu, gpu) = (world.memory(), flight.planner.memory());
        Self { lights: world.light_count(), regions: world.regions().len(), cpu, gpu }
    }
}

/// The median, the 99.9th percentile and the largest of some values.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    pub median: f64,
    pub high: f64,
    pub worst: f64,
}

impl Spread {
    /// Of at least one value.
    pub fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
        Self { median: at(0.5), high: at(0.999), worst: at(1.0) }
    }
}

/// The columns of `summary.csv`.
const COLUMNS: [&str; 4] = ["what", "median", "p999", "worst"];

/// A value of a frame.
type Measure = fn(&Row) -> f64;

/// What each frame is measured by.
const MEASURES: [(&str, Measure); 12] = [
    ("frame, µs", |row| us(row.costs.frame)),
    ("adding and removing regions, µs", |row| us(row.costs.regions)),
    ("moves and edits, µs", |row| us(row.costs.edits)),
    ("update, µs", |row| us(row.costs.update)),
    ("plan, µs", |row| us(row.costs.plan)),
    ("resident lights", |row| row.lights as f64),
    ("bytes uploaded", |row| row.upload.bytes as f64),
    ("trees waiting for an upload", |row| row.upload.waiting_trees as f64),
    ("bytes per resident light on the CPU", |row| row.cpu_bytes as f64 / row.lights as f64),
    ("bytes per resident light in all GPU buffers", |row| row.gpu_bytes as f64 / row.lights as f64),
    ("of these, in use by nodes and lights", |row| row.used_bytes as f64 / row.lights as f64),
    ("gaps in the GPU's pools over bytes in use", |row| row.gap_bytes as f64 / row.used_bytes as f64),
];

/// Writes the spread of each measure over all frames, and of the worst frame over the median of each run.
pub fn write(path: &Path, rows: &[Row], runs: &[Spread]) -> Result<(), String> {
    let mut table = Table::create(path, &COLUMNS)?;
    for (what, measure) in MEASURES {
        let Spread { median, high, worst } = Spread::of(rows.iter().map(measure));
        table.add([what.to_owned()].into_iter().chain([median, high, worst].map(|value| format!("{value:.4}"))))?;
    }
    for (number, Spread { median, high, worst }) in runs.iter().enumerate() {
        let what = format!("frame in run {} alone, µs", number + 1);
        table.add([what].into_iter().chain([median, high, worst].map(|value| format!("{value:.4}"))))?;
    }
    Ok(())
}

/// All figures, as text.
#[derive(Clone, Debug)]
pub struct Summary(String);

impl Summary {
    pub fn new(settings: &Settings, flight: &Flight, rows: &[Row], ends: &[Ends; 2]) -> Self {
        let mut text = String::new();
        let mut line = |what: &str, value: String| text.push_str(&format!("{what:28} {value}\n"));
        let km = 1.0e-3 * settings.world_size();
        let lights = flight.builder.world_light_count();
        line("world", format!("{km} km x {km} km, {lights} lights, {} blocks", settings.blocks.pow(2)));
        let length = 1.0e-3 * settings.length();
        line("flight", format!("{} frames, {length:.1} km at {} m/s", rows.len(), settings.speed));
        let resident = Spread::of(rows.iter().map(|row| row.lights as f64));
        line("resident lights", format!("median {:.0}, most {:.0}", resident.median, resident.worst));
        let [arrived, left]: [usize; 2] =
            [rows.iter().map(|row| row.costs.arrived).sum(), rows.iter().map(|row| row.costs.left).sum()];
        line("blocks", format!("{} resident at the end, {arrived} arrived, {left} left", ends[1].regions));
        let mut times = |what: &str, time: fn(&Row) -> f64| {
            let Spread { median, high, worst } = Spread::of(rows.iter().map(time));
            let ratios =
                format!("99.9 % {high:.0} ({:.2} x), worst {worst:.0} ({:.2} x)", high / median, worst / median);
            line(what, format!("median {median:.0} us, {ratios}"));
        };
        times("frame, CPU time", |row| us(row.costs.frame));
        times("frame, wall-clock time", |row| us(row.costs.wall));
        times("  regions", |row| us(row.costs.regions));
        times("  moves and edits", |row| us(row.costs.edits));
        times("  update", |row| us(row.costs.update));
        times("  plan", |row| us(row.costs.plan));
        let bytes = Spread::of(rows.iter().map(|row| row.upload.bytes as f64));
        line("bytes uploaded in a frame", format!("median {:.0}, worst {:.0}", bytes.median, bytes.worst));
        let waiting = Spread::of(rows.iter().map(|row| row.upload.waiting_trees as f64));
        line("trees waiting for an upload", format!("median {:.0}, most {:.0}", waiting.median, waiting.worst));
        let per_light = |bytes: fn(&Row) -> f64| Spread::of(rows.iter().map(|row| bytes(row) / row.lights as f64));
        let cpu = per_light(|row| row.cpu_bytes as f64);
        let gpu = per_light(|row| row.gpu_bytes as f64);
        let used = per_light(|row| row.used_bytes as f64);
        line("bytes per light, CPU", format!("median {:.0}, most {:.0}", cpu.median, cpu.worst));
        line("bytes per light, GPU", format!("median {:.0}, most {:.0}", gpu.median, gpu.worst));
        line("  nodes and lights in use", format!("median {:.0}, most {:.0}", used.median, used.worst));
        let gaps = Spread::of(rows.iter().map(|row| row.gap_bytes as f64 / row.used_bytes as f64));
        line("gaps over used bytes, GPU", format!("median {:.3}, most {:.3}", gaps.median, gaps.worst));
        for (when, end) in ["at rest before", "at rest after"].into_iter().zip(ends) {
            let Ends { lights, regions, cpu, gpu } = end;
            let cpu = format!("CPU {} bytes and {} of tables", cpu.total() - cpu.tables, cpu.tables);
            let gpu = format!("GPU {} of {} bytes used", gpu.used, gpu.buffers);
            line(when, format!("{lights} lights, {regions} blocks, {cpu}, {gpu}"));
        }
        Self(text)
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.trim_end())
    }
}
