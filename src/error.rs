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
//! | 100 to 199 | [`LightError`] |
//! | 200 to 299 | [`WorldError`] |
//! | 300 to 399 | [`PlacementError`] |
//! | 400 | [`BudgetError`] |
//! | 600 to 699 | `gpu::GpuError`, `plan::PlanError` |
//! | 700 to 799 | `AssetError` of the package `girandole-assets` |
//! | 800 | `tree::CheckError` |
//! | 900 | `plan::ShaderNameError` |
//! | 1000 to 1001 | [`CellError`] |
//! | 1100 to 1104 | `LoadError` |
//! | 1300 to 1305 | [`SkyError`] |
//! | 1400 | [`ProfileError`] |

use glam::{DVec3, Vec3};

use crate::keys::{DirectionalKey, InstanceKey, RegionKey, TreeKey};

/// Why a light was refused. Codes 100 to 104.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LightError {
    /// A number is NaN or infinite.
    #[error("{what} is {value}, not a finite number")]
    NotFinite {
        /// The name of the field.
        what: &'static str,
        /// The given value.
        value: f32,
    },
    /// A number lies outside the range that the kind of light allows.
    #[error("{what} is {value}, outside {min} to {max}")]
    OutOfRange {
        /// The name of the field.
        what: &'static str,
        /// The given value.
        value: f32,
        /// The least value allowed.
        min: f32,
        /// The greatest value allowed.
        max: f32,
    },
    /// A direction is the zero vector.
    #[error("{what} has no direction: its length is 0")]
    NoDirection {
        /// The name of the field.
        what: &'static str,
    },
    /// A direction is not of unit length.
    #[error("{what} has length {length}; it must be a unit vector, to within {tolerance}")]
    NotUnitLength {
        /// The name of the field.
        what: &'static str,
        /// The length of the given vector.
        length: f32,
        /// How far the length may be from 1.
        tolerance: f32,
    },
    /// A number is zero, negative or NaN.
    #[error("{what} is {value}; it must be above 0")]
    NotPositive {
        /// The name of the field.
        what: &'static str,
        /// The given value.
        value: f32,
    },
}

impl LightError {
    /// The stable code, see [`error`](self).
    pub fn code(&self) -> u32 {
        match self {
            Self::NotFinite { .. } => 100,
            Self::OutOfRange { .. } => 101,
            Self::NoDirection { .. } => 102,
            Self::NotUnitLength { .. } => 103,
            Self::NotPositive { .. } => 104,
        }
    }
}

/// Why a world or a tree refused a call, which has then changed nothing. Codes 200 to 215, or the
/// code of the error inside.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WorldError {
    /// One light of a list is refused, and with it the whole list.
    #[error("light {index}: {source}")]
    Light {
        /// The light's index: in the given list, or in the tree where the call names lights by
        /// index.
        index: usize,
        /// What is wrong with the light.
        source: LightError,
    },
    /// A directional light is refused.
    #[error("directional light: {source}")]
    Directional {
        /// What is wrong with the light.
        source: LightError,
    },
    /// A placement is refused.
    #[error("placement: {0}")]
    Placement(#[from] PlacementError),
    /// One move of a list is refused, and with it the whole list.
    #[error("move {index}: {source}")]
    Move {
        /// The index of the move in the given list.
        index: usize,
        /// [`WorldError::NoSuchInstance`] or [`WorldError::Placement`].
        source: Box<WorldError>,
    },
    /// A tree of a region is refused, and with it the whole region.
    #[error("tree {index} of the region: {source}")]
    RegionTree {
        /// The index of the tree in the region.
        index: usize,
        /// [`WorldError::NoSuchTree`].
        source: Box<WorldError>,
    },
    /// An instance of a region is refused, and with it the whole region.
    #[error("instance {index} of the region: {source}")]
    RegionInstance {
        /// The index of the instance in the region.
        index: usize,
        /// [`WorldError::Placement`].
        source: Box<WorldError>,
    },
    /// More lights than a tree can hold.
    #[error("{given} lights in one tree; the limit is {limit}")]
    TooManyLights {
        /// The given number of lights.
        given: usize,
        /// The most lights that a tree holds.
        limit: usize,
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
    /// A threshold of a policy is not finite or is too small.
    #[error("policy: {what} is {value}; it must be finite and at least {min}")]
    Policy {
        /// The name of the field.
        what: &'static str,
        /// The given value.
        value: f32,
        /// The least value allowed.
        min: f32,
    },
    /// A coordinate of the viewpoint or of the origin is NaN or infinite.
    #[error("{what} is {value}, not a finite number")]
    NotFinite {
        /// A description of the coordinate.
        what: &'static str,
        /// The given value.
        value: f64,
    },
    /// A channel of the factor of an instance is negative, NaN or too large.
    #[error("a channel of the factor is {value}; it must be from 0 to {limit}")]
    Factor {
        /// The given value.
        value: f32,
        /// The greatest value allowed.
        limit: f32,
    },
    /// A light of the tree has a profile, which kernels on the GPU cannot bound.
    #[error("a light of the tree has a profile; such lights cannot be written on the GPU")]
    ProfileOnGpu,
    /// The origin does not lie on the grid of the world's [`OriginMode`](crate::OriginMode).
    #[error("a coordinate of the origin is {value} m; it must be a multiple of {grid} m")]
    OriginOffGrid {
        /// The given coordinate, in metres.
        value: f64,
        /// [`ORIGIN_GRID`](crate::ORIGIN_GRID).
        grid: f64,
    },
    /// The origin, or the viewpoint that it would follow, is too far from zero for a world whose
    /// origin lies on a grid.
    #[error("{what} is {value} m; the limit is {limit} m where the origin lies on a grid")]
    OriginTooFar {
        /// A description of the coordinate.
        what: &'static str,
        /// The given coordinate, in metres.
        value: f64,
        /// The greatest absolute value allowed, in metres.
        limit: f64,
    },
}

impl WorldError {
    /// The stable code, see [`error`](self).
    pub fn code(&self) -> u32 {
        match self {
            Self::Light { source, .. } | Self::Directional { source } => source.code(),
            Self::Placement(source) => source.code(),
            Self::Move { source, .. } | Self::RegionTree { source, .. } | Self::RegionInstance { source, .. } => {
                source.code()
            }
            Self::TooManyLights { .. } => 200,
            Self::NoSuchLight { .. } => 201,
            Self::NoSuchTree(_) => 202,
            Self::NoSuchInstance(_) => 203,
            Self::NoSuchDirectional(_) => 204,
            Self::TreeInUse { .. } => 205,
            Self::StaticTree(_) => 206,
            Self::Policy { .. } => 207,
            Self::NotFinite { .. } => 208,
            Self::Factor { .. } => 209,
            Self::RemovedLight { .. } => 210,
            Self::NoSuchRegion(_) => 211,
            Self::NoSuchRegionTree { .. } => 212,
            Self::RegionInUse { .. } => 213,
            Self::OriginOffGrid { .. } => 214,
            Self::OriginTooFar { .. } => 215,
            Self::ProfileOnGpu => 216,
        }
    }
}

/// Checks that no coordinate of a point is NaN or infinite.
pub(crate) fn check_finite(what: &'static str, point: DVec3) -> Result<(), WorldError> {
    match point.to_array().into_iter().find(|value| !value.is_finite()) {
        Some(value) => Err(WorldError::NotFinite { what, value }),
        None => Ok(()),
    }
}

/// Why a placement was refused. Codes 300 to 303.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlacementError {
    /// A number is NaN or infinite.
    #[error("{what} is {value}, not a finite number")]
    NotFinite {
        /// A description of the number.
        what: &'static str,
        /// The given value.
        value: f64,
    },
    /// An entry of the linear part is too large.
    #[error("an entry of the linear part is {value}; the limit is {limit}")]
    TooLarge {
        /// The given value.
        value: f32,
        /// The greatest absolute value allowed.
        limit: f32,
    },
    /// The translation is too far from the world's origin, see
    /// [`LightWorld::set_origin`](crate::LightWorld::set_origin).
    #[error("{distance} m from the world's origin along one axis; the limit is {limit} m")]
    TooFar {
        /// The largest distance from the origin along one axis, in metres.
        distance: f64,
        /// The greatest distance allowed, in metres.
        limit: f64,
    },
    /// The translation is too far from zero for a world whose origin lies on a grid, see
    /// [`OriginMode`](crate::OriginMode).
    #[error("{distance} m from zero along one axis; the limit is {limit} m where the origin lies on a grid")]
    TooFarFromZero {
        /// The largest coordinate without its sign, in metres.
        distance: f64,
        /// The greatest distance allowed, in metres.
        limit: f64,
    },
}

impl PlacementError {
    /// The stable code, see [`error`](self).
    pub fn code(&self) -> u32 {
        match self {
            Self::NotFinite { .. } => 300,
            Self::TooLarge { .. } => 301,
            Self::TooFar { .. } => 302,
            Self::TooFarFromZero { .. } => 303,
        }
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
    pub(crate) fn content(what: impl std::fmt::Display, why: impl std::fmt::Display) -> Self {
        Self::Content { what: what.to_string(), why: why.to_string() }
    }
}

/// Why a budget was refused. Code 400.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[error("a budget of {millis} milliseconds; it must be a number of at least 0")]
pub struct BudgetError {
    /// The given number of milliseconds.
    pub millis: f64,
}

impl BudgetError {
    /// The stable code, see [`error`](self).
    pub fn code(&self) -> u32 {
        400
    }
}

/// Why [`CutOptions`](crate::CutOptions) or [`VisibilityOptions`](crate::VisibilityOptions) were refused. Codes 1000
/// and 1001.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CellError {
    /// The edge of a cell is out of range, or NaN.
    #[error("the edge of a cell is {edge} m, outside {min} to {max} m")]
    Edge {
        /// The given edge.
        edge: f32,
        /// The least edge allowed.
        min: f32,
        /// The greatest edge allowed.
        max: f32,
    },
    /// The number of cells is out of range, or no power of two where visibility is learnt.
    #[error("{cells} cells; their number must be from {min} to {max}, and a power of two where visibility is learnt")]
    Cells {
        /// The given number.
        cells: usize,
        /// The least number allowed.
        min: usize,
        /// The greatest number allowed.
        max: usize,
    },
}

impl CellError {
    /// The stable code, see [`error`](self).
    pub fn code(&self) -> u32 {
        match self {
            Self::Edge { .. } => 1000,
            Self::Cells { .. } => 1001,
        }
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

    const WHAT: &str = "field";

    fn light_errors() -> [LightError; 5] {
        [
            LightError::NotFinite { what: WHAT, value: f32::NAN },
            LightError::OutOfRange { what: WHAT, value: 3.0, min: 0.0, max: 2.0 },
            LightError::NoDirection { what: WHAT },
            LightError::NotUnitLength { what: WHAT, length: 2.0, tolerance: 1.0e-3 },
            LightError::NotPositive { what: WHAT, value: 0.0 },
        ]
    }

    fn placement_errors() -> [PlacementError; 4] {
        [
            PlacementError::NotFinite { what: WHAT, value: f64::NAN },
            PlacementError::TooLarge { value: 3.0, limit: 2.0 },
            PlacementError::TooFar { distance: 3.0, limit: 2.0 },
            PlacementError::TooFarFromZero { distance: 3.0, limit: 2.0 },
        ]
    }

    /// Errors of a world that wrap no other.
    fn world_errors() -> [WorldError; 16] {
        [
            WorldError::TooManyLights { given: 3, limit: 2 },
            WorldError::NoSuchLight { index: 3, count: 2 },
            WorldError::NoSuchTree(TreeKey::default()),
            WorldError::NoSuchInstance(InstanceKey::default()),
            WorldError::NoSuchDirectional(DirectionalKey::default()),
            WorldError::TreeInUse { tree: TreeKey::default(), instances: 1 },
            WorldError::StaticTree(TreeKey::default()),
            WorldError::Policy { what: WHAT, value: -1.0, min: 0.0 },
            WorldError::NotFinite { what: WHAT, value: f64::NAN },
            WorldError::Factor { value: -1.0, limit: 2.0 },
            WorldError::RemovedLight { index: 3 },
            WorldError::NoSuchRegion(RegionKey::default()),
            WorldError::NoSuchRegionTree { index: 3, count: 2 },
            WorldError::RegionInUse { region: RegionKey::default(), tree: TreeKey::default(), instances: 1 },
            WorldError::OriginOffGrid { value: 3.0, grid: 2.0 },
            WorldError::OriginTooFar { what: WHAT, value: 3.0, limit: 2.0 },
        ]
    }

    #[test]
    fn all_codes_are_distinct_and_without_gaps_in_the_stated_ranges() {
        let codes: Vec<u32> = light_errors()
            .map(|error| error.code())
            .into_iter()
            .chain(world_errors().map(|error| error.code()))
            .chain(placement_errors().map(|error| error.code()))
            .chain([BudgetError { millis: -1.0 }.code()])
            .chain([
                CellError::Edge { edge: 0.0, min: 1.0, max: 2.0 }.code(),
                CellError::Cells { cells: 3, min: 4, max: 8 }.code(),
            ])
            .collect();
        assert_eq!(codes.iter().collect::<BTreeSet<_>>().len(), codes.len());
        let expected: Vec<u32> = (100..105).chain(200..216).chain(300..304).chain([400, 1000, 1001]).collect();
        assert_eq!(codes, expected);
    }

    #[test]
    fn an_error_that_wraps_another_has_the_inner_code() {
        for source in light_errors() {
            assert_eq!(WorldError::Light { index: 7, source }.code(), source.code());
            assert_eq!(WorldError::Directional { source }.code(), source.code());
        }
        for source in placement_errors() {
            let error = WorldError::from(source);
            assert_eq!(error.code(), source.code());
            let wrapped: [fn(Box<WorldError>) -> WorldError; 3] = [
                |source| WorldError::Move { index: 7, source },
                |source| WorldError::RegionTree { index: 7, source },
                |source| WorldError::RegionInstance { index: 7, source },
            ];
            assert!(wrapped.iter().all(|wrap| wrap(Box::new(error.clone())).code() == source.code()));
        }
    }

    #[test]
    fn messages_state_what_was_given_and_what_is_allowed() {
        let message = |source| WorldError::Directional { source }.to_string();
        let [_, range, none, length, zero] = light_errors();
        assert_eq!(message(range), "directional light: field is 3, outside 0 to 2");
        assert_eq!(message(none), "directional light: field has no direction: its length is 0");
        assert_eq!(message(length), "directional light: field has length 2; it must be a unit vector, to within 0.001");
        assert_eq!(message(zero), "directional light: field is 0; it must be above 0");
    }
}
