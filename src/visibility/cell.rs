//! Where a shading point lies in the table, and where a cluster of lights lies as seen from there.
//!
//! Twin of `shaders/visibility.wgsl`. Both are functions of positions alone. So they stay the same
//! when trees are built anew, and when one light takes the place of another.

use glam::{DVec3, Mat3, Vec3};

use super::fold::share;
use crate::math::dice::hash;
use crate::shading::importance::LocalShadingPoint;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::{Lanes, Node, WIDTH};

/// Groups of lights in a cell. 256 have 6 % more noise in ten rooms, 128 have 11 % more.
pub(crate) const BINS: usize = 512;

/// The bits of a hash that are not part of a bin.
pub(crate) const BIN_SHIFT: u32 = u32::BITS - BINS.ilog2();

/// Cells along the edge of a block, as a power of two: blocks have 4 x 4 x 4 cells.
pub(crate) const BLOCK_BITS: u32 = 2;

/// From the corner of a block to the middle of its groups, in cells: half of its edge, and a little more, since
/// lamps at round coordinates would lie on the borders of groups.
pub(crate) const BLOCK_MIDDLE: f32 = (1 << (BLOCK_BITS - 1)) as f32 + 0.1183;

/// The lowest bit of a tag is set once something was recorded in a row. Until then the row is not read.
pub(crate) const LEARNT_BIT: u32 = 1;

/// Set in each tag, so that no tag is 0 without [`LEARNT_BIT`].
pub(crate) const USED_BIT: u32 = 2;

/// Coordinates of cells are clamped to this, and the distance of a cluster, in metres, to
/// [`MAX_DIST`]. Neither occurs within the limits of placements.
pub(crate) const MAX_COORDINATE: f32 = 1.0e9;
/// See [`MAX_COORDINATE`].
pub(crate) const MAX_DIST: f32 = 1.0e30;

/// Mixed into the hash that becomes a tag, so that it is independent of the bucket.
pub(crate) const TAG_SEED: u32 = 0x9e37_79b9;

/// The grid of cells, for coordinates that are relative to an origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CellGrid {
    /// In metres.
    pub edge: f32,
    pub cells_per_metre: f32,
    /// The origin in its own cell, in metres.
    pub offset: Vec3,
    /// The cell of the origin, modulo 2^32.
    pub first: [u32; 3],
}

/// The cell of a shading point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cell {
    pub key: CellKey,
    /// That of the block that holds the cell.
    pub block: CellKey,
    /// From the middle of the block's groups to the shading point, in metres.
    pub from_center: Vec3,
}

/// Finds the row of a cell or block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CellKey {
    /// Selects a bucket of the table.
    pub hash: u32,
    /// Tells cells of a bucket apart. Has [`LEARNT_BIT`] and [`USED_BIT`].
    pub tag: u32,
}

impl CellKey {
    fn new([x, y, z]: [u32; 3], side: u32) -> Self {
        let first = hash(x ^ hash(y ^ hash(z ^ hash(side))));
        Self { hash: first, tag: hash(first ^ hash(x ^ TAG_SEED)) | LEARNT_BIT | USED_BIT }
    }
}

/// What is known about the cell of a shading point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LearntCell<'t> {
    pub shares: &'t [u8; BINS],
    /// See [`Cell::from_center`].
    pub from_center: Vec3,
    /// In metres.
    pub edge: f32,
}

impl CellGrid {
    /// Cells with edges of so many metres, which lie at multiples of the edge in the world.
    pub fn new(edge: f32, origin: DVec3) -> Self {
        let exact = f64::from(edge);
        let first = (origin / exact).floor();
        Self {
            edge,
            cells_per_metre: 1.0 / edge,
            offset: (origin - first * exact).as_vec3(),
            first: first.to_array().map(|coordinate| coordinate as i64 as u32),
        }
    }

    /// The cell of a shading point, and its block.
    #[inline]
    pub fn cell(&self, shading_point: &ShadingPoint) -> Cell {
        let place = shading_point.position + self.offset;
        let cube = (place * self.cells_per_metre).floor();
        let limited = cube.clamp(Vec3::splat(-MAX_COORDINATE), Vec3::splat(MAX_COORDINATE));
        let at = [0, 1, 2].map(|k| (limited[k] as i32 as u32).wrapping_add(self.first[k]));
        let side = side(shading_point.normal);
        // Blocks are signed cells, shifted.
        let block = at.map(|coordinate| (coordinate as i32 >> BLOCK_BITS) as u32);
        let in_block = Vec3::from(at.map(|coordinate| (coordinate & ((1 << BLOCK_BITS) - 1)) as f32));
        let center = (cube - in_block + BLOCK_MIDDLE) * self.edge;
        Cell { key: CellKey::new(at, side), block: CellKey::new(block, side), from_center: place - center }
    }
}

/// The side of a cube that a surface faces: the axis of the longest component of its normal and its
/// sign, or 6 for a volume.
pub(crate) fn side(normal: Vec3) -> u32 {
    let length = normal.abs();
    let axis = match () {
        () if length.x >= length.y && length.x >= length.z => 0,
        () if length.y >= length.z => 1,
        () => 2,
    };
    if normal == Vec3::ZERO { 6 } else { 2 * axis + u32::from(normal[axis as usize] < 0.0) }
}

/// Adding this rounds to a whole number, which the lowest bits of the sum then hold. Unlike a cast,
/// it is one instruction for a whole vector, and it has the same bits on a GPU.
pub(crate) const ROUNDING: f32 = 12_582_912.0;

/// Bits of a key for each coordinate.
pub(crate) const COORDINATE_BITS: u32 = 4;

/// The groups of some clusters of lights. `toward` are the vectors from the middle of the block to
/// the mean positions of the clusters, in metres, one array for each axis.
///
/// The groups are cubes whose edge is half the distance, rounded down to a power of two, and the
/// hash puts some together. Distances below `edge` count as `edge`. So near clusters are told apart
/// as finely as they differ for the surfaces of the cell. All cells of a block have the same groups.
#[inline(always)]
pub(crate) fn bins<const N: usize>(toward: &[[f32; N]; 3], edge: f32) -> [u32; N] {
    let mut bins = [0; N];
    for (i, bin) in bins.iter_mut().enumerate() {
        let mut dist = edge;
        for axis in toward {
            let length = axis[i].abs();
            dist = if length > dist { length } else { dist };
        }
        let dist = if dist < MAX_DIST { dist } else { MAX_DIST };
        let exponent = dist.to_bits() >> 23;
        // Two over the distance, rounded up to a power of two. Steps are from -4 to 4.
        let steps_per_metre = f32::from_bits((255 - exponent) << 23);
        let mut key = exponent;
        for axis in toward {
            let step = (axis[i] * steps_per_metre + ROUNDING).to_bits() & ((1 << COORDINATE_BITS) - 1);
            key = key << COORDINATE_BITS | step;
        }
        *bin = hash(key) >> BIN_SHIFT;
    }
    bins
}

impl LearntCell<'_> {
    /// The learnt share of each child of a node; 1 for unused slots, or any other share.
    ///
    /// `local` is the shading point as the node is seen from it, and `to_world` maps vectors from
    /// there to the world.
    #[inline(always)]
    pub fn shares(&self, node: &Node, local: &LocalShadingPoint, to_world: &Mat3) -> Lanes {
        let mut toward = [[0.0; WIDTH]; 3];
        for slot in 0..WIDTH {
            let child = from_center(local.child(node, slot).toward, self.from_center, to_world);
            for k in 0..3 {
                toward[k][slot] = child[k];
            }
        }
        bins(&toward, self.edge).map(|bin| share(self.shares[bin as usize % BINS]))
    }
}

impl LearntCell<'_> {
    /// The learnt share of the group of lights at a place, given as the vector to it from the shading point.
    pub fn share_toward(&self, toward: Vec3) -> f32 {
        share(self.shares[bin_toward(toward, self.from_center, self.edge) % BINS])
    }
}

/// The group of lights at a place, given as the vector to it from the shading point. The other arguments are
/// those of [`LearntCell`].
pub(crate) fn bin_toward(toward: Vec3, from_center: Vec3, edge: f32) -> usize {
    let [bin] = bins(&(toward + from_center).to_array().map(|coordinate| [coordinate]), edge);
    bin as usize
}

/// The group of one child of a node, as [`LearntCell::shares`] finds it.
pub(crate) fn bin_of_child(
    node: &Node,
    slot: usize,
    local: &LocalShadingPoint,
    to_world: &Mat3,
    cell: &Cell,
    edge: f32,
) -> usize {
    let toward = local.child(node, slot).toward;
    bin_toward(from_center(toward, cell.from_center, to_world).into(), Vec3::ZERO, edge)
}

/// From the middle of a block to the end of a vector that starts at the shading point, in the space
/// that `to_world` maps.
#[inline(always)]
fn from_center(toward: [f32; 3], from_center: Vec3, to_world: &Mat3) -> [f32; 3] {
    let [x, y, z] = toward;
    let columns = to_world.to_cols_array_2d();
    [0, 1, 2].map(|k| columns[0][k] * x + columns[1][k] * y + columns[2][k] * z + from_center[k])
}
