//! Parts of the table: the front of least error, and all samplers in equal time.

use super::front::Front;
use super::measured::Measured;
use super::noise::SamplerNoise;
use super::table::Row;
use std::path::Path;
use testbed::common::table::{Table, markdown_head};

/// The columns of the front. A frame with one default sample per pixel takes half a millisecond.
const FRONT: [&str; 5] = ["setting", "page_ms", "rel_mse", "rel_mse_low", "rel_mse_high"];

/// The columns of `equal_time.csv`, which are explained in `table.rs`.
const EQUAL_TIME: [&str; 9] =
    ["sampler", "samples", "rel_mse", "rel_mse_low", "rel_mse_high", "mape", "sigma", "sigma_visible", "dead"];

fn errors(row: &Row) -> [String; 3] {
    let error = &row.errors.rel_mse;
    let [low, high] = error.positive_interval();
    [error.mean, low, high].map(|value| format!("{value:.6}"))
}

/// Prints the front, and writes `equal_time.csv`.
pub fn write(out: &Path, measured: &Measured, front: &Front) -> Result<(), String> {
    testbed::say!("The front of least error:\n\n{}", markdown_head(&FRONT));
    for row in &front.rows {
        let time = format!("{:.4}", row.time_ms() * front.scale);
        let fields: Vec<String> = [row.setting.name(), time].into_iter().chain(errors(row)).collect();
        testbed::say!("| {} |", fields.join(" | "));
    }
    let mut equal_time = Table::create(&out.join("equal_time.csv"), &EQUAL_TIME)?;
    for row in measured.equal_time.iter().map(|panel| &panel.row) {
        let noise =
            |value: fn(&SamplerNoise) -> f64| row.noise.as_ref().map_or(String::new(), |n| format!("{:.4}", value(n)));
        let head = [row.setting.sampler.name(), format!("{:.2}", row.setting.samples)];
        let tail = [
            format!("{:.5}", row.errors.mape.mean),
            noise(|noise| noise.sigma),
            noise(|noise| noise.sigma_visible),
            noise(|noise| noise.dead),
        ];
        equal_time.add(head.into_iter().chain(errors(row)).chain(tail))?;
    }
    Ok(())
}
