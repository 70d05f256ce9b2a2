//! Photometric profiles: how much a lamp emits in each direction, as its maker has measured it.
//!
//! Intensities lie on a [grid](grid::Grid) of angles and are interpolated; what the light tree needs follows from
//! exact integrals of them. Grids are [kept](interned) for the life of the process, so that lights
//! that refer to them stay plain values.

mod grid;
mod interned;
#[cfg(feature = "bake")]
mod record;
#[cfg(feature = "gpu-plan")]
mod stored;

use std::fmt;
use std::hash::{Hash, Hasher};

#[cfg(feature = "gpu-plan")]
use glam::Quat;
use glam::{Mat3, Vec3};

use crate::error::ProfileError;
use grid::Grid;
#[cfg(feature = "gpu-plan")]
pub(crate) use grid::WHOLE_TURN;
use interned::Table;
#[cfg(feature = "gpu-plan")]
pub(crate) use stored::{for_each_table, stored_quads};

/// How much a lamp emits in each direction, in candela.
///
/// [`Light::profile`](crate::Light::profile) makes a lamp of it. Between the angles that are given, intensities are
/// interpolated linearly; beyond them it is dark. The package `girandole-assets` reads the files of makers (IES and
/// EULUMDAT).
///
/// A profile is a reference to a table that is kept as long as the process runs: 4 bytes for each intensity.
/// Equal tables are kept once. Copies and comparisons cost nothing.
///
/// ```
/// use girandole::glam::{Mat3, Quat, Vec3};
/// use girandole::{Light, Profile};
///
/// // A downlight with a wide beam, the same all around. It points to -Z, as spots do.
/// let degrees = [0.0_f32, 30.0, 60.0, 90.0].map(f32::to_radians);
/// let axes = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::NEG_Z);
/// let profile = Profile::new(&degrees, &[0.0], &[500.0, 600.0, 300.0, 0.0], axes)?;
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
    /// Makes a profile of intensities on a grid of angles in radians: `polar` from a pole, `around` around it. For each
    /// angle around, `candela` has the intensities at all angles from the pole. A single angle around stands for all.
    ///
    /// The columns of `axes` are directions in the space of the lamp, each along one of its axes: where the angle around
    /// is 0, where it is a quarter of a turn, and the pole.
    ///
    /// O(intensities).
    ///
    /// # Errors
    /// [`ProfileError`] for
    ///
    /// - less than two angles from the pole, or none around it;
    /// - more than 262,144 intensities, or not one for each pair of angles;
    /// - angles that do not ascend by 10⁻⁵, or are out of range: from 0 to π from the pole, from one turn before 0 to two
    ///   turns after it around the pole, and these within one turn;
    /// - intensities that are negative, not finite or above 10¹⁵ candela;
    /// - axes that are no rotation or reflection which takes axes to axes.
    pub fn new(polar: &[f32], around: &[f32], candela: &[f32], axes: Mat3) -> Result<Self, ProfileError> {
        // A sum turns -0 into 0, so that equal tables have equal bits.
        let list = |numbers: &[f32]| numbers.iter().map(|number| number + 0.0).collect();
        let axes = Mat3::from_cols_array(&axes.to_cols_array().map(|entry| entry + 0.0));
        let grid = Grid { polar: list(polar), around: list(around), candela: list(candela), axes };
        grid.check()?;
        Ok(Self(interned::intern(grid)))
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
