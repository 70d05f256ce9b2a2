//! The errors of this crate: each states what was given and what is allowed.
//!
//! A call that returns an error has changed nothing.
//!
//! # Codes
//! Every error has a `code()`, a stable number for engines that pass errors through C or a log. A
//! code keeps its meaning in all later versions, and a new error gets a new code. A [`WorldError`]
//! that wraps another error returns the code of the inner error. The ranges:
//!
//! | codes | type |
//! |---|---|
//! | 100 | [`ValueError`] |
//! | 200 to 299 | [`WorldError`] |
//! | 600 to 699 | `gpu::GpuError`, `plan::PlanError` |
//! | 700 to 799 | `AssetError` of the package `girandole-assets` |
//! | 800 | `tree::CheckError` |
//! | 900 | `plan::ShaderNameError` |
//! | 1100 to 1104 | `LoadError` |
//! | 1300 to 1305 | [`SkyError`] |
//! | 1400 | [`ProfileError`] |

use std::error::Error;
use std::fmt;

use glam::{DVec3, Vec3};

use crate::keys::{DirectionalKey, InstanceKey, RegionKey, TreeKey};

/// Why a number was refused: what was given, and what is allowed. Code 100.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ValueError {
    /// What the number is.
    pub what: &'static str,
    /// The given value.
    pub value: f64,
    /// What is asked of the number besides its range, such as "a power of two"; empty if nothing is.
    pub rule: &'static str,
    /// The least value allowed.
    pub min: f64,
    /// The greatest value allowed.
    pub max: f64,
}

impl ValueError {
    pub(crate) const fn new(what: &'static str, value: f64, min: f64, max: f64) -> Self {
        Self { what, value, rule: "", min, max }
    }

    /// The stable code, see [`error`](self).
    pub fn code(&self) -> u32 {
        100
    }
}

impl Error for ValueError {}

impl fmt::Display for ValueError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, value, rule, min, max } = *self;
        let comma = if rule.is_empty() { "" } else { ", " };
        let [value, min, max] = [value, min, max].map(shown);
        write!(f, "{what} is {value}; it must be {rule}{comma}from {min} to {max}")
    }
}

/// A number with the fewest digits that tell it from others of its precision.
fn shown(value: f64) -> String {
    let single = value as f32;
    let is_single = f64::from(single) == value;
    if value != 0.0 && !(1.0e-4..1.0e10).contains(&value.abs()) {
        return if is_single { format!("{single:?}") } else { format!("{value:?}") };
    }
    // An f32 of more than seven digits would be shown with zeros at its end.
    if is_single && value.fract() != 0.0 { single.to_string() } else { value.to_string() }
}

/// Checks that a number lies in a range. NaN is in none.
pub(crate) fn check_range(what: &'static str, value: f32, min: f32, max: f32) -> Result<(), ValueError> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    Err(ValueError::new(what, value.into(), min.into(), max.into()))
}

/// Checks that no coordinate of a point is further than `limit` from zero, NaN or infinite.
pub(crate) fn check_point(what: &'static str, point: DVec3, limit: f64) -> Result<(), ValueError> {
    match point.to_array().into_iter().find(|value| !(-limit..=limit).contains(value)) {
        Some(value) => Err(ValueError::new(what, value, -limit, limit)),
        None => Ok(()),
    }
}

/// Why a world or a tree refused a call, which has then changed nothing. Codes 201 to 216, or the
/// code of the error inside.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WorldError {
    /// A number is not allowed.
    #[error(transparent)]
    Value(#[from] ValueError),
    /// One entry of a list is refused, and with it the whole list: a light, a move, a tree or an instance of a region.
    #[error("{what} {index}: {source}")]
    Entry {
        /// What the entry is.
        what: &'static str,
        /// Its index: in the given list, or in the tree where the call names lights by index.
        index: usize,
        /// What is wrong with it.
        source: Box<WorldError>,
    },
    /// The tree has no light of this index.
    #[error("light index {index} in a tree of {count} lights")]
    NoSuchLight {
        /// The given index.
        index: u32,
        /// The number of indices in the tree, those of removed lights included.
        count: usize,
    },
    /// The light of this index was removed: before, or in the same call.
    #[error("light index {index} is that of a light that was removed")]
    RemovedLight {
        /// The given index.
        index: u32,
    },
    /// No tree has this key: it was removed, or never existed. A key of another world is not
    /// recognized as such; it may name something else here.
    #[error("no tree {0:?} in this world")]
    NoSuchTree(TreeKey),
    /// No instance has this key, see [`WorldError::NoSuchTree`].
    #[error("no instance {0:?} in this world")]
    NoSuchInstance(InstanceKey),
    /// No directional light has this key, see [`WorldError::NoSuchTree`].
    #[error("no directional light {0:?} in this world")]
    NoSuchDirectional(DirectionalKey),
    /// No region has this key, see [`WorldError::NoSuchTree`].
    #[error("no region {0:?} in this world")]
    NoSuchRegion(RegionKey),
    /// The region that is being filled has no tree of this index.
    #[error("tree index {index} in a region of {count} trees")]
    NoSuchRegionTree {
        /// The given index.
        index: usize,
        /// The number of trees in the region.
        count: usize,
    },
    /// A tree of the region has instances that are not part of the region.
    #[error("tree {tree:?} of region {region:?} has {instances} instances outside of it; remove them first")]
    RegionInUse {
        /// The region.
        region: RegionKey,
        /// The tree.
        tree: TreeKey,
        /// The number of its instances outside of the region.
        instances: usize,
    },
    /// The tree still has instances.
    #[error("tree {tree:?} still has {instances} instances; remove them first")]
    TreeInUse {
        /// The tree.
        tree: TreeKey,
        /// The number of its instances.
        instances: usize,
    },
    /// All instances of the tree have [`Policy::Static`](crate::Policy::Static), so its lights
    /// cannot change.
    #[error("tree {0:?} is static: every instance of it has Policy::Static")]
    StaticTree(TreeKey),
    /// A light of the tree has a profile, which kernels on the GPU cannot bound.
    #[error("a light of the tree has a profile; such lights cannot be written on the GPU")]
    ProfileOnGpu,
}

impl WorldError {
    /// The stable code, see [`error`](self).
    pub fn code(&self) -> u32 {
        match self {
            Self::Value(source) => source.code(),
            Self::Entry { source, .. } => source.code(),
            Self::NoSuchLight { .. } => 201,
            Self::NoSuchTree(_) => 202,
            Self::NoSuchInstance(_) => 203,
            Self::NoSuchDirectional(_) => 204,
            Self::TreeInUse { .. } => 205,
            Self::StaticTree(_) => 206,
            Self::RemovedLight { .. } => 210,
            Self::NoSuchRegion(_) => 211,
            Self::NoSuchRegionTree { .. } => 212,
            Self::RegionInUse { .. } => 213,
            Self::ProfileOnGpu => 216,
        }
    }

    /// [`WorldError::Entry`].
    pub(crate) fn entry(what: &'static str, index: usize, source: impl Into<Self>) -> Self {
        Self::Entry { what, index, source: Box::new(source.into()) }
    }
}

/// Why [`LightTree::from_baked`](crate::LightTree::from_baked) or [`LightWorld::from_dump`](crate::LightWorld::from_dump)
/// refused some bytes. Nothing was loaded. Codes 1100 to 1104.
#[cfg(feature = "bake")]
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The bytes do not start as those of the format.
    #[error("the first bytes are not those of {expected}")]
    Format {
        /// What should have been loaded.
        expected: &'static str,
    },
    /// The file has a version of the format that this version of the library does not read.
    #[error("version {given} of the format; this library reads version {supported}: write the file again")]
    Version {
        /// The version of the file.
        given: u32,
        /// The version that is read.
        supported: u32,
    },
    /// The content differs from what was written.
    #[error("the {bytes} bytes do not have the checksum at their end: the file is damaged or incomplete")]
    Damaged {
        /// The given number of bytes.
        bytes: usize,
    },
    /// A light has a [`Profile`](crate::Profile) that was not made in this process. Files of trees do not hold
    /// profiles, which many trees share: read them before the trees.
    #[error("light {light} has a profile that was not made before: its number is {id:#018x}")]
    Profile {
        /// The index of the light.
        light: usize,
        /// The [number](crate::Profile::id) of the profile.
        id: u64,
    },
    /// The checksum is right, but no tree or world is written so, or it is larger than what is loaded.
    #[error("{what}: {why}")]
    Content {
        /// What is refused, with its index among those of its kind.
        what: String,
        /// What is wrong with it.
        why: String,
    },
}

#[cfg(feature = "bake")]
impl LoadError {
    /// The stable code, see [`error`](self).
    pub fn code(&self) -> u32 {
        match self {
            Self::Format { .. } => 1100,
            Self::Version { .. } => 1101,
            Self::Damaged { .. } => 1102,
            Self::Profile { .. } => 1103,
            Self::Content { .. } => 1104,
        }
    }

    /// [`LoadError::Content`].
    pub(crate) fn content(what: impl fmt::Display, why: impl fmt::Display) -> Self {
        Self::Content { what: what.to_string(), why: why.to_string() }
    }
}

/// Why a [`Sky`](crate::Sky), or a part of one, was refused. Codes 1300 to 1305.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SkyError {
    /// The pixels are no whole rows, none, or too many; or those of an octahedral map are no square.
    #[error("{pixels} pixels fill no map of {width} columns; its width and height must be 1 to {max}")]
    Size {
        /// The given width.
        width: usize,
        /// The given number of pixels.
        pixels: usize,
        /// The largest width and height.
        max: usize,
    },
    /// A pixel is negative, not finite or too bright.
    #[error("pixel {pixel} is {value}; each channel must be from 0 to {max}")]
    Pixel {
        /// The index of the pixel.
        pixel: usize,
        /// The given pixel.
        value: Vec3,
        /// The greatest value allowed.
        max: f32,
    },
    /// A part of the map leaves it, or has another number of pixels.
    #[error("{pixels} pixels are no part of {size:?} at {corner:?} in a map of {map:?}")]
    Part {
        /// The first column and row of the part.
        corner: [usize; 2],
        /// The columns and rows of the part.
        size: [usize; 2],
        /// The given number of pixels.
        pixels: usize,
        /// The columns and rows of the map.
        map: [usize; 2],
    },
    /// The world has no sky.
    #[error("the world has no sky")]
    NoSky,
    /// There are too many portals.
    #[error("{given} portals are more than {max}")]
    Portals {
        /// The given number.
        given: usize,
        /// The greatest number allowed.
        max: usize,
    },
    /// A portal has a number that is not finite, no area, or a room without a volume.
    #[error("portal {portal} has a number that is not finite, no area, or a room without a volume")]
    Portal {
        /// The index of the portal.
        portal: usize,
    },
}

impl SkyError {
    /// The stable code, see [`error`](self).
    pub fn code(&self) -> u32 {
        match self {
            Self::Size { .. } => 1300,
            Self::Pixel { .. } => 1301,
            Self::Part { .. } => 1302,
            Self::NoSky => 1303,
            Self::Portals { .. } => 1304,
            Self::Portal { .. } => 1305,
        }
    }
}

/// Why a [`Profile`](crate::Profile) was refused. Code 1400.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[error("{message}")]
pub struct ProfileError {
    /// What was given, and what is allowed.
    pub message: String,
}

impl ProfileError {
    /// The stable code, see [`error`](self).
    pub fn code(&self) -> u32 {
        1400
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// Errors of a world that wrap no other.
    fn world_errors() -> [WorldError; 11] {
        [
            WorldError::NoSuchLight { index: 3, count: 2 },
            WorldError::NoSuchTree(TreeKey::default()),
            WorldError::NoSuchInstance(InstanceKey::default()),
            WorldError::NoSuchDirectional(DirectionalKey::default()),
            WorldError::TreeInUse { tree: TreeKey::default(), instances: 1 },
            WorldError::StaticTree(TreeKey::default()),
            WorldError::RemovedLight { index: 3 },
            WorldError::NoSuchRegion(RegionKey::default()),
            WorldError::NoSuchRegionTree { index: 3, count: 2 },
            WorldError::RegionInUse { region: RegionKey::default(), tree: TreeKey::default(), instances: 1 },
            WorldError::ProfileOnGpu,
        ]
    }

    #[test]
    fn all_codes_are_distinct_and_an_error_that_wraps_another_has_the_inner_code() {
        let errors = world_errors();
        let codes: BTreeSet<u32> = errors.iter().map(WorldError::code).collect();
        assert_eq!(codes.len(), errors.len());
        assert!(codes.iter().all(|code| (201..=216).contains(code)));
        let value = ValueError::new("field", 3.0, 0.0, 2.0);
        assert_eq!((value.code(), WorldError::from(value).code()), (100, 100));
        for error in errors {
            assert_eq!(WorldError::entry("move", 7, error.clone()).code(), error.code());
        }
        assert_eq!(WorldError::entry("light", 7, value).to_string(), "light 7: field is 3; it must be from 0 to 2");
    }

    #[test]
    fn messages_state_what_was_given_and_what_is_allowed() {
        let message = |value, min, max| ValueError::new("field", value, min, max).to_string();
        assert_eq!(message(f64::from(0.1_f32), 0.2, 1.0), "field is 0.1; it must be from 0.2 to 1");
        assert_eq!(message(f64::NAN, -1.0e9, 1.0e9), "field is NaN; it must be from -1000000000 to 1000000000");
        let max = f64::from(f32::MAX);
        assert_eq!(message(f64::INFINITY, 0.0, max), "field is inf; it must be from 0 to 3.4028235e38");
        assert_eq!(message(1.0e300, 1.0, 1.0e9 + 0.5), "field is 1e300; it must be from 1 to 1000000000.5");
        let even = ValueError { rule: "even", ..ValueError::new("field", 3.0, 0.0, 8.0) };
        assert_eq!(even.to_string(), "field is 3; it must be even, from 0 to 8");
    }
}
