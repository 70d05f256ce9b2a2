//! The cost of frames in worlds of several sizes, in which the same number of things change.

use super::device::Device;
use super::flight::{Flight, FlightError};
use super::record::us;
use super::settings::Settings;
use super::summary::Spread;
use girandole::plan::PlanLimits;
use std::path::Path;
use testbed::common::table::Table;

/// Approximate numbers of resident lights, in thousands.
const SIZES: [u32; 4] = [30, 100, 300, 3_000];
/// The number of these sizes with `--quick`.
const QUICK: usize = 2;
/// Frames before the first that counts. All trees are frozen then: 64 in each frame at most.
const REST: u32 = 650;
const FRAMES: u32 = 500;

const COLUMNS: [&str; 8] =
    ["resident_lights", "instances", "frame_us", "edit_us", "update_us", "plan_us", "worst_frame_us", "upload_bytes"];

/// Measures all sizes, and returns the rows as text.
pub fn measure(path: &Path, seed: u64, is_quick: bool) -> Result<Vec<String>, String> {
    let mut table = Table::create(path, &COLUMNS)?;
    let mut lines = vec![COLUMNS.join(", ")];
    for thousands in &SIZES[..if is_quick { QUICK } else { SIZES.len() }] {
        let fields = of_size(*thousands, seed).map_err(|FlightError(text)| text)?;
        table.add(&fields)?;
        lines.push(fields.join(", "));
    }
    Ok(lines)
}

/// The camera rests, so that no blocks come or go. Vehicles move and lights flicker.
fn of_size(thousands: u32, seed: u64) -> Result<Vec<String>, FlightError> {
    let full = Settings::full(seed);
    let share = f64::from(thousands) * 1.0e-3;
    // A million lights are resident in the full flight.
    let radius = full.radius * share.sqrt();
    let limits = PlanLimits::new(1 << 30).with_tree_memory(1 << 30).with_frame_bytes(256 << 10);
    let mut device = Device::default();
    let mut flight = Flight::start(Settings { radius, limits, ..full }, |plan| device.play(plan))?;
    let mut frames = Vec::with_capacity(FRAMES as usize);
    let mut bytes = 0;
    for frame in 0..REST + FRAMES {
        let costs = flight.hover(|plan| {
            bytes = plan.report.bytes;
            device.play(plan);
        })?;
        if frame >= REST {
            frames.push(costs);
        }
    }
    let frame = Spread::of(frames.iter().map(|costs| us(costs.frame)));
    let median = |values: Vec<f64>| format!("{:.0}", Spread::of(values.into_iter()).median);
    Ok(vec![
        flight.world.light_count().to_string(),
        flight.world.instances().len().to_string(),
        format!("{:.0}", frame.median),
        median(frames.iter().map(|costs| us(costs.edits)).collect()),
        median(frames.iter().map(|costs| us(costs.update)).collect()),
        median(frames.iter().map(|costs| us(costs.plan)).collect()),
        format!("{:.0}", frame.worst),
        bytes.to_string(),
    ])
}
