//! Groups neighbours: a piece of at most [`PIECE`] units is split in two, and again, until no part holds more than a
//! node.
//!
//! Twin of `shaders/top_split.wgsl`. Based on CK18 4.2-4.4. Differs: each cut is tried by itself, since one invocation
//! can do that without memory for bins; units are rounded to a grid of the piece (16 bits an axis, box and mean; 8 bits
//! of flux and of each coordinate of direction), so that a piece fits into a workgroup's 16 KiB and both sides choose
//! the same cuts, but where two cost the same to 1 part in 8192.

use crate::cluster::Cluster;
use crate::curve::{exponent, power_of_two};
use crate::light::LAMBERTIAN;
use crate::tree::{DIAGONAL_WEIGHT, WIDTH, fills_nodes, middle};

/// Cuts that are tried along each axis, evenly spaced; of so few units or less all that there are. Cuts through as many
/// units instead, however they lie, are noisier (docs/decisions.md, 4).
pub(crate) const CUTS: usize = 16;
/// After so many rounds parts are halved: no chain of ever smaller parts goes on for long.
pub(crate) const ROUNDS: usize = 12;
/// The greatest coordinate of a piece's grid.
pub(crate) const LAST_CELL: u32 = 0xffff;
/// Bits of a cost that are not compared: what rounding may change, on either side.
pub(crate) const COST_SLACK: u32 = 10;
/// Bits of a cut's number.
pub(crate) const CUT_BITS: u32 = (3 * CUTS).ilog2() + 1;
/// The least orientation of a cost; see `tree/shape/group.rs`.
pub(crate) const MIN_ORIENTATION: f32 = 1.0 / 256.0;
/// Steps of a coordinate of a unit's mean direction.
pub(crate) const AXIS_STEPS: f32 = 127.0;

/// One unit on its piece's grid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Item {
    low: [u32; 3],
    high: [u32; 3],
    mean: [u32; 3],
    flux: f32,
    /// Flux times mean direction.
    power: [f32; 3],
}

/// Part of a piece: consecutive places of its order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub first: usize,
    pub count: usize,
    /// Bits of its cost; 0 for the whole piece.
    pub cost: u32,
    /// What it was split into: places of the list of parts.
    pub halves: Option<[usize; 2]>,
}

/// A piece that was split.
pub(super) struct Split {
    /// The units' numbers, in the order of the parts.
    pub order: Vec<usize>,
    /// The whole piece first; halves after what they are halves of.
    pub parts: Vec<Part>,
}

/// Splits units until no part holds more than [`WIDTH`].
pub(super) fn split<'a>(units: impl ExactSizeIterator<Item = &'a Cluster> + Clone) -> Split {
    let items = items(units);
    let mut order: Vec<usize> = (0..items.len()).collect();
    let mut parts = vec![Part { first: 0, count: items.len(), cost: 0, halves: None }];
    let mut round = 0;
    let mut begin = 0;
    while begin < parts.len() {
        let end = parts.len();
        for place in begin..end {
            let Part { first, count, .. } = parts[place];
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
                parts.push(Part { first, count: left, cost: costs[0], halves: None });
                parts.push(Part { first: first + left, count: count - left, cost: costs[1], halves: None });
            }
        }
        begin = end;
        round += 1;
    }
    Split { order, parts }
}

/// Rounds units to the grid of them all.
fn items<'a>(units: impl ExactSizeIterator<Item = &'a Cluster> + Clone) -> Vec<Item> {
    let (mut min, mut max, mut most) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3], 0.0_f32);
    for unit in units.clone() {
        for k in 0..3 {
            min[k] = min[k].min(unit.aabb.min[k]);
            max[k] = max[k].max(unit.aabb.max[k]);
        }
        most = most.max(unit.flux);
    }
    let longest = (max[0] - min[0]).max(max[1] - min[1]).max(max[2] - min[2]);
    // Powers of two, so that products are exact: the extent gets below 2^16, the flux below 2.
    let cells = power_of_two(15 - exponent(longest));
    let per_flux = power_of_two(-exponent(most));
    let item = |unit: &Cluster| {
        let cell = |p: f32, k: usize| (((p - min[k]) * cells) as u32).min(LAST_CELL);
        // The upper half of a float, as it is stored in half a word.
        let flux = f32::from_bits((unit.flux * per_flux).to_bits() & 0xffff_0000);
        let step = |v: f32| (v * AXIS_STEPS) as i32 as f32 * (1.0 / AXIS_STEPS);
        Item {
            low: [0, 1, 2].map(|k| cell(unit.aabb.min[k], k)),
            high: [0, 1, 2].map(|k| cell(unit.aabb.max[k], k)),
            mean: [0, 1, 2].map(|k| cell(unit.mean[k], k)),
            flux,
            power: [0, 1, 2].map(|k| flux * step(unit.axis[k])),
        }
    };
    units.map(item).collect()
}

/// Box and flux of some items.
#[derive(Clone, Copy)]
struct Sums {
    low: [u32; 3],
    high: [u32; 3],
    flux: f32,
    power: [f32; 3],
}

impl Sums {
    const EMPTY: Self = Self { low: [LAST_CELL; 3], high: [0; 3], flux: 0.0, power: [0.0; 3] };

    #[inline(always)]
    fn add(&mut self, item: &Item) {
        for k in 0..3 {
            self.low[k] = self.low[k].min(item.low[k]);
            self.high[k] = self.high[k].max(item.high[k]);
            self.power[k] += item.power[k];
        }
        self.flux += item.flux;
    }

    /// As `costs` in `tree/shape/group.rs`, for one group and in cells.
    #[inline(always)]
    fn cost(&self) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|k| self.high[k].saturating_sub(self.low[k]) as f32);
        let size = x * y + y * z + z * x + DIAGONAL_WEIGHT * (x * x + y * y + z * z);
        let [a, b, c] = self.power;
        let axis = (a * a + b * b + c * c).sqrt();
        let wide = 4.0 * self.flux - (3.0 / LAMBERTIAN) * axis;
        let narrow = 3.0 * (self.flux - axis);
        size * wide.max(narrow).max(MIN_ORIENTATION * self.flux)
    }
}

fn cost_of(items: &[Item], places: &[usize]) -> f32 {
    let mut sums = Sums::EMPTY;
    places.iter().for_each(|place| sums.add(&items[*place]));
    sums.cost()
}

/// A cut of a part.
#[derive(Clone, Copy)]
struct Cut {
    axis: usize,
    /// The last cell of the left side.
    border: u32,
    /// The last place of the left side among those in that cell.
    end: usize,
}

impl Cut {
    fn new(items: &[Item], part: &[usize], axis: usize, [low, high]: [u32; 2], number: usize) -> Self {
        if part.len() > CUTS {
            let border = low + (high - low) * (number as u32 + 1) / (CUTS as u32 + 1);
            Self { axis, border, end: part.len() }
        } else {
            Self { axis, border: items[part[number]].mean[axis], end: number }
        }
    }

    /// Whether the unit at a place of the part is on the left.
    #[inline(always)]
    fn is_left(&self, item: &Item, place: usize) -> bool {
        item.mean[self.axis] < self.border || item.mean[self.axis] == self.border && place <= self.end
    }
}

/// The cheapest cut, of equals the first. `None` if no cut leaves counts that fill nodes.
fn best_cut(items: &[Item], part: &[usize]) -> Option<Cut> {
    let (mut low, mut high) = ([LAST_CELL; 3], [0; 3]);
    for place in part {
        for k in 0..3 {
            low[k] = low[k].min(items[*place].mean[k]);
            high[k] = high[k].max(items[*place].mean[k]);
        }
    }
    let extent = [0, 1, 2].map(|k| high[k] - low[k]);
    let longest = extent[0].max(extent[1]).max(extent[2]);
    let of = |number: usize| {
        let axis = number / CUTS;
        Cut::new(items, part, axis, [low[axis], high[axis]], number % CUTS)
    };
    let mut best = u32::MAX;
    for axis in (0..3).filter(|axis| extent[*axis] > 0) {
        // How much longer the longest axis is: thin slices are worse than their area says; CK18 equation 3.
        let stretch = longest as f32 / extent[axis] as f32;
        for number in (axis * CUTS..).take(part.len().min(CUTS)) {
            let cut = of(number);
            let mut sides = [Sums::EMPTY; 2];
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
    (best < u32::MAX).then(|| of(number))
}

/// Moves the left side to the front, each side in the order at hand; returns how many are left.
fn partition(items: &[Item], part: &mut [usize], cut: &Cut) -> usize {
    let before = part.to_vec();
    let is_left = |place: &usize| cut.is_left(&items[before[*place]], *place);
    let left = (0..before.len()).filter(is_left);
    let right = (0..before.len()).filter(|place| !is_left(place));
    let count = left.clone().count();
    part.iter_mut().zip(left.chain(right)).for_each(|(unit, place)| *unit = before[place]);
    count
}
