//! Learnt visibility: the noise with shadows after some frames, and the time of a sample.
//!
//! In each frame rays leave every eye in random directions. Each surface that they meet takes one
//! sample and one shadow ray, whose result is recorded.

use super::effort::Effort;
use super::places::{self, Place};
use super::receivers::{Receiver, receivers};
use girandole::glam::{Vec3, vec3};
use girandole::light::luminance;
use girandole::{
    CutOptions, CutTable, Incident, LightId, LightSampler, ShadingPoint, ValueError, VisibilityOptions, VisibilityTable,
};
use rayon::prelude::*;
use std::f32::consts::TAU;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;
use testbed::common::table::{Table, markdown_head};
use testbed::direct_light::shadows::Shadows;
use testbed::direct_light::view::first_surface;
use testbed::measuring::shared_cuts;
use testbed::measuring::sigma::{Noise, Summary};
use testbed::scene::SceneError;
use testbed::scene::rng::Rng;

/// Rays from each eye in a frame. They are spread over all directions, as thinly as the pixels of a
/// picture of 12 by 7 with a field of view of 70 degrees.
const RAYS: usize = 1_024;
/// The frames after which noise is measured. Cells get their rows in the first one.
const FRAMES: [usize; 6] = [1, 2, 8, 20, 65, 257];
/// The edge of cells that share cuts, in metres.
const CUT_EDGE: f32 = 0.5;
/// Estimates at each receiver by which the noise of several candidates is measured.
const ESTIMATES: usize = 1_000;
/// Seeds the rays and samples.
const SEED: u64 = 4_711;
/// Forms of a sample take turns for this many rounds, and the fastest round counts.
const ROUNDS: usize = 25;

const COLUMNS: [&str; 13] = [
    "scene",
    "table",
    "samples_per_cell",
    "sigma_mean",
    "sigma_median",
    "sigma_p95",
    "sigma_rms",
    "gain_mean",
    "gain_median",
    "gain_rms",
    "cells",
    "ns_per_pick",
    "sigma_of_8",
];

/// A place, what is measured in it, and what blocks its light.
struct Learner<'a> {
    name: &'a str,
    sampler: LightSampler<'a>,
    receivers: &'a [Receiver],
    place: &'a Place,
    /// Nothing is hidden, neither for the table nor for the measure.
    is_all_visible: bool,
    effort: Effort,
}

/// A row of the table.
struct Row {
    what: String,
    samples_per_cell: f64,
    sigma: Summary,
    cells: usize,
}

impl Learner<'_> {
    /// Plays one frame. Returns the number of samples.
    fn teach(&self, table: &mut VisibilityTable, cuts: Option<&mut CutTable>, frame: usize) -> usize {
        let (mut sampler, geometry) = (self.sampler.with_visibility(table), &self.place.geometry);
        let surface = |index: usize| {
            let mut rng = Rng::new(SEED + frame as u64, index as u64);
            let eye = self.place.eyes[index % self.place.eyes.len()];
            let slope = rng.range(-1.0, 1.0);
            let (sin, cos) = (rng.unit() * TAU).sin_cos();
            let level = (1.0 - slope * slope).sqrt();
            let at = first_surface(geometry, eye, vec3(cos * level, slope, sin * level))?.shading_point;
            Some((at, std::array::from_fn(|_| rng.unit())))
        };
        let rays = self.effort.select(RAYS, 16) * self.place.eyes.len();
        let surfaces: Vec<(ShadingPoint, [f32; 4])> = (0..rays).into_par_iter().filter_map(surface).collect();
        if let Some(cuts) = cuts {
            let marker = self.sampler.with_cuts(cuts);
            surfaces.par_iter().for_each(|(at, _)| marker.mark(at));
            cuts.build(sampler);
            sampler = sampler.with_cuts(cuts);
        }
        let shadows = Shadows::new(&self.place.scene, geometry);
        let ray = |(at, u): &(ShadingPoint, [f32; 4])| {
            let sample = sampler.sample(at, *u)?;
            let is_visible = self.is_all_visible || !shadows.is_shadowed(at, &sample.incident);
            sampler.record_visibility(at, &sample, is_visible);
            Some(())
        };
        let samples = surfaces.par_iter().filter_map(ray).count();
        table.end_frame();
        samples
    }

    fn sigma(&self, sampler: &LightSampler<'_>) -> Summary {
        let at = |receiver: &Receiver| {
            let mut pmfs = Vec::new();
            sampler.distribution(&receiver.shading_point, &mut pmfs);
            let lux = &receiver.illuminance;
            Noise::of(if self.is_all_visible { &lux.all } else { &lux.visible }, &pmfs)
        };
        let noises: Vec<Noise> = self.receivers.par_iter().filter_map(at).collect();
        Summary::of(&noises)
    }

    /// The cells of all receivers, built for what a sampler knows.
    fn cuts(&self, sampler: LightSampler<'_>) -> Result<CutTable, ValueError> {
        let points: Vec<ShadingPoint> = self.receivers.iter().map(|receiver| receiver.shading_point).collect();
        let mut cuts = shared_cuts::marked(&self.place.world, &points, CUT_EDGE)?;
        cuts.build(sampler);
        Ok(cuts)
    }

    /// The noise without a table, and then after some frames. With `shares_cuts` the samples of these frames come
    /// from cells that know what is learnt, and so do the rows but the first.
    fn measure(&self, table: &mut VisibilityTable, what: &str, shares_cuts: bool) -> Result<Vec<Row>, SceneError> {
        let shared = |sampler: LightSampler<'_>| match shares_cuts {
            true => Ok(self.sigma(&sampler.with_cuts(&self.cuts(sampler)?))),
            false => Ok(self.sigma(&sampler)),
        };
        let mut rows =
            vec![Row { what: "none".into(), samples_per_cell: 0.0, sigma: self.sigma(&self.sampler), cells: 0 }];
        // Few samples of a frame share a cell.
        let options = CutOptions::new(CUT_EDGE, 1 << 16).map_err(refused)?.with_min_marks(1);
        let mut cuts = shares_cuts.then(|| CutTable::new(options));
        if shares_cuts {
            let sigma = shared(self.sampler).map_err(refused)?;
            rows.push(Row { what: "shared cuts".into(), samples_per_cell: 0.0, sigma, cells: 0 });
        }
        let suffix = if shares_cuts { ", shared cuts" } else { "" };
        let mut samples = 0;
        for frame in 1..=self.effort.select(FRAMES[FRAMES.len() - 1], 2) {
            samples += self.teach(table, cuts.as_mut(), frame);
            if FRAMES.contains(&frame) {
                let cells = table.cell_count();
                rows.push(Row {
                    what: format!("{what}{frame} frames{suffix}"),
                    samples_per_cell: samples as f64 / cells as f64,
                    sigma: shared(self.sampler.with_visibility(table)).map_err(refused)?,
                    cells,
                });
            }
        }
        Ok(rows)
    }

    /// The noise of one sample that is kept of eight candidates, as a mean over the receivers. Unlike that of one
    /// candidate it is not exact.
    fn sigma_of_candidates(&self, sampler: &LightSampler<'_>) -> f64 {
        let shadows = Shadows::new(&self.place.scene, &self.place.geometry);
        let at = |(index, receiver): (usize, &Receiver)| {
            let (at, mut rng) = (&receiver.shading_point, Rng::new(SEED, index as u64));
            let count = self.effort.select(ESTIMATES, 10);
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..count {
                let u = std::array::from_fn(|_| rng.unit());
                let kept = sampler.reservoir_sample(at, &sampler.resample(at, u, 8));
                let lux = kept.filter(|kept| self.is_all_visible || !shadows.is_shadowed(at, &kept.incident));
                let lux = lux.map_or(0.0, |kept| {
                    let Incident { direction, radiance, pdf, .. } = kept.incident;
                    let cosine = if at.normal == Vec3::ZERO { 1.0 } else { at.normal.dot(direction) };
                    f64::from(luminance(radiance) * cosine / (kept.pmf * pdf))
                });
                sum += lux;
                squares += lux * lux;
            }
            let mean = sum / count as f64;
            (mean > 0.0).then(|| (squares / count as f64 - mean * mean).max(0.0).sqrt() / mean)
        };
        let sigmas: Vec<f64> = self.receivers.par_iter().enumerate().filter_map(at).collect();
        sigmas.iter().sum::<f64>() / sigmas.len().max(1) as f64
    }

    /// Nanoseconds of a pick without and with a table, and of a record, on one thread.
    fn nanoseconds(&self, table: &VisibilityTable, cuts: Option<&CutTable>) -> [f64; 3] {
        let with = self.sampler.with_visibility(table);
        let with = cuts.map_or(with, |cuts| with.with_cuts(cuts));
        let mut fastest = [f64::INFINITY; 3];
        let sample = self.receivers.first().and_then(|at| self.sampler.sample(&at.shading_point, [0.5; 4]));
        let mut time = |which: usize, run: &mut dyn FnMut(&ShadingPoint, [f32; 2])| {
            let mut rng = Rng::new(SEED, which as u64);
            let start = Instant::now();
            for receiver in self.receivers.iter().cycle().take(8_000) {
                run(&receiver.shading_point, [rng.unit(), rng.unit()]);
            }
            fastest[which] = fastest[which].min(start.elapsed().as_secs_f64() * 1.0e9 / 8_000.0);
        };
        for _ in 0..self.effort.select(ROUNDS, 1) {
            time(0, &mut |at, u| _ = black_box(self.sampler.pick(at, u)));
            time(1, &mut |at, u| _ = black_box(with.pick(at, u)));
            time(2, &mut |at, u| {
                if let Some(sample) = &sample {
                    with.record_visibility(at, sample, u[0] < 0.5);
                }
            });
        }
        fastest
    }
}

fn refused(error: ValueError) -> SceneError {
    SceneError(error.to_string())
}

/// Measures, prints the table and writes it.
pub fn run(count: usize, effort: Effort, out: &Path) -> Result<(), SceneError> {
    let mut csv = Table::create(out, &COLUMNS).map_err(SceneError)?;
    testbed::say!("{}", markdown_head(&COLUMNS));
    // Picks are timed, and candidates are measured, without a table and with the last one.
    let mut report = |name: &str, rows: &[Row], times: Option<[[f64; 2]; 2]>| {
        for (index, row) in rows.iter().enumerate() {
            let (sigma, without) = (row.sigma, rows[0].sigma);
            let sigmas = [sigma.mean, sigma.median, sigma.p95, sigma.rms].map(|sigma| format!("{sigma:.3}"));
            let gains = [without.mean / sigma.mean, without.median / sigma.median, without.rms / sigma.rms];
            let head = [name.to_owned(), row.what.clone(), format!("{:.0}", row.samples_per_cell)];
            let ends = times.and_then(|[without, with]| match index {
                0 => Some(without),
                _ => (index + 1 == rows.len()).then_some(with),
            });
            let [time, of_8] =
                ends.map_or([const { String::new() }; 2], |[ns, sigma]| [format!("{ns:.0}"), format!("{sigma:.3}")]);
            let tail = gains.map(|gain| format!("{gain:.2}")).into_iter().chain([row.cells.to_string(), time, of_8]);
            let fields: Vec<String> = head.into_iter().chain(sigmas).chain(tail).collect();
            testbed::say!("| {} |", fields.join(" | "));
            csv.add(fields).map_err(SceneError)?;
        }
        Ok::<(), SceneError>(())
    };
    let table = |edge: f32, cells: usize| {
        VisibilityOptions::new(edge, cells).map(VisibilityTable::new).map_err(|error| SceneError(error.to_string()))
    };
    for (place, cells) in [(places::rooms()?, 4_096), (places::street()?, 16_384)] {
        let sampler = place.world.sampler();
        let ids: Vec<LightId> = sampler.all_lights().collect();
        let receivers = receivers(&place, &sampler, &ids, count)?;
        let is_rooms = cells == 4_096;
        let learner =
            |name| Learner { name, sampler, receivers: &receivers, place: &place, is_all_visible: false, effort };
        let forms = [(0.5, false), (1.0, false), (1.0, true), (2.0, false)];
        for (edge, shares_cuts) in forms.into_iter().filter(|(edge, _)| is_rooms || *edge >= 1.0) {
            let learner = learner(&place.name);
            let mut learnt = table(edge, cells.max(16_384 * usize::from(edge < 1.0)))?;
            let rows = learner.measure(&mut learnt, &format!("{edge} m, "), shares_cuts)?;
            let cuts =
                shares_cuts.then(|| learner.cuts(sampler.with_visibility(&learnt)).map_err(refused)).transpose()?;
            let times = (edge == 1.0).then(|| learner.nanoseconds(&learnt, cuts.as_ref()));
            let with = sampler.with_visibility(&learnt);
            let with = cuts.as_ref().map_or(with, |cuts| with.with_cuts(cuts));
            let ends = times.map(|[without_ns, with_ns, _]| {
                [(without_ns, &sampler), (with_ns, &with)]
                    .map(|(ns, sampler)| [ns, learner.sigma_of_candidates(sampler)])
            });
            report(learner.name, &rows, ends)?;
            if let Some([.., record]) = times {
                testbed::say!("{}: {record:.0} ns a record", place.name);
            }
        }
        if is_rooms {
            let open = Learner { is_all_visible: true, ..learner("ten rooms, nothing hidden") };
            report(open.name, &open.measure(&mut table(1.0, cells)?, "1 m, ", false)?, None)?;
            // All doors are closed for as long as the table remembers, and then open at once.
            let closed = places::rooms_with_doors(false)?;
            let before = Learner { place: &closed, ..learner("ten rooms, doors closed") };
            let mut learnt = table(1.0, cells)?;
            before.measure(&mut learnt, "", false)?;
            let after = learner("ten rooms, doors just opened");
            let rows = after.measure(&mut learnt, "1 m, ", false)?;
            report(after.name, &rows, None)?;
        }
    }
    Ok(())
}
