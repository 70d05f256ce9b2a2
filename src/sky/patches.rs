//! The patches of a map: squares of texels, small where much light comes from.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use glam::Vec3;

use super::levels::{Levels, Square};

/// Patches of a map, at most. Few enough for a tree that is built in a frame, and enough for
/// patches of 6 degrees in an even sky.
pub(crate) const PATCHES: usize = 1024;

/// Patches begin as squares of at most this many in a row.
const FIRST_SQUARES: usize = 16;

/// Patches are not cut below this part of the light of the map, times their size in radians: choices within them are
/// as good.
const LEAST_SHARE: f32 = 1.0e-6;

/// What the radius of a patch has above the distance of its farthest corner: the rounding of both.
const MARGIN: f32 = 4.0e-6;

/// A part of the map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub place: Square,
    /// The light of all texels, in lux on a surface that faces it. Above 0.
    pub lux: f32,
    /// The direction from which it comes in the mean, a unit vector.
    pub mean: Vec3,
    /// All directions of the patch are this close to the mean, as points of the unit sphere.
    pub radius: f32,
}

/// A patch that may be cut: the bits of what that gains, which are in the order of numbers above 0; then, the first in
/// order of equal ones before the others; and its place in a list.
type Waiting = (u32, Reverse<u64>, usize);

/// Squares that were looked at, as patches; `None` for dark ones.
pub(super) type Known = HashMap<Square, Option<Patch>>;

/// Cuts a map into patches in order: always the one whose light comes from most different directions. Squares that are
/// known are not computed, and all that are looked at become known.
pub(super) fn cut(levels: &Levels, known: &mut Known) -> Vec<Patch> {
    let mut patches: Vec<Patch> = Vec::new();
    let mut wait = |square: Square, patches: &mut Vec<Patch>| -> Option<Waiting> {
        let patch = (*known.entry(square).or_insert_with(|| patch_of(levels, square)))?;
        let gain = if square.level == 0 { 0.0 } else { patch.lux * patch.radius };
        patches.push(patch);
        Some((gain.to_bits(), Reverse(square.first_in_order()), patches.len() - 1))
    };
    let first = (0..levels.count()).find(|level| levels.size_of(*level)[0] <= FIRST_SQUARES).unwrap_or(0);
    let [width, height] = levels.size_of(first);
    let squares = (0..height).flat_map(|y| (0..width).map(move |x| Square { level: first, at: [x, y] }));
    let mut waiting: BinaryHeap<Waiting> = squares.filter_map(|square| wait(square, &mut patches)).collect();
    let least = LEAST_SHARE * waiting.iter().map(|(.., place)| patches[*place].lux).sum::<f32>();
    let mut done = Vec::new();
    while let Some((gain, _, place)) = waiting.pop() {
        let patch = patches[place];
        let is_small = f32::from_bits(gain) <= least || patch.place.level == 0;
        if is_small || done.len() + waiting.len() + 4 > PATCHES {
            done.push(patch);
            continue;
        }
        waiting.extend(below(levels, patch.place).filter_map(|square| wait(square, &mut patches)));
    }
    done.sort_unstable_by_key(|patch| patch.place.first_in_order());
    done
}

/// The squares below a square, within the map.
fn below(levels: &Levels, Square { level, at }: Square) -> impl Iterator<Item = Square> {
    let size = levels.size_of(level - 1);
    let squares = (0..4).map(move |k| Square { level: level - 1, at: [2 * at[0] + k % 2, 2 * at[1] + k / 2] });
    squares.filter(move |square| square.at[0] < size[0] && square.at[1] < size[1])
}

/// The patch that a square is; `None` if it is dark.
fn patch_of(levels: &Levels, place: Square) -> Option<Patch> {
    let lux = levels.lux(place);
    // NaN is not above 0.
    (lux > 0.0).then(|| patch(levels, place, lux))
}

fn patch(levels: &Levels, place: Square, lux: f32) -> Patch {
    let [width, height] = levels.size();
    // The corners of a square, in texels.
    let corners = |square: Square| {
        let first = square.at.map(|at| at << square.level);
        let end = square.at.map(|at| (at + 1) << square.level);
        [first, [end[0].min(width), end[1].min(height)]].map(|corner| corner.map(|at| at as f32))
    };
    let middle = |square: Square| {
        let [first, end] = corners(square);
        levels.direction([0.5 * (first[0] + end[0]), 0.5 * (first[1] + end[1])])
    };
    // By the light of squares two levels below.
    let mut squares = vec![place];
    for _ in 0..2.min(place.level) {
        squares = squares.into_iter().flat_map(|square| below(levels, square)).collect();
    }
    let weighted: Vec3 = squares.iter().map(|square| middle(*square) * (levels.lux(*square) / lux)).sum();
    // Light from all around has no mean.
    let mean = weighted.try_normalize().unwrap_or_else(|| middle(place));
    // The farthest point of a rectangle of angles from one in it is a corner, unless it is nearly half of the
    // sphere.
    let [[left, top], [right, bottom]] = corners(place);
    let far = [[left, top], [right, top], [left, bottom], [right, bottom]];
    let distance = far.map(|corner| levels.direction(corner).distance(mean)).into_iter().fold(0.0, f32::max);
    let is_wide = 4.0 * (right - left) > width as f32 || 2.0 * (bottom - top) > height as f32;
    Patch { place, lux, mean, radius: if is_wide { 2.0 } else { distance + MARGIN } }
}
