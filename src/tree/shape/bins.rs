//! Sums lights in bins along each axis, finds the best cut between bins, and partitions the lights.
//!
//! Based on CK18 4.4. These are the hot loops of a build: every split bins and partitions each of
//! its lights once. In a tree of a million lights that is about 17 times for each light.

use std::array;
use std::mem::swap;

use glam::{Vec3, Vec4};

use super::counts::fills_nodes;
use super::group::{BuildItem, Group, GroupSums, MeanBounds, costs, has_several_runs, map_runs};

/// An axis is not cut if its extent is less than this share of the longest one. Slices so thin are
/// no candidates, and the factor for thinness stays far inside f32.
const MIN_EXTENT_SHARE: f32 = 1.0e-6;

/// Adding 2^15 to a position in bins leaves 8 bits for its fraction, with the whole bins above
/// them. This is cheaper than a conversion to an integer, which checks the range.
const WHOLE_BINS: f32 = (1 << 15) as f32;

/// Scales positions so that the last one stays inside the last bin, rounding included.
const LAST_BIN: f32 = 0.999;

/// Items that a partition classifies before it moves any.
const BLOCK: usize = 128;

/// Splits items at the best cut between two of `N` bins along some axis, the left side first.
/// `None`, and the items stay as they are, if no cut leaves counts that fill nodes.
pub(super) fn split_binned<const N: usize>(items: &mut [BuildItem], whole: &Group) -> Option<[Group; 2]> {
    let grid = BinGrid::new(&whole.means, N as f32);
    let bins = Bins::<N>::around(items, &grid);
    let (axis, cut) = bins.best_cut(items.len(), grid.stretch, whole.sums.per_flux())?;
    let mut groups = [Group::EMPTY; 2];
    for bin in 0..N {
        let side = &mut groups[usize::from(bin >= cut)];
        side.sums.add(&bins.sums[axis][bin]);
        side.count += bins.counts[axis][bin] as usize;
    }
    let partition = [partition::<0>, partition::<1>, partition::<2>][axis];
    [groups[0].means, groups[1].means] = partition(items, &grid, cut, groups[0].count);
    Some(groups)
}

/// Maps mean positions to bins.
pub(super) struct BinGrid {
    pub origin: Vec4,
    /// Bins per metre; 0 along axes that are too short to be cut.
    pub scale: Vec4,
    /// Ratio of the longest extent to each extent: thin slices are worse than their area suggests
    /// (CK18 equation 3).
    pub stretch: Vec3,
}

impl BinGrid {
    pub fn new(means: &MeanBounds, bins: f32) -> Self {
        let extent = means.extent();
        let longest = extent.max_element();
        let is_cut = extent.cmpge(Vec3::splat(longest * MIN_EXTENT_SHARE));
        let scale = Vec3::select(is_cut, bins * LAST_BIN / extent, Vec3::ZERO);
        Self { origin: means.min, scale: scale.extend(0.0), stretch: longest / extent }
    }

    /// The position along each axis, from 0 to the number of bins.
    #[inline(always)]
    pub fn positions(&self, mean: Vec4) -> Vec4 {
        (mean - self.origin) * self.scale
    }
}

/// The sums and the number of items in each bin of each axis.
struct Bins<const N: usize> {
    sums: [[GroupSums; N]; 3],
    counts: [[u32; N]; 3],
}

impl<const N: usize> Bins<N> {
    fn around(items: &[BuildItem], grid: &BinGrid) -> Self {
        if !has_several_runs(items.len()) {
            return Self::around_run(items, grid);
        }
        let mut runs = map_runs(items, |run| Self::around_run(run, grid)).into_iter();
        let mut all = runs.next().expect("a run");
        for run in runs {
            all.sums.as_flattened_mut().iter_mut().zip(run.sums.as_flattened()).for_each(|(a, b)| a.add(b));
            all.counts.as_flattened_mut().iter_mut().zip(run.counts.as_flattened()).for_each(|(a, b)| *a += b);
        }
        all
    }

    #[inline(never)]
    fn around_run(items: &[BuildItem], grid: &BinGrid) -> Self {
        let mut bins = Self { sums: [[GroupSums::EMPTY; N]; 3], counts: [[0; N]; 3] };
        for item in items {
            let [x, y, z, _] = (grid.positions(item.mean) + WHOLE_BINS).to_array();
            let sums = item.sums();
            for (position, axis) in [x, y, z].into_iter().zip(0..) {
                let bin = (position.to_bits() >> 8) as usize % N;
                bins.sums[axis][bin].add(&sums);
                bins.counts[axis][bin] += 1;
            }
        }
        bins
    }

    /// The cut of the least cost: its axis and its number of bins on the left. Of equals the most
    /// even cut, then the first.
    #[inline(never)]
    fn best_cut(&self, count: usize, stretch: Vec3, per_flux: f32) -> Option<(usize, usize)> {
        let (mut least, mut most_even, mut best) = (f32::INFINITY, 0, None);
        for axis in 0..3 {
            let bins = &self.sums[axis];
            // For each cut the smaller of both counts; 0 if the counts would not fill nodes.
            let mut evenness = [0; N];
            let mut left = 0;
            for (even, bin) in evenness[1..].iter_mut().zip(self.counts[axis]) {
                left += bin as usize;
                if fills_nodes(left) && fills_nodes(count - left) {
                    *even = left.min(count - left);
                }
            }
            if evenness.iter().all(|even| *even == 0) {
                continue;
            }
            let mut right = GroupSums::EMPTY;
            let mut right_costs = [Vec4::ZERO; N];
            for four in (0..N).step_by(4).rev() {
                let mut add = |bin: usize| {
                    right.add(&bins[bin]);
                    right
                };
                let [d, c, b, a] = [add(four + 3), add(four + 2), add(four + 1), add(four)];
                right_costs[four] = costs([&a, &b, &c, &d], per_flux);
            }
            let mut left = GroupSums::EMPTY;
            for four in (0..N).step_by(4) {
                let lefts: [GroupSums; 4] = array::from_fn(|lane| {
                    let before = left;
                    left.add(&bins[four + lane]);
                    before
                });
                let cost = stretch[axis] * (costs(lefts.each_ref(), per_flux) + right_costs[four]);
                for (cost, cut) in cost.to_array().into_iter().zip(four..) {
                    let even = evenness[cut];
                    if even > 0 && (cost < least || cost == least && even > most_even) {
                        (least, most_even, best) = (cost, even, Some((axis, cut)));
                    }
                }
            }
        }
        best
    }
}

/// Moves the items of bins below `cut` to the front; there are `count` of them. Returns the bounds
/// of the mean positions on both sides.
#[inline(never)]
fn partition<const AXIS: usize>(items: &mut [BuildItem], grid: &BinGrid, cut: usize, count: usize) -> [MeanBounds; 2] {
    let limit = Vec4::splat(WHOLE_BINS + cut as f32);
    let along = |item: &BuildItem| Vec4::splat((grid.positions(item.mean) + WHOLE_BINS).to_array()[AXIS]);
    let (front, back) = items.split_at_mut(count);
    let (mut lefts, mut rights) = (Side::EMPTY, Side::EMPTY);
    loop {
        // Without SIMD, glam's masks have another type, so they are turned into numbers here.
        lefts.classify(front, |item| {
            let is_right = along(item).cmpge(limit);
            (Vec4::select(is_right, Vec4::INFINITY, Vec4::ZERO), is_right.bitmask())
        });
        rights.classify(back, |item| {
            let is_left = along(item).cmplt(limit);
            (Vec4::select(is_left, Vec4::INFINITY, Vec4::ZERO), is_left.bitmask())
        });
        let (front_misplaced, back_misplaced) = (lefts.misplaced(), rights.misplaced());
        let pairs = front_misplaced.len().min(back_misplaced.len());
        if pairs == 0 {
            break;
        }
        for (a, b) in front_misplaced.iter().zip(back_misplaced) {
            swap(&mut front[*a as usize], &mut back[*b as usize]);
        }
        lefts.moved += pairs;
        rights.moved += pairs;
    }
    [lefts.home.union(&rights.away), rights.home.union(&lefts.away)]
}

/// One side of a partition, and its items that belong to the other side.
struct Side {
    /// The number of items that have been classified.
    classified: usize,
    /// The first `found` entries are the places of the last block's items that belong to the other
    /// side. The first `moved` of them have been moved.
    places: [u32; BLOCK],
    found: usize,
    moved: usize,
    /// Bounds of the items that belong to this side.
    home: MeanBounds,
    /// Bounds of the items that belong to the other side.
    away: MeanBounds,
}

impl Side {
    const EMPTY: Self = Self {
        classified: 0,
        places: [0; BLOCK],
        found: 0,
        moved: 0,
        home: MeanBounds::EMPTY,
        away: MeanBounds::EMPTY,
    };

    /// The places of items that still have to move to the other side.
    fn misplaced(&self) -> &[u32] {
        &self.places[self.moved..self.found]
    }

    /// Classifies more items if none is left to move. `is_away` returns, for an item of the other
    /// side, infinity and set bits; for one of this side, zeros.
    #[inline(always)]
    fn classify(&mut self, items: &[BuildItem], is_away: impl Fn(&BuildItem) -> (Vec4, u32)) {
        while self.moved == self.found && self.classified < items.len() {
            let end = items.len().min(self.classified + BLOCK);
            (self.found, self.moved) = (0, 0);
            for (item, place) in items[self.classified..end].iter().zip(self.classified as u32..) {
                // No branches: half of them would be mispredicted, for 110 ns more per light (of
                // 360 in all).
                let (not_home, bits) = is_away(item);
                let not_away = Vec4::select(not_home.cmpeq(Vec4::ZERO), Vec4::INFINITY, Vec4::ZERO);
                self.home.min = self.home.min.min(item.mean + not_home);
                self.home.max = self.home.max.max(item.mean - not_home);
                self.away.min = self.away.min.min(item.mean + not_away);
                self.away.max = self.away.max.max(item.mean - not_away);
                self.places[self.found % BLOCK] = place;
                self.found += (bits & 1) as usize;
            }
            self.classified = end;
        }
    }
}
