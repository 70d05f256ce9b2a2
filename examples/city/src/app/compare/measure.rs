//! Renders the same view by several samplers in equal time, and by a reference.
//!
//! The CPU renders everything, so that all samplers trace the same rays with the same code. The time
//! of a sample is measured in short passes, in which the samplers take turns: other load on the
//! machine meets all of them. The pictures themselves are not timed, because load may differ from one
//! to the next.

use super::session::{Rendered, Session};
use girandole::light::luminance;
use std::time::Duration;
use testbed::measuring::score::{FLOOR, Score, mean};
use testbed::render::image::Image;
use testbed::render::sequence::frame_seed;
use testbed::render::settings::{LightChoice, Settings};
use testbed::scene::SceneError;

/// The samplers in the order in which they take turns, are listed and are drawn.
pub const SAMPLERS: [LightChoice; 6] = [
    LightChoice::Uniform,
    LightChoice::Flux,
    LightChoice::Pbrt,
    LightChoice::SgTree,
    LightChoice::SharedCuts,
    LightChoice::Girandole,
];
/// Rounds in which the time of one sample is measured.
const TIMING_ROUNDS: u32 = 8;
/// A round has a part of the samples of the comparison: one in so many.
const TIMING_PART: u32 = 8;
/// The reference has so many times the samples of Girandole, so that its own error hardly counts.
const REFERENCE_SAMPLES: u32 = 64;
/// The number that seeds the reference, in place of that of a frame. Pictures have lower ones.
const REFERENCE_FRAME: u32 = 1 << 31;

/// A picture and its error.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// How its lights were chosen.
    pub sampler: LightChoice,
    /// Time of rendering, without the build of the sampler: the number of samples times the mean
    /// time of one.
    pub time: Duration,
    /// Samples per pixel.
    pub samples: u32,
    /// Its error against the reference.
    pub score: Score,
}

/// The results of a comparison.
pub struct Comparison {
    /// All pictures: from the least time to the most, each with all samplers.
    pub rows: Vec<Row>,
    /// The pictures of the last time, one for each of [`SAMPLERS`].
    pub equal_time: Vec<(Row, Image)>,
    /// The times in which the samplers were built, for each of [`SAMPLERS`]. The light trees are
    /// part of the scene.
    pub builds: [Duration; SAMPLERS.len()],
    /// What errors are measured against.
    pub reference: Image,
    /// How the reference was made.
    pub reference_name: String,
    /// The relMSE of the reference itself, as far as its samples show it.
    pub reference_error: f64,
}

/// The times of each of [`SAMPLERS`].
#[derive(Clone, Copy, Debug)]
pub struct SampleTimes {
    /// Seconds for one sample per pixel.
    pub seconds: [f64; SAMPLERS.len()],
    /// The build of the sampler.
    pub builds: [Duration; SAMPLERS.len()],
}

/// What a comparison renders.
#[derive(Clone, Debug)]
pub struct Plan {
    settings: Settings,
    /// Samples of Girandole per pixel, rising.
    steps: Vec<u32>,
    /// How the reference chooses lights, and its samples per pixel.
    reference: (LightChoice, u32),
    /// Work of the reference, in samples of one light per pixel.
    reference_work: f64,
    /// Work that is done, and all work.
    work: (f64, f64),
}

impl Plan {
    /// Compares pictures that take as long as 1, 2, 4 and so on samples of Girandole per pixel, up
    /// to [`Settings::spp`]. The reference is the sum over all lights with [`Settings::spp`] samples
    /// if that is the choice of the settings, or else a picture by Girandole with 64 times the
    /// samples.
    pub fn new(settings: &Settings, light_count: usize) -> Self {
        let spp = settings.spp;
        let mut steps: Vec<u32> = (0..).map(|level| 1 << level).take_while(|samples| *samples < spp).collect();
        steps.push(spp);
        let is_sum = settings.light_choice == LightChoice::Exhaustive;
        let reference = if is_sum {
            (LightChoice::Exhaustive, spp)
        } else {
            (LightChoice::Girandole, spp.saturating_mul(REFERENCE_SAMPLES))
        };
        let samplers = SAMPLERS.len() as f64;
        let timing = f64::from(TIMING_ROUNDS * timing_samples(spp)) * samplers;
        let pictures = steps.iter().map(|samples| f64::from(*samples)).sum::<f64>() * samplers;
        let reference_work = f64::from(reference.1) * if is_sum { light_count as f64 } else { 1.0 };
        let work = (0.0, timing + pictures + reference_work);
        Self { settings: settings.clone(), steps, reference, reference_work, work }
    }

    /// Renders everything. The session must have a CPU backend and be at the frame that is to be
    /// shown. `progress` receives the finished share, from 0 to 1.
    pub fn run(mut self, session: &mut Session, progress: &(dyn Fn(f64) + Sync)) -> Result<Comparison, SceneError> {
        let times = self.sample_times(session, progress)?;
        self.run_with(&times, session, progress)
    }

    /// Renders all pictures, with numbers of samples that follow from the times of samples.
    pub fn run_with(
        mut self,
        times: &SampleTimes,
        session: &mut Session,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Comparison, SceneError> {
        let (choice, samples) = self.reference;
        let work = self.reference_work;
        let reference = self.render(session, (choice, samples), REFERENCE_FRAME, work, progress)?.image;
        if mean(&reference.pixels) <= 0.0 {
            return Err(SceneError("--compare: the picture is black, so there is nothing to compare".into()));
        }
        let girandole = times.seconds[SAMPLERS.len() - 1];
        let (mut rows, mut equal_time) = (Vec::new(), Vec::new());
        for (frame, step) in (0..).zip(self.steps.clone()) {
            let is_last = step == self.settings.spp;
            for (sampler, seconds) in SAMPLERS.into_iter().zip(times.seconds) {
                // At least one sample, even if it takes longer.
                let samples = match sampler {
                    LightChoice::Girandole => step,
                    _ => ((f64::from(step) * girandole / seconds) as u32).max(1),
                };
                let Rendered { image, .. } =
                    self.render(session, (sampler, samples), frame, f64::from(step), progress)?;
                let score = Score::new(&image.pixels, &reference.pixels);
                let time = Duration::from_secs_f64(f64::from(samples) * seconds);
                let row = Row { sampler, time, samples, score };
                rows.push(row);
                if is_last {
                    equal_time.push((row, image));
                }
            }
        }
        let count = if samples == 1 { "1 sample".into() } else { format!("{samples} samples") };
        let reference_name = match choice {
            LightChoice::Exhaustive => format!("sum over all lights, {count} per pixel"),
            _ => format!("Girandole, {count} per pixel"),
        };
        Ok(Comparison {
            rows,
            equal_time,
            builds: times.builds,
            reference_error: relative_variance(&reference),
            reference,
            reference_name,
        })
    }

    /// Takes the times of samples and builds, as means over the rounds.
    fn sample_times(
        &mut self,
        session: &mut Session,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<SampleTimes, SceneError> {
        let samples = timing_samples(self.settings.spp);
        let mut seconds = [0.0; SAMPLERS.len()];
        let mut builds = [Duration::ZERO; SAMPLERS.len()];
        for frame in 0..TIMING_ROUNDS {
            for (place, sampler) in SAMPLERS.into_iter().enumerate() {
                let work = f64::from(samples);
                let times = self.render(session, (sampler, samples), frame, work, progress)?.times;
                seconds[place] += times.rendering.as_secs_f64() / f64::from(samples * TIMING_ROUNDS);
                builds[place] += times.baseline_build;
            }
        }
        Ok(SampleTimes { seconds, builds })
    }

    /// Renders a picture, which is this much of the work.
    fn render(
        &mut self,
        session: &mut Session,
        (light_choice, spp): (LightChoice, u32),
        frame: u32,
        work: f64,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Rendered, SceneError> {
        let settings = Settings { light_choice, spp, reused_frames: 0, ..self.settings.clone() };
        let seed = frame_seed(settings.seed, frame);
        let (done, all) = self.work;
        let rendered = session.render(&settings, seed, &|share| progress((done + share * work) / all));
        self.work.0 += work;
        rendered
    }
}

/// Samples per pixel of a picture whose time is measured.
fn timing_samples(spp: u32) -> u32 {
    (spp / TIMING_PART).max(1)
}

/// The mean over pixels of the squared standard error, in units of relMSE.
fn relative_variance(image: &Image) -> f64 {
    let floor = FLOOR * mean(&image.pixels);
    let terms = image.pixels.iter().zip(&image.variance);
    let sum: f64 = terms.map(|(pixel, v)| f64::from(*v) / (floor + f64::from(luminance(*pixel))).powi(2)).sum();
    sum / image.pixels.len() as f64
}
