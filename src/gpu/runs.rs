//! Runs of neighbouring records, which are written together.

use std::ops::Range;

/// Joins ascending indices to runs. Two indices with at most `gap` others between them share a run.
pub(super) fn runs(indices: &[u32], gap: u32) -> Vec<Range<u32>> {
    let mut runs: Vec<Range<u32>> = Vec::new();
    for index in indices {
        match runs.last_mut() {
            Some(run) if index - run.end <= gap => run.end = index + 1,
            _ => runs.push(*index..index + 1),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_indices_share_a_run() {
        assert_eq!(runs(&[], 9), []);
        assert_eq!(runs(&[3], 0), [3..4]);
        assert_eq!(runs(&[0, 1, 2, 4, 7], 0), [0..3, 4..5, 7..8]);
        assert_eq!(runs(&[0, 1, 2, 4, 7], 1), [0..5, 7..8]);
        assert_eq!(runs(&[0, 1, 2, 4, 7], 2), [0..8]);
        assert_eq!(runs(&[u32::MAX - 1], 9), [u32::MAX - 1..u32::MAX]);
    }
}
