//! A best-fit suballocator of ranges of a buffer.
//!
//! A range comes from the shortest gap that is long enough, the first one of several, and follows the last range in use
//! where no gap is. All calls take O(log gaps), so frames hardly take longer as a pool gets more gaps; a copy takes
//! O(1).

use std::ops::Range;

use rpds::{RedBlackTreeMapSync, RedBlackTreeSetSync};

/// The ranges of one buffer that are in use, in records.
#[derive(Clone, Debug, Default)]
pub(super) struct Ranges {
    /// The end of the last range.
    end: u64,
    /// The ends of the gaps between ranges by their starts. No two gaps touch.
    gaps: RedBlackTreeMapSync<u64, u64>,
    /// The lengths and starts of the same gaps.
    by_length: RedBlackTreeSetSync<(u64, u64)>,
    /// The lengths of all gaps together.
    free: u64,
}

impl Ranges {
    /// The end of the last range in use; 0 without any.
    pub fn end(&self) -> u64 {
        self.end
    }

    /// The records in use.
    pub fn taken(&self) -> u64 {
        self.end - self.free
    }

    /// Takes `length` records, more than 0, of which none lies beyond `limit`; `None` if there is no room.
    pub fn take(&mut self, length: u64, limit: u64) -> Option<Range<u64>> {
        let start = match self.gap_for(length) {
            Some(start) => {
                let end = self.remove_gap(start);
                self.add_gap(start + length..end);
                start
            }
            None if self.end + length > limit => return None,
            None => {
                self.end += length;
                self.end - length
            }
        };
        Some(start..start + length)
    }

    /// Where the gap begins from which [`Ranges::take`] would take so many records.
    pub fn gap_for(&self, length: u64) -> Option<u64> {
        self.by_length.range((length, 0)..).next().map(|(_, start)| *start)
    }

    /// Frees a range, which must be in use, and joins the gap with the gaps beside it.
    pub fn free(&mut self, range: Range<u64>) {
        let Range { mut start, mut end } = range;
        if start == end {
            return;
        }
        assert!(end <= self.end, "{start}..{end} is free already");
        if let Some((before, at)) = self.gaps.range(..end).next_back().map(|(before, at)| (*before, *at)) {
            assert!(at <= start, "{start}..{end} is free already");
            if at == start {
                self.remove_gap(before);
                start = before;
            }
        }
        if self.gaps.contains_key(&end) {
            end = self.remove_gap(end);
        }
        if end == self.end {
            self.end = start;
        } else {
            self.add_gap(start..end);
        }
    }

    fn add_gap(&mut self, gap: Range<u64>) {
        if !gap.is_empty() {
            self.free += gap.end - gap.start;
            self.by_length.insert_mut((gap.end - gap.start, gap.start));
            self.gaps.insert_mut(gap.start, gap.end);
        }
    }

    /// Removes the gap that begins at `start`. Returns its end.
    fn remove_gap(&mut self, start: u64) -> u64 {
        let end = *self.gaps.get(&start).expect("a gap begins there");
        self.free -= end - start;
        self.gaps.remove_mut(&start);
        self.by_length.remove_mut(&(end - start, start));
        end
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::dice::hash;

    /// The same, one record after the other.
    #[derive(Default)]
    struct Model {
        is_used: Vec<bool>,
    }

    impl Model {
        fn end(&self) -> usize {
            self.is_used.iter().rposition(|is_used| *is_used).map_or(0, |last| last + 1)
        }

        fn take(&mut self, length: usize, limit: usize) -> Option<Range<u64>> {
            self.is_used.truncate(self.end());
            let mut gaps: Vec<Range<usize>> = Vec::new();
            for place in (0..self.is_used.len()).filter(|place| !self.is_used[*place]) {
                match gaps.last_mut() {
                    Some(gap) if gap.end == place => gap.end += 1,
                    _ => gaps.push(place..place + 1),
                }
            }
            let fitting = gaps.into_iter().filter(|gap| gap.len() >= length);
            let start = fitting.min_by_key(|gap| (gap.len(), gap.start)).map_or(self.end(), |gap| gap.start);
            if start + length > limit {
                return None;
            }
            self.is_used.resize(self.is_used.len().max(start + length), false);
            self.is_used[start..start + length].fill(true);
            Some(start as u64..(start + length) as u64)
        }
    }

    #[test]
    fn ranges_come_from_the_shortest_gap_that_is_long_enough_as_in_a_plain_model() {
        let (mut ranges, mut model) = (Ranges::default(), Model::default());
        let mut taken: Vec<Range<u64>> = Vec::new();
        let mut refusals = 0;
        for i in 0..20_000 {
            let [kind, size, which] = [0, 1, 2].map(|j| hash(3 * i + j) as usize);
            if kind % 2 == 0 {
                let (length, limit) = (size % 24 + 1, 100 + which % 400);
                let range = ranges.take(length as u64, limit.max(model.end()) as u64);
                let end = model.end();
                assert_eq!(range, model.take(length, limit.max(end)));
                refusals += usize::from(range.is_none());
                taken.extend(range);
            } else if !taken.is_empty() {
                let range = taken.swap_remove(which % taken.len());
                model.is_used[range.start as usize..range.end as usize].fill(false);
                ranges.free(range);
            }
            let used = model.is_used.iter().filter(|is_used| **is_used).count();
            assert_eq!((ranges.end(), ranges.taken()), (model.end() as u64, used as u64));
        }
        assert!(refusals > 100, "{refusals} refusals");
        taken.drain(..).for_each(|range| ranges.free(range));
        assert_eq!((ranges.end(), ranges.taken(), ranges.gap_for(1)), (0, 0, None));
    }

    #[test]
    #[should_panic(expected = "is free already")]
    fn a_range_is_freed_once() {
        let mut ranges = Ranges::default();
        let [range, _] = [3, 3].map(|length| ranges.take(length, 9).expect("room"));
        ranges.free(range.clone());
        ranges.free(range);
    }
}
