//! The plots of the page.

use super::answers::{Answers, BUDGETS, is_plain};
use super::settings::{Change, DEFAULT, LEARNT, SHARED, Sampler, resampled_default};
use super::table::Row;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use testbed::common::table::short;
use testbed::measuring::charts::{FONT, Mark, PALETTE, Stroke, legend, line, text};
use testbed::measuring::log_log::{LABEL_FONT, LEGEND_FONT, LEGEND_LINE, SIZE, around, log_log};

/// What the horizontal axes show.
const TIME: &str = "time of a frame, ms of the page";
/// What the vertical axes show.
const ERROR: &str = "error, relMSE";

/// A plot as SVG text.
type Plot = Result<String, String>;

/// A curve of a plot: one mark for each point, joined by a line.
struct Curve {
    name: String,
    color: RGBColor,
    is_dashed: bool,
    points: Vec<(f64, f64)>,
}

/// The colours of the samplers that are compared.
const COLORS: [RGBColor; 6] = [PALETTE[0], PALETTE[1], PALETTE[3], PALETTE[7], PALETTE[6], PALETTE[2]];

/// The axis of [`error_over_time`] ends at so many times the time of the slowest setting of the
/// library that is swept, or of the last budget if that is more. Points of the front beyond it are
/// named in the plot.
const AXIS_END: f64 = 1.4;

/// Error over time of all settings of the library, with the front.
pub fn error_over_time(rows: &[Row], answers: &Answers) -> Plot {
    let at = |row: &Row| (row.time_ms() * answers.scale, row.errors.rel_mse.mean);
    let is_one_tree = |row: &Row| matches!(row.setting.sampler, Sampler::OneLevel { .. });
    // Changes of the frame are to the library's two levels.
    let is_own = |row: &Row| is_plain(row) || row.setting.change != Change::Nothing;
    let swept = rows.iter().filter(|row| is_plain(row) || is_one_tree(row)).map(|row| at(row).0);
    let end = AXIS_END * swept.chain(BUDGETS).fold(f64::MIN_POSITIVE, f64::max);
    let of = |rows: &mut dyn Iterator<Item = &Row>| -> Vec<(f64, f64)> { rows.map(at).collect() };
    let own = of(&mut rows.iter().filter(|row| is_plain(row) && !row.on_front));
    let one_tree = of(&mut rows.iter().filter(|row| is_one_tree(row) && !row.on_front));
    let (front, beyond): (Vec<&Row>, Vec<&Row>) = answers.front.iter().partition(|row| at(row).0 <= end);
    let of_front = |keep: &dyn Fn(&Row) -> bool| of(&mut front.iter().copied().filter(|row| keep(row)));
    let own_front = of_front(&is_own);
    let one_tree_front = of_front(&is_one_tree);
    let other_front = of_front(&|row| !is_own(row) && !is_one_tree(row));
    let path = of_front(&|_| true);
    let all: Vec<(f64, f64)> = [&own, &one_tree, &path].into_iter().flatten().copied().collect();
    let notes: Vec<String> = beyond
        .iter()
        .map(|row| format!("{}: relMSE {} at {:.0} ms →", row.setting.sampler.name(), short(at(row).1), at(row).0))
        .collect();
    let entries = [
        (Mark::Line(Stroke::new(PALETTE[5], 2, false)), "front of least error, all samplers"),
        (Mark::Circle(PALETTE[5], true), "Girandole on the front"),
        (Mark::Circle(PALETTE[1], true), "Girandole, one tree, on the front"),
        (Mark::Triangle(PALETTE[6]), "other samplers on the front"),
        (Mark::Circle(PALETTE[2], false), "other settings of Girandole"),
        (Mark::Circle(PALETTE[1], false), "other settings of Girandole, one tree"),
        (Mark::Line(Stroke::new(RGBColor(150, 150, 150), 1, true)), "budgets of 0.5, 1 and 4 ms"),
    ];
    let (x, y) = (around(all.iter().map(|at| at.0)).start..end, around(all.iter().map(|at| at.1)));
    log_log((x.clone(), y.clone()), (TIME, ERROR), &entries, |chart| {
        for budget in BUDGETS {
            let stroke = Stroke::new(RGBColor(150, 150, 150), 1, true);
            line(chart, vec![(budget, y.start), (budget, y.end)], stroke)?;
        }
        line(chart, path.clone(), Stroke::new(PALETTE[5], 2, false))?;
        let circles = |points: &[(f64, f64)], radius: i32, style: ShapeStyle| -> Vec<Circle<(f64, f64), i32>> {
            points.iter().map(|at| Circle::new(*at, radius, style)).collect()
        };
        chart.draw_series(circles(&own, 4, PALETTE[2].stroke_width(2))).map_err(text)?;
        chart.draw_series(circles(&own_front, 4, PALETTE[5].filled())).map_err(text)?;
        chart.draw_series(circles(&one_tree_front, 4, PALETTE[1].filled())).map_err(text)?;
        let others = other_front.iter().map(|at| TriangleMarker::new(*at, 6, PALETTE[6].filled()));
        chart.draw_series(others).map_err(text)?;
        // Last and larger, so that no point of the front covers a ring.
        chart.draw_series(circles(&one_tree, 6, PALETTE[1].stroke_width(2))).map_err(text)?;
        let font = (FONT, LABEL_FONT).into_font().color(&BLACK).pos(Pos::new(HPos::Right, VPos::Top));
        // Errors fall with the time, so this corner is empty.
        for (place, note) in notes.iter().enumerate() {
            let offset = (-6, 6 + (LABEL_FONT as i32 + 4) * place as i32);
            let note = EmptyElement::at((x.end, y.end)) + Text::new(note.clone(), offset, font.clone());
            chart.draw_series([note]).map_err(text)?;
        }
        Ok(())
    })
}

/// Error over time of the default and of other samplers, by samples per pixel.
pub fn alternatives(rows: &[Row], others: &[Sampler], answers: &Answers, is_quick: bool) -> Plot {
    let of = |sampler: Sampler| {
        let is_drawn = |row: &&Row| row.setting.sampler == sampler && row.setting.change == Change::Nothing;
        let at = |row: &Row| (row.time_ms() * answers.scale, row.errors.rel_mse.mean);
        let mut points: Vec<(f64, f64)> = rows.iter().filter(is_drawn).map(at).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    let curve = |(sampler, color): (Sampler, RGBColor)| Curve {
        name: sampler.name(),
        color,
        is_dashed: false,
        points: of(sampler),
    };
    let mut curves: Vec<Curve> = others.iter().copied().zip(COLORS).map(curve).collect();
    curves.push(Curve { is_dashed: true, ..curve((resampled_default(is_quick), PALETTE[5])) });
    curves.push(Curve { is_dashed: true, ..curve((SHARED, PALETTE[1])) });
    curves.push(curve((LEARNT, RGBColor(120, 120, 120))));
    curves.push(curve((DEFAULT, PALETTE[5])));
    let all = || curves.iter().flat_map(|curve| &curve.points);
    let ranges = (around(all().map(|at| at.0)), around(all().map(|at| at.1)));
    let stroke = |curve: &Curve| Stroke::new(curve.color, 2, curve.is_dashed);
    let entry = |curve| (Mark::Line(stroke(curve)), curve.name.as_str());
    let entries: Vec<(Mark, &str)> = curves.iter().rev().map(entry).collect();
    log_log(ranges, (TIME, ERROR), &entries, |chart| {
        for curve in &curves {
            line(chart, curve.points.clone(), stroke(curve))?;
            let marks = curve.points.iter().map(|at| Circle::new(*at, 3, curve.color.filled()));
            chart.draw_series(marks).map_err(text)?;
        }
        Ok(())
    })
}

/// The stages of a sample, in microseconds of one core, for each sampler.
pub fn stages(rows: &[Row], others: &[Sampler], shaded_pixels: f64, is_quick: bool) -> Plot {
    const ROW: u32 = 46;
    /// The left end of the bars.
    const LEFT: u32 = 10;
    const PARTS: [(&str, RGBColor); 3] =
        [("choosing", PALETTE[5]), ("shadow ray", PALETTE[1]), ("shading", PALETTE[3])];
    let find = |sampler: Sampler| {
        rows.iter().find(|row| row.setting.sampler == sampler && row.setting.change == Change::Nothing)
    };
    let splits = |splits| Sampler::TwoLevels { splits, candidates: 1 };
    let one_tree = Sampler::OneLevel { splits: 6, candidates: 1 };
    let own = [splits(0), DEFAULT, resampled_default(is_quick), SHARED, LEARNT, one_tree];
    let bars: Vec<(String, [f64; 3])> = own
        .into_iter()
        .chain(others.iter().copied())
        .filter_map(|sampler| {
            let row = find(sampler)?;
            let us = |ms: f64| ms * 1.0e3 / (row.setting.samples * shaded_pixels);
            Some((sampler.name(), [us(row.samples.choosing), us(row.samples.shadow_rays), us(row.samples.shading)]))
        })
        .collect();
    let longest = bars.iter().map(|(_, parts)| parts.iter().sum::<f64>()).fold(f64::MIN_POSITIVE, f64::max);
    let height = ROW * bars.len() as u32 + 30;
    let mut svg = String::new();
    {
        let size = (SIZE.0, height + LEGEND_LINE * 4 + 10);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE).map_err(text)?;
        let (upper, lower) = root.split_vertically(height);
        let font = (FONT, LABEL_FONT).into_font().color(&BLACK);
        let width = f64::from(SIZE.0 - LEFT - 80);
        for (i, (name, parts)) in bars.iter().enumerate() {
            let top = 14 + (ROW * i as u32) as i32;
            upper.draw(&Text::new(name.as_str(), (LEFT as i32, top), font.clone())).map_err(text)?;
            let mut x = f64::from(LEFT);
            let top = top + 18;
            for (part, (_, color)) in parts.iter().zip(PARTS) {
                let end = x + part / longest * width;
                upper.draw(&Rectangle::new([(x as i32, top), (end as i32, top + 20)], color.filled())).map_err(text)?;
                x = end;
            }
            let total = format!("{:.2} µs", parts.iter().sum::<f64>());
            upper.draw(&Text::new(total, (x as i32 + 6, top + 4), font.clone())).map_err(text)?;
        }
        let entries = PARTS.map(|(name, color)| (Mark::Bar(color), name));
        legend(&lower, &entries, LEGEND_FONT)?;
        root.present().map_err(text)?;
    }
    Ok(svg)
}
