//! Every refusal, with what was given and what the limit is.

use crate::keys::{DirectionalKey, InstanceKey, TreeKey};

/// Why a light was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LightError {
    /// A number is NaN or infinite.
    #[error("{what} is {value}, not a finite number")]
    NotFinite {
        /// The field.
        what: &'static str,
        /// What was given.
        value: f32,
    },
    /// A number lies outside what the light kind allows.
    #[error("{what} is {value}, outside {min} to {max}")]
    OutOfRange {
        /// The field.
        what: &'static str,
        /// What was given.
        value: f32,
        /// The least allowed.
        min: f32,
        /// The most allowed.
        max: f32,
    },
    /// A direction has no length.
    #[error("{what} has no direction: its length is {length}")]
    NoDirection {
        /// The field.
        what: &'static str,
        /// What was given.
        length: f32,
    },
}

/// Why the world refused a call. The world is as it was before the call.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WorldError {
    /// One light of a list is bad; none was taken.
    #[error("light {index}: {source}")]
    Light {
        /// Its place in the list that was given.
        index: usize,
        /// What is wrong with it.
        source: LightError,
    },
    /// More lights than a tree can hold.
    #[error("{given} lights in one tree; the limit is {limit}")]
    TooManyLights {
        /// How many were given.
        given: usize,
        /// The most a tree holds.
        limit: usize,
    },
    /// An index that the tree does not have.
    #[error("light index {index} in a tree of {count} lights")]
    NoSuchLight {
        /// What was given.
        index: u32,
        /// How many lights the tree has.
        count: usize,
    },
    /// A removed tree. A key of another world is not told apart: it may name something else here.
    #[error("no tree {0:?} in this world")]
    NoSuchTree(TreeKey),
    /// A removed instance.
    #[error("no instance {0:?} in this world")]
    NoSuchInstance(InstanceKey),
    /// A removed directional light.
    #[error("no directional light {0:?} in this world")]
    NoSuchDirectional(DirectionalKey),
    /// The tree still has instances.
    #[error("tree {tree:?} still has {instances} instances; remove them first")]
    TreeInUse {
        /// The tree.
        tree: TreeKey,
        /// How many instances show it.
        instances: usize,
    },
    /// All instances of the tree promised that it does not change.
    #[error("tree {0:?} is static: every instance of it has Policy::Static")]
    StaticTree(TreeKey),
    /// A placement that is not finite, too far away, or flattens space.
    #[error("placement: {0}")]
    Placement(#[from] PlacementError),
    /// A policy with a threshold that is not a finite number of the stated range.
    #[error("policy: {what} is {value}; it must be finite and at least {min}")]
    Policy {
        /// The field.
        what: &'static str,
        /// What was given.
        value: f32,
        /// The least allowed.
        min: f32,
    },
}

/// Why a placement was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlacementError {
    /// An entry is NaN or infinite.
    #[error("{what} is {value}, not a finite number")]
    NotFinite {
        /// The entry.
        what: &'static str,
        /// What was given.
        value: f64,
    },
    /// An entry of the linear part is too large.
    #[error("an entry of the linear part is {value}; the limit is {limit}")]
    TooLarge {
        /// What was given.
        value: f32,
        /// The largest allowed size.
        limit: f32,
    },
    /// Its linear part has no inverse in single precision: a scale of zero, or nearly so.
    #[error("the linear part flattens space (determinant {determinant})")]
    Singular {
        /// Of the linear part.
        determinant: f32,
    },
    /// Too far from the world's origin, see [`LightWorld::set_origin`](crate::LightWorld::set_origin).
    #[error("{distance} m from the world's origin; the limit is {limit} m")]
    TooFar {
        /// Largest coordinate's distance from the origin.
        distance: f64,
        /// The most allowed.
        limit: f64,
    },
}

/// Why a budget was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("a budget of {millis} milliseconds; it must be a number of at least 0")]
pub struct BudgetError {
    /// What was given.
    pub millis: f64,
}

/// Why a count was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{given} {what}; the limits are {min} and {max}")]
pub struct CountError {
    /// What is counted.
    pub what: &'static str,
    /// What was given.
    pub given: usize,
    /// The least allowed.
    pub min: usize,
    /// The most allowed.
    pub max: usize,
}
