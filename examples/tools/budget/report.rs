//! The tables, as CSV and for eyes.

use super::scene::SceneError;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Of budget.csv.
pub const COLUMNS: [&str; 9] = [
    "scene",
    "motion",
    "strategy",
    "budget_share",
    "gap_recovered",
    "cost_share",
    "within_budget",
    "worst_overrun_us",
    "longest_wait_frames",
];

/// Of over_time.csv.
pub const TIME_COLUMNS: [&str; 6] = ["scene", "motion", "strategy", "budget_share", "frame", "sigma"];

/// Of scenes.csv: what the others are relative to.
pub const SCENE_COLUMNS: [&str; 10] = [
    "scene",
    "motion",
    "lights",
    "instances",
    "deforming_trees",
    "deforming_lights",
    "sigma_update",
    "sigma_rebuild",
    "always_rebuild_us_per_frame",
    "smallest_job_us",
];

/// How one strategy did with one budget.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub scene: String,
    pub motion: String,
    pub strategy: String,
    /// Of what rebuilding always takes; infinite without a budget.
    pub budget_share: f64,
    /// Of the gap between updating only and rebuilding always.
    pub gap_recovered: f64,
    /// Time spent, of what rebuilding always takes.
    pub cost_share: f64,
    /// Share of frames.
    pub within_budget: f64,
    pub worst_overrun_us: f64,
    pub longest_wait_frames: u32,
    /// Mean over shading points, by measured frame.
    pub over_time: Vec<(u32, f64)>,
}

impl Row {
    /// In the order of [`COLUMNS`].
    pub fn fields(&self) -> [String; 9] {
        [
            self.scene.clone(),
            self.motion.clone(),
            self.strategy.clone(),
            self.budget_share.to_string(),
            format!("{:.4}", self.gap_recovered),
            format!("{:.5}", self.cost_share),
            format!("{:.5}", self.within_budget),
            format!("{:.2}", self.worst_overrun_us),
            self.longest_wait_frames.to_string(),
        ]
    }
}

/// A scene in a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneRow {
    pub scene: String,
    pub motion: String,
    pub lights: usize,
    pub instances: usize,
    pub deforming_trees: usize,
    pub deforming_lights: usize,
    pub sigma_update: f64,
    pub sigma_rebuild: f64,
    pub always_rebuild_us: f64,
    pub smallest_job_us: f64,
}

impl SceneRow {
    fn fields(&self) -> [String; 10] {
        [
            self.scene.clone(),
            self.motion.clone(),
            self.lights.to_string(),
            self.instances.to_string(),
            self.deforming_trees.to_string(),
            self.deforming_lights.to_string(),
            format!("{:.5}", self.sigma_update),
            format!("{:.5}", self.sigma_rebuild),
            format!("{:.2}", self.always_rebuild_us),
            format!("{:.2}", self.smallest_job_us),
        ]
    }
}

/// The three tables of a folder. To be opened before anything is measured: what cannot be written is better known then.
pub struct Tables {
    budget: Table,
    over_time: Table,
    scenes: Table,
}

impl Tables {
    /// Creates or empties them.
    pub fn create(out: &Path) -> Result<Self, SceneError> {
        std::fs::create_dir_all(out).map_err(|error| SceneError(format!("cannot make {}: {error}", out.display())))?;
        Ok(Self {
            budget: Table::create(&out.join("budget.csv"), &COLUMNS)?,
            over_time: Table::create(&out.join("over_time.csv"), &TIME_COLUMNS)?,
            scenes: Table::create(&out.join("scenes.csv"), &SCENE_COLUMNS)?,
        })
    }

    /// Adds a scene's lines.
    pub fn add(&mut self, scene: &SceneRow, rows: &[Row]) -> Result<(), SceneError> {
        self.scenes.line(scene.fields())?;
        for row in rows {
            self.budget.line(row.fields())?;
            for (frame, sigma) in &row.over_time {
                let name = [&row.scene, &row.motion, &row.strategy].map(String::clone);
                let values = [row.budget_share.to_string(), frame.to_string(), format!("{sigma:.5}")];
                self.over_time.line(name.into_iter().chain(values))?;
            }
        }
        [&mut self.budget, &mut self.over_time, &mut self.scenes].into_iter().try_for_each(Table::flush)
    }
}

/// A CSV file.
pub struct Table {
    path: PathBuf,
    writer: csv::Writer<File>,
}

impl Table {
    /// Creates or empties the file, and writes its head.
    pub fn create(path: &Path, columns: &[&str]) -> Result<Self, SceneError> {
        let refuse = |error| refusal(path, &error);
        let mut writer = csv::Writer::from_path(path).map_err(refuse)?;
        writer.write_record(columns).map_err(refuse)?;
        let mut table = Self { path: path.to_owned(), writer };
        table.flush()?;
        Ok(table)
    }

    /// Adds a line.
    pub fn line(&mut self, fields: impl IntoIterator<Item = String>) -> Result<(), SceneError> {
        self.writer.write_record(fields).map_err(|error| refusal(&self.path, &error))
    }

    /// Ends it.
    pub fn finish(mut self) -> Result<(), SceneError> {
        self.flush()
    }

    fn flush(&mut self) -> Result<(), SceneError> {
        self.writer.flush().map_err(|error| refusal(&self.path, &error.into()))
    }
}

fn refusal(path: &Path, error: &csv::Error) -> SceneError {
    SceneError(format!("cannot write {}: {error}", path.display()))
}
