//! Photometric profiles: how much a lamp emits in each direction, from the files of their makers.
//!
//! A file becomes a [grid](grid::Grid) of angles, which is interpolated; what the light tree needs follows from
//! exact integrals of it. Grids are [kept](interned) for the life of the process, so that lights
//! that refer to them stay plain values.

mod eulumdat;
mod grid;
mod ies;
mod interned;
mod measured;
#[cfg(feature = "bake")]
mod record;
#[cfg(feature = "gpu-plan")]
mod stored;
mod text;

use std::fmt;
use std::hash::{Hash, Hasher};

use glam::Vec3;
#[cfg(feature = "gpu-plan")]
use glam::{Mat3, Quat};

use crate::error::ProfileError;
#[cfg(feature = "gpu-plan")]
pub(crate) use grid::WHOLE_TURN;
use interned::Table;
use measured::{Coordinates, Measured};
#[cfg(feature = "gpu-plan")]
pub(crate) use stored::{for_each_table, stored_quads};
use text::Number;

/// How much a lamp emits in each direction, in candela.
///
/// [`Light::profile`](crate::Light::profile) makes a lamp of it. In the space of the lamp, vertical angle 0 is at
/// -Z, where spots of glTF point too, and the plane C0 is at +X, C90 at +Y. Of types A and B, upward is +X and rightward -Y.
/// Between the angles of a file intensities are interpolated linearly; beyond them it is dark.
///
/// A profile is a reference to a table that is kept as long as the process runs: 4 bytes for each intensity,
/// with those that symmetry adds. Equal tables are kept once. Copies and comparisons cost nothing.
///
/// ```
/// use girandole::{Light, Profile, glam::{Quat, Vec3}};
///
/// // A downlight with a wide beam. The numbers are its vertical angles, its only plane, and candela.
/// let file = b"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 4 1 1 2 0 0 0 1 1 10\n0 30 60 90\n0\n500 600 300 0";
/// let profile = Profile::ies(file)?;
/// assert_eq!(profile.candela(Vec3::NEG_Z), 500.0);
/// assert_eq!(profile.candela(Vec3::Z), 0.0);
/// assert!((profile.flux() - 1941.6).abs() < 1.0);
///
/// // It hangs from a ceiling of a world in which +Y is up.
/// let down = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2);
/// let lamp = Light::profile(Vec3::new(0.0, 3.0, 0.0), down, profile, Vec3::ONE);
/// assert_eq!(lamp.flux(), profile.flux());
/// # Ok::<(), girandole::ProfileError>(())
/// ```
#[derive(Clone, Copy)]
pub struct Profile(&'static Table);

impl Profile {
    /// Reads an IES file: LM-63 of 1986 to 2019, of type A, B or C.
    ///
    /// Candela are multiplied by the file's multiplier, its ballast factor and, before 1995, the factor after it. Types
    /// A and B with angles from 0 to 90 degrees are symmetric, and so is type C with planes from 0 to 90 or 180, or
    /// from 90 to 270. What `TILT` says about tilted lamps is passed over.
    ///
    /// O(intensities).
    ///
    /// # Errors
    /// [`ProfileError`], with the line:
    ///
    /// - a file that ends early, a word that is no number, and a number after the last one, as decimal commas leave;
    /// - UTF-16;
    /// - angles that do not ascend by 0.001 degrees, or are out of range: vertical ones from 0 to 180 for type C, all
    ///   angles from -90 to 90 for types A and B, planes from -180 to 360;
    /// - less than two vertical angles, for types A and B also less than two horizontal ones, and more than 4,096;
    /// - planes that are no turn, with their symmetry; a whole turn may lack the last plane, which is the first;
    /// - intensities that are negative or above 10¹⁵ candela, after all factors;
    /// - more than 262,144 intensities, with the ones that symmetry adds.
    pub fn ies(file: &[u8]) -> Result<Self, ProfileError> {
        Self::of(ies::read(file)?)
    }

    /// Reads a EULUMDAT file. Its intensities are those of 1,000 lumens: they are multiplied by the conversion
    /// factor and by the lumens of the first set of lamps over 1,000.
    ///
    /// O(intensities).
    ///
    /// # Errors
    /// As for [`Profile::ies`], with at most 1,024 planes and angles of a plane. Numbers may follow the last one.
    pub fn eulumdat(file: &[u8]) -> Result<Self, ProfileError> {
        Self::of(eulumdat::read(file)?)
    }

    /// Makes a profile of type C: candela at vertical angles, 0 at nadir to 180 degrees, in planes at horizontal
    /// angles, which are completed by symmetry as those of [files](Self::ies). The candela of a plane follow each
    /// other. Other numbers of candela than the product of both are refused.
    ///
    /// O(intensities).
    ///
    /// # Errors
    /// As for [`Profile::ies`]; the line is the index of a number in its list, from 1 on.
    pub fn new(vertical: &[f32], horizontal: &[f32], candela: &[f32]) -> Result<Self, ProfileError> {
        let numbers = |values: &[f32], what: &'static str| -> Vec<Number> {
            let number = |(at, value): (usize, &f32)| Number { value: f64::from(*value), line: at + 1, what };
            values.iter().enumerate().map(number).collect()
        };
        let vertical = numbers(vertical, "a vertical angle");
        let horizontal = numbers(horizontal, "a horizontal angle");
        for (list, fewest, what) in [(&vertical, 2, "a second vertical angle"), (&horizontal, 1, "a plane")] {
            if list.len() < fewest {
                return Err(ProfileError::Missing { line: list.len() + 1, what });
            }
        }
        let (found, expected) = (candela.len(), measured::check_size(&vertical, &horizontal)?);
        if found != expected {
            return Err(ProfileError::Candela { found, expected });
        }
        let candela = numbers(candela, "an intensity");
        Self::of(Measured { coordinates: Coordinates::C, vertical, horizontal, candela, factor: 1.0 })
    }

    fn of(measured: Measured) -> Result<Self, ProfileError> {
        Ok(Self(interned::intern(measured.grid()?)))
    }

    /// The intensity in a direction in the space of the lamp, in candela. The direction need not have unit length;
    /// along the zero vector it is 0.
    pub fn candela(self, direction: Vec3) -> f32 {
        if direction == Vec3::ZERO {
            return 0.0;
        }
        self.0.grid.candela(self.0.grid.axes.transpose() * direction)
    }

    /// All that the lamp emits, in lumens: the exact integral of its intensities.
    pub fn flux(self) -> f32 {
        self.0.lobe.flux
    }

    /// The greatest intensity, in candela.
    pub fn greatest_candela(self) -> f32 {
        self.0.greatest
    }

    /// A number that is the same for equal profiles in all processes and versions: a hash of the table. Baked trees name
    /// profiles by it.
    pub fn id(self) -> u64 {
        self.0.id
    }

    /// The profile with a number, if an equal one was made in this process.
    pub fn of_id(id: u64) -> Option<Self> {
        interned::table_of(id).map(Self)
    }

    /// Where the table of a GPU ends, in quads before the map of the sky.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn stored_end(self) -> u32 {
        self.0.end
    }

    /// The mean direction of emission in the space of the lamp, as long as the mean cosine of the angle to it.
    pub(crate) fn mean(self) -> Vec3 {
        self.0.lobe.mean
    }

    /// All light leaves within this angle of the mean direction, in radians.
    pub(crate) fn half_angle(self) -> f32 {
        self.0.lobe.half_angle
    }

    /// The axes of the grid, in the space in which a rotation turns the lamp.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn axes(self, rotation: Quat) -> Mat3 {
        let (axes, rotation) = (self.0.grid.axes, rotation.normalize());
        Mat3::from_cols(rotation * axes.x_axis, rotation * axes.y_axis, rotation * axes.z_axis)
    }
}

impl PartialEq for Profile {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.0, other.0)
    }
}

impl Eq for Profile {}

impl Hash for Profile {
    fn hash<H: Hasher>(&self, state: &mut H) {
        std::ptr::hash(self.0, state);
    }
}

impl fmt::Debug for Profile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Table { grid, lobe, .. } = self.0;
        let planes = [grid.around.len(), grid.polar.len()];
        f.debug_struct("Profile").field("lumens", &lobe.flux).field("planes", &planes).finish_non_exhaustive()
    }
}

#[cfg(test)]
pub(crate) mod tests;
