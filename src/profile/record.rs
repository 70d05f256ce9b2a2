//! Profiles as numbers of 32 bits, for dumps of worlds.
//!
//! | numbers | content |
//! |---|---|
//! | 2 | the counts of angles from the pole and around it |
//! | 9 | the axes |
//! | counts | the angles from the pole, those around it, the candela |

use glam::Mat3;

use super::Profile;
use super::grid::Grid;

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
        let list = |bits: &[u32]| -> Vec<f32> { bits.iter().map(|bits| f32::from_bits(*bits)).collect() };
        let (polar, numbers) = numbers.split_at_checked(header[0] as usize)?;
        let (around, candela) = numbers.split_at_checked(header[1] as usize)?;
        let axes = Mat3::from_cols_slice(&list(&header[2..]));
        Self::new(&list(polar), &list(around), &list(candela), axes).ok()
    }
}
