//! The texels of a map, and the sums of their light over squares of 4, 16, 64 and more.
//!
//! Sixteen squares lie together in a block, by four in quads, so that a walk from a square to a texel reads 64 bytes
//! for every second level: most of its time is that of reading memory. Sums over squares of 2, 8, 32 are those
//! of a quad. A GPU reads the same words.

use std::collections::VecDeque;
use std::f32::consts::PI;
#[cfg(feature = "gpu-plan")]
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use glam::Vec3;

use crate::light::luminance;
use crate::math::dice::U_STEP;
use crate::math::parallel::for_each_chunk;

/// The largest number of a shared exponent, with nine bits for a channel.
const MAX_SHARED: f32 = 65_408.0;

/// How much brighter than the brightest pixel a later one may be: beyond that all pixels are stored anew.
const HEADROOM: f32 = 128.0;

/// Texels and sums.
#[derive(Clone)]
pub(super) struct Levels {
    size: [usize; 2],
    /// What stored radiances are multiplied by.
    scale: f32,
    /// Of levels 0, 2, 4, and so on.
    levels: Vec<Level>,
    /// Texels as shared exponents, and then sums in lux as f32, as bits.
    blocks: Vec<Block>,
    /// The solid angle of a texel of each row, in steradians.
    solid_angles: Vec<f32>,
    /// The revision of the last change of everything.
    all_since: u64,
    /// The last parts that have changed since: a revision, the first texel and the end.
    changes: VecDeque<Change>,
}

type Change = (u64, [usize; 2], [usize; 2]);

/// The next revision of any map.
static NEXT_REVISION: AtomicU64 = AtomicU64::new(1);

/// Blocks in rows are shared among threads from this number on.
const MIN_SHARED_BLOCKS: usize = 1 << 12;

/// Changes that are told apart; readers of older revisions read everything.
const KEPT_CHANGES: usize = 16;

/// The words of 4 x 4 squares: quads of 2 x 2 in rows of two, and so the words of a quad. A line of most caches.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Block([[u32; 4]; 4]);

impl Block {
    fn word(&mut self, [x, y]: [usize; 2]) -> &mut u32 {
        &mut self.0[2 * (y / 2 % 2) + x / 2 % 2][2 * (y % 2) + x % 2]
    }
}

/// The blocks of a level that is stored, in rows.
#[derive(Clone, Copy)]
struct Level {
    first: usize,
    in_row: usize,
}

/// A square of a level: 2^level texels wide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Square {
    pub level: usize,
    pub at: [usize; 2],
}

impl Square {
    /// Whether it holds a texel.
    pub fn contains(&self, texel: [usize; 2]) -> bool {
        texel.map(|at| at >> self.level) == self.at
    }

    /// Whether it has a texel from `first` on and before `end`.
    pub fn meets(&self, first: [usize; 2], end: [usize; 2]) -> bool {
        [0, 1].into_iter().all(|k| self.at[k] << self.level < end[k] && (self.at[k] + 1) << self.level > first[k])
    }

    /// The first place of its texels [in order](in_order), which follow each other.
    pub fn first_in_order(&self) -> u64 {
        in_order(self.at.map(|at| at << self.level))
    }
}

/// The place of a texel in an order in which all texels of each square follow each other: Morton's.
pub(super) fn in_order([x, y]: [usize; 2]) -> u64 {
    (0..u32::BITS).fold(0, |order, bit| {
        let of = |at: usize| (at as u64 >> bit & 1) << (2 * bit);
        order | of(x) | of(y) << 1
    })
}

impl Levels {
    /// `pixels` are rows of `size[0]`, of which no channel is above `greatest`.
    pub fn new(size: [usize; 2], pixels: &[Vec3], greatest: f32) -> Self {
        let (mut levels, mut at, mut first) = (Vec::new(), size, 0);
        loop {
            let [in_row, rows] = at.map(|side| side.div_ceil(4));
            levels.push(Level { first, in_row });
            first += in_row * rows;
            if [in_row, rows] == [1, 1] {
                break;
            }
            at = [in_row, rows];
        }
        let (blocks, changes) = (vec![Block([[0; 4]; 4]); first], VecDeque::new());
        let [width, height] = size.map(|size| size as f32);
        let middle = |row: usize| PI * (row as f32 + 0.5) / height;
        let solid_angle = |row: usize| (2.0 * PI / width) * 2.0 * middle(row).sin() * (0.5 * PI / height).sin();
        let solid_angles = (0..size[1]).map(solid_angle).collect();
        let mut levels = Self { size, scale: 1.0, levels, blocks, solid_angles, all_since: 0, changes };
        levels.scale = scale_for(greatest);
        levels.set([0, 0], size, pixels, greatest);
        levels.renew();
        levels
    }

    /// Makes all of the map new to everyone.
    pub fn renew(&mut self) {
        self.changes.clear();
        self.all_since = NEXT_REVISION.fetch_add(1, Relaxed);
    }

    /// The revision of the last change.
    #[cfg(feature = "gpu-plan")]
    pub fn revision(&self) -> u64 {
        self.changes.back().map_or(self.all_since, |(revision, ..)| *revision)
    }

    /// The runs of quads that have changed since a revision; `None` if all may have.
    #[cfg(feature = "gpu-plan")]
    pub fn changes_since(&self, revision: u64) -> Option<impl Iterator<Item = Range<usize>>> {
        let changes = self.changes.iter().filter(move |(number, ..)| *number > revision);
        (revision >= self.all_since).then(|| changes.flat_map(|(_, first, end)| self.runs(*first, *end)))
    }

    /// The quads of a part of the map, and of all squares that hold any of it.
    #[cfg(feature = "gpu-plan")]
    fn runs(&self, first: [usize; 2], end: [usize; 2]) -> impl Iterator<Item = Range<usize>> {
        self.levels.iter().enumerate().flat_map(move |(stored, Level { first: start, in_row })| {
            let first = first.map(|at| at >> (2 * stored) >> 2);
            let end = end.map(|at| at.div_ceil(4 << (2 * stored)));
            (first[1]..end[1]).map(move |y| 4 * (start + y * in_row + first[0])..4 * (start + y * in_row + end[0]))
        })
    }

    /// The number of quads.
    #[cfg(feature = "gpu-plan")]
    pub fn quad_count(&self) -> usize {
        4 * self.blocks.len()
    }

    /// Quads, in the order of blocks.
    #[cfg(feature = "gpu-plan")]
    pub fn quads(&self, run: Range<usize>) -> Vec<[u32; 4]> {
        run.map(|quad| self.blocks[quad / 4].0[quad % 4]).collect()
    }

    /// The first quad of a level that is stored, by its number among these, and the number of blocks in a row. Zeros
    /// beyond the last one.
    #[cfg(feature = "gpu-plan")]
    pub fn place(&self, stored: usize) -> [usize; 2] {
        self.levels.get(stored).map_or([0; 2], |level| [4 * level.first, level.in_row])
    }

    #[cfg(feature = "gpu-plan")]
    pub fn scale(&self) -> f32 {
        self.scale
    }

    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The number of levels: the last one has one square.
    pub fn count(&self) -> usize {
        let side = self.size[0].max(self.size[1]);
        side.next_power_of_two().ilog2() as usize + 1
    }

    /// The squares in a row of a level, and the rows.
    pub fn size_of(&self, level: usize) -> [usize; 2] {
        self.size.map(|side| side.div_ceil(1 << level))
    }

    pub fn memory_bytes(&self) -> usize {
        let [blocks, levels] = [self.blocks.capacity(), self.levels.capacity()];
        size_of::<Block>() * blocks + size_of::<Level>() * levels + size_of_val(&self.solid_angles[..])
    }

    /// Stores the pixels of a part of the map, which lies within it, and the sums above. No channel is above
    /// `greatest`. Returns the first texel that changed and the end: all texels are stored anew for brighter pixels.
    pub fn set(&mut self, corner: [usize; 2], size: [usize; 2], pixels: &[Vec3], greatest: f32) -> [[usize; 2]; 2] {
        let end = [0, 1].map(|k| corner[k] + size[k]);
        if corner[0] >= end[0] || corner[1] >= end[1] {
            return [corner, end];
        }
        let is_brighter = greatest > MAX_SHARED * self.scale;
        if is_brighter {
            self.store_anew(scale_for(greatest));
        }
        // Exact: scales are powers of two.
        let inverse = self.scale.recip();
        self.for_each_square(0, corner, end, |_, [x, y]| {
            encode(pixels[(y - corner[1]) * size[0] + x - corner[0]] * inverse)
        });
        self.sum(corner, end);
        self.note(corner, end);
        if is_brighter { [[0, 0], self.size] } else { [corner, end] }
    }

    /// Notes that a part has changed.
    fn note(&mut self, first: [usize; 2], end: [usize; 2]) {
        if self.changes.len() == KEPT_CHANGES {
            // Who has not read the oldest one reads everything.
            self.all_since = self.changes.pop_front().map_or(self.all_since, |(revision, ..)| revision);
        }
        self.changes.push_back((NEXT_REVISION.fetch_add(1, Relaxed), first, end));
    }

    /// Stores all texels for another scale.
    fn store_anew(&mut self, scale: f32) {
        let ratio = self.scale / scale;
        let texels = self.levels.get(1).map_or(self.blocks.len(), |above| above.first);
        for quad in self.blocks[..texels].iter_mut().flat_map(|block| &mut block.0) {
            *quad = quad.map(|code| encode(decode(code) * ratio));
        }
        self.scale = scale;
        self.sum([0, 0], self.size);
        self.renew();
    }

    /// Adds up the squares above the texels from `first` to before `end`.
    fn sum(&mut self, first: [usize; 2], end: [usize; 2]) {
        let (mut first, mut end) = (first, end);
        for stored in 1..self.levels.len() {
            (first, end) = (first.map(|at| at / 4), end.map(|at| at.div_ceil(4)));
            let Level { first: start, in_row } = self.levels[stored - 1];
            let (scale, solid_angles) = (self.scale, std::mem::take(&mut self.solid_angles));
            self.for_each_square(stored, first, end, |below, [x, y]| {
                // Each square has a block of the level below.
                let block = &below[start + y * in_row + x];
                let [a, b, c, d] = lux_of_block(block, 2 * stored - 2, y, scale, &solid_angles);
                ((a + b) + (c + d)).to_bits()
            });
            self.solid_angles = solid_angles;
        }
    }

    /// Sets the words of squares of a stored level, on rayon's threads if they are many. The function gets the blocks
    /// of the levels below.
    fn for_each_square(
        &mut self,
        stored: usize,
        first: [usize; 2],
        end: [usize; 2],
        word: impl Fn(&[Block], [usize; 2]) -> u32 + Sync,
    ) {
        let Level { first: start, in_row } = self.levels[stored];
        let (below, blocks) = self.blocks.split_at_mut(start);
        let rows = first[1] / 4..end[1].div_ceil(4);
        let blocks = &mut blocks[rows.start * in_row..rows.end * in_row];
        let of_row = |row: usize, blocks: &mut [Block]| {
            let y = 4 * (rows.start + row);
            for y in y.max(first[1])..(y + 4).min(end[1]) {
                (first[0]..end[0]).for_each(|x| *blocks[x / 4].word([x, y]) = word(below, [x, y]));
            }
        };
        if blocks.len() >= MIN_SHARED_BLOCKS {
            return for_each_chunk(blocks, in_row, of_row);
        }
        blocks.chunks_mut(in_row).enumerate().for_each(|(row, blocks)| of_row(row, blocks));
    }

    /// The quad of a stored level below the square `at` of the level above it.
    fn quad(&self, stored: usize, at: [usize; 2]) -> &[u32; 4] {
        let Level { first, in_row } = self.levels[stored];
        &self.blocks[first + (at[1] / 2) * in_row + at[0] / 2].0[2 * (at[1] % 2) + at[0] % 2]
    }

    /// The light of a square in lux, on a surface that faces it.
    pub fn lux(&self, square: Square) -> f32 {
        if square.level == 0 {
            return self.luminance(square.at) * self.solid_angle(square.at[1]);
        }
        let [a, b, c, d] = self.children(square);
        (a + b) + (c + d)
    }

    /// The lux of the four squares below a square; 0 beyond the border.
    fn children(&self, Square { level, at }: Square) -> [f32; 4] {
        let stored = (level - 1) / 2;
        if level % 2 == 1 {
            return lux_of_quad(self.quad(stored, at), level - 1, at[1], self.scale, &self.solid_angles);
        }
        let Level { first, in_row } = self.levels[stored];
        let block = &self.blocks[first + at[1] * in_row + at[0]];
        lux_of_block(block, level - 2, at[1], self.scale, &self.solid_angles)
    }

    /// The solid angle of a texel of a row, in steradians.
    pub fn solid_angle(&self, row: usize) -> f32 {
        // Texels beyond the border are black.
        self.solid_angles.get(row).copied().unwrap_or(0.0)
    }

    /// The radiance of a texel, in nits.
    pub fn texel(&self, at: [usize; 2]) -> Vec3 {
        decode(self.quad(0, at.map(|at| at / 2))[2 * (at[1] % 2) + at[0] % 2]) * self.scale
    }

    pub fn luminance(&self, at: [usize; 2]) -> f32 {
        luminance(self.texel(at))
    }

    /// The texel in a direction of any length.
    pub fn texel_at(&self, direction: Vec3) -> [usize; 2] {
        let [width, height] = self.size.map(|size| size as f32);
        let around = direction.z.atan2(direction.x) / (2.0 * PI) + 0.5;
        let down = direction.x.hypot(direction.z).atan2(direction.y) / PI;
        // Casts of NaN give 0.
        [(around * width) as usize % self.size[0], ((down * height) as usize).min(self.size[1] - 1)]
    }

    /// The direction of a column and a row, in fractions.
    pub fn direction(&self, at: [f32; 2]) -> Vec3 {
        direction(self.size, at)
    }

    /// Chooses a texel of a square in proportion to its light, and a direction in it. The first number chooses among
    /// columns, the second among rows.
    pub fn sample(&self, square: Square, u: [f32; 2]) -> (Vec3, [usize; 2]) {
        let mut u = u;
        let Square { mut level, mut at } = square;
        while level > 0 {
            let [a, b, c, d] = self.children(Square { level, at });
            let right = choose(&mut u[0], a + c, b + d);
            let below = if right { choose(&mut u[1], b, d) } else { choose(&mut u[1], a, c) };
            at = [2 * at[0] + usize::from(right), 2 * at[1] + usize::from(below)];
            level -= 1;
        }
        let row = self.row_of(at[1], u[1]);
        (self.direction([at[0] as f32 + u[0], row]), at)
    }

    /// The row, in fractions, above which a part `u` of a row's solid angle lies.
    fn row_of(&self, row: usize, u: f32) -> f32 {
        let step = PI / self.size[1] as f32;
        // The sine of half the angle from the zenith has a square that is uniform.
        let square = |row: f32| (0.5 * step * row).sin().powi(2);
        let (above, below) = (square(row as f32), square(row as f32 + 1.0));
        let angle = 2.0 * (above + (below - above) * u).clamp(0.0, 1.0).sqrt().asin();
        (angle / step).clamp(row as f32, row as f32 + 1.0)
    }
}

/// The direction of a column and a row of a map, in fractions.
pub(super) fn direction(size: [usize; 2], [column, row]: [f32; 2]) -> Vec3 {
    let [width, height] = size.map(|size| size as f32);
    let (sin_phi, cos_phi) = (2.0 * PI * (column / width - 0.5)).sin_cos();
    let (sin_theta, cos_theta) = (PI * row / height).sin_cos();
    Vec3::new(sin_theta * cos_phi, cos_theta, sin_theta * sin_phi)
}

/// Whether the second of two is chosen in proportion to their weights. The number is stretched over the choice.
fn choose(u: &mut f32, first: f32, second: f32) -> bool {
    let share = first / (first + second);
    let is_second = (*u >= share || first <= 0.0) && second > 0.0;
    let stretched = if is_second { (*u - share) / (1.0 - share) } else { *u / share };
    *u = stretched.clamp(0.0, 1.0 - U_STEP);
    is_second
}

/// The lux of the four squares of a quad in the row `row` of quads of a level.
fn lux_of_quad(words: &[u32; 4], level: usize, row: usize, scale: f32, solid_angles: &[f32]) -> [f32; 4] {
    if level > 0 {
        return words.map(f32::from_bits);
    }
    // Texels beyond the border are black.
    let angles = [2 * row, 2 * row + 1].map(|row| solid_angles.get(row).map_or(0.0, |angle| scale * angle));
    std::array::from_fn(|k| luminance(decode(words[k])) * angles[k / 2])
}

/// The lux of the four quads of a block in the row `row` of blocks of a level.
fn lux_of_block(block: &Block, level: usize, row: usize, scale: f32, solid_angles: &[f32]) -> [f32; 4] {
    std::array::from_fn(|k| {
        let [a, b, c, d] = lux_of_quad(&block.0[k], level, 2 * row + k / 2, scale, solid_angles);
        (a + b) + (c + d)
    })
}

/// A power of two by which pixels are divided, so that the greatest is at most [`MAX_SHARED`] / [`HEADROOM`].
fn scale_for(greatest: f32) -> f32 {
    let least = greatest * (HEADROOM / MAX_SHARED);
    least.log2().ceil().exp2().max(f32::MIN_POSITIVE)
}

/// Three channels with nine bits each and a common exponent: RGB9E5 of Vulkan and WebGPU. At most [`MAX_SHARED`] is
/// stored.
fn encode(color: Vec3) -> u32 {
    let color = color.min(Vec3::splat(MAX_SHARED));
    let greatest = color.max_element();
    // The exponent of the greatest channel, rounded, whose steps are 2^(exponent - 24).
    let exponent = (((greatest.to_bits() >> 23) as i32) - 127 + 16).max(0);
    // The inverse of a step, which is exact.
    let steps = |exponent: i32| f32::from_bits(((127 + 24 - exponent) as u32) << 23);
    let exponent = exponent + i32::from(greatest * steps(exponent) >= 511.5);
    let [r, g, b] = (color * steps(exponent) + 0.5).to_array().map(|channel| channel as u32);
    r | g << 9 | b << 18 | (exponent as u32) << 27
}

fn decode(code: u32) -> Vec3 {
    let step = f32::from_bits(((code >> 27) + 103) << 23);
    Vec3::new((code & 511) as f32, (code >> 9 & 511) as f32, (code >> 18 & 511) as f32) * step
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_exponents_keep_nine_bits_of_the_greatest_channel() {
        for exponent in -14..16 {
            for part in [1.0, 1.001, 1.3, 1.999, 1.9999] {
                let greatest = part * (exponent as f32).exp2();
                let color = Vec3::new(greatest, 0.3 * greatest, 0.0).min(Vec3::splat(MAX_SHARED));
                let error = (decode(encode(color)) - color).abs().max_element();
                assert!(error <= color.x / 512.0, "{color} {error}");
            }
        }
        assert_eq!(decode(encode(Vec3::ZERO)), Vec3::ZERO);
        assert_eq!(decode(encode(Vec3::splat(1.0e9))), Vec3::splat(MAX_SHARED));
        // Below the least exponent steps are even.
        assert_eq!(decode(encode(Vec3::splat(3.0 * 2.0_f32.powi(-24)))), Vec3::splat(3.0 * 2.0_f32.powi(-24)));
    }

    #[test]
    fn directions_and_texels_agree_and_cover_the_sphere() {
        for size in [[1, 1], [2, 1], [7, 5], [64, 32], [4096, 2048]] {
            let levels = Levels::new(size, &vec![Vec3::ONE; size[0] * size[1]], 1.0);
            let steps = |side: usize| (0..side).step_by((side / 50).max(1));
            for y in steps(size[1]) {
                for x in steps(size[0]) {
                    let direction = levels.direction([x as f32 + 0.3, y as f32 + 0.6]);
                    assert!((direction.length() - 1.0).abs() < 1.0e-6);
                    assert_eq!(levels.texel_at(direction * 7.0), [x, y], "{size:?}");
                }
            }
            let all: f32 = (0..size[1]).map(|row| levels.solid_angle(row) * size[0] as f32).sum();
            assert!((all / (4.0 * PI) - 1.0).abs() < 1.0e-5, "{size:?} {all}");
            let root = Square { level: levels.count() - 1, at: [0, 0] };
            assert!((levels.lux(root) / (4.0 * PI) - 1.0).abs() < 1.0e-5, "{size:?}");
        }
    }
}
