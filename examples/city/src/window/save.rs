//! Saves the picture that is shown.

use super::app::files::{cannot_write, write_file, write_png};
use super::viewer::Shown;
use std::fs;
use std::path::Path;
use testbed::scene::SceneError;

/// Writes the picture as a PNG file, and creates its folder if it does not exist.
pub fn save_picture(path: &Path, shown: &Shown) -> Result<(), SceneError> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|error| cannot_write(path, error))?;
    }
    write_file(path, |file| write_png(file, (shown.width, shown.height), &shown.pixels))
}
