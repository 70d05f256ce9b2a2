//! Output files: EXR pictures of radiance, PNG pictures for a screen, and a table of the costs of
//! each frame.
//!
//! Each file is written under a temporary name in the same folder and then renamed, so that it is
//! complete if it exists.

use super::render::image::Image;
use super::scene::SceneError;
use super::session::{Frame, FrameStats};
use super::tone_mapping::tone_map;
use exr::prelude::{Encoding, Image as ExrImage, SpecificChannels, WritableImage};
use girandole::Effects;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The column names of the table.
pub const CSV_HEADER: [&str; 20] = [
    "frame",
    "instances",
    "lights",
    "moved_instances",
    "refit_trees",
    "rebuilt_trees",
    "background_trees",
    "waiting_trees",
    "longest_wait",
    "budget_us",
    "predicted_us",
    "spent_us",
    "deciding_us",
    "overrun_us",
    "upload_bytes",
    "top_build_us",
    "effects",
    "shadow_rays",
    "shadow_rays_skipped",
    "frame_ms",
];

/// The folder of a run.
pub struct Output {
    folder: PathBuf,
    table: csv::Writer<File>,
}

impl Output {
    /// Creates the folder if it does not exist. Fails if it cannot be written to.
    pub fn new(folder: &Path) -> Result<Self, SceneError> {
        let refuse = |e: std::io::Error| SceneError(format!("cannot write to {}: {e}", folder.display()));
        fs::create_dir_all(folder).map_err(refuse)?;
        let table = File::create(folder.join(temporary("frames.csv"))).map_err(refuse)?;
        let mut table = csv::Writer::from_writer(table);
        table.write_record(CSV_HEADER).map_err(|e| refuse(e.into()))?;
        Ok(Self { folder: folder.into(), table })
    }

    /// Writes the radiance of a frame, a picture of it for the screen, and its line of the table.
    pub fn write(&mut self, frame: &Frame, picture: &Image, exposure: f32) -> Result<(), SceneError> {
        let number = frame.stats.frame;
        self.write_file(&format!("frame_{number:04}.exr"), |file| write_exr(file, &frame.image))?;
        self.write_file(&format!("frame_{number:04}.png"), |file| write_png(file, picture, exposure))?;
        self.table
            .write_record(row(&frame.stats))
            .and_then(|()| Ok(self.table.flush()?))
            .map_err(|e| SceneError(format!("cannot write {}: {e}", self.folder.join("frames.csv").display())))
    }

    /// Completes the table. An output that is dropped without this call leaves no table.
    pub fn finish(self) -> Result<(), SceneError> {
        let (from, to) = (self.folder.join(temporary("frames.csv")), self.folder.join("frames.csv"));
        fs::rename(&from, &to).map_err(|e| SceneError(format!("cannot write {}: {e}", to.display())))
    }

    /// Writes a file under a temporary name and renames it.
    fn write_file<E: std::fmt::Display>(
        &self,
        name: &str,
        write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
    ) -> Result<(), SceneError> {
        let (from, to) = (self.folder.join(temporary(name)), self.folder.join(name));
        let result = File::create(&from).map_err(|e| e.to_string()).and_then(|file| {
            let mut file = BufWriter::new(file);
            write(&mut file).map_err(|e| e.to_string())?;
            file.flush().map_err(|e| e.to_string())?;
            fs::rename(&from, &to).map_err(|e| e.to_string())
        });
        result.map_err(|e| {
            // An incomplete file is useless. If it cannot be removed, the first error is reported
            // anyway.
            let _ = fs::remove_file(&from);
            SceneError(format!("cannot write {}: {e}", to.display()))
        })
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        // After `finish` there is no such file.
        let _ = fs::remove_file(self.folder.join(temporary("frames.csv")));
    }
}

/// The names of effects in lower case, separated by spaces; `none` if there are none.
pub fn effect_names(effects: Effects) -> String {
    let names: Vec<_> = effects.iter_names().map(|(name, _)| name.to_lowercase().replace('_', "-")).collect();
    if names.is_empty() { "none".into() } else { names.join(" ") }
}

fn temporary(name: &str) -> String {
    format!(".{name}.part")
}

/// A line of the table.
fn row(stats: &FrameStats) -> [String; 20] {
    let micros = |d: Duration| format!("{:.1}", d.as_secs_f64() * 1e6);
    [
        stats.frame.to_string(),
        stats.instances.to_string(),
        stats.lights.to_string(),
        stats.moved_instances.to_string(),
        stats.refit_trees.to_string(),
        stats.rebuilt_trees.to_string(),
        stats.background_trees.to_string(),
        stats.waiting_trees.to_string(),
        stats.longest_wait.to_string(),
        micros(stats.budget),
        micros(stats.predicted),
        micros(stats.spent),
        micros(stats.deciding),
        micros(stats.overrun),
        stats.upload_bytes.to_string(),
        stats.times.top_build.map(micros).unwrap_or_default(),
        effect_names(stats.effects),
        stats.shadow_rays.traced.to_string(),
        stats.shadow_rays.skipped.to_string(),
        format!("{:.2}", stats.times.total().as_secs_f64() * 1e3),
    ]
}

fn write_exr(file: &mut BufWriter<File>, image: &Image) -> Result<(), exr::error::Error> {
    let channels = SpecificChannels::rgb(|place: exr::math::Vec2<usize>| {
        let pixel = image.pixels[place.y() * image.width as usize + place.x()];
        (pixel.x, pixel.y, pixel.z)
    });
    let size = (image.width as usize, image.height as usize);
    let mut exr = ExrImage::from_channels(size, channels);
    exr.layer_data.encoding = Encoding::FAST_LOSSLESS;
    // A buffered file can seek, which the writer needs.
    exr.write().non_parallel().to_buffered(file)
}

fn write_png(file: &mut BufWriter<File>, image: &Image, exposure: f32) -> Result<(), png::EncodingError> {
    let mut encoder = png::Encoder::new(file, image.width, image.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&tone_map(image, exposure))?;
    writer.finish()
}
