//! Splits a piece of neighbouring units in two, and its parts again, until no part holds more units
//! than a node.
//!
//! Twin of `shaders/top_split.wgsl`. Based on CK18 4.2-4.4. Differs:
//!
//! - Each cut is tried on its own, which one invocation can do without memory for bins.
//! - Units are rounded to a grid of the piece: 16 bits per axis for box and mean, 8 bits for the
//!   flux and for each coordinate of the direction. So a piece fits into a workgroup's 16 KiB.
//! - Costs are compared to 1 part in 8192, and cuts of equal cost by number. So CPU and GPU choose
//!   the same cuts, except where two costs agree to about that.

use crate::cluster::Cluster;
use crate::curve::{exponent, power_of_two};
use crate::tree::{ChildGroup, WIDTH, build_cost, build_size, fills_nodes, middle};

/// Cuts that are tried along each axis, evenly spaced in space. Up to this many units, all cuts are
/// tried. Cuts that are evenly spaced in the number of units are noisier (docs/decisions.md, 4).
pub(crate) const CUTS: usize = 16;
/// After this many rounds, parts are split into halves. This bounds chains of ever smaller parts.
pub(crate) const ROUNDS: usize = 12;
/// The greatest coordinate of a piece's grid.
pub(crate) const LAST_CELL: u32 = 0xffff;
/// The lowest bits of a cost, which rounding on either side may change. They are not compared.
pub(crate) const COST_SLACK: u32 = 10;
/// Bits of a cut's number.
pub(crate) const CUT_BITS: u32 = (3 * CUTS).ilog2() + 1;
/// Steps of a coordinate of a unit's mean direction.
pub(crate) const AXIS_STEPS: f32 = 127.0;

/// A unit on the grid of its piece.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct GridItem {
    low: [u32; 3],
    high: [u32; 3],
    mean: [u32; 3],
    flux: f32,
    /// Flux times mean direction.
    power: [f32; 3],
}

/// A part of a piece: consecutive places of its order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PiecePart {
    pub first: usize,
    pub count: usize,
    /// The bits of its cost; 0 for the whole piece.
    pub cost: u32,
    /// The indices of the two parts that it was split into. `None` for a part of at most [`WIDTH`]
    /// units.
    pub halves: Option<[usize; 2]>,
}

impl ChildGroup for PiecePart {
    type Cost = u32;

    fn count(&self) -> usize {
        self.count
    }

    fn cost(&self) -> u32 {
        self.cost >> COST_SLACK
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

/// Splits units until no part holds more than [`WIDTH`] of them.
pub(super) fn split<'a>(units: impl ExactSizeIterator<Item = &'a Cluster> + Clone) -> SplitPiece {
    let items = items(units);
    let mut order: Vec<usize> = (0..items.len()).collect();
    let mut parts = vec![PiecePart { first: 0, count: items.len(), cost: 0, halves: None }];
    let mut round = 0;
    let mut begin = 0;
    while begin < parts.len() {
        let end = parts.len();
        for place in begin..end {
            let PiecePart { first, count, .. } = parts[place];
            if count > WIDTH {
                let part = &mut order[first..first + count];
                let cut = if round < ROUNDS { best_cut(&items, part) } else { None };
                let left = match cut {
                    Some(cut) => partition(&items, part, &cut),
                    None => middle(count),
                };
                let cost = |places: &[usize]| cost_of(&items, places).to_bits();
                let costs = [cost(&part[..left]), cost(&part[left..])];
                parts[place].halves = Some([parts.len(), parts.len() + 1]);
                parts.push(PiecePart { first, count: left, cost: costs[0], halves: None });
                parts.push(PiecePart { first: first + left, count: count - left, cost: costs[1], halves: None });
            }
        }
        begin = end;
        round += 1;
    }
    SplitPiece { order, parts }
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
    // Powers of two keep products exact. The extent gets below 2^16 cells, the flux below 2.
    let cells = power_of_two(15 - exponent(longest));
    let per_flux = power_of_two(-exponent(most));
    let item = |unit: &Cluster| {
        let cell = |p: f32, k: usize| (((p - min[k]) * cells) as u32).min(LAST_CELL);
        // The GPU stores the upper half of the float, in half a word.
        let flux = f32::from_bits((unit.flux * per_flux).to_bits() & 0xffff_0000);
        let step = |v: f32| (v * AXIS_STEPS) as i32 as f32 * (1.0 / AXIS_STEPS);
        GridItem {
            low: [0, 1, 2].map(|k| cell(unit.aabb.min[k], k)),
            high: [0, 1, 2].map(|k| cell(unit.aabb.max[k], k)),
            mean: [0, 1, 2].map(|k| cell(unit.mean[k], k)),
            flux,
            power: [0, 1, 2].map(|k| flux * step(unit.axis[k])),
        }
    };
    units.map(item).collect()
}

/// The box and the summed flux of some items.
#[derive(Clone, Copy)]
struct GridSums {
    low: [u32; 3],
    high: [u32; 3],
    flux: f32,
    power: [f32; 3],
}

impl GridSums {
    const EMPTY: Self = Self { low: [LAST_CELL; 3], high: [0; 3], flux: 0.0, power: [0.0; 3] };

    #[inline(always)]
    fn add(&mut self, item: &GridItem) {
        for k in 0..3 {
            self.low[k] = self.low[k].min(item.low[k]);
            self.high[k] = self.high[k].max(item.high[k]);
            self.power[k] += item.power[k];
        }
        self.flux += item.flux;
    }

    /// The cost, with lengths in cells.
    #[inline(always)]
    fn cost(&self) -> f32 {
        let edges = [0, 1, 2].map(|k| self.high[k].saturating_sub(self.low[k]) as f32);
        build_cost(build_size(edges), self.power, self.flux)
    }
}

fn cost_of(items: &[GridItem], places: &[usize]) -> f32 {
    let mut sums = GridSums::EMPTY;
    places.iter().for_each(|place| sums.add(&items[*place]));
    sums.cost()
}

/// A cut of a part in two.
#[derive(Clone, Copy)]
struct PieceCut {
    axis: usize,
    /// The last cell of the left side.
    border: u32,
    /// The last place of the part whose unit, if it is in that cell, belongs to the left side.
    end: usize,
}

impl PieceCut {
    fn new(items: &[GridItem], part: &[usize], axis: usize, [low, high]: [u32; 2], number: usize) -> Self {
        if part.len() > CUTS {
            let border = low + (high - low) * (number as u32 + 1) / (CUTS as u32 + 1);
            Self { axis, border, end: part.len() }
        } else {
            Self { axis, border: items[part[number]].mean[axis], end: number }
        }
    }

    /// Whether the unit at a place of the part belongs to the left side.
    #[inline(always)]
    fn is_left(&self, item: &GridItem, place: usize) -> bool {
        item.mean[self.axis] < self.border || item.mean[self.axis] == self.border && place <= self.end
    }
}

/// The cut of the least cost; of equals the first. `None` if no cut leaves counts that fill nodes
/// on both sides.
fn best_cut(items: &[GridItem], part: &[usize]) -> Option<PieceCut> {
    let (mut low, mut high) = ([LAST_CELL; 3], [0; 3]);
    for place in part {
        for k in 0..3 {
            low[k] = low[k].min(items[*place].mean[k]);
            high[k] = high[k].max(items[*place].mean[k]);
        }
    }
    let extent = [0, 1, 2].map(|k| high[k] - low[k]);
    let longest = extent[0].max(extent[1]).max(extent[2]);
    let cut_of = |number: usize| {
        let axis = number / CUTS;
        PieceCut::new(items, part, axis, [low[axis], high[axis]], number % CUTS)
    };
    let mut best = u32::MAX;
    for axis in (0..3).filter(|axis| extent[*axis] > 0) {
        // Thin slices are worse than their area tells (CK18 equation 3).
        let stretch = longest as f32 / extent[axis] as f32;
        for number in (axis * CUTS..).take(part.len().min(CUTS)) {
            let cut = cut_of(number);
            let mut sides = [GridSums::EMPTY; 2];
            let mut left = 0;
            for (place, unit) in part.iter().enumerate() {
                let is_left = cut.is_left(&items[*unit], place);
                sides[usize::from(!is_left)].add(&items[*unit]);
                left += usize::from(is_left);
            }
            if left < part.len() && fills_nodes(left) && fills_nodes(part.len() - left) {
                let cost = stretch * (sides[0].cost() + sides[1].cost());
                best = best.min((cost.to_bits() >> COST_SLACK) << CUT_BITS | number as u32);
            }
        }
    }
    let number = (best & ((1 << CUT_BITS) - 1)) as usize;
    (best < u32::MAX).then(|| cut_of(number))
}

/// Moves the left side to the front, with each side in its former order. Returns the number of
/// units on the left.
fn partition(items: &[GridItem], part: &mut [usize], cut: &PieceCut) -> usize {
    let before = part.to_vec();
    let is_left = |place: &usize| cut.is_left(&items[before[*place]], *place);
    let left = (0..before.len()).filter(is_left);
    let right = (0..before.len()).filter(|place| !is_left(place));
    let count = left.clone().count();
    part.iter_mut().zip(left.chain(right)).for_each(|(unit, place)| *unit = before[place]);
    count
}
