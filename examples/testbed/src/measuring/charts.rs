//! What the SVG charts of the measuring tools share: font, colours, lines, marks and legends.

use plotters::coord::Shift;
use plotters::coord::ranged1d::ValueFormatter;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// The font family of all texts.
pub const FONT: &str = "sans-serif";

/// The palette of Okabe and Ito for colour-blind readers: black, orange, sky blue, bluish green,
/// yellow, blue, vermilion, reddish purple.
pub const PALETTE: [RGBColor; 8] = [
    RGBColor(0, 0, 0),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 158, 115),
    RGBColor(240, 228, 66),
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(204, 121, 167),
];

/// A part of a drawing, in pixels.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// How a line is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Stroke {
    pub color: RGBColor,
    /// Pixels.
    pub width: u32,
    pub is_dashed: bool,
}

impl Stroke {
    /// A solid or dashed line.
    pub const fn new(color: RGBColor, width: u32, is_dashed: bool) -> Self {
        Self { color, width, is_dashed }
    }

    fn style(self) -> ShapeStyle {
        self.color.stroke_width(self.width)
    }
}

/// A mark of a legend.
#[derive(Clone, Copy, Debug)]
pub enum Mark {
    Line(Stroke),
    /// A circle, filled or empty.
    Circle(RGBColor, bool),
    Cross,
    /// A filled triangle.
    Triangle(RGBColor),
    /// A filled rectangle, as in a bar chart.
    Bar(RGBColor),
}

/// The message of an error of the drawing library.
pub fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// Draws a legend, one entry below the other. `size` is that of the font, in pixels.
pub fn legend(area: &Area<'_>, entries: &[(Mark, &str)], size: u32) -> Result<(), String> {
    let font = (FONT, size).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
    let step = size as i32 + 7;
    for (i, (mark, name)) in entries.iter().enumerate() {
        let y = step * 3 / 2 + step * i as i32;
        match mark {
            Mark::Line(stroke) if stroke.is_dashed => {
                for x in [40, 52, 64] {
                    area.draw(&PathElement::new(vec![(x, y), (x + 7, y)], stroke.style())).map_err(text)?;
                }
            }
            Mark::Line(stroke) => {
                area.draw(&PathElement::new(vec![(40, y), (72, y)], stroke.style())).map_err(text)?;
            }
            Mark::Circle(color, is_filled) => {
                let style = if *is_filled { color.filled() } else { color.stroke_width(2) };
                area.draw(&Circle::new((56, y), 4, style)).map_err(text)?;
            }
            Mark::Cross => {
                area.draw(&Cross::new((56, y), 5, BLACK.stroke_width(1))).map_err(text)?;
            }
            Mark::Triangle(color) => {
                area.draw(&TriangleMarker::new((56, y), 6, color.filled())).map_err(text)?;
            }
            Mark::Bar(color) => {
                area.draw(&Rectangle::new([(48, y - 6), (64, y + 6)], color.filled())).map_err(text)?;
            }
        }
        area.draw(&Text::new((*name).to_owned(), (84, y), font.clone())).map_err(text)?;
    }
    Ok(())
}

/// Draws one line of a chart.
pub fn line<X, Y>(
    chart: &mut ChartContext<'_, SVGBackend<'_>, Cartesian2d<X, Y>>,
    points: Vec<(f64, f64)>,
    stroke: Stroke,
) -> Result<(), String>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    if stroke.is_dashed {
        chart.draw_series(DashedLineSeries::new(points, 7, 5, stroke.style())).map_err(text)?;
    } else {
        chart.draw_series(LineSeries::new(points, stroke.style())).map_err(text)?;
    }
    Ok(())
}

/// The label of a value on a logarithmic axis: 1, 2 and 5 times powers of ten have one, other
/// values stay empty.
pub fn log_label(value: f64) -> String {
    let exponent = value.abs().max(f64::MIN_POSITIVE).log10().floor();
    let digit = value / 10.0_f64.powf(exponent);
    // Coordinates that are computed from logarithms are rounded.
    let is_labelled = [1.0, 2.0, 5.0, 10.0].iter().any(|labelled| (digit - labelled).abs() < 1.0e-6);
    let digits = if (digit - 10.0).abs() < 1.0e-6 { -exponent - 1.0 } else { -exponent };
    if is_labelled { format!("{value:.0$}", digits.max(0.0) as usize) } else { String::new() }
}

#[cfg(test)]
mod tests {
    use super::log_label;

    #[test]
    fn logarithmic_axes_have_labels_at_1_2_and_5() {
        for (value, label) in [
            (0.300_000_000_4, ""),
            (0.1, "0.1"),
            (0.020_000_000_01, "0.02"),
            (5.0, "5"),
            (99.999_999_999, "100"),
            (70.0, ""),
        ] {
            assert_eq!(log_label(value), label, "{value}");
        }
    }
}
