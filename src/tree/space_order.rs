//! An order of the lights of a placeholder. Neighbours in this order are neighbours in space.
//!
//! Based on Bentley, Multidimensional Binary
//! Search Trees Used for Associative Searching (1975): space is divided by planes, and each bit of a
//! key tells on which side of a plane a position lies. Differs:
//!
//! - Only the first planes are medians, those of a sample. So no border of the world decides where
//!   they are. The others halve boxes, as along a Morton curve.
//! - Boxes are halved in codes of positions, of which most belong to the middle of the sample.
//! - A cell is divided across the axis along which the middle half of its sample is longest, so that a
//!   lamp far away does not stretch it.
//!
//! A Gray code in place of this order was tried and gained nothing beyond what another sample changes.

use glam::Vec3;

use crate::cluster::bounds::Aabb;

/// Bits of a key.
pub(crate) const KEY_BITS: u32 = 31;

/// Positions of which the medians are taken: one for each invocation of a workgroup.
pub(crate) const SAMPLES: usize = 256;

/// Levels of positions, of which four together have about half as many as the four below them. The
/// sample has the highest levels, so it does not depend on the order of the positions.
pub(crate) const LEVELS: u32 = 96;

/// The greatest number of positions of a level of the sample. A fifth of the sample is expected.
pub(crate) const LEVEL_SAMPLES: usize = 96;

/// Bits of a key that come from medians. More leave too few samples for each plane.
pub(crate) const PLANE_BITS: u32 = 5;

/// The axis of a plane that halves the box of its cell instead.
pub(crate) const NO_AXIS: usize = 3;

/// The coordinates of a position, as whole numbers in an order that keeps that of the positions.
type Code = [u32; 3];

/// A map of positions to codes. It is linear around the middle of a sample. Farther away, each doubling
/// of the distance has as many codes, so a lamp far away leaves many to a town.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Lens {
    middle: Vec3,
    /// One over a length, as a power of two.
    power: f32,
}

/// The code of the middle.
const MIDDLE: u32 = 1 << 30;

/// Middle halves shorter than two to this power, in metres, count as this long, so that no distance
/// overflows.
pub(crate) const LEAST_LENGTH: i32 = -40;

impl Lens {
    /// The lens over the middle half of some samples.
    fn new(half: &Aabb) -> Self {
        let extent = half.extent();
        let length = exponent(extent[longest(extent.to_array())]).max(LEAST_LENGTH);
        Self { middle: (half.min + half.max) * 0.5, power: power_of_two(-1 - length) }
    }

    fn code(&self, position: Vec3) -> Code {
        ((position - self.middle) * self.power).to_array().map(|t| {
            // The bits of a number of at least 1 count doublings, and are linear between them.
            let steps = (t.abs() + 1.0).to_bits() - 1.0_f32.to_bits();
            if t < 0.0 { MIDDLE - steps } else { MIDDLE + steps }
        })
    }
}

/// A plane across an axis, or [`NO_AXIS`].
#[derive(Clone, Copy, Debug, PartialEq)]
struct Plane {
    axis: usize,
    at: u32,
}

/// An order of positions in a box.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SpaceOrder {
    lens: Lens,
    /// The box of all positions.
    low: Code,
    high: Code,
    /// The first planes: the root at 1, and the planes below plane n at 2 n and 2 n + 1.
    planes: [Plane; 1 << PLANE_BITS],
}

impl SpaceOrder {
    /// The order for positions that are later cut into `pieces` equal pieces. Each comes with its
    /// identity, which decides whether it is in the sample. O(positions).
    pub fn new(positions: impl Iterator<Item = (u32, Vec3)> + Clone, pieces: usize) -> Self {
        let mut samples = sample(positions.clone());
        let lens = Lens::new(&middle_half(&samples));
        let bounds = Aabb::around(positions.map(|(_, position)| position));
        let mut planes = [Plane { axis: NO_AXIS, at: 0 }; 1 << PLANE_BITS];
        for level in 0..PLANE_BITS {
            for cell in 0..1 << level {
                let rank = |cell: usize, level: u32| first_sample(samples.len(), pieces, cell, level);
                let (first, end) = (rank(cell, level), rank(cell + 1, level));
                let border = rank(2 * cell + 1, level + 1);
                if first < border && border < end {
                    planes[(1 << level) + cell] = median(&mut samples[first..end], border - first, &lens);
                }
            }
        }
        Self { lens, low: lens.code(bounds.min), high: lens.code(bounds.max), planes }
    }

    /// The place of a position in the order, below 2^31.
    pub fn key(&self, position: Vec3) -> u32 {
        let (mut low, mut high) = (self.low, self.high);
        let position = self.lens.code(position);
        let (mut cell, mut key) = (1, 0);
        for _ in 0..KEY_BITS {
            let mut plane = if cell < self.planes.len() { self.planes[cell] } else { Plane { axis: NO_AXIS, at: 0 } };
            if plane.axis == NO_AXIS {
                let axis = longest([0, 1, 2].map(|k| high[k].saturating_sub(low[k])));
                plane = Plane { axis, at: low[axis] + high[axis].saturating_sub(low[axis]).div_ceil(2) };
            }
            let Plane { axis, at } = plane;
            let is_above = position[axis] >= at;
            if is_above {
                low[axis] = at
            } else {
                high[axis] = at
            }
            if cell < self.planes.len() {
                cell = 2 * cell + usize::from(is_above);
            }
            key = key << 1 | u32::from(is_above);
        }
        key
    }
}

/// At most [`SAMPLES`] of these positions, all of them if there are no more. Positions that have the
/// same identities give the same sample, in whatever order they come.
fn sample(positions: impl Iterator<Item = (u32, Vec3)> + Clone) -> Vec<Vec3> {
    // From the leading zeros of a hash, and the two bits after the first one.
    let level = |identity: u32| {
        let hash = hash(identity) | 0x1ff;
        let zeros = hash.leading_zeros();
        (4 * zeros + 3 - (hash << zeros >> 29 & 3)) as usize
    };
    let mut counts = [0; LEVELS as usize];
    positions.clone().for_each(|(identity, _)| counts[level(identity)] += 1);
    // The highest levels that are no more together.
    let (mut least, mut count) = (counts.len(), 0);
    while least > 0 && counts[least - 1] <= LEVEL_SAMPLES && count + counts[least - 1] <= SAMPLES {
        least -= 1;
        count += counts[least];
    }
    positions.filter(|(identity, _)| level(*identity) >= least).map(|(_, position)| position).collect()
}

/// A hash of a number: PCG of Jarzynski and Olano, Hash Functions for GPU Rendering (2020).
fn hash(number: u32) -> u32 {
    let state = number.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// The first of `samples` samples in a cell of a level. Cells are cut where pieces are.
fn first_sample(samples: usize, pieces: usize, cell: usize, level: u32) -> usize {
    ((cell * pieces) >> level) * samples / pieces.max(1)
}

/// For each axis the range of the middle half of some samples.
fn middle_half(samples: &[Vec3]) -> Aabb {
    let mut half = Aabb::point(Vec3::ZERO);
    for axis in 0..3 {
        let mut sorted: Vec<f32> = samples.iter().map(|at| at[axis]).collect();
        sorted.sort_by(f32::total_cmp);
        let quarter = sorted.len() / 4;
        if let (Some(low), Some(high)) = (sorted.get(quarter), sorted.iter().nth_back(quarter)) {
            (half.min[axis], half.max[axis]) = (*low, *high);
        }
    }
    half
}

/// Sorts samples along the axis along which their middle half is longest in codes, and returns the plane
/// before the sample at `middle`.
fn median(samples: &mut [Vec3], middle: usize, lens: &Lens) -> Plane {
    let half = middle_half(samples);
    let (low, high) = (lens.code(half.min), lens.code(half.max));
    let axis = longest([0, 1, 2].map(|axis| high[axis] - low[axis]));
    let from = |axis: usize, a: &Vec3, b: &Vec3| a[axis].total_cmp(&b[axis]);
    samples.sort_by(|a, b| {
        let [second, third] = [(axis + 1) % 3, (axis + 2) % 3];
        from(axis, a, b).then(from(second, a, b)).then(from(third, a, b))
    });
    let [below, above] = [samples[middle - 1], samples[middle]].map(|at| lens.code(at)[axis]);
    Plane { axis, at: below + (above - below).div_ceil(2) }
}

/// The axis of the longest extent, of equals the first.
fn longest<T: PartialOrd + Copy>(extent: [T; 3]) -> usize {
    let axis = usize::from(extent[1] > extent[0]);
    if extent[2] > extent[axis] { 2 } else { axis }
}

/// The exponent e of a positive number in [2^e, 2^(e + 1)). -127 for zero and denormal numbers.
pub(crate) fn exponent(x: f32) -> i32 {
    (x.to_bits() >> 23) as i32 - 127
}

/// 2^e, or the nearest power of two that is a normal number.
pub(crate) fn power_of_two(e: i32) -> f32 {
    f32::from_bits(((e.clamp(-126, 127) + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(positions: &[Vec3]) -> SpaceOrder {
        SpaceOrder::new((0..).zip(positions.iter().copied()), positions.len().div_ceil(256))
    }

    /// Positions in a square of a kilometre.
    fn square(count: u32) -> Vec<Vec3> {
        let unit = |n: u32| hash(n) as f32 / u32::MAX as f32;
        (0..count).map(|i| Vec3::new(unit(2 * i), 0.0, unit(2 * i + 1)) * 1000.0).collect()
    }

    /// The mean half perimeter of the boxes of runs of 128 positions.
    fn mean_extent(positions: &[Vec3], order: &SpaceOrder) -> f32 {
        let mut sorted = positions.to_vec();
        sorted.sort_by_key(|position| order.key(*position));
        let runs = sorted.chunks_exact(128).map(|run| Aabb::around(run.iter().copied()).extent());
        runs.clone().map(|extent| extent.x + extent.z).sum::<f32>() / runs.count() as f32
    }

    #[test]
    fn a_lamp_anywhere_leaves_the_cells_of_a_town_as_they_are() {
        let town = square(8192);
        // 64 squares of 125 m.
        let alone = mean_extent(&town, &order(&town));
        assert!((250.0..450.0).contains(&alone), "{alone}");
        for distance in [1010.0, 1024.0, 1100.0, 2000.0, 1.0e5, 1.0e9] {
            for direction in [Vec3::X, -Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE] {
                let mut with = town.clone();
                with.push(direction * distance);
                let with = mean_extent(&town, &order(&with));
                assert!(with < 1.2 * alone, "{direction} {distance}: {with}, alone {alone}");
            }
        }
    }

    #[test]
    fn keys_have_31_bits_for_boxes_of_any_shape_and_increase_along_a_street() {
        for size in
            [Vec3::ZERO, Vec3::X, Vec3::splat(1.0e9), Vec3::new(1.0e-30, 1.0e9, 3.0), Vec3::new(1.0, 2.0, 1.0e-40)]
        {
            let at = [Vec3::ZERO, 0.5 * size, size];
            assert!(at.iter().all(|position| order(&at).key(*position) < 1 << KEY_BITS), "{size}");
        }
        assert!(order(&[]).key(Vec3::ONE) < 1 << KEY_BITS);
        // Along a street the order is the street, up to the resolution of its bits.
        let street: Vec<Vec3> = (0..=100_000).map(|i| Vec3::Z * (i as f32 * 0.01)).collect();
        let order = order(&street);
        let keys: Vec<_> = street.iter().map(|position| order.key(*position)).collect();
        assert!(keys.is_sorted() && keys.windows(2).all(|k| k[0] < k[1]));
    }
}
