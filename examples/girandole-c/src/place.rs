//! Placements and policies as plain values.

use girandole::glam::{Mat3, Vec3};
use girandole::{Attribute, Placement, Policy};

use crate::status::Failure;
use crate::vectors::{GirandoleDVec3, GirandoleVec3};

/// Where an instance is: an affine map from the space of its tree to the world.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandolePlacement {
    /// The images of the three axes: the columns of a matrix. Either the matrix has an inverse, with scales
    /// from 1e-9 to 1e9, or all axes are exactly 0, which hides the instance.
    pub axes: [GirandoleVec3; 3],
    /// Metres. Along each axis at most 1e9 from zero.
    pub translation: GirandoleDVec3,
}

impl From<&GirandolePlacement> for Placement {
    fn from(placement: &GirandolePlacement) -> Self {
        let [x, y, z] = placement.axes.map(Vec3::from);
        Self { linear: Mat3::from_cols(x, y, z), translation: placement.translation.into() }
    }
}

/// Returns a placement that only translates, in metres. Checks nothing.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_placement_at(x: f64, y: f64, z: f64) -> GirandolePlacement {
    GirandolePlacement { axes: [Vec3::X, Vec3::Y, Vec3::Z].map(Into::into), translation: GirandoleDVec3 { x, y, z } }
}

/// When an instance requests a rebuild of its tree: one of GIRANDOLE_POLICY_*.
pub type GirandolePolicyKind = u32;
/// Once the tree has become noisy, its rebuild shares the budget with the rebuilds of all other trees. The
/// default.
pub const GIRANDOLE_POLICY_BUDGETED: GirandolePolicyKind = 0;
/// The lights never change: edits of them are refused.
pub const GIRANDOLE_POLICY_STATIC: GirandolePolicyKind = 1;
/// The tree is refitted and never rebuilt.
pub const GIRANDOLE_POLICY_REFIT_ONLY: GirandolePolicyKind = 2;
/// As BUDGETED, with bounds on the excess noise: a is the floor and b the ceiling.
pub const GIRANDOLE_POLICY_BOUNDED: GirandolePolicyKind = 3;
/// Requests a rebuild when the splitting cost exceeds its minimum since the last rebuild by more than a * b.
pub const GIRANDOLE_POLICY_DEVIATION: GirandolePolicyKind = 4;
/// Requests a rebuild when the splitting cost exceeds a times its minimum since the last rebuild.
pub const GIRANDOLE_POLICY_RATIO: GirandolePolicyKind = 5;
/// Requests an urgent rebuild whenever the lights change.
pub const GIRANDOLE_POLICY_ALWAYS_REBUILD: GirandolePolicyKind = 6;

/// A policy and its parameters.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandolePolicy {
    /// One of GIRANDOLE_POLICY_*.
    pub kind: GirandolePolicyKind,
    /// BOUNDED: the floor. DEVIATION: the standard deviation. RATIO: the factor. Others ignore it.
    pub a: f32,
    /// BOUNDED: the ceiling. DEVIATION: the factor. Others ignore it.
    pub b: f32,
}

pub(crate) fn policy(policy: &GirandolePolicy) -> Result<Policy, Failure> {
    let attribute = Attribute::SplittingCost;
    // Each kind reads its own parameters only, since the others may be undefined.
    Ok(match policy.kind {
        GIRANDOLE_POLICY_BUDGETED => Policy::Budgeted,
        GIRANDOLE_POLICY_STATIC => Policy::Static,
        GIRANDOLE_POLICY_REFIT_ONLY => Policy::RefitOnly,
        GIRANDOLE_POLICY_BOUNDED => Policy::Bounded { floor: policy.a, ceiling: policy.b },
        GIRANDOLE_POLICY_DEVIATION => Policy::Deviation { attribute, deviation: policy.a, factor: policy.b },
        GIRANDOLE_POLICY_RATIO => Policy::Ratio { attribute, factor: policy.a },
        GIRANDOLE_POLICY_ALWAYS_REBUILD => Policy::AlwaysRebuild,
        other => return Err(Failure::bad_value("policy", other)),
    })
}
