//! Photometric profiles from the files of lamps' makers.
//!
//! In the space of a lamp, vertical angle 0 is at -Z, where spots of glTF point too, and the plane C0 is at +X, C90
//! at +Y. Of types A and B, upward is +X and rightward -Y. Between the angles of a file intensities are interpolated
//! linearly; beyond them it is dark.
//!
//! ```
//! use girandole_assets::girandole::glam::Vec3;
//! use girandole_assets::profile;
//!
//! // A downlight with a wide beam. The numbers are its vertical angles, its only plane, and candela.
//! let file = b"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 4 1 1 2 0 0 0 1 1 10\n0 30 60 90\n0\n500 600 300 0";
//! let lamp = profile::ies(file)?;
//! assert_eq!((lamp.candela(Vec3::NEG_Z), lamp.candela(Vec3::Z)), (500.0, 0.0));
//! assert!((lamp.flux() - 1941.6).abs() < 1.0);
//! # Ok::<(), girandole_assets::AssetError>(())
//! ```

mod eulumdat;
mod ies;
mod measured;
mod text;

use girandole::Profile;

use crate::error::AssetError;

/// Reads an IES file: LM-63 of 1986 to 2019, of type A, B or C.
///
/// Candela are multiplied by the file's multiplier, its ballast factor and, before 1995, the factor after it. Types
/// A and B with angles from 0 to 90 degrees are symmetric, and so is type C with planes from 0 to 90 or 180, or
/// from 90 to 270. What `TILT` says about tilted lamps is passed over.
///
/// O(intensities).
///
/// # Errors
/// [`AssetError::Invalid`], with the line, for
///
/// - a file that ends early, a word that is no number, and a number after the last one, as decimal commas leave;
/// - UTF-16;
/// - angles that do not ascend by 0.001 degrees, or are out of range: vertical ones from 0 to 180 for type C, all
///   angles from -90 to 90 for types A and B, planes from -180 to 360;
/// - less than two vertical angles, for types A and B also less than two horizontal ones, and more than 4,096;
/// - planes that are no turn, with their symmetry; a whole turn may lack the last plane, which is the first;
/// - intensities that are negative or above 10¹⁵ candela, after all factors;
/// - more than 262,144 intensities, with the ones that symmetry adds.
pub fn ies(file: &[u8]) -> Result<Profile, AssetError> {
    ies::read(file)?.profile()
}

/// Reads a EULUMDAT file. Its intensities are those of 1,000 lumens: they are multiplied by the conversion
/// factor and by the lumens of the first set of lamps over 1,000.
///
/// O(intensities).
///
/// # Errors
/// As for [`ies`], with at most 1,024 planes and angles of a plane. Numbers may follow the last one.
pub fn eulumdat(file: &[u8]) -> Result<Profile, AssetError> {
    eulumdat::read(file)?.profile()
}

#[cfg(test)]
mod tests;
