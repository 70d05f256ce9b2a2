//! The world from above: lights per area, the path, and the radius of residency.

use super::blocks::Block;
use super::flight::Flight;
use super::route::Route;
use super::settings::Settings;
use plotters::prelude::*;
use std::path::Path;
use testbed::measuring::charts::{FONT, PALETTE, text};

/// The edge of the picture, in pixels.
const SIZE: u32 = 860;
/// Squares along each side.
const SQUARES: u32 = 80;

/// Draws the map.
pub fn draw(path: &Path, settings: &Settings, flight: &Flight) -> Result<(), String> {
    let draw = || -> Result<(), String> {
        let root = SVGBackend::new(path, (SIZE, SIZE)).into_drawing_area();
        root.fill(&WHITE).map_err(text)?;
        let km = 1.0e-3 * settings.world_size();
        let mut chart = ChartBuilder::on(&root)
            .caption("Brightness: lights per area. White: the path. Blue: what is resident.", (FONT, 18))
            .margin(12)
            .margin_right(30)
            .x_label_area_size(36)
            .y_label_area_size(44)
            .build_cartesian_2d(0.0..km, 0.0..km)
            .map_err(text)?;
        chart.configure_mesh().disable_mesh().x_desc("km").y_desc("km").label_style((FONT, 14)).draw().map_err(text)?;
        let squares = SQUARES.min(settings.blocks);
        let edge = km / f64::from(squares);
        let per_square = settings.blocks / squares;
        for (x, z) in (0..squares).flat_map(|x| (0..squares).map(move |z| (x, z))) {
            let block = Block { x: (x * per_square) as i32, z: (z * per_square) as i32 };
            let light = (flight.builder.density(block) * 110.0) as u8;
            let color = RGBColor(light, (f32::from(light) * 0.85) as u8, (f32::from(light) * 0.45) as u8);
            let [left, low] = [x, z].map(|i| f64::from(i) * edge);
            let corners = [(left, low), (left + edge, low + edge)];
            chart.draw_series([Rectangle::new(corners, color.filled())]).map_err(text)?;
        }
        let circle = |(x, z): (f64, f64)| -> Vec<(f64, f64)> {
            let radius = 1.0e-3 * settings.radius;
            (0..=96)
                .map(|i| f64::from(i) / 96.0 * std::f64::consts::TAU)
                .map(|a| (x + radius * a.cos(), z + radius * a.sin()))
                .collect()
        };
        let route = Route::new(settings);
        let at = |share: f64| {
            let camera = 1.0e-3 * route.camera(share);
            (camera.x, camera.z)
        };
        let points = (0..=1000).map(|i| at(f64::from(i) / 1000.0));
        chart.draw_series(LineSeries::new(points, WHITE.stroke_width(3))).map_err(text)?;
        for (i, share) in [0.0, 0.25, 0.5].into_iter().enumerate() {
            let color = PALETTE[2].stroke_width(if i == 0 { 3 } else { 1 });
            chart.draw_series(LineSeries::new(circle(at(share)), color)).map_err(text)?;
            chart.draw_series([Circle::new(at(share), 5, PALETTE[2].filled())]).map_err(text)?;
            let frame = (share * f64::from(settings.frames)).round();
            let (x, z) = at(share);
            let label = Text::new(format!("frame {frame}"), (x + 0.012 * km, z), (FONT, 15).into_font().color(&WHITE));
            chart.draw_series([label]).map_err(text)?;
        }
        root.present().map_err(text)
    };
    draw().map_err(|error| format!("cannot draw {}: {error}", path.display()))
}
