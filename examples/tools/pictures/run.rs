//! The command line, and the whole run.

use super::city::render::geometry::Geometry;
use super::city::scene::procedural::{self, CityOptions, Size};
use super::city::scene::{Scene, SceneError, Stage};
use super::lights::{carried, contributions};
use super::samplers::{self, Chooser};
use super::sampling::Renderer;
use super::score::{Estimate, PICTURES, Score};
use super::sheet::{Panel, Sheet};
use super::sigma::{Noise, Summary};
use super::view::{Surface, View};
use crate::common::table::markdown_head;
use clap::Parser;
use girandole::glam::Vec3;
use girandole::{FrameBudget, LightId, LightSampler, LightWorld};
use rayon::prelude::*;
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::time::Instant;

/// Renders one view three times in the same time: by flux, by pbrt-v4's formula and by Girandole.
#[derive(Clone, Debug, Parser)]
#[command(name = "pictures", version)]
pub struct Options {
    /// The PNG with the three pictures
    #[arg(long, value_name = "FILE.png")]
    pub out: PathBuf,
    /// How large the procedural city is
    #[arg(long, value_enum, ignore_case = true, default_value_t = Size::S)]
    pub world: Size,
    /// Microseconds of one core per pixel of each picture
    #[arg(long, value_name = "N", default_value_t = 40.0, value_parser = parse_time)]
    pub us_per_pixel: f64,
    /// Samples per pixel of the three pictures, instead of equal time: repeats pictures bit for bit
    #[arg(long, value_name = "A,B,C", value_parser = parse_samples)]
    pub samples: Option<[f64; 3]>,
    /// Keep the city's glossy materials instead of matte ones
    #[arg(long)]
    pub glossy: bool,
    /// Pictures of 64 x 48 pixels and a short reference, to try it out
    #[arg(long)]
    pub quick: bool,
}

fn parse_time(text: &str) -> Result<f64, String> {
    let is_time = |us: &f64| (0.1..=1.0e6).contains(us);
    text.parse().ok().filter(is_time).ok_or_else(|| "expected microseconds, from 0.1 to 1000000".into())
}

fn parse_samples(text: &str) -> Result<[f64; 3], String> {
    let counts: Option<Vec<f64>> = text.split(',').map(|count| count.trim().parse().ok()).collect();
    let counts = counts.and_then(|counts| <[f64; 3]>::try_from(counts).ok());
    let are_counts = |counts: &[f64; 3]| counts.iter().all(|count| (1.0..=1.0e6).contains(count));
    counts.filter(are_counts).ok_or_else(|| "expected three numbers of samples per pixel, from 1 to 1000000".into())
}

/// How large and how exact the pictures are.
struct Plan {
    size: (u32, u32),
    /// Samples per pixel of the reference.
    reference: f64,
    /// Surfaces at which sigma is computed.
    sigma_points: usize,
}

const FULL: Plan = Plan { size: (360, 270), reference: 640.0, sigma_points: 400 };
const QUICK: Plan = Plan { size: (64, 48), reference: 64.0, sigma_points: 20 };

/// Seeds the reference. The pictures have the seeds from 0 on.
const REFERENCE_SEED: u32 = 1_000;
/// The titles of the pictures, in the order of [`samplers::main_three`].
pub const TITLES: [&str; 3] = ["Flux alone", "pbrt-v4's formula, opaque", "Girandole"];

/// The columns of the printed table.
const COLUMNS: [&str; 8] =
    ["sampler", "samples per pixel", "us per sample", "s per picture", "sigma", "MAPE", "relMSE", "mean / reference"];

/// One sampler in numbers.
#[derive(Clone, Debug)]
pub struct Row {
    pub sampler: &'static str,
    /// Samples per pixel, in the mean.
    pub samples: f64,
    /// The time of a sample on one thread.
    pub seconds_per_sample: f64,
    /// The wall time of a picture on all threads, in the mean.
    pub seconds: f64,
    /// The exact relative standard deviation of one choice without shadows, in the mean over
    /// surfaces of the view.
    pub sigma: f64,
    pub mape: Estimate,
    pub rel_mse: Estimate,
    /// The mean luminance of all pictures over that of the reference.
    pub mean: f64,
}

impl Row {
    /// A row of the printed table, in the order of [`COLUMNS`].
    fn fields(&self) -> [String; 8] {
        [
            self.sampler.into(),
            format!("{:.2}", self.samples),
            format!("{:.2}", self.seconds_per_sample * 1.0e6),
            format!("{:.2}", self.seconds),
            format!("{:.2}", self.sigma),
            self.mape.to_string(),
            self.rel_mse.to_string(),
            format!("{:.3}", self.mean),
        ]
    }

    /// The second line of the picture's label.
    pub fn label(&self) -> String {
        format!("{:.1} samples per pixel, MAPE {:.2}", self.samples, self.mape.mean)
    }
}

/// A city as the city example's first frame shows it, without lights at infinity, which belong to
/// no tree.
pub fn city(size: Size, is_glossy: bool) -> Result<(Scene, LightWorld), SceneError> {
    let Stage { mut scene, mut world, mut animation } = procedural::stage(&CityOptions { size, cars: None, seed: 1 })?;
    animation.advance(0.0, &mut scene, &mut world)?;
    let directionals: Vec<_> = world.directionals().map(|(key, _)| key).collect();
    directionals.into_iter().try_for_each(|key| world.remove_directional(key))?;
    world.update(FrameBudget::UNLIMITED);
    if !is_glossy {
        for material in &mut scene.materials {
            (material.roughness, material.metallic) = (1.0, 0.0);
        }
    }
    Ok((scene, world))
}

/// Renders the pictures, prints the table and writes the file. An error is one line for the user.
#[allow(clippy::print_stdout, reason = "a program talks to its user")]
pub fn run(options: &Options) -> Result<Vec<Row>, SceneError> {
    let refuse = |error: String| SceneError(format!("cannot write {}: {error}", options.out.display()));
    // A path that cannot be written is reported before anything is rendered.
    let file = File::create(&options.out).map_err(|error| refuse(error.to_string()))?;
    let plan = if options.quick { QUICK } else { FULL };
    let (scene, world) = city(options.world, options.glossy)?;
    let geometry = Geometry::new(&scene)?;
    let view = View::new(&scene, &geometry, plan.size);
    let lights = world.sampler();
    let ids: Vec<LightId> = lights.all_lights().collect();
    let choosers = samplers::main_three(&world, &carried(&world), &ids);
    let renderer = Renderer { scene: &scene, geometry: &geometry, view: &view, lights };

    let times = renderer.seconds_per_sample(&choosers);
    let samples = match &options.samples {
        Some(samples) => *samples,
        // As exact as the printed table, which `--samples` takes.
        None => times.map(|seconds| (options.us_per_pixel * 1.0e-4 / seconds).round() / 100.0),
    };
    if let Some(few) = samples.iter().find(|samples| **samples < 1.0) {
        let us = options.us_per_pixel;
        return Err(SceneError(format!("{us} microseconds per pixel are only {few:.2} samples; at least 1 is needed")));
    }
    let [_, _, girandole] = &choosers;
    let reference = renderer.picture(girandole.as_ref(), plan.reference, REFERENCE_SEED);

    // Samplers take turns, so that moments in which the machine is busy hit all of them.
    let mut first: Vec<Vec<Vec3>> = Vec::new();
    let mut scores = vec![[Score { mape: 0.0, rel_mse: 0.0, mean: 0.0 }; PICTURES]; choosers.len()];
    let mut seconds = vec![0.0; choosers.len()];
    for seed in 0..PICTURES {
        for (i, chooser) in choosers.iter().enumerate() {
            let start = Instant::now();
            let picture = renderer.picture(chooser.as_ref(), samples[i], seed as u32);
            seconds[i] += start.elapsed().as_secs_f64() / PICTURES as f64;
            scores[i][seed] = Score::new(&picture, &reference);
            if seed == 0 {
                first.push(picture);
            }
        }
    }
    let sigmas = sigmas(&choosers, &lights, &ids, &view, plan.sigma_points);
    let row = |i: usize| Row {
        sampler: choosers[i].name(),
        samples: samples[i],
        seconds_per_sample: times[i],
        seconds: seconds[i],
        sigma: sigmas[i],
        mape: Estimate::new(scores[i].map(|score| score.mape)),
        rel_mse: Estimate::new(scores[i].map(|score| score.rel_mse)),
        mean: scores[i].iter().map(|score| score.mean).sum::<f64>() / PICTURES as f64,
    };
    let rows: Vec<Row> = (0..choosers.len()).map(row).collect();

    let (width, height) = plan.size;
    println!(
        "city {:?}, {} lights in {} instances, {width} x {height} pixels, {} threads; errors of {PICTURES} pictures, ± half \
         of the 95 % confidence interval\n",
        options.world,
        world.light_count(),
        world.instance_count(),
        rayon::current_num_threads(),
    );
    println!("{}", markdown_head(&COLUMNS));
    rows.iter().for_each(|row| println!("| {} |", row.fields().join(" | ")));
    let panels = first.into_iter().zip(&rows).zip(TITLES);
    let panels: Vec<Panel> =
        panels.map(|((pixels, row), title)| Panel { pixels, lines: [title.into(), row.label()] }).collect();
    let sheet = Sheet::new(&panels, (width as usize, height as usize), scene.exposure);
    sheet.write_png(BufWriter::new(file)).map_err(|error| refuse(error.to_string()))?;
    Ok(rows)
}

/// The mean of sigma over surfaces that are spread evenly over the view, for each sampler.
fn sigmas(
    choosers: &[Box<dyn Chooser + '_>],
    lights: &LightSampler<'_>,
    ids: &[LightId],
    view: &View,
    count: usize,
) -> Vec<f64> {
    let all: Vec<&Surface> = view.pixels.iter().filter_map(|pixel| pixel.surfaces[0].as_ref()).collect();
    let chosen: Vec<&Surface> = all.iter().step_by((all.len() / count).max(1)).copied().collect();
    let lux: Vec<Vec<f32>> = chosen.par_iter().map(|at| contributions(lights, ids, &at.shading_point)).collect();
    let sigma = |chooser: &dyn Chooser| {
        let noise = |(at, lux): (&&Surface, &Vec<f32>)| Noise::of(lux, &chooser.pmfs(&at.shading_point));
        let noises: Vec<Noise> = chosen.par_iter().zip(&lux).filter_map(noise).collect();
        Summary::of(&noises).mean
    };
    choosers.iter().map(|chooser| sigma(chooser.as_ref())).collect()
}
