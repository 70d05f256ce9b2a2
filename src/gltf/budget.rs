//! The memory that a call may still take.

use super::error::GltfError;

/// What is left of [`GltfOptions::max_bytes`](super::GltfOptions::max_bytes).
#[derive(Debug)]
pub(super) struct Budget {
    limit: u64,
    taken: u64,
}

impl Budget {
    pub fn new(limit: u64) -> Self {
        Self { limit, taken: 0 }
    }

    /// Takes a number of bytes, before they are allocated.
    pub fn take(&mut self, bytes: u64) -> Result<(), GltfError> {
        self.taken = self.taken.saturating_add(bytes);
        if self.taken <= self.limit {
            return Ok(());
        }
        Err(GltfError::TooManyBytes { needed: self.taken, limit: self.limit })
    }
}
