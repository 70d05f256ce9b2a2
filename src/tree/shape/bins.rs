//! Sums lights in bins along each axis, finds the best cut between bins, and partitions the lights.
//! Where directions of emission differ, there are axes of direction besides those of position.
//!
//! Based on CK18 4.4. Differs: CK18 bins positions only. These are the hot loops of a build: every
//! split bins and partitions each of its lights once. In a tree of a million lights that is about
//! 17 times for each light.

use std::array;
use std::mem::swap;

use glam::{Vec3, Vec4};

use super::counts::fills_nodes;
use super::group::{Bounds, BuildItem, Group, GroupSums, ItemSums, MeanBounds, costs};

/// An axis is not cut if its extent is less than this share of the longest one. Slices so thin are
/// no candidates, and the factor for thinness stays far inside f32.
const MIN_EXTENT_SHARE: f32 = 1.0e-6;

/// Lights less than this many metres apart count as one place. Above it, the scale of the thinnest
/// axis that is cut is finite.
pub(super) const MIN_EXTENT: f32 = 1.0e-30;

/// An axis of direction is not cut if its extent is less than this share of the longest one.
const MIN_DIRECTION_SHARE: f32 = 0.1;

/// The most that is added to the factor on the cost of a cut by direction, in a group that is large
/// in its tree. Without it, beams in all directions from all places of a hall are first divided by
/// direction, which nearly doubles the noise (docs/decisions.md, 17).
const MAX_DIRECTION_PENALTY: f32 = 1.0;

/// A group with this share of the tree's diagonal has half of the greatest penalty.
const FAR_SHARE: f32 = 0.2;

/// Adding 2^15 to a position in bins leaves 8 bits for its fraction, with the whole bins above
/// them. This is cheaper than a conversion to an integer, which checks the range.
const WHOLE_BINS: f32 = (1 << 15) as f32;

/// Scales positions so that the last one stays inside the last bin, rounding included.
const LAST_BIN: f32 = 0.999;

/// Items that a partition classifies before it moves any.
const BLOCK: usize = 128;

/// A cut between two bins.
pub(super) struct BinCut {
    pub axis: usize,
    /// The first bin of the right side.
    pub bin: usize,
    /// Both sides, without the bounds of their mean positions.
    pub groups: [Group; 2],
}

/// The axes along which groups are cut: three of position, then three of direction.
pub(super) const AXES: usize = 6;

/// Maps the mean positions and directions of items to bins.
#[derive(Clone, Copy)]
pub(super) struct BinGrid {
    position: GridBox,
    direction: GridBox,
    /// The factors on the costs of cuts: thin slices are worse than their area suggests (CK18
    /// equation 3).
    pub stretch: [f32; AXES],
    /// 3, or [`AXES`] if directions differ.
    pub axes: usize,
}

/// The bins along three axes.
#[derive(Clone, Copy)]
struct GridBox {
    origin: Vec4,
    /// Bins per unit; 0 along axes that are too short to be cut.
    scale: Vec4,
    /// Ratio of the longest extent to each extent.
    stretch: Vec3,
}

impl GridBox {
    /// Axes shorter than `min_share` of the longest one are not cut.
    fn new(bounds: &Bounds, bins: f32, min_share: f32) -> Self {
        let extent = bounds.extent();
        let longest = extent.max_element();
        let is_cut = extent.cmpge(Vec3::splat((longest * min_share).max(MIN_EXTENT)));
        let scale = Vec3::select(is_cut, bins * LAST_BIN / extent, Vec3::ZERO);
        Self { origin: bounds.min, scale: scale.extend(0.0), stretch: longest / extent }
    }

    /// The position along each axis, from 0 to the number of bins.
    #[inline(always)]
    fn positions(&self, point: Vec4) -> Vec4 {
        (point - self.origin) * self.scale
    }
}

impl BinGrid {
    pub fn new(whole: &Group, bins: f32) -> Self {
        let min_share = if whole.is_cut_along_longest { 1.0 } else { MIN_EXTENT_SHARE };
        let position = GridBox::new(&whole.means.position, bins, min_share);
        let direction = GridBox::new(&whole.means.direction, bins, MIN_DIRECTION_SHARE);
        let [x, y, z] = position.stretch.to_array();
        let [a, b, c] = (direction_penalty(whole) * direction.stretch).to_array();
        let axes = if whole.means.has_directions() { AXES } else { 3 };
        Self { position, direction, stretch: [x, y, z, a, b, c], axes }
    }

    /// Whether the positions of the items are farthest apart along this axis.
    pub fn is_longest(&self, axis: usize) -> bool {
        axis < 3 && self.stretch[axis] <= 1.0
    }

    /// Whether items may be cut along an axis.
    pub fn is_cut(&self, axis: usize) -> bool {
        axis < self.axes && [self.position.scale, self.direction.scale][axis / 3][axis % 3] > 0.0
    }

    /// The place of an item along the three axes of position, or of direction, from 0 to the number
    /// of bins.
    #[inline(always)]
    pub fn places<const DIRECTION: bool>(&self, item: &BuildItem) -> Vec4 {
        if DIRECTION { self.direction.positions(item.direction()) } else { self.position.positions(item.mean) }
    }
}

/// The factor on the costs of cuts by direction.
///
/// A shading point inside a group needs its lights apart by position. One far from it needs them
/// apart by direction. Most shading points of a group that is small in its tree are far from it.
fn direction_penalty(whole: &Group) -> f32 {
    let diagonal_sq = whole.sums.diagonal_sq();
    let limit_sq = FAR_SHARE * FAR_SHARE * whole.tree_diagonal_sq();
    let is_point = diagonal_sq + limit_sq < f32::MIN_POSITIVE;
    1.0 + if is_point { 0.0 } else { MAX_DIRECTION_PENALTY * diagonal_sq / (diagonal_sq + limit_sq) }
}

/// The sums and the number of items in each bin of each axis.
#[derive(Clone)]
pub(super) struct Bins<const N: usize> {
    sums: [[GroupSums; N]; AXES],
    counts: [[u32; N]; AXES],
}

impl<const N: usize> ItemSums for Bins<N> {
    fn clear(&mut self) {
        self.sums.as_flattened_mut().fill(GroupSums::EMPTY);
        self.counts.as_flattened_mut().fill(0);
    }

    fn add(&mut self, other: &Self) {
        self.sums.as_flattened_mut().iter_mut().zip(other.sums.as_flattened()).for_each(|(a, b)| a.add(b));
        self.counts.as_flattened_mut().iter_mut().zip(other.counts.as_flattened()).for_each(|(a, b)| *a += b);
    }
}

impl<const N: usize> Bins<N> {
    pub const EMPTY: Self = Self { sums: [[GroupSums::EMPTY; N]; AXES], counts: [[0; N]; AXES] };

    #[inline(never)]
    pub fn add_items(&mut self, items: &[BuildItem], grid: &BinGrid) {
        for item in items {
            self.add_along(0, item, grid.places::<false>(item));
        }
        if grid.axes > 3 {
            items.iter().for_each(|item| self.add_along(3, item, grid.places::<true>(item)));
        }
    }

    /// Adds an item to the bins of three axes.
    #[inline(always)]
    fn add_along(&mut self, first_axis: usize, item: &BuildItem, places: Vec4) {
        let [x, y, z, _] = (places + WHOLE_BINS).to_array();
        let sums = item.sums();
        for (place, axis) in [x, y, z].into_iter().zip(first_axis..) {
            let bin = (place.to_bits() >> 8) as usize % N;
            self.sums[axis][bin].add(&sums);
            self.counts[axis][bin] += 1;
        }
    }

    /// The best cut of the group `whole`, all of whose items are in the bins. `None` if no cut is
    /// allowed.
    pub fn cut(&self, whole: &Group, grid: &BinGrid) -> Option<BinCut> {
        let (axis, bin) = self.best_cut(whole, grid)?;
        let mut groups = [Group::EMPTY; 2];
        for i in 0..N {
            let side = &mut groups[usize::from(i >= bin)];
            side.sums.add(&self.sums[axis][i]);
            side.count += self.counts[axis][i] as usize;
        }
        Some(BinCut { axis, bin, groups })
    }

    /// The cut of the least cost: its axis and its number of bins on the left. Of equals the most
    /// even cut, then the first.
    #[inline(never)]
    fn best_cut(&self, whole: &Group, grid: &BinGrid) -> Option<(usize, usize)> {
        let (count, unit) = (whole.count, whole.cost_unit());
        let (mut least, mut most_even, mut best) = (f32::INFINITY, 0, None);
        for axis in (0..AXES).filter(|axis| grid.is_cut(*axis)) {
            let bins = &self.sums[axis];
            // For each cut the smaller of both counts; 0 if the cut is not allowed.
            let mut evenness = [0; N];
            let (mut left, mut empty) = (0, 0);
            let is_longest = grid.is_longest(axis);
            for (even, bin) in evenness[1..].iter_mut().zip(self.counts[axis]) {
                left += bin as usize;
                empty = if bin == 0 { empty + 1 } else { 0 };
                // Across a gap any counts are better than a node with lights of both sides. A gap of
                // three quarters has five whole bins of eight.
                let is_gap = is_longest && 8 * empty >= 5 * N;
                if is_gap || fills_nodes(left) && fills_nodes(count - left) {
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
                right_costs[four] = costs([&a, &b, &c, &d], unit);
            }
            let mut left = GroupSums::EMPTY;
            for four in (0..N).step_by(4) {
                let lefts: [GroupSums; 4] = array::from_fn(|lane| {
                    let before = left;
                    left.add(&bins[four + lane]);
                    before
                });
                let cost = grid.stretch[axis] * (costs(lefts.each_ref(), unit) + right_costs[four]);
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

/// Both sides of a partition.
pub(super) struct Sides {
    left: Side,
    right: Side,
}

impl Sides {
    pub const EMPTY: Self = Self { left: Side::EMPTY, right: Side::EMPTY };

    /// Classifies up to [`BLOCK`] items of each side of a cut, and swaps items that are on the wrong
    /// sides. Returns the number of items that were classified or swapped, which is 0 once all items
    /// are on their side.
    #[inline(never)]
    pub fn advance_along(&mut self, items: &mut [BuildItem], grid: &BinGrid, cut: &BinCut) -> usize {
        let advance = [
            Self::advance::<0>,
            Self::advance::<1>,
            Self::advance::<2>,
            Self::advance::<3>,
            Self::advance::<4>,
            Self::advance::<5>,
        ];
        advance[cut.axis](self, items, grid, cut.bin, cut.groups[0].count)
    }

    /// [`Sides::advance_along`] one axis.
    #[inline(always)]
    fn advance<const AXIS: usize>(
        &mut self,
        items: &mut [BuildItem],
        grid: &BinGrid,
        cut: usize,
        count: usize,
    ) -> usize {
        let limit = Vec4::splat(WHOLE_BINS + cut as f32);
        let along = |item: &BuildItem| {
            let places = if AXIS < 3 { grid.places::<false>(item) } else { grid.places::<true>(item) };
            Vec4::splat((places + WHOLE_BINS).to_array()[AXIS % 3])
        };
        let (front, back) = items.split_at_mut(count);
        // Without SIMD, glam's masks have another type, so they are turned into numbers here.
        let mut handled = self.left.classify(front, |item| {
            let is_right = along(item).cmpge(limit);
            (Vec4::select(is_right, Vec4::INFINITY, Vec4::ZERO), is_right.bitmask())
        });
        handled += self.right.classify(back, |item| {
            let is_left = along(item).cmplt(limit);
            (Vec4::select(is_left, Vec4::INFINITY, Vec4::ZERO), is_left.bitmask())
        });
        let (front_misplaced, back_misplaced) = (self.left.misplaced(), self.right.misplaced());
        let pairs = front_misplaced.len().min(back_misplaced.len());
        for (a, b) in front_misplaced.iter().zip(back_misplaced) {
            swap(&mut front[*a as usize], &mut back[*b as usize]);
        }
        self.left.moved += pairs;
        self.right.moved += pairs;
        handled + pairs
    }

    /// Both parts, once all items are on their side.
    pub fn parts(&self, cut: &BinCut) -> [Group; 2] {
        let [left, right] = cut.groups;
        let means = [self.left.home.union(&self.right.away), self.right.home.union(&self.left.away)];
        [Group { means: means[0], ..left }, Group { means: means[1], ..right }]
    }
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

    /// Classifies one more block of items if none is left to move. Returns the number of items.
    /// `is_away` returns, for an item of the other side, infinity and set bits; for one of this
    /// side, zeros.
    #[inline(always)]
    fn classify(&mut self, items: &[BuildItem], is_away: impl Fn(&BuildItem) -> (Vec4, u32)) -> usize {
        if self.moved < self.found || self.classified == items.len() {
            return 0;
        }
        let first = self.classified;
        let end = items.len().min(first + BLOCK);
        (self.found, self.moved) = (0, 0);
        for (item, place) in items[first..end].iter().zip(first as u32..) {
            // No branches: half of them would be mispredicted, for 110 ns more per light (of 360 in
            // all).
            let (not_home, bits) = is_away(item);
            let not_away = Vec4::select(not_home.cmpeq(Vec4::ZERO), Vec4::INFINITY, Vec4::ZERO);
            self.home.add(item, not_home);
            self.away.add(item, not_away);
            self.places[self.found % BLOCK] = place;
            self.found += (bits & 1) as usize;
        }
        self.classified = end;
        end - first
    }
}
