//! Divides many items near the median along an axis.
//!
//! Radix selection finds the limit between both sides, and a partition moves the items. Both work
//! in pieces of any size, so that a build can stop within them. Their result does not depend on
//! the pieces. Quickselect needs less memory, but its time depends on the pivots.

use super::group::BuildItem;

/// Values of a digit.
const RADIX: usize = 256;
/// Bits of a digit.
const DIGIT_BITS: u32 = RADIX.ilog2();

/// The key that orders items along an axis: the mean position, then the index. All keys differ.
fn key(item: &BuildItem, axis: usize) -> u64 {
    // The order of these bits is that of `f32::total_cmp`.
    let bits = item.mean[axis].to_bits();
    let ordered = if bits >> 31 == 0 { bits | 1 << 31 } else { !bits };
    u64::from(ordered) << 32 | u64::from(item.index())
}

/// A search for the key that has a given number of smaller keys.
pub(super) struct Selection {
    axis: usize,
    /// The digits that are known of the key, the highest first.
    prefix: u64,
    /// The number of bits below these digits and the next one.
    shift: u32,
    /// The number of smaller keys that begin with these digits.
    rank: u32,
    /// How many keys with these digits have each value of the next digit.
    counts: [u32; RADIX],
}

impl Selection {
    /// Starts a search for the key with `rank` smaller keys.
    pub fn new(axis: usize, rank: usize) -> Self {
        Self { axis, prefix: 0, shift: u64::BITS - DIGIT_BITS, rank: rank as u32, counts: [0; RADIX] }
    }

    /// The axis of the keys.
    pub fn axis(&self) -> usize {
        self.axis
    }

    /// Counts the next digit of some items. Each digit needs all items once.
    pub fn count(&mut self, items: &[BuildItem]) {
        for item in items {
            let digits = key(item, self.axis) >> self.shift;
            self.counts[digits as usize % RADIX] += u32::from(digits >> DIGIT_BITS == self.prefix);
        }
    }

    /// Fixes the digit that was counted. Returns a key with the given number of smaller keys, or
    /// `None` if the next digit has to be counted.
    pub fn fix_digit(&mut self) -> Option<u64> {
        let mut digit = 0;
        while self.rank >= self.counts[digit] {
            self.rank -= self.counts[digit];
            digit += 1;
        }
        self.prefix = self.prefix << DIGIT_BITS | digit as u64;
        if self.rank == 0 {
            return Some(self.prefix << self.shift);
        }
        self.shift -= DIGIT_BITS;
        self.counts = [0; RADIX];
        None
    }
}

/// A partition of items by their keys.
pub(super) struct KeyPartition {
    axis: usize,
    /// Items with smaller keys belong to the left side.
    limit: u64,
    /// The items before this one belong to the left side.
    front: usize,
    /// The items from this one on belong to the right side.
    back: usize,
}

impl KeyPartition {
    pub fn new(axis: usize, limit: u64, count: usize) -> Self {
        Self { axis, limit, front: 0, back: count }
    }

    /// Classifies about `max_items` more items and moves them to their side. Returns whether all
    /// items are on their side.
    pub fn advance(&mut self, items: &mut [BuildItem], max_items: usize) -> bool {
        for _ in 0..max_items {
            if self.front >= self.back {
                break;
            }
            if key(&items[self.front], self.axis) < self.limit {
                self.front += 1;
            } else if key(&items[self.back - 1], self.axis) >= self.limit {
                self.back -= 1;
            } else {
                items.swap(self.front, self.back - 1);
                self.front += 1;
                self.back -= 1;
            }
        }
        self.front >= self.back
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::cluster::Cluster;
    use crate::tree::testing::Rng;

    /// Moves the `left` items with the smallest keys to the front.
    pub(super) fn divide(items: &mut [BuildItem], axis: usize, left: usize) {
        let mut selection = Selection::new(axis, left);
        let limit = loop {
            selection.count(items);
            if let Some(limit) = selection.fix_digit() {
                break limit;
            }
        };
        KeyPartition::new(axis, limit, items.len()).advance(items, usize::MAX);
    }

    fn items(positions: impl Iterator<Item = f32>) -> Vec<BuildItem> {
        let cluster = |x: f32| Cluster { mean: Vec3::new(0.0, x, 0.0), ..Cluster::EMPTY };
        (0..).zip(positions).map(|(index, x)| BuildItem::new(&cluster(x), index)).collect()
    }

    #[test]
    fn the_left_side_has_the_smallest_keys_in_total_order_and_then_by_index() {
        let mut rng = Rng(1);
        let values = [-0.0, 0.0, 1.0, -1.0, 1.0e-40, -1.0e-40, 3.0e38, -3.0e38];
        for round in 0..200 {
            let count = 2 + (rng.bits() % 300) as usize;
            let few = round % 2 == 0;
            let mut item = |_| if few { values[(rng.bits() % 8) as usize] } else { rng.between(-9.0, 9.0) };
            let positions: Vec<f32> = (0..count).map(&mut item).collect();
            let mut sorted = items(positions.iter().copied());
            sorted.sort_by(|a, b| a.mean[1].total_cmp(&b.mean[1]).then(a.index().cmp(&b.index())));
            let left = 1 + (rng.bits() % (count as u64 - 1)) as usize;
            let mut divided = items(positions.iter().copied());
            divide(&mut divided, 1, left);
            for (a, b) in [(&divided[..left], &sorted[..left]), (&divided[left..], &sorted[left..])] {
                let indices = |items: &[BuildItem]| {
                    let mut indices: Vec<u32> = items.iter().map(BuildItem::index).collect();
                    indices.sort_unstable();
                    indices
                };
                assert_eq!(indices(a), indices(b), "{left} of {count}");
            }
        }
    }
}
