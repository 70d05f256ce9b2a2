//! Measures all settings of a run.

use super::errors::{Errors, errors, errors_of_all, times_of_all};
use super::noise::{Points, SamplerNoise};
use super::options::{Options, Plan};
use super::played::{Played, Upkeep, WorldTimes, play};
use super::samplers::{Prepared, Samplers, resampled};
use super::scene_view::{SceneView, matte};
use super::settings::{self, Change, DEFAULT, DEFAULT_BUDGET, MOST_LIGHTS, Sampler, Setting};
use super::simplified::without;
use super::table::{Row, mark_front};
use girandole::LightWorld;
use girandole::glam::Vec3;
use girandole::light::luminance;
use std::collections::{HashMap, HashSet};
use testbed::common::progress::progress;
use testbed::direct_light::converged;
use testbed::direct_light::draw::{Draw, Resampled};
use testbed::direct_light::reference::Reference;
use testbed::direct_light::renderer::Renderer;
use testbed::direct_light::times::StageTimes;
use testbed::measuring::score::{FLOOR, mean};
use testbed::render::metering::meter;
use testbed::scene::SceneError;

/// Seeds the passes of the reference, above those of all pictures.
const REFERENCE_SEED: u32 = 1_000_000;
/// The samples per pixel of a pass where there are too many lights to sum up, and the candidates of
/// each sample.
pub const REFERENCE_SAMPLES: f64 = 64.0;
/// See [`REFERENCE_SAMPLES`].
pub const REFERENCE_CANDIDATES: u32 = 32;
/// The samples per pixel of the default that equal time stands for.
pub const EQUAL_TIME_SAMPLES: f64 = 4.0;
/// The samplers to compare with that are shown in equal time: those with the least error.
const BEST_OTHERS: usize = 6;

/// A sampler in equal time.
pub struct Panel {
    pub row: Row,
    /// Its first picture.
    pub picture: Vec<Vec3>,
}

/// Everything that was measured.
pub struct Measured {
    pub rows: Vec<Row>,
    pub equal_time: Vec<Panel>,
    pub reference: Vec<Vec3>,
    /// The relMSE of the reference itself, as its passes show it.
    pub reference_error: f64,
    pub view: SceneView,
    pub shaded_pixels: f64,
    pub lights: usize,
}

/// Plays the scene, renders the reference, and measures all settings.
pub fn measure(options: &Options) -> Result<Measured, SceneError> {
    let plan = options.plan();
    let Played { stage, times: world_times } =
        play((&options.scene, plan.size), plan.frames, Upkeep::Budgeted(DEFAULT_BUDGET))?;
    let mut view = SceneView::new(&stage.scene, options.matte, plan.size)?;
    meter(&mut view.scene, &view.geometry, &stage.world, plan.size);
    let prepared = Prepared::new(&stage.world)?;
    if prepared.ids.is_empty() {
        return Err(SceneError("the scene has no lights".into()));
    }
    let samplers = Samplers::new(&stage.world, &prepared, &view)?;
    let reference = reference(&plan, &view, &stage.world, &prepared);
    let picture = reference.picture();
    if picture.iter().all(|pixel| luminance(*pixel) <= 0.0) {
        return Err(SceneError("the picture is black".into()));
    }

    let bench = Bench { options, plan, view: &view, world: &stage.world, world_times, reference: &picture };
    let all = settings::all(prepared.ids.len(), stage.world.effects(), options.matte, &plan);
    let mut rows = bench.rows(&all, &samplers)?;
    let mut equal_time = bench.equal_time(&rows, &samplers)?;
    // Numbers of samples that differ by less than the digits of a name count as the same.
    let names: HashSet<String> = all.iter().map(Setting::name).collect();
    let new = equal_time.iter().filter(|panel| !names.contains(&panel.row.setting.name()));
    rows.extend(new.map(|panel| panel.row.clone()));
    let points = Points::new(&view, &samplers, &plan);
    add_noise(&mut rows, &points, &view, &samplers, &plan);
    for panel in &mut equal_time {
        let same = rows.iter().find(|row| row.setting.sampler == panel.row.setting.sampler);
        panel.row.noise = same.and_then(|row| row.noise);
    }
    mark_front(&mut rows);

    let (lights, shaded_pixels) = (prepared.ids.len(), view.shaded_pixels());
    let reference_error = relative_variance(&reference);
    drop(samplers);
    Ok(Measured { rows, equal_time, reference: picture, reference_error, view, shaded_pixels, lights })
}

/// Renders the passes of the reference.
fn reference(plan: &Plan, view: &SceneView, world: &LightWorld, prepared: &Prepared) -> Reference {
    let (lights, renderer) = (world.sampler(), view.renderer());
    let mut draw = Resampled { lights, candidates: REFERENCE_CANDIDATES, has_gloss: false };
    let bar = progress("reference", u64::from(plan.passes));
    let passes = (REFERENCE_SEED..REFERENCE_SEED + plan.passes).map(|seed| {
        let pass = match prepared.ids.len() <= MOST_LIGHTS {
            true => converged::picture(&renderer, &lights, &prepared.ids, seed),
            false => renderer.picture(&mut draw, REFERENCE_SAMPLES, seed),
        };
        bar.inc(1);
        pass
    });
    let reference = Reference::new(view.view.pixels.len(), passes);
    bar.finish_and_clear();
    reference
}

/// The mean over pixels of the squared standard error of a reference, in units of relMSE.
fn relative_variance(reference: &Reference) -> f64 {
    let picture = reference.picture();
    let floor = FLOOR * mean(&picture);
    let terms = picture.iter().zip(reference.variance());
    let sum: f64 = terms.map(|(pixel, variance)| variance / (floor + f64::from(luminance(*pixel))).powi(2)).sum();
    sum / picture.len() as f64
}

/// What all settings share.
struct Bench<'a> {
    options: &'a Options,
    plan: Plan,
    view: &'a SceneView,
    world: &'a LightWorld,
    world_times: WorldTimes,
    reference: &'a [Vec3],
}

impl Bench<'_> {
    /// The rows of all settings, without noise.
    fn rows(&self, settings: &[Setting], samplers: &Samplers<'_>) -> Result<Vec<Row>, SceneError> {
        let times = self.sample_times(settings, samplers);
        // The bar counts milliseconds of one core.
        let shaded = self.view.shaded_pixels();
        let work = |setting: &Setting| {
            let per_sample = times.get(&setting.sampler).map_or(0.0, StageTimes::total);
            (1.0e3 * per_sample * setting.samples * shaded * f64::from(self.plan.pictures)) as u64 + 1
        };
        let bar = progress("settings", settings.iter().map(work).sum());
        let mut rows = Vec::with_capacity(settings.len());
        for setting in settings {
            let mut row = match setting.change {
                Change::Nothing => self.plain(setting, samplers, &times)?,
                change => self.changed(setting, change, &times)?,
            };
            row.memory_bytes += samplers.memory_bytes(setting.sampler);
            rows.push(row);
            bar.inc(work(setting));
        }
        bar.finish_and_clear();
        Ok(rows)
    }

    /// The time of one sample of each sampler.
    fn sample_times(&self, settings: &[Setting], samplers: &Samplers<'_>) -> HashMap<Sampler, StageTimes> {
        let mut named: Vec<Sampler> = Vec::new();
        for setting in settings {
            if !named.contains(&setting.sampler) {
                named.push(setting.sampler);
            }
        }
        named.retain(|sampler| samplers.draw(*sampler).is_some());
        let mut draws: Vec<Box<dyn Draw + '_>> = named.iter().filter_map(|sampler| samplers.draw(*sampler)).collect();
        let mut draws: Vec<&mut dyn Draw> = draws.iter_mut().map(|draw| &mut **draw as &mut dyn Draw).collect();
        let times = self.view.renderer().stage_times(&mut draws, self.plan.timed_pixels);
        named.into_iter().zip(times).collect()
    }

    fn row(&self, setting: &Setting, world: WorldTimes, per_sample: StageTimes, errors: Errors) -> Row {
        Row::new(*setting, world, per_sample, self.view.shaded_pixels(), errors)
    }

    /// A setting of the default frame.
    fn plain(
        &self,
        setting: &Setting,
        samplers: &Samplers<'_>,
        times: &HashMap<Sampler, StageTimes>,
    ) -> Result<Row, SceneError> {
        let renderer = self.view.renderer();
        let Some(mut draw) = samplers.draw(setting.sampler) else {
            let (lights, ids) = (samplers.lights(), samplers.ids());
            let open = self.view.without_shadows()?;
            let unshadowed = Renderer { geometry: &open, ..self.view.renderer() };
            let time = times_of_all(&renderer, &unshadowed, (&lights, ids), self.plan.most_evaluations);
            let errors = errors_of_all(
                &renderer,
                (&lights, ids),
                (self.plan.pictures, self.plan.most_evaluations),
                self.reference,
            );
            return Ok(self.row(setting, self.world_times, time, errors));
        };
        let (errors, _) = errors(&renderer, draw.as_mut(), setting.samples, self.plan.pictures, self.reference);
        Ok(self.row(setting, self.world_times, times[&setting.sampler], errors))
    }

    /// A setting that differs from the default frame in more than the sampler, which has two
    /// levels. Its time is measured beside that of the unchanged frame, since the machine may be
    /// busier by now.
    fn changed(
        &self,
        setting: &Setting,
        change: Change,
        times: &HashMap<Sampler, StageTimes>,
    ) -> Result<Row, SceneError> {
        let Sampler::TwoLevels { splits, candidates } = setting.sampler else {
            return Err(SceneError("only two levels have changes".into()));
        };
        let beyond = || SceneError("a count beyond its limit".into());
        let mut world_times = self.world_times;
        let (mut other, mut diffuse, mut open) = (None, None, None);
        match change {
            Change::Upkeep(upkeep) => {
                let Played { stage, times } = play((&self.options.scene, self.plan.size), self.plan.frames, upkeep)?;
                world_times = times;
                other = Some(stage.world);
            }
            Change::SolidAngles => {
                let budget = Upkeep::Budgeted(DEFAULT_BUDGET);
                let Played { mut stage, .. } = play((&self.options.scene, self.plan.size), self.plan.frames, budget)?;
                stage.world.set_solid_angle_sampling(true);
                other = Some(stage.world);
            }
            Change::Without(effect, _) => other = Some(without(self.world, effect)?),
            Change::NoShadows => open = Some(self.view.without_shadows()?),
            Change::NoGloss => diffuse = Some(matte(self.view.scene.clone())),
            Change::Nothing => {}
        }
        let mut draw = resampled(other.as_ref().unwrap_or(self.world), splits, candidates).ok_or_else(beyond)?;
        let mut unchanged = resampled(self.world, splits, candidates).ok_or_else(beyond)?;
        let mut renderer = self.view.renderer();
        let now = renderer.stage_times(&mut [unchanged.as_mut()], self.plan.timed_pixels);
        renderer.scene = diffuse.as_ref().unwrap_or(renderer.scene);
        renderer.geometry = open.as_ref().unwrap_or(renderer.geometry);
        let changed = renderer.stage_times(&mut [draw.as_mut()], self.plan.timed_pixels);
        let ([now], [changed]) = (&now[..], &changed[..]) else {
            return Err(SceneError("one way to draw has one time".into()));
        };
        let per_sample = changed.scaled(times[&setting.sampler].total() / now.total());
        let (errors, _) = errors(&renderer, draw.as_mut(), setting.samples, self.plan.pictures, self.reference);
        Ok(self.row(setting, world_times, per_sample, errors))
    }

    /// The best samplers to compare with, by falling error, and the library, in the time that samples of
    /// the default take.
    fn equal_time(&self, rows: &[Row], samplers: &Samplers<'_>) -> Result<Vec<Panel>, SceneError> {
        let per_sample = |sampler: Sampler| {
            let row = rows.iter().find(|row| row.setting.sampler == sampler && row.setting.change == Change::Nothing);
            let row = row.ok_or_else(|| SceneError("a sampler has no time".into()))?;
            Ok::<_, SceneError>(row.samples.scaled(1.0e-3 / (row.setting.samples * self.view.shaded_pixels())))
        };
        let time = EQUAL_TIME_SAMPLES * per_sample(DEFAULT)?.total();
        let panel = |sampler: Sampler| {
            let per_sample = per_sample(sampler)?;
            // Slower samplers get at least one sample, and so more time.
            let samples = (time / per_sample.total()).max(1.0);
            let setting = Setting { sampler, samples, change: Change::Nothing };
            let mut draw = samplers.draw(sampler).ok_or_else(|| SceneError("a sampler cannot draw".into()))?;
            let (errors, picture) =
                errors(&self.view.renderer(), draw.as_mut(), samples, self.plan.pictures, self.reference);
            let mut row = self.row(&setting, self.world_times, per_sample, errors);
            row.memory_bytes = samplers.memory_bytes(sampler);
            Ok::<_, SceneError>(Panel { row, picture })
        };
        let mut panels: Vec<Panel> = settings::others().map(panel).collect::<Result<_, _>>()?;
        panels.sort_by(|a, b| b.row.errors.rel_mse.mean.total_cmp(&a.row.errors.rel_mse.mean));
        panels.drain(..panels.len() - BEST_OTHERS);
        for own in settings::own_in_equal_time(self.plan.is_quick) {
            panels.push(panel(own)?);
        }
        Ok(panels)
    }
}

/// Computes the noise of each sampler once.
fn add_noise(rows: &mut [Row], points: &Points, view: &SceneView, samplers: &Samplers<'_>, plan: &Plan) {
    let mut known: HashMap<Sampler, Option<SamplerNoise>> = HashMap::new();
    let bar = progress("noise", rows.len() as u64);
    for row in rows.iter_mut().filter(|row| row.setting.change == Change::Nothing) {
        let sampler = row.setting.sampler;
        let noise = || points.noise(view, samplers, sampler, plan.noise_draws);
        row.noise = *known.entry(sampler).or_insert_with(noise);
        bar.inc(1);
    }
    bar.finish_and_clear();
}
