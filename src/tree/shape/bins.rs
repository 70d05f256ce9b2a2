//! Sums of lights by bins along each axis, the best cut between bins, and the partition that follows.
//!
//! Based on CK18 4.4. The hot loops of a build: each light is binned and partitioned once a split, about 17 times in
//! a million.

use std::array;
use std::mem::swap;

use glam::{Vec3, Vec4};

use super::group::{Group, Item, Means, Sums, are_runs, costs, map_runs};
use super::split::fills_nodes;

/// Shares of the longest axis below which an axis is not cut: slices so thin are no candidates, and the factor for
/// their thinness stays far inside f32.
const THINNEST: f32 = 1.0e-6;

/// Bins are told apart by adding 2^15: that leaves 8 bits of a float's fraction, and whole bins above them. Cheaper than
/// conversions to integers, which check for what does not fit.
const WHOLE_BINS: f32 = (1 << 15) as f32;

/// Keeps the last place inside the last bin, rounding included.
const LAST_BIN: f32 = 0.999;

/// Items that a partition looks at before it moves any.
const BLOCK: usize = 128;

/// Splits items between two bins of `N` along some axis, the left ones first, if there is such a cut.
pub(super) fn split_binned<const N: usize>(items: &mut [Item], whole: &Group) -> Option<[Group; 2]> {
    let grid = Grid::new(&whole.means, N as f32);
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

/// Maps means to bins.
pub(super) struct Grid {
    pub origin: Vec4,
    /// Bins a metre; none along axes that are too short.
    pub scale: Vec4,
    /// How much longer the longest axis is than each: thin slices are worse than their area says; CK18 equation 3.
    pub stretch: Vec3,
}

impl Grid {
    pub fn new(means: &Means, bins: f32) -> Self {
        let extent = means.extent();
        let longest = extent.max_element();
        let is_cut = extent.cmpge(Vec3::splat(longest * THINNEST));
        let scale = Vec3::select(is_cut, bins * LAST_BIN / extent, Vec3::ZERO);
        Self { origin: means.min, scale: scale.extend(0.0), stretch: longest / extent }
    }

    /// From zero to the number of bins.
    #[inline(always)]
    pub fn places(&self, mean: Vec4) -> Vec4 {
        (mean - self.origin) * self.scale
    }
}

/// Sums over the items of each bin of each axis.
struct Bins<const N: usize> {
    sums: [[Sums; N]; 3],
    counts: [[u32; N]; 3],
}

impl<const N: usize> Bins<N> {
    fn around(items: &[Item], grid: &Grid) -> Self {
        if !are_runs(items.len()) {
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
    fn around_run(items: &[Item], grid: &Grid) -> Self {
        let mut bins = Self { sums: [[Sums::EMPTY; N]; 3], counts: [[0; N]; 3] };
        for item in items {
            let [x, y, z, _] = (grid.places(item.mean) + WHOLE_BINS).to_array();
            let sums = item.sums();
            for (place, axis) in [x, y, z].into_iter().zip(0..) {
                let bin = (place.to_bits() >> 8) as usize % N;
                bins.sums[axis][bin].add(&sums);
                bins.counts[axis][bin] += 1;
            }
        }
        bins
    }

    /// Axis and number of bins on the left of the cut with the least cost; of equals the most even, then the first.
    #[inline(never)]
    fn best_cut(&self, count: usize, stretch: Vec3, per_flux: f32) -> Option<(usize, usize)> {
        let (mut least, mut most_even, mut best) = (f32::INFINITY, 0, None);
        for axis in 0..3 {
            let bins = &self.sums[axis];
            // By cut, the smaller of both counts; zero where it is not allowed.
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
            let mut right = Sums::EMPTY;
            let mut right_costs = [Vec4::ZERO; N];
            for four in (0..N).step_by(4).rev() {
                let mut from = |bin: usize| {
                    right.add(&bins[bin]);
                    right
                };
                let [d, c, b, a] = [from(four + 3), from(four + 2), from(four + 1), from(four)];
                right_costs[four] = costs([&a, &b, &c, &d], per_flux);
            }
            let mut left = Sums::EMPTY;
            for four in (0..N).step_by(4) {
                let lefts: [Sums; 4] = array::from_fn(|lane| {
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

/// Moves items of bins below `cut` to the front, of which there are `count`.
#[inline(never)]
fn partition<const AXIS: usize>(items: &mut [Item], grid: &Grid, cut: usize, count: usize) -> [Means; 2] {
    let limit = Vec4::splat(WHOLE_BINS + cut as f32);
    let along = |item: &Item| Vec4::splat((grid.places(item.mean) + WHOLE_BINS).to_array()[AXIS]);
    let (front, back) = items.split_at_mut(count);
    let (mut lefts, mut rights) = (Side::EMPTY, Side::EMPTY);
    loop {
        // Glam's masks have another type without SIMD: they are turned into numbers here.
        lefts.look(front, |item| {
            let is_right = along(item).cmpge(limit);
            (Vec4::select(is_right, Vec4::INFINITY, Vec4::ZERO), is_right.bitmask())
        });
        rights.look(back, |item| {
            let is_left = along(item).cmplt(limit);
            (Vec4::select(is_left, Vec4::INFINITY, Vec4::ZERO), is_left.bitmask())
        });
        let (out, back_out) = (lefts.waiting(), rights.waiting());
        let pairs = out.len().min(back_out.len());
        if pairs == 0 {
            break;
        }
        for (a, b) in out.iter().zip(back_out) {
            swap(&mut front[*a as usize], &mut back[*b as usize]);
        }
        lefts.moved += pairs;
        rights.moved += pairs;
    }
    [lefts.home.union(&rights.away), rights.home.union(&lefts.away)]
}

/// One side of a partition, while it finds what belongs to the other.
struct Side {
    looked_at: usize,
    /// Of the last block: the first `found` places are of items that belong to the other side, `moved` of them done.
    misplaced: [u32; BLOCK],
    found: usize,
    moved: usize,
    /// Around what belongs to this side and to the other.
    home: Means,
    away: Means,
}

impl Side {
    const EMPTY: Self =
        Self { looked_at: 0, misplaced: [0; BLOCK], found: 0, moved: 0, home: Means::EMPTY, away: Means::EMPTY };

    fn waiting(&self) -> &[u32] {
        &self.misplaced[self.moved..self.found]
    }

    /// Looks at more items, unless some still wait. `is_away` gives infinity or zero, and all bits or none.
    #[inline(always)]
    fn look(&mut self, items: &[Item], is_away: impl Fn(&Item) -> (Vec4, u32)) {
        while self.moved == self.found && self.looked_at < items.len() {
            let end = items.len().min(self.looked_at + BLOCK);
            (self.found, self.moved) = (0, 0);
            for (item, place) in items[self.looked_at..end].iter().zip(self.looked_at as u32..) {
                // Branches would be guessed wrong half the time: 110 ns more a light, of 360 in all.
                let (not_home, bits) = is_away(item);
                let not_away = Vec4::select(not_home.cmpeq(Vec4::ZERO), Vec4::INFINITY, Vec4::ZERO);
                self.home.min = self.home.min.min(item.mean + not_home);
                self.home.max = self.home.max.max(item.mean - not_home);
                self.away.min = self.away.min.min(item.mean + not_away);
                self.away.max = self.away.max.max(item.mean - not_away);
                self.misplaced[self.found % BLOCK] = place;
                self.found += (bits & 1) as usize;
            }
            self.looked_at = end;
        }
    }
}
