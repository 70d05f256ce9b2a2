//! The files of a comparison: a table, a plot, and the pictures, alone and beside each other.

use super::files::{cannot_write, write_file, write_png};
use super::measure::{Comparison, Row, SAMPLERS};
use clap::ValueEnum;
use girandole::glam::Vec3;
use plotters::prelude::*;
use std::io::Write;
use std::path::Path;
use testbed::common::table::short;
use testbed::measuring::charts::{Mark, PALETTE, Stroke, line, text};
use testbed::measuring::crops::{Crops, Window};
use testbed::measuring::log_log::{around, log_log};
use testbed::render::image::Image;
use testbed::render::settings::LightChoice;
use testbed::scene::SceneError;
use testbed::tone_mapping::{agx, tone_map};

/// The columns of `compare.csv`: the sampler's name as on the command line, [`Row::time`], the
/// samples per pixel, and both errors of [`Row::score`].
pub const COLUMNS: [&str; 5] = ["sampler", "time_ms", "samples", "rel_mse", "mape"];
/// The part of the pictures that is shown beside each other, in pixels, at most.
const CROP: (usize, usize) = (240, 135);
/// The colours of [`SAMPLERS`].
const COLORS: [RGBColor; SAMPLERS.len()] = [PALETTE[0], PALETTE[1], PALETTE[7], PALETTE[2], PALETTE[3], PALETTE[5]];

/// Writes `compare.csv`, `compare.svg` (the pictures of equal time beside each other),
/// `compare_error.svg` (error over time), and `compare_NAME.png` for each sampler and for the
/// reference, into a folder that exists.
pub fn write_all(folder: &Path, comparison: &Comparison, exposure: f32) -> Result<(), SceneError> {
    write_file(&folder.join("compare.csv"), |file| table(file, &comparison.rows))?;
    let write_text = |name: &str, text: Result<String, String>| {
        let path = folder.join(name);
        let text = text.map_err(|error| cannot_write(&path, error))?;
        write_file(&path, |file| file.write_all(text.as_bytes()))
    };
    write_text("compare.svg", pictures(comparison, exposure).map(|crops| crops.svg()))?;
    write_text("compare_error.svg", error_over_time(&comparison.rows))?;
    let write_picture = |name: &str, image: &Image| {
        let bytes = tone_map(image, exposure);
        let size = (image.width, image.height);
        write_file(&folder.join(format!("compare_{name}.png")), |file| write_png(file, size, &bytes))
    };
    for (row, image) in &comparison.equal_time {
        write_picture(&name(row.sampler), image)?;
    }
    write_picture("reference", &comparison.reference)
}

/// The name of a sampler as on the command line.
pub fn name(sampler: LightChoice) -> String {
    sampler.to_possible_value().map_or_else(|| "sum".into(), |value| value.get_name().to_owned())
}

/// The name of a sampler in pictures.
fn title(sampler: LightChoice) -> &'static str {
    match sampler {
        LightChoice::Girandole => "Girandole",
        LightChoice::SharedCuts => "Girandole, shared cuts",
        LightChoice::Roots => "Girandole, from the roots",
        LightChoice::Uniform => "Uniform",
        LightChoice::Flux => "By flux",
        LightChoice::Pbrt => "pbrt-v4's formula",
        LightChoice::SgTree => "Spherical Gaussians",
        LightChoice::Exhaustive => "Sum over all lights",
    }
}

fn milliseconds(row: &Row) -> f64 {
    row.time.as_secs_f64() * 1e3
}

fn table(file: &mut impl Write, rows: &[Row]) -> Result<(), csv::Error> {
    let mut table = csv::Writer::from_writer(file);
    table.write_record(COLUMNS)?;
    for row in rows {
        table.write_record([
            name(row.sampler),
            format!("{:.3}", milliseconds(row)),
            row.samples.to_string(),
            format!("{:.6}", row.score.rel_mse),
            format!("{:.6}", row.score.mape),
        ])?;
    }
    Ok(table.flush()?)
}

/// The part of the pictures with the most contrast, without the bloom of lamps.
fn pictures(comparison: &Comparison, exposure: f32) -> Result<Crops, String> {
    let reference = &comparison.reference;
    let window = Window::of_most_contrast(&reference.pixels, reference.width as usize, CROP);
    let to_screen = |pixel: Vec3| agx((pixel * exposure).max(Vec3::ZERO));
    let mut all = Vec::new();
    for (row, image) in &comparison.equal_time {
        let title = format!("{}, relMSE {}", title(row.sampler), short(row.score.rel_mse));
        let caption = format!("{} spp in {:.0} ms, MAPE {}", row.samples, milliseconds(row), short(row.score.mape));
        all.push(window.cut(&image.pixels, to_screen, title, caption)?);
    }
    let caption = comparison.reference_name.clone();
    all.push(window.cut(&reference.pixels, to_screen, "Reference".into(), caption)?);
    Ok(Crops { all, size: window.size })
}

/// A plot of the relMSE over the time of rendering, with a curve for each sampler.
fn error_over_time(rows: &[Row]) -> Result<String, String> {
    let at = |row: &Row| (milliseconds(row), row.score.rel_mse);
    let curve = |sampler| rows.iter().filter(|row| row.sampler == sampler).map(at).collect::<Vec<_>>();
    let ranges = (around(rows.iter().map(|row| at(row).0)), around(rows.iter().map(|row| at(row).1)));
    let stroke = |color| Stroke::new(color, 2, false);
    let entries = SAMPLERS.into_iter().zip(COLORS).rev();
    let entries: Vec<_> = entries.map(|(sampler, color)| (Mark::Line(stroke(color)), title(sampler))).collect();
    log_log(ranges, ("time of rendering, ms", "error, relMSE"), &entries, |chart| {
        for (sampler, color) in SAMPLERS.into_iter().zip(COLORS) {
            line(chart, curve(sampler), stroke(color))?;
            let marks = curve(sampler).into_iter().map(|at| Circle::new(at, 3, color.filled()));
            chart.draw_series(marks).map_err(text)?;
        }
        Ok(())
    })
}
