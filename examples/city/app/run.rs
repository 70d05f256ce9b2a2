//! The whole program: load a scene, choose a backend, render frames, write files.

use super::options::Options;
use super::output::{Output, effect_names};
use super::render::backend;
use super::render::image::ShadowRays;
use super::scene::SceneError;
use super::session::Session;
use crate::common::progress::progress;
use girandole::Effects;
use std::time::Duration;

/// Steps of the progress bar in one frame.
const TICKS: u64 = 1000;

/// Renders all frames. `print` receives lines for the user. Invalid input is refused before the
/// first file is written.
pub fn run(options: &Options, print: &mut dyn FnMut(&str)) -> Result<(), SceneError> {
    let stage = options.scene.load()?;
    stage.scene.warnings.iter().for_each(|warning| print(&format!("warning: {warning}")));
    let chosen = backend::choose(options.backend)?;
    print(&chosen.to_string());
    let mut session = Session::new(stage, options.settings(), options.pace(), chosen)?;
    let mut output = Output::new(&options.out)?;

    let bar = progress("", u64::from(options.frames) * TICKS);
    let (mut lights, mut total) = (0, Duration::ZERO);
    let (mut effects, mut rays) = (Effects::empty(), ShadowRays::default());
    for number in 0..options.frames {
        bar.set_message(format!("frame {number}"));
        let base = u64::from(number) * TICKS;
        let frame = session.frame(&|share| bar.set_position(base + (share * TICKS as f64) as u64))?;
        let filtered = (!options.keep_noise).then(|| session.denoise(&frame.image));
        output.write(&frame, filtered.as_ref().unwrap_or(&frame.image), session.scene().exposure)?;
        lights = frame.stats.lights;
        effects |= frame.stats.effects;
        rays = rays + frame.stats.shadow_rays;
        total += frame.stats.times.total();
    }
    bar.finish_and_clear();
    output.finish()?;
    let (width, height) = options.size;
    print(&format!(
        "{} frame(s) of {width}x{height} pixels, {} samples per pixel, {lights} lights: {:.2} s per frame; pictures in {}",
        options.frames,
        options.spp,
        total.as_secs_f64() / f64::from(options.frames),
        options.out.display(),
    ));
    print(&format!(
        "effects: {}; shadow rays: {} traced, {} skipped because nothing could block them",
        effect_names(effects),
        rays.traced,
        rays.skipped,
    ));
    Ok(())
}
