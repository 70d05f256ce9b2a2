//! The folder of a run: EXR pictures of radiance, PNG pictures for a screen, and a table of the
//! costs of each frame.
//!
//! Pictures are complete if they exist. The table has its final name from the start, and a row is in
//! the file as soon as its frame is done: an interrupted run leaves a table of the finished frames.

use super::files::{DRAFT, cannot_write, write_exr, write_file, write_png};
use super::session::FrameStats;
use girandole::Effects;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;
use testbed::render::image::Image;
use testbed::scene::SceneError;

/// The column names of the table. `frame_ms` is the sum of the times of all stages: the columns from
/// `animation_us` to `writing_us`. The columns from `budget_us` to `overrun_us` are parts of
/// `light_update_us`.
pub const CSV_HEADER: [&str; 28] = [
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
    "effects",
    "shadow_rays",
    "shadow_rays_skipped",
    "animation_us",
    "light_update_us",
    "geometry_us",
    "upload_us",
    "top_build_us",
    "rendering_us",
    "denoising_us",
    "tone_mapping_us",
    "writing_us",
    "frame_ms",
];

/// The folder of a run.
pub struct Output {
    folder: PathBuf,
    table: csv::Writer<File>,
}

impl Output {
    /// Creates the folder if it does not exist, and starts a new table. Fails if the folder cannot be
    /// written to.
    pub fn new(folder: &Path) -> Result<Self, SceneError> {
        let refuse = |e: io::Error| SceneError(format!("cannot write to {}: {e}", folder.display()));
        fs::create_dir_all(folder).map_err(refuse)?;
        let table = File::create(folder.join("frames.csv")).map_err(refuse)?;
        let mut output = Self { folder: folder.into(), table: csv::Writer::from_writer(table) };
        output.add(CSV_HEADER.map(String::from))?;
        Ok(output)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Removes the pictures that an earlier run has left in the folder and that this run does not
    /// replace: all files with the names of frames from number `count` on, and those that it did not
    /// complete. Returns the number of complete ones.
    pub fn remove_later_frames(&self, count: u32) -> Result<usize, SceneError> {
        let mut removed = 0;
        for entry in fs::read_dir(&self.folder).map_err(|e| cannot_write(&self.folder, e))? {
            let entry = entry.map_err(|e| cannot_write(&self.folder, e))?;
            let name = entry.file_name();
            let name = name.to_str().unwrap_or_default();
            let is_later = frame_number(name).is_some_and(|number| number >= count);
            let is_draft = name.strip_prefix(DRAFT).is_some_and(|name| frame_number(name).is_some());
            if (is_later || is_draft) && entry.file_type().is_ok_and(|kind| kind.is_file()) {
                fs::remove_file(entry.path()).map_err(|e| cannot_write(&entry.path(), e))?;
                removed += usize::from(is_later);
            }
        }
        Ok(removed)
    }

    /// Writes the radiance of a frame and a picture of it for the screen, `bytes` in sRGB.
    pub fn write_pictures(&self, number: u32, image: &Image, bytes: &[u8]) -> Result<(), SceneError> {
        let path = |extension| self.folder.join(format!("frame_{number:04}.{extension}"));
        write_file(&path("exr"), |file| write_exr(file, image))?;
        write_file(&path("png"), |file| write_png(file, (image.width, image.height), bytes))
    }

    /// Adds the line of a finished frame to the table. It is in the file when this returns.
    pub fn write_row(&mut self, stats: &FrameStats) -> Result<(), SceneError> {
        self.add(row(stats))
    }

    fn add(&mut self, fields: [String; CSV_HEADER.len()]) -> Result<(), SceneError> {
        // A row is shorter than the writer's buffer, so that one write puts it into the file.
        let written = self.table.write_record(fields).and_then(|()| Ok(self.table.flush()?));
        written.map_err(|e| cannot_write(&self.folder.join("frames.csv"), e))
    }
}

/// The number in the name of a frame's picture, as [`Output::write_pictures`] writes it.
fn frame_number(name: &str) -> Option<u32> {
    let digits = name.strip_prefix("frame_")?;
    let digits = digits.strip_suffix(".png").or_else(|| digits.strip_suffix(".exr"))?;
    let number = digits.parse().ok()?;
    (digits == format!("{number:04}")).then_some(number)
}

/// The names of effects in lower case, separated by spaces; `none` if there are none.
pub fn effect_names(effects: Effects) -> String {
    let names: Vec<_> = effects.names().map(|name| name.to_lowercase().replace('_', "-")).collect();
    if names.is_empty() { "none".into() } else { names.join(" ") }
}

/// A line of the table.
fn row(stats: &FrameStats) -> [String; CSV_HEADER.len()] {
    let micros = |d: Duration| format!("{:.1}", d.as_secs_f64() * 1e6);
    let times = &stats.times;
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
        effect_names(stats.effects),
        stats.shadow_rays.traced.to_string(),
        stats.shadow_rays.skipped.to_string(),
        micros(times.animation),
        micros(times.light_update),
        micros(times.geometry),
        micros(times.upload),
        micros(times.top_build),
        micros(times.rendering),
        micros(times.denoising),
        micros(times.tone_mapping),
        micros(times.writing),
        format!("{:.2}", times.total().as_secs_f64() * 1e3),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_names_of_frames_are_recognised() {
        for (name, number) in [
            ("frame_0007.png", Some(7)),
            ("frame_0000.exr", Some(0)),
            ("frame_12345.png", Some(12345)),
            ("frame_7.png", None),
            ("frame_00007.png", None),
            ("frame_0007.jpg", None),
            ("frame_+007.png", None),
            ("my_frame_0007.png", None),
            ("frame_0007.png.bak", None),
            ("frame_.png", None),
        ] {
            assert_eq!(frame_number(name), number, "{name}");
        }
    }
}
