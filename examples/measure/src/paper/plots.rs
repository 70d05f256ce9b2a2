//! Plots as SVG: MAPE and an attribute over the frames, in the form of figures 3 to 14 of [SS], and
//! the change of the MAPE over the share of the cost.

use super::decisions::Rule;
use super::results::{Results, Row, Run};
use super::strategies::{ATTRIBUTES, Strategy, TreeKind, attribute_name};
use girandole::Attribute;
use plotters::prelude::*;
use std::ops::Range;
use std::path::Path;
use testbed::measuring::charts::{Area, FONT, Mark, PALETTE, Stroke, legend, line, text};
use testbed::scene::SceneError;

/// The size of a panel over frames, pixels.
const PANEL: (u32, u32) = (560, 260);
/// The height of a legend, pixels.
const LEGEND: u32 = 76;
/// The size of the font of legends, pixels.
const LEGEND_FONT: u32 = 16;
/// The values of S of the drawn runs of algorithms 1 and 2.
const DRAWN: [f32; 2] = [1.0, 1.05];

/// Always updated, always rebuilt, and the algorithm.
const STROKES: [Stroke; 3] = [
    Stroke::new(RGBColor(150, 150, 150), 2, false),
    Stroke::new(PALETTE[5], 2, false),
    Stroke::new(PALETTE[6], 2, false),
];

/// Draws a file.
fn drawing(
    path: &Path,
    size: (u32, u32),
    title: &str,
    draw: impl FnOnce(&Area<'_>) -> Result<(), String>,
) -> Result<(), SceneError> {
    let all = || {
        let root = SVGBackend::new(path, size).into_drawing_area();
        root.fill(&WHITE).map_err(text)?;
        let area = root.titled(title, (FONT, 20)).map_err(text)?;
        draw(&area)?;
        root.present().map_err(text)
    };
    all().map_err(|error| SceneError(format!("cannot draw {}: {error}", path.display())))
}

/// Plots each attribute: a column for each algorithm, with a panel of MAPE and one of the
/// attribute.
pub fn over_time(out: &Path, results: &Results, kind: TreeKind) -> Result<(), SceneError> {
    for attribute in ATTRIBUTES {
        let name = attribute_name(attribute);
        let file = format!("frames_{}_{}_{}.svg", results.scene, kind.file_name(), name.replace(' ', "_"));
        let title = format!("{}, {}: {name}", results.scene, kind.name());
        let size = (2 * PANEL.0, 2 * PANEL.1 + LEGEND + 30);
        drawing(&out.join(file), size, &title, |area| {
            let (panels, below) = area.split_vertically(2 * PANEL.1);
            for (column, algorithm) in panels.split_evenly((1, 2)).iter().zip([1, 2]) {
                if let Some(runs) = drawn(results, kind, attribute, algorithm) {
                    let [upper, lower] =
                        <[Area<'_>; 2]>::try_from(column.split_evenly((2, 1))).map_err(|_| "two panels".to_owned())?;
                    let caption = format!("algorithm {algorithm}, S {}", DRAWN[algorithm - 1]);
                    panel(&upper, &caption, "MAPE", &runs, |run, frame| run.mape_of(frame))?;
                    let value = |run: &Run, frame: usize| f64::from(run.frames[frame].step.attributes.get(attribute));
                    panel(&lower, "", name, &runs, value)?;
                }
            }
            let [update, rebuild, algorithm] = STROKES.map(Mark::Line);
            let (left, right) = below.split_horizontally(PANEL.0);
            legend(&left, &[(update, "always updated"), (rebuild, "always rebuilt")], LEGEND_FONT)?;
            let marks = [(algorithm, "the algorithm"), (Mark::Circle(PALETTE[6], true), "rebuild by the algorithm")];
            legend(&right, &marks, LEGEND_FONT)
        })?;
    }
    Ok(())
}

/// The three runs of a column.
fn drawn(results: &Results, kind: TreeKind, attribute: Attribute, algorithm: usize) -> Option<[&Run; 3]> {
    let is_drawn = |run: &&Run| {
        run.kind == kind
            && match run.strategy {
                Strategy::Rule(Rule::Deviation { attribute: own, factor, .. }) => {
                    algorithm == 1 && own == attribute && factor == DRAWN[0]
                }
                Strategy::Rule(Rule::Ratio { attribute: own, factor }) => {
                    algorithm == 2 && own == attribute && factor == DRAWN[1]
                }
                _ => false,
            }
    };
    let run = results.runs.iter().find(is_drawn)?;
    Some([results.end(kind, Rule::Never)?, results.end(kind, Rule::Always)?, run])
}

/// Draws a value of three runs over the frames. Rebuilds of the third are marked.
fn panel(
    area: &Area<'_>,
    caption: &str,
    label: &str,
    runs: &[&Run; 3],
    value: impl Fn(&Run, usize) -> f64,
) -> Result<(), String> {
    let frames = runs[0].frames.len();
    let values = runs.iter().flat_map(|run| (0..frames).map(|frame| value(run, frame)));
    let range = padded(values);
    let digits = (1.0 - (range.end - range.start).log10().floor()).clamp(0.0, 6.0) as usize;
    let mut builder = ChartBuilder::on(area);
    if !caption.is_empty() {
        builder.caption(caption, (FONT, 18));
    }
    let mut chart = builder
        .margin(8)
        .x_label_area_size(44)
        .y_label_area_size(78)
        .build_cartesian_2d(0.0..(frames - 1) as f64, range)
        .map_err(text)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .x_desc("frame")
        .y_desc(label)
        .x_labels(10)
        .y_labels(5)
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| format!("{y:.digits$}"))
        .label_style((FONT, 15))
        .axis_desc_style((FONT, 16))
        .draw()
        .map_err(text)?;
    for (run, stroke) in runs.iter().zip(STROKES) {
        line(&mut chart, (0..frames).map(|frame| (frame as f64, value(run, frame))).collect(), stroke)?;
    }
    let rebuilt = (1..frames).filter(|frame| runs[2].frames[*frame].step.rebuilds > 0);
    let marks = rebuilt.map(|frame| Circle::new((frame as f64, value(runs[2], frame)), 4, STROKES[2].color.filled()));
    chart.draw_series(marks).map_err(text)?;
    Ok(())
}

/// The range of some values, a little wider.
fn padded(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let margin = 0.06 * (high - low).max(1.0e-6 * high.abs()).max(1.0e-9);
    low - margin..high + margin
}

/// The axis of costs begins here, or below the least share of a panel.
const MIN_COST: f64 = 0.005;
/// The greatest share of the cost on the axis.
const MAX_COST: f64 = 1.6;
/// The size of a panel over costs, pixels.
const COST_PANEL: (u32, u32) = (440, 420);
/// The width of the legend beside such panels, pixels.
const COST_LEGEND: u32 = 320;

/// Plots the change of the MAPE over the share of the cost, with a panel for each kind of tree.
///
/// The axis is logarithmic, so runs without rebuilds have no place on it. A note in the panel
/// counts them.
pub fn cost(out: &Path, results: &Results) -> Result<(), SceneError> {
    let rows = results.rows();
    let is_compared = |kind: &TreeKind| rows.iter().filter(|row| row.kind == *kind).count() > 1;
    let kinds: Vec<TreeKind> = TreeKind::ALL.into_iter().filter(is_compared).collect();
    let width = COST_PANEL.0 * kinds.len() as u32;
    let title = format!("{}: change of the MAPE over the time of rebuilds, with 95 % intervals", results.scene);
    let path = out.join(format!("cost_{}.svg", results.scene));
    drawing(&path, (width + COST_LEGEND, COST_PANEL.1), &title, |area| {
        let (panels, right) = area.split_horizontally(width);
        for (area, kind) in panels.split_evenly((1, kinds.len())).iter().zip(&kinds) {
            let rows: Vec<&Row> = rows.iter().filter(|row| row.kind == *kind).collect();
            cost_panel(area, kind.name(), &rows)?;
        }
        let mut entries: Vec<(Mark, String)> = Vec::new();
        let has_algorithms = results.runs.iter().any(|run| run.kind == TreeKind::Binary);
        for attribute in ATTRIBUTES.into_iter().filter(|_| has_algorithms) {
            let (color, name) = (color_of(attribute), attribute_name(attribute));
            entries.push((Mark::Circle(color, true), format!("{name}, alg 1")));
            entries.push((Mark::Circle(color, false), format!("{name}, alg 2")));
        }
        entries.push((Mark::Circle(PALETTE[6], true), "the library's budgets".into()));
        entries.push((Mark::Circle(BLACK, true), "always rebuild".into()));
        entries.push((Mark::Line(Stroke::new(BLACK, 1, true)), "always update".into()));
        let entries: Vec<(Mark, &str)> = entries.iter().map(|(mark, name)| (*mark, name.as_str())).collect();
        legend(&right, &entries, LEGEND_FONT)
    })
}

fn color_of(attribute: Attribute) -> RGBColor {
    match attribute {
        Attribute::Distance => PALETTE[1],
        Attribute::Overlap => PALETTE[2],
        Attribute::Variance => PALETTE[3],
        Attribute::SplittingCost => PALETTE[7],
    }
}

/// The color of a strategy's circle, and whether it is filled. The line of always updating has
/// none.
fn mark_of(strategy: &Strategy) -> Option<(RGBColor, bool)> {
    match strategy {
        Strategy::Rule(Rule::Never) => None,
        Strategy::Rule(Rule::Always) => Some((BLACK, true)),
        Strategy::Rule(Rule::Deviation { attribute, .. }) => Some((color_of(*attribute), true)),
        Strategy::Rule(Rule::Ratio { attribute, .. }) => Some((color_of(*attribute), false)),
        Strategy::Budget(_) => Some((PALETTE[6], true)),
    }
}

fn cost_panel(area: &Area<'_>, caption: &str, rows: &[&Row]) -> Result<(), String> {
    let update =
        rows.iter().find(|row| row.strategy == Strategy::Rule(Rule::Never)).ok_or("no run without rebuilds")?;
    let percent = 100.0 / update.mape.mean;
    let (drawn, free): (Vec<&Row>, Vec<&Row>) = rows.iter().copied().partition(|row| row.cost_share > 0.0);
    let least = drawn.iter().map(|row| 0.8 * row.cost_share).fold(MIN_COST, f64::min);
    let ends = drawn.iter().flat_map(|row| [row.difference.low() * percent, row.difference.high() * percent]);
    let y_range = padded(ends.chain([0.0]));
    let top = y_range.end;
    let mut chart = ChartBuilder::on(area)
        .caption(caption, (FONT, 18))
        .margin(8)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d((least..MAX_COST).log_scale(), y_range)
        .map_err(text)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .x_desc("rebuild time / that of always rebuilding")
        .y_desc("MAPE minus always update, %")
        .x_labels(4)
        .y_labels(8)
        .x_label_formatter(&|x| format!("{x}"))
        .y_label_formatter(&|y| format!("{:.1}", y + 0.0))
        .label_style((FONT, 15))
        .axis_desc_style((FONT, 16))
        .draw()
        .map_err(text)?;
    line(&mut chart, vec![(least, 0.0), (MAX_COST, 0.0)], Stroke::new(BLACK, 1, true))?;
    let free = free.iter().filter(|row| mark_of(&row.strategy).is_some()).count();
    if free > 0 {
        let runs = if free == 1 { "run" } else { "runs" };
        let note = format!("not shown: {free} {runs} without later rebuilds");
        let font = (FONT, 14).into_font().color(&BLACK);
        let at = EmptyElement::at((least, top)) + Text::new(note, (6, 4), font);
        chart.draw_series([at]).map_err(text)?;
    }
    for row in drawn {
        let Some((color, is_filled)) = mark_of(&row.strategy) else { continue };
        let (x, y) = (row.cost_share, row.difference);
        line(&mut chart, vec![(x, y.low() * percent), (x, y.high() * percent)], Stroke::new(color, 1, false))?;
        let style = if is_filled { color.filled() } else { color.stroke_width(2) };
        chart.draw_series([Circle::new((x, y.mean * percent), 4, style)]).map_err(text)?;
    }
    Ok(())
}
