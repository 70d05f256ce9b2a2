//! Reads EULUMDAT files: one number or name on each line.
//!
//! After A. W. Stockmar, EULUMDAT: a European file format for luminaires (1990).

use super::measured::{Coordinates, Measured, value_count};
use super::text::{Number, Reader};
use crate::error::AssetError;

/// The most planes and the most angles of a plane.
const MAX_ANGLES: usize = 1024;

/// The greatest number of lumens, and of factors.
const MAX_NUMBER: f64 = 1.0e15;

/// The greatest number of sets of lamps that a file has.
const MAX_SETS: usize = 100;

/// The table of a file. Where a file has several sets of lamps, they are the first.
pub(super) fn read(text: &[u8]) -> Result<Measured, AssetError> {
    let mut reader = Reader::new(text)?;
    reader.skip(2, "the maker and the kind of lamp")?;
    let symmetry = reader.number_of_line("the symmetry")?.count(0, 4)?;
    let planes = reader.number_of_line("the number of C planes")?.count(1, MAX_ANGLES)?;
    reader.number_of_line("the distance of C planes")?;
    let rows = reader.number_of_line("the number of angles in a plane")?.count(2, MAX_ANGLES)?;
    reader.skip(17, "a description of the luminaire")?;
    let factor = reader.number_of_line("the conversion factor")?.between(0.0, MAX_NUMBER)?;
    reader.skip(1, "the tilt")?;
    let sets = reader.number_of_line("the number of sets of lamps")?.count(1, MAX_SETS)?;
    reader.skip(2, "the number and type of lamps")?;
    let lumens = reader.number_of_line("the lumens of lamps")?.between(0.0, MAX_NUMBER)?;
    // The rest of the first set, the others, and ten ratios.
    reader.skip(3 + 6 * (sets - 1) + 10, "lamps and direct ratios")?;
    let all_horizontal = reader.numbers_of_lines(planes, "the angle of a C plane")?;
    let vertical = reader.numbers_of_lines(rows, "an angle in a plane")?;
    // Which of the planes follow, as the format counts them.
    let (first, count) = match symmetry {
        0 => (0, planes),
        1 => (0, 1),
        2 => (0, planes / 2 + 1),
        3 => (3 * planes / 4, planes / 2 + 1),
        _ => (0, planes / 4 + 1),
    };
    let horizontal: Vec<Number> = (first..first + count)
        .map(|plane| {
            let number = all_horizontal[plane % planes];
            // The half that is symmetric about C90 to C270 begins before C0.
            Number {
                value: if symmetry == 3 && plane < planes { number.value - 360.0 } else { number.value },
                ..number
            }
        })
        .collect();
    let candela = reader.numbers_of_lines(value_count(&vertical, &horizontal)?, "an intensity")?;
    // Intensities are those of a thousand lumens.
    Ok(Measured { coordinates: Coordinates::C, vertical, horizontal, candela, factor: factor * lumens / 1000.0 })
}
