//! A plot of one scene as SVG, with a panel for each motion: the recovered gap over the time spent.

use super::report::Row;
use plotters::prelude::*;
use std::path::Path;
use testbed::measuring::charts::{Area, FONT, Mark, PALETTE, Stroke, legend, line, text};
use testbed::scene::SceneError;

/// The size of a panel, in pixels.
const SIZE: (u32, u32) = (440, 340);
/// The most panels side by side. The legend takes the place of one.
const COLUMNS: usize = 3;
/// The size of the font of legends, in pixels.
const LEGEND: u32 = 17;

/// The least share of time on the axis.
const MIN_COST: f64 = 0.004;
/// The greatest share of time on the axis.
const MAX_COST: f64 = 2.0;
/// The goal: a share of the time, and a share of the gap.
const GOAL: (f64, f64) = (0.1, 0.97);

/// How a strategy is drawn.
struct Style {
    /// The strategy's name in tables, or the beginning of the names of [SS]'s.
    name: &'static str,
    legend: &'static str,
    stroke: Stroke,
}

const fn style(name: &'static str, legend: &'static str, color: RGBColor, width: u32, is_dashed: bool) -> Style {
    Style { name, legend, stroke: Stroke::new(color, width, is_dashed) }
}

/// The styles in drawing order.
const STYLES: [Style; 6] = [
    style("SS 1", "SS 1 within the budget, by attribute", PALETTE[6], 1, false),
    style("SS 2", "SS 2 within the budget, by attribute", PALETTE[7], 1, false),
    style("round robin", "round robin", PALETTE[1], 2, false),
    style("oldest first", "oldest first", PALETTE[3], 2, false),
    style("oracle", "oracle", PALETTE[0], 2, true),
    style("girandole", "girandole, told of the camera", PALETTE[5], 3, false),
];

fn refusal(path: &Path, error: &impl std::fmt::Display) -> SceneError {
    SceneError(format!("cannot draw {}: {error}", path.display()))
}

/// The strategies of a style, each once and in the order of the rows.
fn of_style(style: &Style, rows: &[&Row]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for row in rows {
        let is_ss = style.name.starts_with("SS") && row.strategy.starts_with(style.name);
        if (is_ss || row.strategy == style.name) && !names.contains(&row.strategy) {
            names.push(row.strategy.clone());
        }
    }
    names
}

/// Draws a file with a panel for each motion of the rows, and the legend.
fn figure(
    path: &Path,
    title: &str,
    rows: &[Row],
    entries: &[(Mark, &str)],
    panel: impl Fn(&Area<'_>, &str, &[&Row]) -> Result<(), String>,
) -> Result<(), SceneError> {
    let mut motions: Vec<&str> = Vec::new();
    for row in rows {
        if !motions.contains(&row.motion.as_str()) {
            motions.push(&row.motion);
        }
    }
    let cells = motions.len() + 1;
    let columns = cells.min(COLUMNS);
    let lines = cells.div_ceil(columns);
    let size = (SIZE.0 * columns as u32, SIZE.1 * lines as u32 + 36);
    let draw = || -> Result<(), String> {
        let root = SVGBackend::new(path, size).into_drawing_area();
        root.fill(&WHITE).map_err(text)?;
        let root = root.titled(title, (FONT, 22).into_font()).map_err(text)?;
        let areas = root.split_evenly((lines, columns));
        for (motion, area) in motions.iter().zip(&areas) {
            let of_motion: Vec<&Row> = rows.iter().filter(|row| row.motion == *motion).collect();
            panel(area, motion, &of_motion)?;
        }
        legend(&areas[motions.len()], entries, LEGEND)?;
        root.present().map_err(text)
    };
    draw().map_err(|error| refusal(path, &error))
}

/// Plots the recovered gap over the share of time spent.
pub fn gap(path: &Path, scene: &str, rows: &[Row]) -> Result<(), SceneError> {
    let all: Vec<&Row> = rows.iter().collect();
    let is_drawn = |style: &&Style| !of_style(style, &all).is_empty();
    let mut entries: Vec<(Mark, &str)> =
        STYLES.iter().rev().filter(is_drawn).map(|style| (Mark::Line(style.stroke), style.legend)).collect();
    let without_budget = [(&STYLES[0], "SS 1 without a budget"), (&STYLES[1], "SS 2 without a budget")];
    let without_budget = without_budget.into_iter().filter(|(style, _)| is_drawn(style));
    entries.extend(without_budget.map(|(style, name)| (Mark::Circle(style.stroke.color, false), name)));
    entries.push((Mark::Cross, "goal: 97 % for 10 %"));
    let title = format!("{scene}: gap recovered over time spent, both relative to always rebuilding");
    figure(path, &title, rows, &entries, |area, motion, rows| {
        let mut chart = ChartBuilder::on(area)
            .caption(motion, (FONT, 19))
            .margin(6)
            .x_label_area_size(44)
            .y_label_area_size(52)
            .build_cartesian_2d((MIN_COST..MAX_COST).log_scale(), -0.1..1.15)
            .map_err(text)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12))
            .x_desc("time spent")
            .y_desc("gap recovered")
            .x_labels(4)
            .x_label_formatter(&|x| format!("{x}"))
            .y_label_formatter(&|y| format!("{y:.1}"))
            .label_style((FONT, 15))
            .axis_desc_style((FONT, 16))
            .draw()
            .map_err(text)?;
        for style in &STYLES {
            for name in of_style(style, rows) {
                let is_drawn = |row: &&&Row| row.strategy == name && row.budget_share.is_finite();
                let mut points: Vec<(f64, f64)> = rows
                    .iter()
                    .filter(is_drawn)
                    .map(|row| (row.cost_share, row.gap_recovered.clamp(-0.1, 1.15)))
                    .collect();
                points.retain(|(cost, _)| *cost >= MIN_COST);
                line(&mut chart, points, style.stroke)?;
                let is_free = |row: &&&Row| row.strategy == name && row.budget_share.is_infinite();
                let free: Vec<_> = rows.iter().filter(is_free).collect();
                let point = |row: &&&Row| (row.cost_share.max(MIN_COST), row.gap_recovered.clamp(-0.1, 1.15));
                let circles = free.iter().map(point).map(|at| Circle::new(at, 4, style.stroke.color.stroke_width(2)));
                chart.draw_series(circles).map_err(text)?;
            }
        }
        chart.draw_series([Cross::new(GOAL, 6, BLACK.stroke_width(2))]).map_err(text)?;
        Ok(())
    })
}
