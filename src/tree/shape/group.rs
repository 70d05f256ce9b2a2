//! Groups of lights and what they cost.
//!
//! Based on CK18 4.3 (surface area orientation heuristic). Differs: orientation is measured by the mean direction, which
//! adds up over lights (docs/decisions.md); a group's size counts its diagonal, so that a street of collinear lamps,
//! whose box has no area, still has a cost. All in f32, four lanes at a time.

use glam::{Mat4, Vec3, Vec4};

use super::super::cost::DIAGONAL_WEIGHT;
use crate::cluster::Cluster;
use crate::light::LAMBERTIAN;

/// Fluxes are kept divided by 2^30: 2^31 lights of the most flux (1e34 lm) add up to 2e34, and the least flux (1e-18 lm)
/// stays a normal number.
const FLUX_UNIT: f32 = 1.0 / (1 << 30) as f32;

/// The least orientation, in units of that of flat emitters that agree. Beams that agree would have none, and what f32
/// sums of a million directions are off by would choose their splits.
const MIN_ORIENTATION: f32 = 1.0 / 256.0;

/// Lights that one thread looks at in a row. Sums over more are sums of such runs, in order, with threads or without.
const RUN: usize = 1 << 14;

/// Up to this many lights are one run all the same, as threads have other groups to look at.
const ONE_RUN: usize = 1 << 16;

/// What a split looks at for one light, or one subtree. A cache line.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Item {
    min: Vec4,
    /// The fourth is the index, as bits: nothing but comparisons ever sees it.
    max: Vec4,
    /// Mean position.
    pub(super) mean: Vec4,
    /// Flux times mean direction, and flux; in units of [`FLUX_UNIT`].
    power: Vec4,
}

impl Item {
    /// Uses box, flux, mean and axis.
    pub fn new(cluster: &Cluster, index: u32) -> Self {
        let flux = cluster.flux * FLUX_UNIT;
        Self {
            min: cluster.aabb.min.extend(0.0),
            max: cluster.aabb.max.extend(f32::from_bits(index)),
            mean: cluster.mean.extend(0.0),
            power: (cluster.axis * flux).extend(flux),
        }
    }

    /// As given.
    pub fn index(&self) -> u32 {
        self.max.w.to_bits()
    }

    pub(super) fn sums(&self) -> Sums {
        Sums { min: self.min, max: self.max, power: self.power }
    }
}

/// Box and flux of a group; the fourth of the corners means nothing.
#[derive(Clone, Copy)]
pub(super) struct Sums {
    min: Vec4,
    max: Vec4,
    power: Vec4,
}

impl Sums {
    pub const EMPTY: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY, power: Vec4::ZERO };

    #[inline(always)]
    pub fn add(&mut self, other: &Self) {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.power += other.power;
    }

    /// What makes this group's flux one; zero if it is dark.
    pub fn per_flux(&self) -> f32 {
        if self.power.w >= f32::MIN_POSITIVE { self.power.w.recip() } else { 0.0 }
    }
}

/// Costs of four groups with their flux times `per_flux`: flux, size and orientation as in CK18 equation 2.
///
/// Orientation is 4 for emission to all sides, 1 for flat emitters that agree (mean direction of length 2/3), 0 for
/// a beam, and linear between them: CK18 equation 1 but for a factor. Flux times it needs no division.
#[inline(always)]
pub(super) fn costs(groups: [&Sums; 4], per_flux: f32) -> Vec4 {
    let lanes = |[a, b, c, d]: [Vec4; 4]| Mat4::from_cols(a, b, c, d).transpose();
    // Empty boxes are inverted.
    let extents = lanes(groups.map(|group| (group.max - group.min).max(Vec4::ZERO)));
    let powers = lanes(groups.map(|group| group.power * per_flux));
    let (x, y, z) = (extents.x_axis, extents.y_axis, extents.z_axis);
    let size = x * y + y * z + z * x + DIAGONAL_WEIGHT * (x * x + y * y + z * z);
    let (x, y, z, flux) = (powers.x_axis, powers.y_axis, powers.z_axis, powers.w_axis);
    let axis = Vec4::from_array((x * x + y * y + z * z).to_array().map(f32::sqrt));
    let wide = 4.0 * flux - 3.0 / LAMBERTIAN * axis;
    let narrow = 3.0 * (flux - axis);
    size * wide.max(narrow).max(MIN_ORIENTATION * flux)
}

/// A box of means.
#[derive(Clone, Copy)]
pub(super) struct Means {
    pub min: Vec4,
    pub max: Vec4,
}

impl Means {
    pub const EMPTY: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY };

    pub fn around(items: &[Item]) -> Self {
        items.iter().fold(Self::EMPTY, |all, item| all.union(&Self { min: item.mean, max: item.mean }))
    }

    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    pub fn extent(&self) -> Vec3 {
        (self.max - self.min).truncate()
    }
}

/// What is known of consecutive items.
#[derive(Clone, Copy)]
pub(super) struct Group {
    pub count: usize,
    pub sums: Sums,
    /// Unknown where no split needs it: of groups that fit into one node.
    pub means: Means,
}

impl Group {
    pub const EMPTY: Self = Self { count: 0, sums: Sums::EMPTY, means: Means::EMPTY };

    pub fn around(items: &[Item]) -> Self {
        let parts = map_runs(items, |run| {
            let mut sums = Sums::EMPTY;
            run.iter().for_each(|item| sums.add(&item.sums()));
            Self { count: run.len(), sums, means: Means::around(run) }
        });
        parts.into_iter().fold(Self::EMPTY, |mut all, part| {
            all.sums.add(&part.sums);
            Self { count: all.count + part.count, sums: all.sums, means: all.means.union(&part.means) }
        })
    }

    /// Costs of two parts of this group.
    pub fn costs(&self, [a, b]: [&Self; 2]) -> [f32; 2] {
        let four = [&a.sums, &b.sums, &Sums::EMPTY, &Sums::EMPTY];
        let [a, b, ..] = costs(four, self.sums.per_flux()).to_array();
        [a, b]
    }
}

/// What a function makes of each run of items, in order.
pub(super) fn map_runs<T: Send>(items: &[Item], function: impl Fn(&[Item]) -> T + Send + Sync) -> Vec<T> {
    if items.len() <= ONE_RUN {
        return vec![function(items)];
    }
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        items.par_chunks(RUN).map(function).collect()
    }
    #[cfg(not(feature = "parallel"))]
    items.chunks(RUN).map(function).collect()
}

/// Whether more than one run is made of so many items.
pub(super) fn are_runs(count: usize) -> bool {
    count > ONE_RUN
}
