//! A best-fit suballocator of ranges of a buffer.
//!
//! A range comes from the shortest gap that is long enough, the first one of several. All calls
//! take O(log gaps), so frames hardly take longer as a pool gets more gaps; a copy takes O(1).

use std::ops::Range;

use rpds::{RedBlackTreeMapSync, RedBlackTreeSetSync};

/// The ranges of one buffer, in records.
#[derive(Clone, Debug)]
pub(super) struct Ranges {
    /// The length of the buffer.
    end: u64,
    /// The ends of the gaps by their starts. No two gaps touch.
    gaps: RedBlackTreeMapSync<u64, u64>,
    /// The lengths and starts of the same gaps.
    by_length: RedBlackTreeSetSync<(u64, u64)>,
}

impl Ranges {
    /// One gap from 0 to `end`.
    pub fn new(end: u64) -> Self {
        let mut ranges = Self { end: 0, gaps: Default::default(), by_length: Default::default() };
        ranges.grow_to(end);
        ranges
    }

    /// The length of the buffer.
    pub fn end(&self) -> u64 {
        self.end
    }

    /// The end of the last range in use; 0 without any.
    pub fn used(&self) -> u64 {
        match self.gaps.last() {
            Some((start, end)) if *end == self.end => *start,
            _ => self.end,
        }
    }

    /// Makes the buffer longer.
    pub fn grow_to(&mut self, end: u64) {
        assert!(end >= self.end, "{end} is before {}", self.end);
        let former = std::mem::replace(&mut self.end, end);
        self.free(former..end);
    }

    /// Makes the buffer shorter. All ranges in use must end before `end`.
    pub fn cut_to(&mut self, end: u64) {
        assert!(self.used() <= end && end <= self.end, "{end} is not within {}..={}", self.used(), self.end);
        if end < self.end {
            let start = self.used();
            self.remove_gap(start);
            self.add_gap(start..end);
            self.end = end;
        }
    }

    /// Takes `length` records, more than 0, out of a gap; `None` if no gap is long enough.
    pub fn take(&mut self, length: u64) -> Option<Range<u64>> {
        let (_, start) = *self.by_length.range((length, 0)..).next()?;
        let end = self.remove_gap(start);
        self.add_gap(start + length..end);
        Some(start..start + length)
    }

    /// Frees a range, which must be in use, and joins the gap with the gaps beside it.
    pub fn free(&mut self, range: Range<u64>) {
        let Range { mut start, mut end } = range;
        if start == end {
            return;
        }
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
        self.add_gap(start..end);
    }

    fn add_gap(&mut self, gap: Range<u64>) {
        if !gap.is_empty() {
            self.by_length.insert_mut((gap.end - gap.start, gap.start));
            self.gaps.insert_mut(gap.start, gap.end);
        }
    }

    /// Removes the gap that begins at `start`. Returns its end.
    fn remove_gap(&mut self, start: u64) -> u64 {
        let end = *self.gaps.get(&start).expect("a gap begins there");
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
        fn gaps(&self) -> Vec<Range<usize>> {
            let mut gaps: Vec<Range<usize>> = Vec::new();
            for place in (0..self.is_used.len()).filter(|place| !self.is_used[*place]) {
                match gaps.last_mut() {
                    Some(gap) if gap.end == place => gap.end += 1,
                    _ => gaps.push(place..place + 1),
                }
            }
            gaps
        }

        fn take(&mut self, length: usize) -> Option<Range<u64>> {
            let fitting = self.gaps().into_iter().filter(|gap| gap.len() >= length);
            let start = fitting.min_by_key(|gap| (gap.len(), gap.start))?.start;
            self.is_used[start..start + length].fill(true);
            Some(start as u64..(start + length) as u64)
        }
    }

    #[test]
    fn ranges_come_from_the_shortest_gap_that_is_long_enough_as_in_a_plain_model() {
        let (mut ranges, mut model) = (Ranges::new(64), Model { is_used: vec![false; 64] });
        let mut taken: Vec<Range<u64>> = Vec::new();
        let (mut refusals, mut cuts) = (0, 0);
        for i in 0..20_000 {
            let [kind, size, which] = [0, 1, 2].map(|j| hash(3 * i + j) as usize);
            match kind % 16 {
                0..8 => {
                    let range = ranges.take(size as u64 % 24 + 1);
                    assert_eq!(range, model.take(size % 24 + 1));
                    refusals += usize::from(range.is_none());
                    taken.extend(range);
                }
                8..15 if !taken.is_empty() => {
                    let range = taken.swap_remove(which % taken.len());
                    model.is_used[range.start as usize..range.end as usize].fill(false);
                    ranges.free(range);
                }
                15 => {
                    let end = (ranges.used() as usize + size % 200).min(1000);
                    if end as u64 >= ranges.end() {
                        ranges.grow_to(end as u64)
                    } else {
                        ranges.cut_to(end as u64)
                    }
                    cuts += 1;
                    model.is_used.resize(end, false);
                }
                _ => {}
            }
            let used = model.is_used.iter().rposition(|is_used| *is_used).map_or(0, |last| last + 1);
            assert_eq!((ranges.used(), ranges.end()), (used as u64, model.is_used.len() as u64));
        }
        assert!(refusals > 100 && cuts > 100, "{refusals} refusals, {cuts} cuts");
        taken.drain(..).for_each(|range| ranges.free(range));
        assert_eq!(ranges.used(), 0);
        let end = ranges.end();
        assert_eq!(ranges.take(end), Some(0..end), "all gaps are joined");
    }

    #[test]
    #[should_panic(expected = "is free already")]
    fn a_range_is_freed_once() {
        let mut ranges = Ranges::new(9);
        let range = ranges.take(3).expect("room");
        ranges.free(range.clone());
        ranges.free(range);
    }
}
