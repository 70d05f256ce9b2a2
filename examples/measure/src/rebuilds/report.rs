//! The tables, as CSV and for the terminal.

use std::path::Path;
use testbed::common::table::Table;
use testbed::scene::SceneError;

/// The columns of `budget.csv`.
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

/// The columns of `scenes.csv`.
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

/// The results of one strategy with one budget.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub scene: String,
    pub motion: String,
    pub strategy: String,
    /// The budget as a share of the time of always rebuilding; infinite without a budget.
    pub budget_share: f64,
    /// The share of the gap in noise between updating only and always rebuilding.
    pub gap_recovered: f64,
    /// The time spent as a share of the time of always rebuilding.
    pub cost_share: f64,
    /// The share of frames that kept their budget.
    pub within_budget: f64,
    pub worst_overrun_us: f64,
    pub longest_wait_frames: u32,
}

impl Row {
    /// A row of `budget.csv`, in the order of [`COLUMNS`].
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

/// A scene in a motion, with the values that rows are relative to.
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
    /// A row of `scenes.csv`, in the order of [`SCENE_COLUMNS`].
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

/// The two tables of a folder. They are created before anything is measured, so that a folder
/// that cannot be written is reported early.
pub struct Tables {
    budget: Table,
    scenes: Table,
}

impl Tables {
    /// Creates the folder if need be, and creates or empties the tables.
    pub fn create(out: &Path) -> Result<Self, SceneError> {
        std::fs::create_dir_all(out).map_err(|error| SceneError(format!("cannot make {}: {error}", out.display())))?;
        let table = |name, columns| Table::create(&out.join(name), columns).map_err(SceneError);
        Ok(Self { budget: table("budget.csv", &COLUMNS)?, scenes: table("scenes.csv", &SCENE_COLUMNS)? })
    }

    /// Adds the rows of a scene in a motion.
    pub fn add(&mut self, scene: &SceneRow, rows: &[Row]) -> Result<(), SceneError> {
        self.scenes.add(scene.fields()).map_err(SceneError)?;
        rows.iter().try_for_each(|row| self.budget.add(row.fields())).map_err(SceneError)
    }
}
