//! `--video`: all frames in one file.
//!
//! Read in this order:
//!
//! 1. `y4m`: YUV4MPEG2, a format without compression;
//! 2. `film`: the file, which this program writes itself or through ffmpeg.

use super::files;

pub mod y4m;
pub mod film;
