//! Splits a piece of neighbouring units in two, and its parts again, until no part holds more units
//! than a node.
//!
//! Twin of `shaders/top_split.wgsl`. Based on CK18 4.2-4.4. Differs:
//!
//! - A part is cut across one axis only, along which its box is longest. Units are ordered by the
//!   centres of their boxes. Large parts are cut between bins, small parts between any two units.
//! - The cost is flux times size; directions do not count (docs/decisions.md, 66).
//! - Each part has a grid of its own, of 16 bits per axis, over the box of its units. So what is far
//!   away from other units of a piece is cut off, and then no longer hides how these differ. Costs are
//!   computed from whole numbers of cells.
//! - Once a part is small, its units are rounded to its grid for good. So a piece fits into a
//!   workgroup's 16 KiB. Fluxes have 14 bits. Sums are integers, which do not depend on the order in
//!   which the invocations of a workgroup add to them.
//! - Costs are rounded after each operation, so that no compiler can fuse two of them. CPU and GPU
//!   choose the same cuts.

use crate::cluster::Cluster;
use crate::tree::space_order::{exponent, power_of_two};
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

/// Grids finer than that of their piece by more than this power of two count as this fine when the
/// costs of parts are compared, so that no cost underflows.
pub(crate) const MAX_ZOOM: i32 = 50;

/// A side of a cut is tiny if its box is this many times shorter than that of the part. A town beside
/// a lamp a million times as far away had seven times the noise without a node of its own, because the
/// boxes of a node have eight bits. With 1,024 in place of 16, a lamp 27 times as far away costs more.
pub(crate) const TINY_SHARE: f32 = 16.0;
/// The greatest number of tiny parts with more than a third of all units: two at each depth.
#[cfg(any(feature = "gpu-plan", test))]
pub(crate) const MAX_TINY: usize = 2 * (LARGE_ROUNDS + SMALL_ROUNDS + 1);

/// A unit: its box in metres while it is in a large part, then in cells of the grid of its first
/// small part, and its flux.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Item {
    low: [f32; 3],
    high: [f32; 3],
    flux: u32,
}

impl Item {
    /// The centre of its box along an axis.
    fn centre(&self, axis: usize) -> f32 {
        (self.low[axis] + self.high[axis]) * 0.5
    }
}

/// A part of a piece: consecutive places of its order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PiecePart {
    pub first: usize,
    pub count: usize,
    /// The bits of its cost on the grid of the piece; 0 for a part of at most [`WIDTH`] units.
    pub cost: u32,
    /// The indices of the two parts that it was cut into. `None` for a part of at most [`WIDTH`]
    /// units.
    pub halves: Option<[usize; 2]>,
    /// See [`ChildGroup::is_tiny`].
    pub is_tiny: bool,
}

impl PiecePart {
    const fn new(first: usize, count: usize) -> Self {
        Self { first, count, cost: 0, halves: None, is_tiny: false }
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
        self.is_tiny
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
    /// Splits units until no part holds more than [`WIDTH`] of them. Only parts of more than
    /// `tiny_above` units may count as tiny. O(n log n).
    pub fn new<'a>(units: impl ExactSizeIterator<Item = &'a Cluster> + Clone, tiny_above: usize) -> Self {
        let mut items = items(units);
        let mut order: Vec<usize> = (0..items.len()).collect();
        let mut parts = vec![PiecePart::new(0, items.len())];
        let whole = Sums::of_all(&items, &order);
        let piece_power = whole.power();
        let mut states = vec![PartState { range: whole, power: piece_power, round: 0, most: u32::MAX }];
        let mut place = 0;
        while place < parts.len() {
            let PiecePart { first, count, .. } = parts[place];
            if count > WIDTH {
                let part = &mut order[first..first + count];
                let PartState { mut range, mut power, round, most } = states[place];
                let cut = if count > SMALL {
                    power = range.power();
                    cut_large(&items, part, &range, round < LARGE_ROUNDS)
                } else {
                    if round == 0 {
                        (range, power) = round_to_cells(&mut items, part);
                    }
                    cut_small(&items, part, &range, round < SMALL_ROUNDS)
                };
                // A finer grid may show a size that a coarser one hides.
                let zoom = power_of_two(2 * (piece_power - power).clamp(-MAX_ZOOM, 0));
                let cost = (cut.cost * zoom).to_bits().min(most);
                parts[place].cost = cost;
                parts[place].halves = Some([parts.len(), parts.len() + 1]);
                let left = cut.left;
                let halves = [PiecePart::new(first, left), PiecePart::new(first + left, count - left)];
                let extent = range.longest().1;
                for (mut half, range) in halves.into_iter().zip(cut.ranges) {
                    half.is_tiny = half.count > tiny_above && range.longest().1 * TINY_SHARE < extent;
                    let round = if (half.count > SMALL) == (count > SMALL) { round + 1 } else { 0 };
                    parts.push(half);
                    states.push(PartState { range, power, round, most: cost });
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

/// What a part takes from the part that it was cut from.
#[derive(Clone, Copy)]
struct PartState {
    /// A box around its units, in metres or, once these are rounded, in cells.
    range: Sums,
    /// Cells per metre, as a power of two.
    power: i32,
    /// The number of cuts of its kind that it comes from.
    round: usize,
    /// The greatest cost that it may have.
    most: u32,
}

/// Units with their boxes in metres, and fluxes on the scale of their piece.
fn items<'a>(units: impl ExactSizeIterator<Item = &'a Cluster> + Clone) -> Vec<Item> {
    let most = units.clone().map(|unit| unit.flux).fold(0.0, f32::max);
    let per_flux = power_of_two(FLUX_BITS as i32 - 1 - exponent(most));
    let flux = |unit: &Cluster| ((unit.flux * per_flux) as u32).max(1);
    units.map(|unit| Item { low: unit.aabb.min.into(), high: unit.aabb.max.into(), flux: flux(unit) }).collect()
}

/// Rounds the units of a part to the grid over their box. Returns that box in cells, and the power of
/// two of cells per metre.
fn round_to_cells(items: &mut [Item], part: &[usize]) -> (Sums, i32) {
    let whole = Sums::of_all(items, part);
    let power = whole.power();
    let cell = |p: f32, k: usize| ((p - whole.low[k]) * power_of_two(power)).trunc();
    for unit in part {
        let Item { low, high, .. } = &mut items[*unit];
        for k in 0..3 {
            (low[k], high[k]) = (cell(low[k], k), cell(high[k], k));
        }
    }
    (Sums::of_all(items, part), power)
}

/// The box and the summed flux of some items.
#[derive(Clone, Copy)]
struct Sums {
    low: [f32; 3],
    high: [f32; 3],
    flux: u32,
    count: usize,
}

impl Sums {
    const EMPTY: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3], flux: 0, count: 0 };

    fn of(item: &Item) -> Self {
        Self { low: item.low, high: item.high, flux: item.flux, count: 1 }
    }

    fn of_all(items: &[Item], part: &[usize]) -> Self {
        part.iter().fold(Self::EMPTY, |all, unit| all.and(&Self::of(&items[*unit])))
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
    fn longest(&self) -> (usize, f32) {
        let extent = [0, 1, 2].map(|k| self.high[k] - self.low[k]);
        let axis = usize::from(extent[1] > extent[0]);
        let axis = if extent[2] > extent[axis] { 2 } else { axis };
        (axis, extent[axis])
    }

    /// The power of two of cells per metre with which the box has as many cells as there are.
    fn power(&self) -> i32 {
        CELL_BITS as i32 - 1 - exponent(self.longest().1)
    }

    /// The cost, with lengths in pairs of cells, of which a unit of length has `cells`. It has no
    /// meaning for no items.
    #[inline(always)]
    fn cost(&self, cells: f32) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|k| (((self.high[k] - self.low[k]) * cells) as u32).div_ceil(2));
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
fn cost_of_cut(left: &Sums, right: &Sums, cells: f32) -> Option<u32> {
    let fills = fills_nodes(left.count) && fills_nodes(right.count);
    fills.then(|| (left.cost(cells) + right.cost(cells)).to_bits() >> COST_SLACK)
}

/// A part that has been cut.
struct PartCut {
    /// The cost of the part on its grid.
    cost: f32,
    /// The number of units on the left.
    left: usize,
    /// A box around each half.
    ranges: [Sums; 2],
}

/// Cuts a part at the border between two bins where the cut costs least; of equal cuts it takes the
/// first. Halves the part if no cut fills nodes on both sides, or if `may_bin` is false. Moves the left
/// side to the front and keeps the order within each side. The bins divide `range`, a box around the
/// part.
fn cut_large(items: &[Item], part: &mut [usize], range: &Sums, may_bin: bool) -> PartCut {
    let (axis, extent) = range.longest();
    let cells = power_of_two(range.power());
    let cell = |unit: usize| ((items[unit].centre(axis) - range.low[axis]) * cells) as u32;
    let bin_of = |unit: usize| (cell(unit) * BINS as u32 / ((extent * cells) as u32 + 1)) as usize;
    let mut bins = [Sums::EMPTY; BINS];
    for unit in part.iter() {
        let bin = &mut bins[bin_of(*unit)];
        *bin = bin.and(&Sums::of(&items[*unit]));
    }
    // `from[b]` has the sums of bin b and all after it.
    let mut from = bins;
    for bin in (0..BINS - 1).rev() {
        from[bin] = from[bin + 1].and(&bins[bin]);
    }
    let mut best = (u32::MAX, 0, [from[0]; 2]);
    let mut to = Sums::EMPTY;
    for bin in 0..BINS - 1 {
        to = to.and(&bins[bin]);
        if let Some(cost) = cost_of_cut(&to, &from[bin + 1], cells).filter(|cost| *cost < best.0) {
            best = (cost, bin, [to, from[bin + 1]]);
        }
    }
    let cost = from[0].cost(cells);
    if best.0 == u32::MAX || !may_bin {
        return PartCut { cost, left: middle(part.len()), ranges: [from[0]; 2] };
    }
    let (_, last, ranges) = best;
    PartCut { cost, left: partition(part, |_, unit| bin_of(unit) <= last), ranges }
}

/// Cuts a small part after the unit where the cut costs least, as [`cut_large`] does. Its units are
/// in cells.
fn cut_small(items: &[Item], part: &mut [usize], range: &Sums, may_search: bool) -> PartCut {
    let (axis, _) = range.longest();
    let count = part.len();
    let centre = |unit: usize| items[unit].centre(axis) as u32;
    // The units' centres and places in the part, in the order of the centres.
    let mut sorted = [(0, 0); SMALL];
    let sorted = &mut sorted[..count];
    for (place, unit) in part.iter().enumerate() {
        sorted[place] = (centre(*unit), place);
    }
    sorted.sort_unstable();
    let mut from = [Sums::EMPTY; SMALL + 1];
    for rank in (0..count).rev() {
        from[rank] = from[rank + 1].and(&Sums::of(&items[part[sorted[rank].1]]));
    }
    let mut best = (u32::MAX, 0, [*range; 2]);
    let mut to = Sums::EMPTY;
    for rank in 0..count {
        let place = sorted[rank].1;
        to = to.and(&Sums::of(&items[part[place]]));
        if let Some(cost) = cost_of_cut(&to, &from[rank + 1], 1.0)
            && (cost, place) < (best.0, best.1)
        {
            best = (cost, place, [to, from[rank + 1]]);
        }
    }
    let cost = from[0].cost(1.0);
    if best.0 == u32::MAX || !may_search {
        return PartCut { cost, left: middle(count), ranges: [*range; 2] };
    }
    let (_, last, ranges) = best;
    let border = (centre(part[last]), last);
    PartCut { cost, left: partition(part, |place, unit| (centre(unit), place) <= border), ranges }
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
