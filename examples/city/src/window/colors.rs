//! Colours for numbers.

/// An sRGB colour.
pub type Rgb = [u8; 3];

/// Where a picture has no value.
pub const NOTHING: Rgb = [110, 110, 110];
/// Trees that wait for a rebuild.
pub const WAITING: Rgb = [255, 64, 64];

/// Boxes of the top level.
pub const TOP_LEVEL: Rgb = [110, 180, 255];
/// The lines of the floor.
pub const FLOOR: Rgb = [48, 48, 48];

/// Anchors of the colour map Inferno (van der Walt and Smith, 2015), at equal distances.
const INFERNO: [Rgb; 9] = [
    [0, 0, 4],
    [31, 12, 72],
    [85, 15, 109],
    [136, 34, 106],
    [186, 54, 85],
    [227, 89, 51],
    [249, 140, 10],
    [249, 201, 50],
    [252, 255, 164],
];
/// Anchors of the colour map Viridis (van der Walt and Smith, 2015), at equal distances.
const VIRIDIS: [Rgb; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

/// Dark for 0, bright for 1; other numbers count as the nearer of both, NaN as 0.
pub fn inferno(share: f32) -> Rgb {
    between(&INFERNO, share)
}

/// Violet for 0, yellow for 1; other numbers count as the nearer of both, NaN as 0.
pub fn viridis(share: f32) -> Rgb {
    between(&VIRIDIS, share)
}

fn between(anchors: &[Rgb; 9], share: f32) -> Rgb {
    let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
    let place = share * (anchors.len() - 1) as f32;
    let first = (place as usize).min(anchors.len() - 2);
    let part = place - first as f32;
    std::array::from_fn(|channel| {
        let [from, to] = [first, first + 1].map(|anchor| f32::from(anchors[anchor][channel]));
        (from + (to - from) * part).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_begin_and_end_at_their_anchors() {
        for (map, anchors) in [(inferno as fn(f32) -> Rgb, INFERNO), (viridis, VIRIDIS)] {
            for (share, anchor) in [(0.0, 0), (-1.0, 0), (f32::NAN, 0), (0.5, 4), (1.0, 8), (f32::INFINITY, 8)] {
                assert_eq!(map(share), anchors[anchor], "{share}");
            }
        }
    }
}
