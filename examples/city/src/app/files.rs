//! Files that are complete if they exist: each is written under a temporary name in the same folder
//! and then renamed.

use exr::prelude::{Encoding, Image as ExrImage, SpecificChannels, WritableImage};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fmt::Display;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use testbed::render::image::Image;
use testbed::scene::SceneError;

/// Writes a file with a buffer. If that fails, the error is one line with the file's name, and no
/// part of the file remains.
pub fn write_file<E: Display>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), SceneError> {
    let write = || -> Result<(), String> {
        let (draft, file) = Draft::create(path).map_err(|e| e.to_string())?;
        let mut file = BufWriter::new(file);
        write(&mut file).map_err(|e| e.to_string())?;
        file.flush().map_err(|e| e.to_string())?;
        draft.complete().map_err(|e| e.to_string())
    };
    write().map_err(|e| cannot_write(path, e))
}

/// The temporary names of all files that are not complete.
static DRAFTS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// A file with a temporary name. If it is dropped before [`Draft::complete`], no part of it remains.
pub struct Draft {
    path: PathBuf,
    draft: PathBuf,
}

impl Draft {
    /// Creates the file. `path` is its name when it is complete.
    pub fn create(path: &Path) -> io::Result<(Self, File)> {
        let draft = temporary(path);
        // An interrupt waits until the file is known.
        let mut drafts = DRAFTS.lock().unwrap_or_else(PoisonError::into_inner);
        let file = File::create(&draft)?;
        drafts.insert(draft.clone());
        Ok((Self { path: path.into(), draft }, file))
    }

    /// Gives the file its name.
    pub fn complete(self) -> io::Result<()> {
        fs::rename(&self.draft, &self.path)
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        // A complete file has another name. If a draft cannot be removed, the first error is reported anyway.
        let _ = fs::remove_file(&self.draft);
        DRAFTS.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.draft);
    }
}

/// The exit code after Ctrl-C, as shells report it for the signal SIGINT.
const INTERRUPTED: i32 = 130;

/// From now on, Ctrl-C removes what is not complete before it ends the program.
#[allow(clippy::exit, reason = "the program ends")]
pub fn clean_up_on_interrupt() -> Result<(), SceneError> {
    let handled = ctrlc::set_handler(|| {
        // The lock is held to the end, so that no other draft is created.
        let drafts = DRAFTS.lock().unwrap_or_else(PoisonError::into_inner);
        drafts.iter().for_each(|draft| drop(fs::remove_file(draft)));
        std::process::exit(INTERRUPTED)
    });
    handled.map_err(|e| SceneError(format!("cannot handle Ctrl-C: {e}")))
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
