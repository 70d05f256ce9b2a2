//! Splits a piece of neighbouring units in two, and its parts again, until no part holds more units
//! than a node.
//!
//! Twin of `shaders/top_split.wgsl`. Based on CK18 4.2-4.4. Differs:
//!
//! - A part is cut across one axis only, along which its box is longest. Units are ordered by the
//!   centres of their boxes. Large parts are cut between bins, small parts between any two units.
//! - The cost is flux times size; directions do not count (docs/decisions.md, 66).
//! - Units are rounded to a grid of the piece: 16 bits per axis, and 14 bits for the flux. So a piece
//!   fits into a workgroup's 16 KiB, and sums are integers, which do not depend on the order in which
//!   the invocations of a workgroup add to them.
//! - Costs are rounded after each operation, so that no compiler can fuse two of them. CPU and GPU
//!   choose the same cuts.

use crate::cluster::Cluster;
use crate::tree::curve::{exponent, power_of_two};
use crate::tree::{ChildGroup, WIDTH, fills_nodes, middle};

/// Bins of a large part.
pub(crate) const BINS: usize = 12;
/// A part of at most this many units is small. One bit of a word for each unit is enough for it.
pub(crate) const SMALL: usize = 31;
/// A part is halved once it comes from this many cuts of large parts. This bounds chains of cuts
/// that each take away a single unit.
pub(crate) const LARGE_ROUNDS: usize = 8;
/// The same for cuts of small parts.
pub(crate) const SMALL_ROUNDS: usize = 6;
/// After so many rounds of halving no large part is left, whatever the cuts before were. The test
/// `no_piece_needs_more_rounds_than_shaders_make` finds that these are just enough.
#[cfg(any(feature = "gpu-plan", test))]
pub(crate) const LARGE_HALVINGS: usize = 5;
/// The same for small parts.
#[cfg(any(feature = "gpu-plan", test))]
pub(crate) const SMALL_HALVINGS: usize = 2;
/// The greatest number of cuts of a piece. The test
/// `no_piece_has_more_cuts_or_nodes_than_there_is_room_for` finds 225 in the worst case.
pub(crate) const MAX_CUTS: usize = 226;
/// Bits of a coordinate of a piece's grid.
pub(crate) const CELL_BITS: u32 = 16;
/// Bits of the flux of a unit.
pub(crate) const FLUX_BITS: u32 = 14;
/// The lowest bits of a cost, which are cleared.
pub(crate) const COST_SLACK: u32 = 4;
/// One over the weight of the squared diagonal beside the half area, as in `tree/cost.rs`.
pub(crate) const DIAGONAL_SHARE: u32 = 20;

/// The greatest coordinate of a piece's grid.
const LAST_CELL: u32 = (1 << CELL_BITS) - 1;

/// A unit on the grid of its piece.
#[derive(Clone, Copy, Debug, PartialEq)]
struct GridItem {
    low: [u32; 3],
    high: [u32; 3],
    flux: u32,
}

impl GridItem {
    /// The centre of its box along an axis.
    fn centre(&self, axis: usize) -> u32 {
        (self.low[axis] + self.high[axis]) / 2
    }
}

/// A part of a piece: consecutive places of its order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PiecePart {
    pub first: usize,
    pub count: usize,
    /// The bits of its cost; 0 for a part of at most [`WIDTH`] units.
    pub cost: u32,
    /// The indices of the two parts that it was cut into. `None` for a part of at most [`WIDTH`]
    /// units.
    pub halves: Option<[usize; 2]>,
}

impl PiecePart {
    const fn new(first: usize, count: usize) -> Self {
        Self { first, count, cost: 0, halves: None }
    }
}

impl ChildGroup for PiecePart {
    type Cost = u32;

    fn count(&self) -> usize {
        self.count
    }

    fn cost(&self) -> u32 {
        self.cost
    }

    fn is_tiny(&self) -> bool {
        false
    }
}

/// A piece that has been split.
pub(super) struct SplitPiece {
    /// The units' numbers, in the order of the parts.
    pub order: Vec<usize>,
    /// The whole piece comes first, and every part before its halves.
    pub parts: Vec<PiecePart>,
}

impl SplitPiece {
    /// Splits units until no part holds more than [`WIDTH`] of them. O(n log n).
    pub fn new<'a>(units: impl ExactSizeIterator<Item = &'a Cluster> + Clone) -> Self {
        let items = items(units);
        let mut order: Vec<usize> = (0..items.len()).collect();
        let mut parts = vec![PiecePart::new(0, items.len())];
        // For each part its box, and the number of cuts of its kind that it comes from.
        let whole = items.iter().fold(GridSums::EMPTY, |all, item| all.and(&GridSums::of(item)));
        let mut ranges = vec![(whole, 0)];
        let mut place = 0;
        while place < parts.len() {
            let PiecePart { first, count, .. } = parts[place];
            if count > WIDTH {
                let part = &mut order[first..first + count];
                let (range, round) = ranges[place];
                let cut = match count > SMALL {
                    true => cut_large(&items, part, &range, round < LARGE_ROUNDS),
                    false => cut_small(&items, part, &range, round < SMALL_ROUNDS),
                };
                parts[place].cost = cut.cost;
                parts[place].halves = Some([parts.len(), parts.len() + 1]);
                let left = cut.left;
                let halves = [PiecePart::new(first, left), PiecePart::new(first + left, count - left)];
                for (half, range) in halves.into_iter().zip(cut.ranges) {
                    parts.push(half);
                    ranges.push((range, if (half.count > SMALL) == (count > SMALL) { round + 1 } else { 0 }));
                }
            }
            place += 1;
        }
        debug_assert!(parts.len() <= 2 * MAX_CUTS + 1);
        Self { order, parts }
    }

    /// The parts that the costliest cuts leave, at most `most` of them, in the order of their
    /// places. A cut is as costly as the part that it cuts; of equal cuts that of the larger part
    /// comes first, then the first. No part is costlier than one that holds it, so each cut comes
    /// after those that it needs.
    pub fn costliest_parts(&self, most: usize) -> Vec<PiecePart> {
        let cut = |part: &usize| self.parts[*part].halves.is_some();
        let mut cuts: Vec<usize> = (0..self.parts.len()).filter(cut).collect();
        let rank = |part: &usize| {
            let PiecePart { first, count, cost, .. } = self.parts[*part];
            (std::cmp::Reverse((cost, count)), first)
        };
        cuts.sort_unstable_by_key(rank);
        cuts.truncate(most - 1);
        let mut left = Vec::with_capacity(cuts.len() + 1);
        let mut stack = vec![0];
        while let Some(part) = stack.pop() {
            match self.parts[part].halves.filter(|_| cuts.contains(&part)) {
                Some([first, second]) => stack.extend([second, first]),
                None => left.push(self.parts[part]),
            }
        }
        left
    }
}

/// Rounds units to the grid of their piece.
fn items<'a>(units: impl ExactSizeIterator<Item = &'a Cluster> + Clone) -> Vec<GridItem> {
    let (mut min, mut max, mut most) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3], 0.0_f32);
    for unit in units.clone() {
        for k in 0..3 {
            min[k] = min[k].min(unit.aabb.min[k]);
            max[k] = max[k].max(unit.aabb.max[k]);
        }
        most = most.max(unit.flux);
    }
    let longest = (max[0] - min[0]).max(max[1] - min[1]).max(max[2] - min[2]);
    // Powers of two keep products exact. The extent and the flux get as many bits as there are.
    let cells = power_of_two(CELL_BITS as i32 - 1 - exponent(longest));
    let per_flux = power_of_two(FLUX_BITS as i32 - 1 - exponent(most));
    let item = |unit: &Cluster| {
        let cell = |p: f32, k: usize| (((p - min[k]) * cells) as u32).min(LAST_CELL);
        GridItem {
            low: [0, 1, 2].map(|k| cell(unit.aabb.min[k], k)),
            high: [0, 1, 2].map(|k| cell(unit.aabb.max[k], k)),
            flux: ((unit.flux * per_flux) as u32).max(1),
        }
    };
    units.map(item).collect()
}

/// The box and the summed flux of some items.
#[derive(Clone, Copy)]
struct GridSums {
    low: [u32; 3],
    high: [u32; 3],
    flux: u32,
    count: usize,
}

impl GridSums {
    const EMPTY: Self = Self { low: [LAST_CELL; 3], high: [0; 3], flux: 0, count: 0 };

    fn of(item: &GridItem) -> Self {
        Self { low: item.low, high: item.high, flux: item.flux, count: 1 }
    }

    #[inline(always)]
    fn and(&self, other: &Self) -> Self {
        Self {
            low: [0, 1, 2].map(|k| self.low[k].min(other.low[k])),
            high: [0, 1, 2].map(|k| self.high[k].max(other.high[k])),
            flux: self.flux + other.flux,
            count: self.count + other.count,
        }
    }

    /// The axis along which the box is longest, of equals the first, with its length.
    fn longest(&self) -> (usize, u32) {
        let extent = [0, 1, 2].map(|k| self.high[k].saturating_sub(self.low[k]));
        let axis = usize::from(extent[1] > extent[0]);
        let axis = if extent[2] > extent[axis] { 2 } else { axis };
        (axis, extent[axis])
    }

    /// The cost, with lengths in pairs of cells. It has no meaning for no items.
    #[inline(always)]
    fn cost(&self) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|k| self.high[k].saturating_sub(self.low[k]).div_ceil(2));
        // Below 2^32, since edges are at most 2^15. Rounded up, so that a row of lamps has a size.
        let size = x * y + y * z + z * x + (x * x + y * y + z * z).div_ceil(DIAGONAL_SHARE);
        rounded(size as f32 * self.flux as f32)
    }
}

/// A cost without its lowest bits, which compilers may compute differently.
fn rounded(cost: f32) -> f32 {
    f32::from_bits(cost.to_bits() >> COST_SLACK << COST_SLACK)
}

/// The cost of a cut, for comparison; `None` if a side would not fill nodes.
fn cost_of_cut(left: &GridSums, right: &GridSums) -> Option<u32> {
    let fills = fills_nodes(left.count) && fills_nodes(right.count);
    fills.then(|| (left.cost() + right.cost()).to_bits() >> COST_SLACK)
}

/// A part that has been cut.
struct PartCut {
    /// The bits of the cost of the part.
    cost: u32,
    /// The number of units on the left.
    left: usize,
    /// A box around each half.
    ranges: [GridSums; 2],
}

impl PartCut {
    /// A cut of a part in half, without regard to cost. `range` is a box around the part.
    fn middle(whole: &GridSums, range: &GridSums) -> Self {
        Self { cost: whole.cost().to_bits(), left: middle(whole.count), ranges: [*range; 2] }
    }
}

/// Cuts a part at the border between two bins where the cut costs least; of equal cuts it takes the
/// first. Halves the part if no cut fills nodes on both sides, or if `may_bin` is false. Moves the left
/// side to the front and keeps the order within each side. The bins divide `range`, a box around the
/// part.
fn cut_large(items: &[GridItem], part: &mut [usize], range: &GridSums, may_bin: bool) -> PartCut {
    let (axis, extent) = range.longest();
    let bin_of = |unit: usize| ((items[unit].centre(axis) - range.low[axis]) * BINS as u32 / (extent + 1)) as usize;
    let mut bins = [GridSums::EMPTY; BINS];
    for unit in part.iter() {
        let bin = &mut bins[bin_of(*unit)];
        *bin = bin.and(&GridSums::of(&items[*unit]));
    }
    // `from[b]` has the sums of bin b and all after it.
    let mut from = bins;
    for bin in (0..BINS - 1).rev() {
        from[bin] = from[bin + 1].and(&bins[bin]);
    }
    let mut best = (u32::MAX, 0, [GridSums::EMPTY; 2]);
    let mut to = GridSums::EMPTY;
    for bin in 0..BINS - 1 {
        to = to.and(&bins[bin]);
        if let Some(cost) = cost_of_cut(&to, &from[bin + 1]).filter(|cost| *cost < best.0) {
            best = (cost, bin, [to, from[bin + 1]]);
        }
    }
    if best.0 == u32::MAX || !may_bin {
        return PartCut::middle(&from[0], range);
    }
    let (_, last, ranges) = best;
    PartCut { cost: from[0].cost().to_bits(), left: partition(part, |_, unit| bin_of(unit) <= last), ranges }
}

/// Cuts a small part after the unit where the cut costs least, as [`cut_large`] does.
fn cut_small(items: &[GridItem], part: &mut [usize], range: &GridSums, may_search: bool) -> PartCut {
    let (axis, _) = range.longest();
    let count = part.len();
    // The units' centres and places in the part, in the order of the centres.
    let mut sorted = [(0, 0); SMALL];
    let sorted = &mut sorted[..count];
    for (place, unit) in part.iter().enumerate() {
        sorted[place] = (items[*unit].centre(axis), place);
    }
    sorted.sort_unstable();
    let mut from = [GridSums::EMPTY; SMALL + 1];
    for rank in (0..count).rev() {
        from[rank] = from[rank + 1].and(&GridSums::of(&items[part[sorted[rank].1]]));
    }
    let mut best = (u32::MAX, 0, [GridSums::EMPTY; 2]);
    let mut to = GridSums::EMPTY;
    for rank in 0..count {
        let place = sorted[rank].1;
        to = to.and(&GridSums::of(&items[part[place]]));
        if let Some(cost) = cost_of_cut(&to, &from[rank + 1])
            && (cost, place) < (best.0, best.1)
        {
            best = (cost, place, [to, from[rank + 1]]);
        }
    }
    if best.0 == u32::MAX || !may_search {
        return PartCut::middle(&from[0], range);
    }
    let (_, last, ranges) = best;
    let border = (items[part[last]].centre(axis), last);
    let left = partition(part, |place, unit| (items[unit].centre(axis), place) <= border);
    PartCut { cost: from[0].cost().to_bits(), left, ranges }
}

/// Moves the units on the left, by their places and numbers, to the front, with each side in its
/// former order. Returns how many these are.
fn partition(part: &mut [usize], is_left: impl Fn(usize, usize) -> bool) -> usize {
    let mut right = Vec::with_capacity(part.len());
    let mut left = 0;
    for place in 0..part.len() {
        let unit = part[place];
        if is_left(place, unit) {
            part[left] = unit;
            left += 1;
        } else {
            right.push(unit);
        }
    }
    part[left..].copy_from_slice(&right);
    left
}
