//! Error over time as a plot.

use super::front::{Front, is_plain};
use super::settings::{Change, Sampler};
use super::table::Row;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use testbed::common::table::short;
use testbed::measuring::charts::{FONT, Mark, PALETTE, Stroke, line, text};
use testbed::measuring::log_log::{LABEL_FONT, around, log_log};

/// What the horizontal axes show.
const TIME: &str = "time of a frame, ms";
/// What the vertical axes show.
const ERROR: &str = "error, relMSE";

/// Frames of these times have a line, milliseconds.
const BUDGETS: [f64; 3] = [0.5, 1.0, 4.0];

/// The axis of [`error_over_time`] ends at so many times the time of the slowest setting of the
/// library that is swept, or of the last budget if that is more. Points of the front beyond it are
/// named in the plot.
const AXIS_END: f64 = 1.4;

/// Error over time of all settings of the library, with the front.
pub fn error_over_time(rows: &[Row], front: &Front) -> Result<String, String> {
    let at = |row: &Row| (row.time_ms() * front.scale, row.errors.rel_mse.mean);
    let is_one_tree = |row: &Row| matches!(row.setting.sampler, Sampler::OneLevel { .. });
    // Changes of the frame are to the library's two levels.
    let is_own = |row: &Row| is_plain(row) || row.setting.change != Change::Nothing;
    let swept = rows.iter().filter(|row| is_plain(row) || is_one_tree(row)).map(|row| at(row).0);
    let end = AXIS_END * swept.chain(BUDGETS).fold(f64::MIN_POSITIVE, f64::max);
    let of = |rows: &mut dyn Iterator<Item = &Row>| -> Vec<(f64, f64)> { rows.map(at).collect() };
    let own = of(&mut rows.iter().filter(|row| is_plain(row) && !row.on_front));
    let one_tree = of(&mut rows.iter().filter(|row| is_one_tree(row) && !row.on_front));
    let (within, beyond): (Vec<&Row>, Vec<&Row>) = front.rows.iter().partition(|row| at(row).0 <= end);
    let of_front = |keep: &dyn Fn(&Row) -> bool| of(&mut within.iter().copied().filter(|row| keep(row)));
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
