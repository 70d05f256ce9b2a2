//! The layout of the storage buffer with the cuts that cells share, in words of 32 bits.

use crate::sampling::cuts::SHARED_NODES;
use crate::tree::WIDTH;

/// The words ahead of the first slot. `shaders/cut_list.wgsl` has their meaning; all are 0 at first but
/// those with the ends of the free rows.
pub(crate) const HEAD: u32 = 16;
/// The word that counts marks for whose cells there was no room.
pub(crate) const LOST_MARKS: u32 = 13;
/// The words of a slot: tag, marks, row, points that its cut was made for, corner, kind, mask, points.
pub(crate) const SLOT_WORDS: u32 = 16;
/// The units of 16 bytes of a row, up to its nodes, and up to its running sums. `shaders/shared.wgsl` has
/// the fields.
pub(crate) const ROW_QUADS: u32 = ROW_SUMS + (SHARED_NODES * WIDTH / 4) as u32;
/// See [`ROW_QUADS`].
pub(crate) const ROW_NODES: u32 = 5;
/// See [`ROW_QUADS`].
pub(crate) const ROW_SUMS: u32 = ROW_NODES + (SHARED_NODES / 2) as u32;

/// A flag of the grid: there is an eye.
pub(crate) const HAS_EYE: u32 = 1;
/// A flag of the grid: the eye has moved since the last build.
pub(crate) const EYE_MOVED: u32 = 2;
