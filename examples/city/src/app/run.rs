//! The whole program: load a scene, choose a backend, render frames, write files.

use super::files::write_file;
use super::options::Options;
use super::output::{Output, effect_names};
use super::session::{Frame, FrameStats, Session};
use super::stage_times::{Laps, StageTimes};
use super::video::film::{FFMPEG, Film};
use girandole::Effects;
use std::time::Duration;
use testbed::common::progress::progress;
use testbed::render::backend;
use testbed::render::image::ShadowRays;
use testbed::scene::SceneError;
use testbed::tone_mapping::tone_map;

/// Steps of the progress bar in one frame.
const TICKS: u64 = 1000;

/// Renders all frames. `print` receives lines for the user. Invalid input is refused before the
/// first file is written.
pub fn run(options: &Options, print: &mut dyn FnMut(&str)) -> Result<(), SceneError> {
    let stage = options.scene.load(options.size)?;
    stage.scene.warnings.iter().for_each(|warning| print(&format!("warning: {warning}")));
    let chosen = backend::choose(options.backend)?;
    print(&chosen.to_string());
    let mut session = Session::new(stage, options.settings(), options.pace(), chosen)?;
    let film = options.video.as_ref().map(|path| Film::new(path, options.size, options.fps, FFMPEG.as_ref()));
    let mut film = film.transpose()?;
    let mut output = options.folder().map(Output::new).transpose()?;
    if let Some(output) = &output {
        let removed = output.remove_later_frames(options.frames)?;
        if removed > 0 {
            let folder = output.folder().display();
            print(&format!("removed {removed} picture(s) of later frames of an earlier run from {folder}"));
        }
    }

    let bar = progress("", u64::from(options.frames) * TICKS);
    let mut sum = Sum::default();
    for number in 0..options.frames {
        bar.set_message(format!("frame {number}"));
        let base = u64::from(number) * TICKS;
        let Frame { image, mut stats, .. } =
            session.frame(&|share| bar.set_position(base + (share * TICKS as f64) as u64))?;
        let mut laps = Laps::start();
        let filtered = (!options.keep_noise).then(|| session.denoise(&image));
        stats.times.denoising = laps.lap();
        let bytes = tone_map(filtered.as_ref().unwrap_or(&image), session.scene().exposure);
        stats.times.tone_mapping = laps.lap();
        if let Some(output) = &output {
            output.write_pictures(number, &image, &bytes)?;
        }
        if let Some(film) = &mut film {
            film.add(&bytes)?;
        }
        stats.times.writing = laps.lap();
        if let Some(output) = &mut output {
            output.write_row(&stats)?;
        }
        sum.add(&stats);
    }
    film.map_or(Ok(()), Film::finish)?;
    if let Some(path) = &options.dump {
        write_file(path, |file| session.world().write_dump(file).map(drop))?;
    }
    bar.finish_and_clear();
    sum.print(options, print);
    Ok(())
}

/// What the summary tells of all frames.
#[derive(Default)]
struct Sum {
    lights: usize,
    effects: Effects,
    rays: ShadowRays,
    times: StageTimes,
}

impl Sum {
    fn add(&mut self, stats: &FrameStats) {
        self.lights = stats.lights;
        self.effects |= stats.effects;
        self.rays = self.rays + stats.shadow_rays;
        self.times = self.times + stats.times;
    }

    fn print(&self, options: &Options, print: &mut dyn FnMut(&str)) {
        let (width, height) = options.size;
        let places: Vec<String> = [("pictures", options.folder()), ("film", options.video.as_deref())]
            .iter()
            .filter_map(|(what, path)| Some(format!("{what} in {}", path.as_ref()?.display())))
            .collect();
        let per_frame = |time: Duration| time.as_secs_f64() / f64::from(options.frames);
        print(&format!(
            "{} frame(s) of {width}x{height} pixels, {} samples per pixel, {} lights: {:.2} s per frame; {}",
            options.frames,
            options.spp,
            self.lights,
            per_frame(self.times.total()),
            places.join(", "),
        ));
        let stages = self.times.named().map(|(name, time)| format!("{name} {:.1}", per_frame(time) * 1e3));
        print(&format!("milliseconds per frame: {}", stages.join(", ")));
        print(&format!(
            "effects: {}; shadow rays: {} traced, {} skipped because nothing could block them",
            effect_names(self.effects),
            self.rays.traced,
            self.rays.skipped,
        ));
    }
}
