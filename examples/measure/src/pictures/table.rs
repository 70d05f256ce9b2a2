//! The rows of `accuracy.csv`.
//!
//! | column | meaning |
//! |---|---|
//! | `setting` | sampler, samples per pixel (spp), and what else differs from the default |
//! | `time_ms` | the time of a frame on one core: the sum of the next six columns |
//! | `update_ms` | refits, rebuilds and their choice; a mean over the frames. |
//! | `upload_ms` | the call that uploads what changed; empty without a device |
//! | `top_level_ms` | the build of the top level |
//! | `choosing_ms` | drawing lights and points on them, with what the sampler prepares for a frame and learns from it |
//! | `shadow_rays_ms`, `shading_ms` | shadow rays; the BRDF and the product of all factors |
//! | `sigma` | relative standard deviation of one sample's illuminance without shadows |
//! | `sigma_visible` | the same with shadows |
//! | `dead` | share of draws that end without a light |
//! | `rel_mse`, `rel_mse_low`, `rel_mse_high` | mean squared relative error without the worst 0.1 % of the pixels, and its 95 % confidence interval |
//! | `mape`, `mape_low`, `mape_high` | mean absolute relative error, and its 95 % confidence interval |
//! | `memory_bytes` | nodes, lights and instances in the library's GPU format, and the table of learnt visibility |
//! | `on_front` | no other unbiased setting has less error in at most the same time |
//!
//! Samplers that are no part of the library, and one level, have 0 for `update_ms` and
//! `top_level_ms`, and an empty `upload_ms`: as if their trees followed all changes at no cost,
//! which favours them. The intervals are those of the logarithms of the errors, to first order, so
//! they never reach 0.

use super::errors::Errors;
use super::noise::SamplerNoise;
use super::played::WorldTimes;
use super::settings::{Sampler, Setting};
use testbed::direct_light::times::StageTimes;

/// The columns, in order.
pub const COLUMNS: [&str; 19] = [
    "setting",
    "time_ms",
    "update_ms",
    "upload_ms",
    "top_level_ms",
    "choosing_ms",
    "shadow_rays_ms",
    "shading_ms",
    "sigma",
    "sigma_visible",
    "dead",
    "rel_mse",
    "rel_mse_low",
    "rel_mse_high",
    "mape",
    "mape_low",
    "mape_high",
    "memory_bytes",
    "on_front",
];

/// A setting and what it costs and gains.
#[derive(Clone, Debug)]
pub struct Row {
    pub setting: Setting,
    /// Milliseconds of one core per frame; zero for the stages of the world where they are taken as
    /// free.
    pub world: WorldTimes,
    /// Milliseconds of one core per frame.
    pub samples: StageTimes,
    pub noise: Option<SamplerNoise>,
    pub errors: Errors,
    pub memory_bytes: usize,
    pub on_front: bool,
}

impl Row {
    /// A row whose sample takes `per_sample` seconds, for a picture in which one sample per pixel
    /// shades `shaded_pixels` pixels.
    pub fn new(
        setting: Setting,
        world: WorldTimes,
        per_sample: StageTimes,
        shaded_pixels: f64,
        errors: Errors,
    ) -> Self {
        let has_two_levels =
            matches!(setting.sampler, Sampler::TwoLevels { .. } | Sampler::ByBrdf { .. } | Sampler::WithGloss { .. });
        let world = if has_two_levels { world } else { WorldTimes::default() };
        let samples = per_sample.scaled(1.0e3 * setting.samples * shaded_pixels);
        Self { setting, world, samples, noise: None, errors, memory_bytes: 0, on_front: false }
    }

    /// The time of a frame, in milliseconds of one core.
    pub fn time_ms(&self) -> f64 {
        self.world.total() + self.samples.total()
    }

    /// The line of the CSV file.
    pub fn fields(&self) -> Vec<String> {
        let ms = |ms: f64| format!("{ms:.4}");
        let of_noise =
            |value: fn(&SamplerNoise) -> f64| self.noise.as_ref().map_or(String::new(), |n| format!("{:.4}", value(n)));
        let Errors { rel_mse, mape, .. } = &self.errors;
        let ([rel_mse_low, rel_mse_high], [mape_low, mape_high]) =
            (rel_mse.positive_interval(), mape.positive_interval());
        vec![
            self.setting.name(),
            ms(self.time_ms()),
            ms(self.world.update),
            self.world.upload.map(ms).unwrap_or_default(),
            ms(self.world.top_level),
            ms(self.samples.choosing),
            ms(self.samples.shadow_rays),
            ms(self.samples.shading),
            of_noise(|noise| noise.sigma),
            of_noise(|noise| noise.sigma_visible),
            of_noise(|noise| noise.dead),
            format!("{:.6}", rel_mse.mean),
            format!("{:.6}", rel_mse_low),
            format!("{:.6}", rel_mse_high),
            format!("{:.5}", mape.mean),
            format!("{mape_low:.5}"),
            format!("{mape_high:.5}"),
            self.memory_bytes.to_string(),
            self.on_front.to_string(),
        ]
    }
}

/// Marks the rows of the front: no other unbiased row has less error in at most the same time.
pub fn mark_front(rows: &mut [Row]) {
    let of = |row: &Row| (row.time_ms(), row.errors.rel_mse.mean);
    let unbiased: Vec<(f64, f64)> = rows.iter().filter(|row| !row.setting.change.is_biased()).map(of).collect();
    for row in rows {
        let (time, error) = of(row);
        row.on_front = !row.setting.change.is_biased() && !unbiased.iter().any(|(t, e)| *t <= time && *e < error);
    }
}
