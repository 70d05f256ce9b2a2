//! Saves the picture that is shown.

use super::scene::SceneError;
use super::viewer::Shown;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::Path;

/// Writes the picture as a PNG file, and creates its folder if it does not exist.
pub fn save_picture(path: &Path, shown: &Shown) -> Result<(), SceneError> {
    let refuse = |error: &dyn std::fmt::Display| SceneError(format!("cannot write {}: {error}", path.display()));
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|error| refuse(&error))?;
    }
    let file = File::create(path).map_err(|error| refuse(&error))?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), shown.width, shown.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(&shown.pixels)?;
        writer.finish()
    });
    written.map_err(|error| refuse(&error))
}
