//! Files: EXR with radiance, PNG for the eye, and a table of what each frame cost.
//!
//! Each file is written beside its place under a temporary name and then renamed, so that a file that is there is whole.

use super::frames::{Frame, Record};
use super::render::image::Image;
use super::scene::SceneError;
use super::tone::tone_map;
use exr::prelude::{Encoding, Image as ExrImage, SpecificChannels, WritableImage};
use girandole::Effects;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The table's first line.
pub const CSV_HEADER: [&str; 21] = [
    "frame",
    "instances",
    "lights",
    "moved_instances",
    "refit_trees",
    "rebuilt_trees",
    "rebuilt_parts",
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

/// A folder that frames go to.
pub struct Output {
    folder: PathBuf,
    table: csv::Writer<File>,
}

impl Output {
    /// Makes the folder if need be, and refuses one that cannot be written to.
    pub fn new(folder: &Path) -> Result<Self, SceneError> {
        let refuse = |e: std::io::Error| SceneError(format!("cannot write to {}: {e}", folder.display()));
        fs::create_dir_all(folder).map_err(refuse)?;
        let table = File::create(folder.join(temporary("frames.csv"))).map_err(refuse)?;
        let mut table = csv::Writer::from_writer(table);
        table.write_record(CSV_HEADER).map_err(|e| refuse(e.into()))?;
        Ok(Self { folder: folder.into(), table })
    }

    /// Writes a frame's radiance, its picture for the eye, and its line in the table.
    pub fn write(&mut self, frame: &Frame, picture: &Image, exposure: f32) -> Result<(), SceneError> {
        let number = frame.record.frame;
        self.whole_file(&format!("frame_{number:04}.exr"), |file| write_exr(file, &frame.image))?;
        self.whole_file(&format!("frame_{number:04}.png"), |file| write_png(file, picture, exposure))?;
        self.table
            .write_record(row(&frame.record))
            .and_then(|()| Ok(self.table.flush()?))
            .map_err(|e| SceneError(format!("cannot write {}: {e}", self.folder.join("frames.csv").display())))
    }

    /// Gives the table its name. Dropping an output instead leaves no table.
    pub fn finish(self) -> Result<(), SceneError> {
        let (from, to) = (self.folder.join(temporary("frames.csv")), self.folder.join("frames.csv"));
        fs::rename(&from, &to).map_err(|e| SceneError(format!("cannot write {}: {e}", to.display())))
    }

    fn whole_file<E: std::fmt::Display>(
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
            // What could be written of it is of no use; that it cannot be removed either is not worth a second message.
            let _ = fs::remove_file(&from);
            SceneError(format!("cannot write {}: {e}", to.display()))
        })
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        // Gone already after `finish`.
        let _ = fs::remove_file(self.folder.join(temporary("frames.csv")));
    }
}

/// The names of effects in lower case, with spaces between; `none` for none.
pub fn effect_names(effects: Effects) -> String {
    let names: Vec<_> = effects.iter_names().map(|(name, _)| name.to_lowercase().replace('_', "-")).collect();
    if names.is_empty() { "none".into() } else { names.join(" ") }
}

fn temporary(name: &str) -> String {
    format!(".{name}.part")
}

fn row(record: &Record) -> [String; 21] {
    let micros = |d: Duration| format!("{:.1}", d.as_secs_f64() * 1e6);
    [
        record.frame.to_string(),
        record.instances.to_string(),
        record.lights.to_string(),
        record.moved_instances.to_string(),
        record.refit_trees.to_string(),
        record.rebuilt_trees.to_string(),
        record.rebuilt_parts.to_string(),
        record.background_trees.to_string(),
        record.waiting_trees.to_string(),
        record.longest_wait.to_string(),
        micros(record.budget),
        micros(record.predicted),
        micros(record.spent),
        micros(record.deciding),
        micros(record.overrun),
        record.upload_bytes.to_string(),
        record.top_build.map(micros).unwrap_or_default(),
        effect_names(record.effects),
        record.shadow_rays.traced.to_string(),
        record.shadow_rays.skipped.to_string(),
        format!("{:.2}", record.frame_time.as_secs_f64() * 1e3),
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
    // The writer wants to seek, which a buffered file does by emptying its buffer.
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
