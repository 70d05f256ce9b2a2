//! Profiles as numbers of 32 bits, for dumps of worlds.
//!
//! | numbers | content |
//! |---|---|
//! | 2 | the counts of angles from the pole and around it |
//! | 9 | the axes |
//! | counts | the angles from the pole, those around it, the candela |

use std::f32::consts::{PI, TAU};

use glam::Mat3;

use super::grid::{Grid, MAX_VALUES};
use super::measured::MAX_CANDELA;
use super::{Profile, interned};

/// The least difference of two angles, in radians: a little less than that of files.
const MIN_STEP: f32 = 1.0e-5;

/// A whole turn, with its rounding.
const MAX_TURN: f32 = 1.0001 * TAU;

/// The numbers before the angles.
const HEADER: usize = 2 + 9;

impl Profile {
    /// The numbers of the profile.
    pub(crate) fn record(self) -> Vec<u32> {
        let Grid { polar, around, candela, axes } = &self.0.grid;
        let axes = axes.to_cols_array();
        let lists = [&axes[..], polar, around, candela];
        [polar, around]
            .into_iter()
            .map(|angles| angles.len() as u32)
            .chain(lists.into_iter().flatten().map(|number| number.to_bits()))
            .collect()
    }

    /// The profile of some numbers, which is kept from then on; `None` if they are not those of a
    /// profile.
    pub(crate) fn of_record(record: &[u32]) -> Option<Self> {
        let (header, numbers) = record.split_at_checked(HEADER)?;
        let [polar, around] = [header[0] as usize, header[1] as usize];
        let count = polar.checked_mul(around).filter(|count| *count <= MAX_VALUES)?;
        if polar < 2 || around < 1 || numbers.len() != polar + around + count {
            return None;
        }
        let list = |bits: &[u32]| -> Vec<f32> { bits.iter().map(|bits| f32::from_bits(*bits)).collect() };
        let (angles, candela) = numbers.split_at(polar + around);
        let (polar, around) = angles.split_at(polar);
        let axes = Mat3::from_cols_slice(&list(&header[2..]));
        let grid = Grid { polar: list(polar), around: list(around), candela: list(candela), axes };
        is_sound(&grid).then(|| Self(interned::intern(grid)))
    }
}

/// Whether a file may have this grid.
fn is_sound(Grid { polar, around, candela, axes }: &Grid) -> bool {
    // NaN is in no range, and differs from its neighbours by nothing.
    let is_within = |angles: &[f32], least: f32, most: f32| angles.iter().all(|angle| (least..=most).contains(angle));
    let ascends = |angles: &[f32]| angles.windows(2).all(|pair| pair[1] - pair[0] >= MIN_STEP);
    let is_turn = is_within(around, -MAX_TURN, 2.0 * MAX_TURN) && around[around.len() - 1] - around[0] <= MAX_TURN;
    let has_axes = axes.to_cols_array().iter().all(|entry| [-1.0, 0.0, 1.0].contains(entry))
        && *axes * axes.transpose() == Mat3::IDENTITY;
    is_within(polar, 0.0, PI)
        && ascends(polar)
        && is_turn
        && ascends(around)
        && is_within(candela, 0.0, MAX_CANDELA as f32)
        && has_axes
}
