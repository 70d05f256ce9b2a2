//! The columns of a flight over time, as SVG.

use super::record::{Row, us};
use plotters::prelude::*;
use std::path::Path;
use testbed::measuring::charts::{Area, FONT, Mark, PALETTE, Stroke, legend, line, text};

/// The size of a panel, in pixels.
const SIZE: (u32, u32) = (520, 260);
const COLUMNS: usize = 2;
/// The most points of a line; each stands for several frames.
const POINTS: usize = 250;

/// A column and its unit.
struct Panel {
    title: &'static str,
    value: fn(&Row) -> f64,
}

const PANELS: [Panel; 10] = [
    Panel { title: "frame, CPU time in µs", value: |row| us(row.costs.frame) },
    Panel { title: "update, µs", value: |row| us(row.costs.update) },
    Panel { title: "regions, µs", value: |row| us(row.costs.regions) },
    Panel { title: "plan, µs", value: |row| us(row.costs.plan) },
    Panel { title: "uploaded, KB", value: |row| row.upload.bytes as f64 * 1.0e-3 },
    Panel { title: "resident lights, thousands", value: |row| row.lights as f64 * 1.0e-3 },
    Panel { title: "trees waiting for an upload", value: |row| row.upload.waiting_trees as f64 },
    Panel { title: "memory on the CPU, MB", value: |row| row.cpu_bytes as f64 * 1.0e-6 },
    Panel { title: "memory on the GPU, MB", value: |row| row.gpu_bytes as f64 * 1.0e-6 },
    Panel {
        title: "gaps in the pools, relative to bytes in use",
        value: |row| row.gap_bytes as f64 / row.used_bytes.max(1) as f64,
    },
];

const WORST: Stroke = Stroke::new(PALETTE[6], 1, false);
const MEDIAN: Stroke = Stroke::new(PALETTE[5], 2, false);

/// Draws all columns. One line shows the median of several frames, another one their largest value.
pub fn draw(path: &Path, rows: &[Row]) -> Result<(), String> {
    let lines = PANELS.len().div_ceil(COLUMNS) as u32;
    let size = (SIZE.0 * COLUMNS as u32, SIZE.1 * lines + 60);
    let draw = || -> Result<(), String> {
        let root = SVGBackend::new(path, size).into_drawing_area();
        root.fill(&WHITE).map_err(text)?;
        let (head, body) = root.split_vertically(60);
        let per_point = rows.len().div_ceil(POINTS).max(1);
        let names = [format!("largest of {per_point} frames"), format!("median of {per_point} frames")];
        legend(&head, &[(Mark::Line(WORST), &names[0]), (Mark::Line(MEDIAN), &names[1])], 15)?;
        for (area, shown) in body.split_evenly((lines as usize, COLUMNS)).iter().zip(&PANELS) {
            panel(area, shown, rows, per_point)?;
        }
        root.present().map_err(text)
    };
    draw().map_err(|error| format!("cannot draw {}: {error}", path.display()))
}

fn panel(area: &Area<'_>, shown: &Panel, rows: &[Row], per_point: usize) -> Result<(), String> {
    let (mut worst, mut median) = (Vec::new(), Vec::new());
    for some in rows.chunks(per_point) {
        let mut values: Vec<f64> = some.iter().map(shown.value).collect();
        values.sort_by(f64::total_cmp);
        let at = f64::from(some[0].frame);
        worst.push((at, values[values.len() - 1]));
        median.push((at, values[values.len() / 2]));
    }
    let top = worst.iter().fold(0.0_f64, |top, (_, value)| top.max(*value));
    let mut chart = ChartBuilder::on(area)
        .caption(shown.title, (FONT, 17))
        .margin(8)
        .margin_right(24)
        .x_label_area_size(30)
        .y_label_area_size(58)
        .build_cartesian_2d(0.0..rows.len() as f64, 0.0..1.1 * top.max(1.0e-3))
        .map_err(text)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .label_style((FONT, 13))
        .x_labels(6)
        .y_labels(6)
        .x_label_formatter(&|frame| format!("{frame:.0}"))
        .draw()
        .map_err(text)?;
    line(&mut chart, worst, WORST)?;
    line(&mut chart, median, MEDIAN)
}
