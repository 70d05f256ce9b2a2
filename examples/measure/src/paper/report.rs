//! The tables of a run: `paper.md` in the form of [SS], and CSV files.

use super::play::Plan;
use super::results::{Results, Row};
use super::stages::Timing;
use super::strategies::{ATTRIBUTES, TreeKind, attribute_name};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use testbed::common::table::{Table, markdown_head};
use testbed::measuring::score::Estimate;
use testbed::scene::SceneError;

/// The columns of `paper.md`.
const COLUMNS: [&str; 8] = [
    "strategy",
    "average MAPE",
    "minus always update",
    "gap recovered",
    "rebuilds",
    "update ms",
    "rebuild ms",
    "cost share",
];

/// The columns of `paper.csv`.
const CSV_COLUMNS: [&str; 15] = [
    "scene",
    "trees",
    "strategy",
    "mape",
    "mape_half_width",
    "difference",
    "difference_half_width",
    "verdict",
    "gap_recovered",
    "gap_half_width",
    "rebuilds",
    "update_ms",
    "rebuild_ms",
    "cost_share",
    "frames",
];

/// The files of a folder. They are created before anything is measured, so that a folder that
/// cannot be written is reported early.
pub struct Tables {
    rows: Table,
    frames: Table,
    markdown: PathBuf,
    text: String,
}

impl Tables {
    /// Creates the folder if need be, and creates or empties the files.
    pub fn create(out: &Path) -> Result<Self, SceneError> {
        std::fs::create_dir_all(out).map_err(|error| SceneError(format!("cannot make {}: {error}", out.display())))?;
        let table = |name, columns| Table::create(&out.join(name), columns).map_err(SceneError);
        let attributes = ATTRIBUTES.map(|attribute| attribute_name(attribute).replace(' ', "_"));
        let [a, b, c, d] = attributes.each_ref().map(String::as_str);
        let columns =
            ["scene", "trees", "strategy", "frame", "mape", "rebuilds", "update_ms", "rebuild_ms", a, b, c, d];
        Ok(Self {
            rows: table("paper.csv", &CSV_COLUMNS)?,
            frames: table("frames.csv", &columns)?,
            markdown: out.join("paper.md"),
            text: String::new(),
        })
    }

    /// Adds a scene.
    pub fn add(&mut self, results: &Results, plan: &Plan) -> Result<(), SceneError> {
        let rows = results.rows();
        for row in &rows {
            self.rows.add(csv_fields(results, row, plan)).map_err(SceneError)?;
        }
        for run in &results.runs {
            for (frame, result) in run.frames.iter().enumerate() {
                let step = &result.step;
                let mut fields = vec![results.scene.clone(), run.kind.name().into(), run.strategy.name()];
                fields.extend([frame.to_string(), format!("{:.5}", run.mape_of(frame)), step.rebuilds.to_string()]);
                fields.extend([step.update_ms, step.rebuild_ms].map(|ms| format!("{ms:.4}")));
                fields.extend(ATTRIBUTES.map(|attribute| format!("{:.6}", step.attributes.get(attribute))));
                self.frames.add(fields).map_err(SceneError)?;
            }
        }
        self.text += &section(results, &rows, plan);
        std::fs::write(&self.markdown, &self.text)
            .map_err(|error| SceneError(format!("cannot write {}: {error}", self.markdown.display())))
    }
}

fn csv_fields(results: &Results, row: &Row, plan: &Plan) -> Vec<String> {
    let number = |value: f64| format!("{value:.5}");
    // Empty where there is no gap.
    let gap = |value: fn(&Estimate) -> f64| row.gap.as_ref().map_or(String::new(), |gap| number(value(gap)));
    let mut fields = vec![results.scene.clone(), row.kind.name().into(), row.strategy.name()];
    fields.extend([row.mape, row.difference].iter().flat_map(|e| [number(e.mean), number(e.half_width)]));
    fields.extend([row.verdict().to_owned(), gap(|gap| gap.mean), gap(|gap| gap.half_width), row.rebuilds.to_string()]);
    fields.extend([row.update_ms, row.rebuild_ms, row.cost_share].map(number));
    fields.push(plan.frames.to_string());
    fields
}

/// The part of `paper.md` about a scene.
fn section(results: &Results, rows: &[Row], plan: &Plan) -> String {
    let Results { scene, lights, instances, changed_lights, reference_error, .. } = results;
    let Plan { frames, timing: Timing { start, fps }, settings, .. } = plan;
    let (width, height) = settings.size;
    let mut text = format!(
        "## {scene}\n\n{lights} lights in {instances} instances, of which {changed_lights:.0} change from a frame to \
         the next. {frames} frames, {fps} per second from second {start} on, {width} x {height} pixels, {} light samples per pixel, {} \
         seeds. The MAPE of the references themselves is {reference_error:.3}. Intervals are of 95 %.\n",
        settings.samples, settings.seeds
    );
    for kind in TreeKind::ALL {
        let _ = write!(text, "\n### {scene}, {}\n\n{}\n", kind.name(), markdown_head(&COLUMNS));
        for row in rows.iter().filter(|row| row.kind == kind) {
            let _ = writeln!(text, "| {} |", fields(row).join(" | "));
        }
    }
    text + "\n"
}

/// A line of a table in `paper.md`.
fn fields(row: &Row) -> [String; 8] {
    let difference = match row.verdict() {
        "" => String::new(),
        "no difference" => format!("{:+.4} ± {:.4}, no difference", row.difference.mean, row.difference.half_width),
        verdict => format!("**{:+.4} ± {:.4}**, {verdict}", row.difference.mean, row.difference.half_width),
    };
    let gap = |gap: Estimate| format!("{:.2} ± {:.2}", gap.mean, gap.half_width);
    [
        row.strategy.name(),
        format!("{:.4} ± {:.4}", row.mape.mean, row.mape.half_width),
        difference,
        row.gap.map_or("no gap".into(), gap),
        row.rebuilds.to_string(),
        format!("{:.1}", row.update_ms),
        format!("{:.1}", row.rebuild_ms),
        format!("{:.3}", row.cost_share),
    ]
}
