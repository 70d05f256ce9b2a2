//! Files that are complete if they exist: each is written under a temporary name in the same folder
//! and then renamed.

use exr::prelude::{Encoding, Image as ExrImage, SpecificChannels, WritableImage};
use std::ffi::OsString;
use std::fmt::Display;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use testbed::render::image::Image;
use testbed::scene::SceneError;

/// Writes a file with a buffer. If that fails, the error is one line with the file's name, and no
/// part of the file remains.
pub fn write_file<E: Display>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), SceneError> {
    let draft = temporary(path);
    let result = File::create(&draft).map_err(|e| e.to_string()).and_then(|file| {
        let mut file = BufWriter::new(file);
        write(&mut file).map_err(|e| e.to_string())?;
        file.flush().map_err(|e| e.to_string())?;
        fs::rename(&draft, path).map_err(|e| e.to_string())
    });
    result.map_err(|e| {
        // If the draft cannot be removed, the first error is reported anyway.
        let _ = fs::remove_file(&draft);
        cannot_write(path, e)
    })
}

/// The error of a file that cannot be written.
pub fn cannot_write(path: &Path, reason: impl Display) -> SceneError {
    SceneError(format!("cannot write {}: {reason}", path.display()))
}

/// How the names of files begin that are not complete.
pub const DRAFT: &str = ".part-";

/// The path of a file until it is complete: the same folder and extension, with [`DRAFT`] before the
/// name.
pub fn temporary(path: &Path) -> PathBuf {
    let mut name = OsString::from(DRAFT);
    name.push(path.file_name().unwrap_or_default());
    path.with_file_name(name)
}

/// Writes the radiance of a picture as EXR with three channels of 32 bits.
pub fn write_exr(file: &mut BufWriter<File>, image: &Image) -> Result<(), exr::error::Error> {
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

/// Writes a picture for an sRGB screen as PNG: three bytes per pixel, row by row from the top.
pub fn write_png(
    file: &mut BufWriter<File>,
    (width, height): (u32, u32),
    bytes: &[u8],
) -> Result<(), png::EncodingError> {
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    writer.finish()
}
