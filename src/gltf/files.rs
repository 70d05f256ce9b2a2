//! Reads files within a budget of memory.

use std::fmt::Display;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

use super::budget::Budget;
use super::error::GltfError;

/// The length of a regular file. Others may have no end, or wait for a writer when they are opened.
pub(super) fn file_length(path: &Path) -> Result<u64, GltfError> {
    let metadata = fs::metadata(path).map_err(|error| read_error(path, &error))?;
    if metadata.is_file() { Ok(metadata.len()) } else { Err(read_error(path, &"it is not a regular file")) }
}

/// The first `length` bytes of a file, or all if there are fewer.
pub(super) fn read(path: &Path, length: u64, budget: &mut Budget) -> Result<Vec<u8>, GltfError> {
    budget.take(length)?;
    let mut bytes = Vec::new();
    let reserved = usize::try_from(length).is_ok_and(|length| bytes.try_reserve_exact(length).is_ok());
    if !reserved {
        return Err(read_error(path, &"there is not enough memory"));
    }
    let file = File::open(path).map_err(|error| read_error(path, &error))?;
    file.take(length).read_to_end(&mut bytes).map_err(|error| read_error(path, &error))?;
    Ok(bytes)
}

fn read_error(path: &Path, what: &dyn Display) -> GltfError {
    GltfError::Read { path: path.to_owned(), message: what.to_string() }
}
