//! The whole program behind the command line: load, choose a backend, render, write.

use super::frames::Session;
use super::options::Options;
use super::output::{Output, effect_names};
use super::render::backend;
use super::render::settings::ShadowRays;
use super::scene::gltf_scene;
use super::scene::procedural::{self, CityOptions};
use super::scene::real_city::{self, RealCityOptions};
use super::scene::{SceneError, Stage};
use girandole::Effects;
use indicatif::{ProgressBar, ProgressStyle};
use std::time::Duration;

/// Steps of the progress bar in one frame.
const TICKS: u64 = 1000;

/// Renders what was asked for; `say` hears lines for the user. Everything that can be refused is refused before the
/// first file is written.
pub fn run(options: &Options, say: &mut dyn FnMut(&str)) -> Result<(), SceneError> {
    let stage = load(options)?;
    let chosen = backend::choose(options.backend)?;
    say(&chosen.to_string());
    let mut session = Session::new(stage, options.settings(), chosen)?;
    let mut output = Output::new(&options.out)?;

    let bar = ProgressBar::new(u64::from(options.frames) * TICKS);
    let template = "{msg} [{bar:40}] {percent}% {elapsed}, {eta} to go";
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(250));
    let (mut lights, mut total) = (0, Duration::ZERO);
    let (mut effects, mut rays) = (Effects::empty(), ShadowRays::default());
    for number in 0..options.frames {
        bar.set_message(format!("frame {number}"));
        let base = u64::from(number) * TICKS;
        let frame = session.frame(&|share| bar.set_position(base + (share * TICKS as f64) as u64))?;
        let clean = (!options.keep_noise).then(|| session.denoise(&frame.image));
        output.write(&frame, clean.as_ref().unwrap_or(&frame.image), session.scene().exposure)?;
        lights = frame.record.lights;
        effects |= frame.record.effects;
        rays = rays + frame.record.shadow_rays;
        total += frame.record.frame_time;
    }
    bar.finish_and_clear();
    output.finish()?;
    let (width, height) = options.size;
    say(&format!(
        "{} frame(s) of {width}x{height}, {} samples a pixel, {lights} lights: {:.2} s a frame; pictures in {}",
        options.frames,
        options.spp,
        total.as_secs_f64() / f64::from(options.frames),
        options.out.display(),
    ));
    say(&format!(
        "effects: {}; shadow rays: {} traced, {} skipped where nothing could stand in the way",
        effect_names(effects),
        rays.traced,
        rays.skipped,
    ));
    Ok(())
}

fn load(options: &Options) -> Result<Stage, SceneError> {
    let Options { gltf, lamps, traffic, seed, cars, .. } = options.clone();
    let mut stage = if let Some(path) = gltf {
        return gltf_scene::stage(&path, options.camera());
    } else if lamps.is_some() || traffic.is_some() {
        real_city::stage(&RealCityOptions { lamps, traffic, cars, seed })?
    } else {
        procedural::stage(&CityOptions { size: options.world, cars, seed })?
    };
    if let Some(camera) = options.camera() {
        stage.scene.camera = camera;
    }
    Ok(stage)
}
