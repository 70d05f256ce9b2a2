//! Reads LM-63 files of the Illuminating Engineering Society, from 1986 to 2019.
//!
//! What the parts of a file mean is described by [EXT_lights_ies] and in its references. A number may stand on any
//! line, so lines count for errors only.
//!
//! [EXT_lights_ies]: https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_lights_ies

use super::measured::{Coordinates, Measured, value_count};
use super::text::{Reader, missing};
use crate::error::AssetError;

/// The most angles of a kind.
const MAX_ANGLES: usize = 4096;

/// The greatest factor and the greatest number of candela of a file.
const MAX_NUMBER: f64 = 1.0e15;

/// The table of a file.
pub(super) fn read(text: &[u8]) -> Result<Measured, AssetError> {
    let mut reader = Reader::new(text)?;
    let factor_of_file = has_ballast_factor(&mut reader)?;
    // How many lamps and their lumens say nothing about directions.
    reader.number("the number of lamps")?;
    reader.number("the lumens of a lamp")?;
    let multiplier = reader.number("the multiplier of the candela values")?.between(0.0, MAX_NUMBER)?;
    let vertical = reader.number("the number of vertical angles")?.count(2, MAX_ANGLES)?;
    let horizontal = reader.number("the number of horizontal angles")?.count(1, MAX_ANGLES)?;
    let coordinates = match reader.number("the photometric type")?.count(1, 3)? {
        1 => Coordinates::C,
        2 => Coordinates::B,
        _ => Coordinates::A,
    };
    for what in ["the type of units", "the width", "the length", "the height"] {
        reader.number(what)?;
    }
    let ballast = reader.number("the ballast factor")?.between(0.0, MAX_NUMBER)?;
    let second = reader.number("the number after the ballast factor")?;
    let factor = multiplier * ballast * if factor_of_file { second.between(0.0, MAX_NUMBER)? } else { 1.0 };
    reader.number("the input watts")?;
    let vertical = reader.numbers(vertical, "a vertical angle")?;
    let horizontal = reader.numbers(horizontal, "a horizontal angle")?;
    let candela = reader.numbers(value_count(&vertical, &horizontal)?, "a candela value")?;
    reader.end()?;
    Ok(Measured { coordinates, vertical, horizontal, candela, factor })
}

/// Passes the head of a file. Returns whether the number after the ballast factor is a factor as well: later
/// versions have a number there that says how the file was made.
fn has_ballast_factor(reader: &mut Reader<'_>) -> Result<bool, AssetError> {
    // Of the first line that is not blank.
    let mut names_later_version = None;
    loop {
        let (_, text) = reader.line().ok_or_else(|| missing(1, "a line that begins with TILT="))?;
        let upper = text.to_ascii_uppercase();
        if !text.is_empty() && names_later_version.is_none() {
            let later = [&b"LM-63-1995"[..], b"LM-63-2002", b"LM-63-2019"];
            names_later_version = Some(later.iter().any(|name| upper.ends_with(name)));
        }
        let Some(tilt) = upper.strip_prefix(b"TILT=") else { continue };
        // How much the lamps emit when the luminaire is tilted; the tilt of an instance does not change it.
        if tilt.trim_ascii() == b"INCLUDE" {
            reader.number("the position of the lamp")?;
            let count = reader.number("the number of tilts")?.count(0, MAX_ANGLES)?;
            (0..2 * count).try_for_each(|_| reader.number("a tilt or its factor").map(drop))?;
        }
        return Ok(names_later_version != Some(true));
    }
}
