//! Boxes in the world around the lights of parts.

use glam::{DVec3, Vec3};

use crate::cluster::{Aabb, Cluster};

/// Boxes count as at least this thick, relative to their diagonal: lamps above a town are among its houses.
const THICKNESS: f64 = 0.02;

/// A box in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    min: DVec3,
    max: DVec3,
}

/// Where a part is, relative to the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub mean: Vec3,
    pub aabb: Aabb,
    /// The number of its lights.
    pub lights: u32,
}

impl Place {
    /// The place of a part; `None` if it does not shine.
    pub fn of(cluster: &Cluster, lights: u32) -> Option<Self> {
        let Cluster { flux, mean, aabb, .. } = *cluster;
        (flux > 0.0 && mean.is_finite()).then_some(Self { mean, aabb, lights })
    }
}

impl Bounds {
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    pub fn around(aabb: &Aabb, origin: DVec3) -> Self {
        Self { min: origin + aabb.min.as_dvec3(), max: origin + aabb.max.as_dvec3() }
    }

    /// As thick as boxes count for what lies within them.
    pub fn thick(&self) -> Self {
        let (center, half) = (0.5 * (self.min + self.max), 0.5 * (self.max - self.min));
        let half = half.max(DVec3::splat(THICKNESS * half.length()));
        Self { min: center - half, max: center + half }
    }

    /// Contains another one too from now on. Returns whether it did not before.
    pub fn grow(&mut self, other: &Self) -> bool {
        let former = *self;
        (self.min, self.max) = (self.min.min(other.min), self.max.max(other.max));
        *self != former
    }

    pub fn contains(&self, other: &Self) -> bool {
        self.min.cmple(other.min).all() && self.max.cmpge(other.max).all()
    }

    pub fn is_apart_from(&self, other: &Self) -> bool {
        self.max.cmplt(other.min).any() || self.min.cmpgt(other.max).any()
    }

    /// The longest edge.
    pub fn size(&self) -> f64 {
        (self.max - self.min).max_element()
    }

    /// The share of another box that lies in this one. This one counts as endless in the direction of the other's
    /// centre, so that a thin string of lamps holds half of another one that crosses it, not a sliver.
    pub fn share_of(&self, other: &Self) -> f64 {
        let edges = other.max - other.min;
        let common = 0.5 * (self.max - self.min + edges) - 0.5 * (self.min + self.max - other.min - other.max).abs();
        let one = |axis: usize| match edges[axis] {
            // A single point.
            0.0 => f64::from(u8::from(common[axis] >= 0.0)),
            edge => (common[axis] / edge).clamp(0.0, 1.0),
        };
        one(0) * one(1) * one(2)
    }
}
