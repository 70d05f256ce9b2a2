//! A curve through the parts of instances, or through the lights of a placeholder. Neighbours on
//! the curve are neighbours in space.
//!
//! Twin of `shaders/top_curve.wgsl`. This is a Hilbert curve over cubic cells, after Skilling,
//! Programming the Hilbert Curve (2004). Differs: while one extent is far longer than the others,
//! the curve has one dimension, and while two are, it has two. So it spends no bits on the height
//! of a flat city. It uses only subtraction, powers of two and integers, so the GPU gets the same
//! bits.

use glam::Vec3;

use crate::cluster::bounds::Aabb;

/// Bits of a key. One more bit is left for [`NO_KEY`], which sorts after all keys.
pub(crate) const KEY_BITS: u32 = 31;

/// The key of a slot without a shining instance.
pub(crate) const NO_KEY: u32 = u32::MAX;

/// A curve through the cells of a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Curve {
    /// The least corner of the box.
    low: Vec3,
    /// The axes by descending extent; of equals x before y before z.
    axes: [usize; 3],
    /// The bits of each coordinate that the curve spends with one, with two and with three
    /// dimensions.
    bits: [u32; 3],
    /// Cells per metre: a power of two.
    scale: f32,
}

impl Curve {
    /// The curve through a box. The box may be flat, a point, or empty.
    pub fn new(bounds: &Aabb) -> Self {
        let extent = bounds.extent();
        let mut axes = [0, 1, 2];
        axes.sort_by(|a, b| extent[*b].total_cmp(&extent[*a]));
        let [long, middle, short] = axes.map(|axis| exponent(extent[axis]));
        let one = ((long - middle) as u32).min(KEY_BITS);
        let two = ((middle - short) as u32).min((KEY_BITS - one) / 2);
        let three = (KEY_BITS - one - 2 * two) / 3;
        // The longest extent is below 2^(long + 1) metres, which the curve divides into a power of
        // two of cells.
        let scale = (one + two + three) as i32 - 1 - long;
        Self { low: bounds.min, axes, bits: [one, two, three], scale: power_of_two(scale) }
    }

    /// The place of a position of the box on the curve, below 2^31.
    pub fn key(&self, position: Vec3) -> u32 {
        let [one, two, three] = self.bits;
        let cells = (position - self.low) * self.scale;
        let cell = self.axes.map(|axis| (cells[axis] as u32).min(low_bits(one + two + three)));
        let flat = cell.map(|c| (c >> three) & low_bits(two));
        let deep = cell.map(|c| c & low_bits(three));
        let key = append(cell[0] >> (two + three), hilbert(flat, 2, two), 2, two);
        append(key, hilbert(deep, 3, three), 3, three)
    }
}

/// Converts the coordinates of a cell to the digits of its place on the Hilbert curve. The place
/// has one bit of each digit in turn, from the highest bits down.
fn hilbert(mut x: [u32; 3], dimensions: usize, bits: u32) -> [u32; 3] {
    for bit in (1..bits).rev() {
        let (this, below) = (1 << bit, low_bits(bit));
        for i in 0..dimensions {
            if x[i] & this != 0 {
                x[0] ^= below;
            } else {
                let swap = (x[0] ^ x[i]) & below;
                x[0] ^= swap;
                x[i] ^= swap;
            }
        }
    }
    for i in 1..dimensions {
        x[i] ^= x[i - 1];
    }
    let last = x[dimensions - 1];
    let flips = (1..bits).filter(|bit| last & (1 << bit) != 0).fold(0, |flips, bit| flips ^ low_bits(bit));
    x.map(|digit| digit ^ flips)
}

/// Appends the bits of some digits to a key: the highest bits of all digits first.
fn append(key: u32, digits: [u32; 3], dimensions: usize, bits: u32) -> u32 {
    let mut key = key;
    for bit in (0..bits).rev() {
        for digit in &digits[..dimensions] {
            key = key << 1 | (digit >> bit & 1);
        }
    }
    key
}

/// The exponent e of a positive number in [2^e, 2^(e + 1)). -127 for zero and denormal numbers.
pub(crate) fn exponent(x: f32) -> i32 {
    (x.to_bits() >> 23) as i32 - 127
}

/// 2^e, or the nearest power of two that is a normal number.
pub(crate) fn power_of_two(e: i32) -> f32 {
    f32::from_bits(((e.clamp(-126, 127) + 127) as u32) << 23)
}

/// A word with its lowest `count` bits set. `count` is below 32.
fn low_bits(count: u32) -> u32 {
    (1 << count) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(size: Vec3) -> Curve {
        Curve::new(&Aabb { min: Vec3::ZERO, max: size })
    }

    #[test]
    fn successive_cells_of_the_curve_are_neighbours_in_space() {
        for (dimensions, bits) in [(2, 5), (3, 4)] {
            let side = 1_u32 << bits;
            let mut cells: Vec<(u32, [u32; 3])> = Vec::new();
            for z in 0..if dimensions == 3 { side } else { 1 } {
                for y in 0..side {
                    for x in 0..side {
                        cells.push((append(0, hilbert([x, y, z], dimensions, bits), dimensions, bits), [x, y, z]));
                    }
                }
            }
            cells.sort_unstable();
            for (place, pair) in cells.windows(2).enumerate() {
                assert_eq!(pair[0].0 as usize, place);
                let steps: u32 = (0..3).map(|i| pair[0].1[i].abs_diff(pair[1].1[i])).sum();
                assert_eq!(steps, 1, "{pair:?}");
            }
        }
    }

    #[test]
    fn a_flat_world_spends_no_bits_on_its_height_and_a_street_none_on_its_width() {
        // 1024 is 2^10 and 20 is in [2^4, 2^5): six levels without height, then six with it.
        assert_eq!(curve(Vec3::new(1024.0, 20.0, 1025.0)).bits, [0, 6, 6]);
        assert_eq!(curve(Vec3::new(1024.0, 0.0, 1024.0)).bits, [0, 15, 0]);
        assert_eq!(curve(Vec3::new(0.0, 3.0, 0.0)).bits, [31, 0, 0]);
        assert_eq!(curve(Vec3::splat(7.0)).bits, [0, 0, 10]);
    }

    #[test]
    fn keys_have_31_bits_for_boxes_of_any_shape_and_increase_along_a_street() {
        for size in
            [Vec3::ZERO, Vec3::X, Vec3::splat(1.0e9), Vec3::new(1.0e-30, 1.0e9, 3.0), Vec3::new(1.0, 2.0, 1.0e-40)]
        {
            for at in [Vec3::ZERO, 0.5 * size, size] {
                assert!(curve(size).key(at) < 1 << KEY_BITS, "{size} {at}");
            }
        }
        // Along a street the curve is the street, up to the resolution of its bits.
        let street = curve(Vec3::new(0.0, 0.0, 1000.0));
        let keys: Vec<_> = (0..=100_000).map(|i| street.key(Vec3::Z * (i as f32 * 0.01))).collect();
        assert!(keys.is_sorted() && keys.windows(2).all(|k| k[0] < k[1]));
    }
}
