//! The records of a dump, as they lie in the file.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, IVec3, Mat3, Vec3};

use crate::instance::appearance::Appearance;
use crate::instance::placement::Placement;
use crate::policy::Policy;
use crate::tree::Attribute;

/// The values of a world as a whole.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Header {
    /// The sector of the origin.
    pub sector: IVec3,
    /// A bit for each effect that is switched on.
    pub switches: u32,
    /// What the dump lacks: skies, portals, trees that wait, trees on the GPU.
    pub left_out: [u32; 4],
    pub profiles: u32,
    pub trees: u32,
    /// Slots of instances, from [`FIRST_SLOT`](super::FIRST_SLOT) on.
    pub slots: u32,
    pub directionals: u32,
}

/// What was set about an instance.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct InstanceRecord {
    translation: DVec3,
    linear: Mat3,
    factor: Vec3,
    is_enabled: u32,
    mask: u32,
    user_data: u32,
    /// The kind of the policy.
    policy: u16,
    /// The number of its attribute.
    attribute: u16,
    thresholds: [f32; 2],
}

const ATTRIBUTES: [Attribute; 4] =
    [Attribute::Distance, Attribute::Overlap, Attribute::Variance, Attribute::SplittingCost];

impl InstanceRecord {
    pub fn of(placement: &Placement, policy: Policy, appearance: &Appearance) -> Self {
        let (policy, attribute, thresholds) = match policy {
            Policy::Static => (0, 0, [0.0; 2]),
            Policy::RefitOnly => (1, 0, [0.0; 2]),
            Policy::Budgeted => (2, 0, [0.0; 2]),
            Policy::AlwaysRebuild => (3, 0, [0.0; 2]),
            Policy::Bounded { floor, ceiling } => (4, 0, [floor, ceiling]),
            Policy::Deviation { attribute, deviation, factor } => (5, attribute as u16, [deviation, factor]),
            Policy::Ratio { attribute, factor } => (6, attribute as u16, [factor, 0.0]),
        };
        Self {
            translation: placement.translation,
            linear: placement.linear,
            factor: appearance.factor,
            is_enabled: appearance.is_enabled.into(),
            mask: appearance.mask,
            user_data: appearance.user_data,
            policy,
            attribute,
            thresholds,
        }
    }

    /// The placement, the policy and the appearance, which the world has yet to accept. `None` for a record that
    /// [`InstanceRecord::of`] never makes.
    pub fn read(&self) -> Option<(Placement, Policy, Appearance)> {
        let attribute = *ATTRIBUTES.get(self.attribute as usize)?;
        let [a, b] = self.thresholds;
        let policy = match self.policy {
            0 => Policy::Static,
            1 => Policy::RefitOnly,
            2 => Policy::Budgeted,
            3 => Policy::AlwaysRebuild,
            4 => Policy::Bounded { floor: a, ceiling: b },
            5 => Policy::Deviation { attribute, deviation: a, factor: b },
            6 => Policy::Ratio { attribute, factor: a },
            _ => return None,
        };
        let placement = Placement { linear: self.linear, translation: self.translation };
        let Self { is_enabled, factor, mask, user_data, .. } = *self;
        let appearance = Appearance { is_enabled: is_enabled != 0, factor, mask, user_data };
        let written = Self::of(&placement, policy, &appearance);
        (bytemuck::bytes_of(&written) == bytemuck::bytes_of(self)).then_some((placement, policy, appearance))
    }
}
