//! Files that are read as a stream, compressed with gzip or not.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

use super::SceneError;

/// Bytes that a file is read by at a time.
const CHUNK: usize = 1 << 16;
/// The first bytes of a file that gzip has compressed.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// The content of a file, without compression.
pub type Source = Box<dyn BufRead + Send>;

/// The mark that some programs put before text in UTF-8.
const BYTE_ORDER_MARK: [u8; 3] = [0xef, 0xbb, 0xbf];

/// Opens a file. Its content decides whether it is compressed, not its name. A byte order mark is skipped.
pub fn open(path: &Path) -> Result<Source, SceneError> {
    let fail = |error: std::io::Error| SceneError(format!("{}: {error}", path.display()));
    let mut file = BufReader::with_capacity(CHUNK, File::open(path).map_err(fail)?);
    let is_compressed = file.fill_buf().map_err(fail)?.starts_with(&GZIP);
    let mut source: Source = match is_compressed {
        true => Box::new(BufReader::with_capacity(CHUNK, MultiGzDecoder::new(file))),
        false => Box::new(file),
    };
    if source.fill_buf().map_err(fail)?.starts_with(&BYTE_ORDER_MARK) {
        source.consume(BYTE_ORDER_MARK.len());
    }
    Ok(source)
}

/// Reads a whole file of text in UTF-8 or UTF-16 or, if it is neither, in Latin-1.
pub fn read_text(path: &Path) -> Result<String, SceneError> {
    let mut bytes = Vec::new();
    let read = open(path)?.read_to_end(&mut bytes);
    read.map_err(|error| SceneError(format!("{}: {error}", path.display())))?;
    let utf_16 = |unit: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes[2..].chunks_exact(2).map(|pair| unit([pair[0], pair[1]])).collect();
        String::from_utf16_lossy(&units)
    };
    Ok(match bytes[..] {
        [0xff, 0xfe, ..] => utf_16(u16::from_le_bytes),
        [0xfe, 0xff, ..] => utf_16(u16::from_be_bytes),
        // Each byte of Latin-1 is a character of Unicode.
        _ => String::from_utf8(bytes)
            .unwrap_or_else(|error| error.as_bytes().iter().map(|&byte| char::from(byte)).collect()),
    })
}
