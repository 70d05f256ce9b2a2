//! Plots with two logarithmic axes, such as of error over time.

use super::charts::{FONT, Mark, legend, log_label, text};
use plotters::coord::combinators::LogCoord;
use plotters::prelude::*;
use std::ops::Range;

/// The size of a plot, in pixels: a phone shows it without scaling it down much.
pub const SIZE: (u32, u32) = (480, 420);
/// The height of the legend below a plot, for each entry.
pub const LEGEND_LINE: u32 = 22;
pub const LEGEND_FONT: u32 = 15;
pub const LABEL_FONT: u32 = 14;
/// So many lines of the grid that 1, 2 and 5 are among them.
const LABELS: usize = 30;

/// A chart with two logarithmic axes.
pub type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<LogCoord<f64>, LogCoord<f64>>>;

/// The range of a logarithmic axis around values. Those that are not positive and finite are left
/// out.
pub fn around(values: impl Iterator<Item = f64>) -> Range<f64> {
    let values = values.filter(|value| value.is_finite() && *value > 0.0);
    let range =
        values.fold(f64::INFINITY..0.0, |range: Range<f64>, value| range.start.min(value)..range.end.max(value));
    if range.is_empty() { 0.1..10.0 } else { range.start / 1.4..range.end * 1.4 }
}

/// Draws a plot with logarithmic axes, which have descriptions, and its legend below. Returns it as
/// SVG text. An error is one line.
pub fn log_log(
    (x, y): (Range<f64>, Range<f64>),
    (x_desc, y_desc): (&str, &str),
    entries: &[(Mark, &str)],
    content: impl Fn(&mut Chart<'_, '_>) -> Result<(), String>,
) -> Result<String, String> {
    let mut svg = String::new();
    let size = (SIZE.0, SIZE.1 + LEGEND_LINE * (entries.len() as u32 + 1));
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE).map_err(text)?;
        let (upper, lower) = root.split_vertically(SIZE.1);
        let mut chart = ChartBuilder::on(&upper)
            .margin(10)
            .x_label_area_size(46)
            .y_label_area_size(64)
            .build_cartesian_2d(x.log_scale(), y.log_scale())
            .map_err(text)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12))
            .x_desc(x_desc)
            .y_desc(y_desc)
            .x_labels(LABELS)
            .y_labels(LABELS)
            .x_label_formatter(&|x| log_label(*x))
            .y_label_formatter(&|y| log_label(*y))
            .label_style((FONT, LABEL_FONT))
            .axis_desc_style((FONT, LABEL_FONT + 1))
            .draw()
            .map_err(text)?;
        content(&mut chart)?;
        legend(&lower, entries, LEGEND_FONT)?;
        root.present().map_err(text)?;
    }
    Ok(svg)
}
