//! Files that are read as a stream, compressed with gzip or not.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

use super::SceneError;

/// Bytes that a file is read by at a time.
const CHUNK: usize = 1 << 16;
/// The first bytes of a file that gzip has compressed.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// The content of a file, without compression.
pub type Source = Box<dyn BufRead + Send>;

/// Opens a file. Its content decides whether it is compressed, not its name.
pub fn open(path: &Path) -> Result<Source, SceneError> {
    let fail = |error: std::io::Error| SceneError(format!("{}: {error}", path.display()));
    let mut file = BufReader::with_capacity(CHUNK, File::open(path).map_err(fail)?);
    let is_compressed = file.fill_buf().map_err(fail)?.starts_with(&GZIP);
    Ok(if is_compressed {
        Box::new(BufReader::with_capacity(CHUNK, MultiGzDecoder::new(file)))
    } else {
        Box::new(file)
    })
}
