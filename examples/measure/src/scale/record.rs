//! The row of a frame.

use super::flight::{Flight, FrameCosts};
use girandole::plan::UploadReport;
use std::path::Path;
use std::time::Duration;
use testbed::common::table::Table;

/// The measurements of a frame.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    pub frame: u32,
    pub costs: FrameCosts,
    pub upload: UploadReport,
    pub lights: usize,
    pub cpu_bytes: usize,
    pub gpu_bytes: u64,
    /// Bytes of nodes and lights in use on the GPU, and of gaps between them.
    pub used_bytes: u64,
    pub gap_bytes: u64,
}

/// The columns of `flight.csv`.
const COLUMNS: [&str; 20] = [
    "frame",
    "frame_us",
    "update_us",
    "upload_bytes",
    "resident_lights",
    "waiting_trees",
    "cpu_bytes",
    "gpu_bytes",
    "region_us",
    "edit_us",
    "plan_us",
    "wall_us",
    "refit_trees",
    "rebuilt_trees",
    "stand_ins",
    "used_bytes",
    "gap_bytes",
    "regions_in",
    "regions_out",
    "written_instances",
];

/// Microseconds.
pub fn us(time: Duration) -> f64 {
    time.as_secs_f64() * 1.0e6
}

impl Row {
    /// The row of the frame that was just played.
    pub fn new(frame: u32, flight: &Flight, costs: FrameCosts, upload: UploadReport) -> Self {
        let gpu = flight.planner.memory();
        Self {
            frame,
            costs,
            upload,
            lights: flight.world.light_count(),
            cpu_bytes: flight.world.memory().total(),
            gpu_bytes: gpu.buffers,
            used_bytes: gpu.used,
            gap_bytes: gpu.gaps,
        }
    }

    fn fields(&self) -> Vec<String> {
        let costs = &self.costs;
        let times = |times: &[Duration]| times.iter().map(|time| format!("{:.1}", us(*time))).collect::<Vec<_>>();
        let mut fields = vec![self.frame.to_string()];
        fields.extend(times(&[costs.frame, costs.update]));
        let counts = [self.upload.bytes, self.lights as u64, self.upload.waiting_trees as u64];
        fields.extend(counts.map(|count| count.to_string()));
        fields.extend([self.cpu_bytes as u64, self.gpu_bytes].map(|count| count.to_string()));
        let report = &costs.report;
        fields.extend(times(&[costs.regions, costs.edits, costs.plan, costs.wall]));
        let counts = [report.refit_trees, report.rebuilt_trees, self.upload.stand_ins];
        fields.extend(counts.map(|count| count.to_string()));
        fields.extend([self.used_bytes, self.gap_bytes].map(|count| count.to_string()));
        fields.extend([costs.arrived, costs.left, self.upload.instances].map(|count| count.to_string()));
        fields
    }
}

/// Writes rows to a file.
pub fn write(path: &Path, rows: &[Row]) -> Result<(), String> {
    let mut table = Table::create(path, &COLUMNS)?;
    rows.iter().try_for_each(|row| table.add(row.fields()))
}
