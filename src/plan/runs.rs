//! Runs of neighbouring records, which are written together.

use std::ops::Range;

/// Joins ascending indices to runs. Two indices with at most `gap` others between them share a run.
pub(super) fn runs(indices: impl IntoIterator<Item = u32>, gap: u32) -> Vec<Range<u32>> {
    let mut runs: Vec<Range<u32>> = Vec::new();
    for index in indices {
        match runs.last_mut() {
            Some(run) if index - run.end <= gap => run.end = index + 1,
            _ => runs.push(index..index + 1),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First and last index of each run.
    fn ends(indices: &[u32], gap: u32) -> Vec<[u32; 2]> {
        runs(indices.iter().copied(), gap).into_iter().map(|run| [run.start, run.end - 1]).collect()
    }

    #[test]
    fn near_indices_share_a_run() {
        assert!(ends(&[], 9).is_empty());
        assert_eq!(ends(&[3], 0), [[3, 3]]);
        assert_eq!(ends(&[0, 1, 2, 4, 7], 0), [[0, 2], [4, 4], [7, 7]]);
        assert_eq!(ends(&[0, 1, 2, 4, 7], 1), [[0, 4], [7, 7]]);
        assert_eq!(ends(&[0, 1, 2, 4, 7], 2), [[0, 7]]);
        assert_eq!(ends(&[u32::MAX - 1], 9), [[u32::MAX - 1; 2]]);
    }
}
