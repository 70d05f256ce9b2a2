//! All measurements as SVG: errors above, noise below, and a column for each sweep.

use super::measure::Measured;
use super::sweep::Sweep;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use std::ops::Range;
use std::path::Path;
use testbed::measuring::charts::{Area, FONT, Mark, PALETTE, Stroke, legend, line, log_label, text};

/// The size of a panel, in pixels.
const SIZE: (u32, u32) = (440, 320);
/// The height of the legend, in pixels.
const HEAD: u32 = 130;

/// Names as in the table, names in the legend, and colours.
const SAMPLERS: [(&str, &str, RGBColor); 2] = [
    ("girandole", "Girandole, two levels", PALETTE[5]),
    ("girandole flat", "Girandole, one tree in world space", PALETTE[2]),
];

/// The least error that is drawn. Smaller ones are drawn there.
const MIN_ERROR: f64 = 1.0e-8;
/// The range of sigma that is drawn. Larger values have marks, as infinite ones.
const SIGMA: Range<f64> = 0.1..1.0e5;

/// Draws all sweeps.
pub fn draw(path: &Path, rows: &[Measured]) -> Result<(), String> {
    let size = (SIZE.0 * Sweep::ALL.len() as u32, SIZE.1 * 2 + HEAD);
    let draw = || -> Result<(), String> {
        let root = SVGBackend::new(path, size).into_drawing_area();
        root.fill(&WHITE).map_err(text)?;
        let (head, body) = root.split_vertically(HEAD);
        let (names, marks) = head.split_horizontally(SIZE.0);
        let stroke = |color| Stroke::new(color, 2, false);
        legend(&names, &SAMPLERS.map(|(_, name, color)| (Mark::Line(stroke(color)), name)), 15)?;
        let marks_of = [
            (Mark::Line(stroke(BLACK)), "mean"),
            (Mark::Line(Stroke::new(BLACK, 1, true)), "99th percentile (errors)"),
            (
                Mark::Triangle(BLACK),
                "sigma is infinite or NaN at some shading points; the line is the mean of the others",
            ),
        ];
        legend(&marks, &marks_of, 15)?;
        let (upper, lower) = body.split_vertically(SIZE.1);
        for (row, areas) in [upper, lower].iter().map(|areas| areas.split_evenly((1, Sweep::ALL.len()))).enumerate() {
            for (area, sweep) in areas.iter().zip(Sweep::ALL) {
                let own: Vec<&Measured> = rows.iter().filter(|measured| measured.sweep == sweep).collect();
                if row == 0 { errors(area, sweep, &own)? } else { sigmas(area, sweep, &own)? }
            }
        }
        root.present().map_err(text)
    };
    draw().map_err(|error| format!("cannot draw {}: {error}", path.display()))
}

/// The place of a value along the axis of a sweep: its decimal logarithm. A distance of zero is one
/// decade below the least other distance.
fn place(value: f64) -> f64 {
    if value == 0.0 { -1.0 } else { value.log10() }
}

/// The label at such a place.
fn label(sweep: Sweep, place: f64) -> String {
    if sweep == Sweep::Distance && place < -0.5 { "0".to_owned() } else { power(place.round() as i32) }
}

/// A power of ten.
fn power(exponent: i32) -> String {
    let digit = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '0'..='9' => char::from_u32('⁰' as u32 + u32::from(c) - u32::from('0')).unwrap_or(c),
        _ => c,
    };
    format!("10{}", exponent.to_string().chars().map(digit).collect::<String>())
}

fn title(sweep: Sweep) -> &'static str {
    match sweep {
        Sweep::Scale => "scale of the scene",
        Sweep::Distance => "distance from the origin, m",
        Sweep::Contrast => "contrast, brightest over faintest light",
    }
}

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, LogCoord<f64>>>;

fn panel<'a, 'b>(
    area: &'a Area<'b>,
    (sweep, own): (Sweep, &[&Measured]),
    (what, range): (&str, Range<f64>),
    value_label: &dyn Fn(&f64) -> String,
) -> Result<Chart<'a, 'b>, String> {
    let places = own.iter().map(|row| place(row.value));
    let x = places.clone().fold(f64::INFINITY, f64::min)..places.fold(f64::NEG_INFINITY, f64::max);
    let steps = if sweep == Sweep::Scale { 7 } else { 13 };
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .margin_right(24)
        .x_label_area_size(46)
        .y_label_area_size(66)
        .build_cartesian_2d(x, range.log_scale())
        .map_err(text)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .label_style((FONT, 13))
        .axis_desc_style((FONT, 15))
        .x_desc(title(sweep))
        .y_desc(what)
        .x_labels(steps)
        .x_label_formatter(&|place| label(sweep, *place))
        .y_label_formatter(value_label)
        .draw()
        .map_err(text)?;
    Ok(chart)
}

/// The values of a sampler that has them all; empty if it has not.
fn points(own: &[&Measured], sampler: &str, value: impl Fn(&Measured) -> Option<f64>) -> Vec<(f64, f64)> {
    let own = own.iter().filter(|row| row.sampler == sampler);
    own.filter_map(|row| Some((place(row.value), value(row)?))).collect()
}

fn errors(area: &Area<'_>, sweep: Sweep, own: &[&Measured]) -> Result<(), String> {
    let value_label = |value: &f64| power(value.log10().round() as i32);
    let mut chart = panel(area, (sweep, own), ("relative error of probabilities", MIN_ERROR..1.0), &value_label)?;
    for (name, _, color) in SAMPLERS {
        let mean = points(own, name, |row| Some(row.error?.mean.max(MIN_ERROR)));
        let high = points(own, name, |row| Some(row.error?.high.max(MIN_ERROR)));
        line(&mut chart, high, Stroke::new(color, 1, true))?;
        line(&mut chart, mean, Stroke::new(color, 2, false))?;
    }
    Ok(())
}

fn sigmas(area: &Area<'_>, sweep: Sweep, own: &[&Measured]) -> Result<(), String> {
    let value_label =
        |value: &f64| if *value < 1000.0 { log_label(*value) } else { power(value.log10().round() as i32) };
    let mut chart = panel(area, (sweep, own), ("sigma of one sample", SIGMA), &value_label)?;
    for (i, (name, _, color)) in SAMPLERS.into_iter().enumerate().rev() {
        let is_shown = |sigma: &f64| *sigma < SIGMA.end;
        line(&mut chart, points(own, name, |row| row.sigma.filter(is_shown)), Stroke::new(color, 2, false))?;
        let is_lost = |row: &Measured| row.infinite > 0.0 || row.nan > 0.0 || !row.sigma.as_ref().is_some_and(is_shown);
        // A row of marks for each sampler.
        let height = SIGMA.end * 0.65_f64.powi(i as i32 + 1);
        let marks = points(own, name, |row| is_lost(row).then_some(height));
        chart
            .draw_series(marks.into_iter().map(|point| TriangleMarker::new(point, 4, color.filled())))
            .map_err(text)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_labelled_with_powers_of_ten() {
        assert_eq!([power(-6), power(0), power(12), power(34)], ["10⁻⁶", "10⁰", "10¹²", "10³⁴"]);
        assert_eq!([label(Sweep::Distance, -1.0), label(Sweep::Distance, 0.0)], ["0", "10⁰"]);
        assert_eq!(label(Sweep::Scale, place(0.1)), "10⁻¹");
    }
}
