//! Eight clusters side by side, at full precision. A node is packed from them, and merged they are
//! the node's own cluster, which is one lane of its parent.
//!
//! Twin of the merging in `shaders/cluster.wgsl`; `gpu/tests/top.rs` compares both. All loops over
//! the lanes are plain, so that the compiler turns each into a few vector instructions.

use glam::Vec3;

use super::node::WIDTH;
use crate::cluster::bounds::Aabb;
use crate::cluster::cone::cap_about;
use crate::cluster::{Cluster, Linear, MAX_FLUX, MIN_AXIS};
use crate::light::MIN_FLUX;

/// One number for each child.
pub(crate) type Lanes = [f32; WIDTH];

/// Eight clusters, one in each lane. Unused lanes are dark. A dark lane (flux 0) has an inverted
/// box, which unions ignore.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WideCluster {
    pub min: [Lanes; 3],
    pub max: [Lanes; 3],
    pub mean: [Lanes; 3],
    pub axis: [Lanes; 3],
    pub flux: Lanes,
    pub area_flux: Lanes,
    pub punctual_flux: Lanes,
    pub variance: Lanes,
    pub cos_half_angle: Lanes,
    pub range: Lanes,
}

/// The cluster that eight lanes merge to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Merged {
    pub cluster: Cluster,
    /// Variance of the lanes' mean positions about the merged mean, in square metres.
    pub between: f32,
}

impl WideCluster {
    /// Eight dark lanes.
    pub const EMPTY: Self = {
        let (zero, inf, neg) = ([0.0; WIDTH], [f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self {
            min: [inf; 3],
            max: [neg; 3],
            mean: [zero; 3],
            axis: [zero; 3],
            flux: zero,
            area_flux: zero,
            punctual_flux: zero,
            variance: zero,
            cos_half_angle: [1.0; WIDTH],
            range: zero,
        }
    };

    /// Writes a cluster to a lane.
    pub fn set(&mut self, lane: usize, cluster: &Cluster) {
        for k in 0..3 {
            self.min[k][lane] = cluster.aabb.min[k];
            self.max[k][lane] = cluster.aabb.max[k];
            self.mean[k][lane] = cluster.mean[k];
            self.axis[k][lane] = cluster.axis[k];
        }
        self.flux[lane] = cluster.flux;
        self.area_flux[lane] = cluster.area_flux;
        self.punctual_flux[lane] = cluster.punctual_flux;
        self.variance[lane] = cluster.variance;
        self.cos_half_angle[lane] = cluster.cos_half_angle;
        self.range[lane] = cluster.range;
    }

    /// The cluster in a lane.
    pub fn get(&self, lane: usize) -> Cluster {
        let point = |v: &[Lanes; 3]| Vec3::new(v[0][lane], v[1][lane], v[2][lane]);
        Cluster {
            aabb: Aabb { min: point(&self.min), max: point(&self.max) },
            flux: self.flux[lane],
            area_flux: self.area_flux[lane],
            punctual_flux: self.punctual_flux[lane],
            mean: point(&self.mean),
            variance: self.variance[lane],
            axis: point(&self.axis),
            cos_half_angle: self.cos_half_angle[lane],
            range: self.range[lane],
        }
    }

    /// Merges all lanes into one cluster, weighted by their fluxes.
    #[inline(always)]
    pub fn merged(&self) -> Merged {
        self.merged_by(&self.flux)
    }

    /// Merges all lanes into one cluster, weighted by the fluxes that they have in the world under
    /// the map `reference`; by their own without one. The sums of flux are those of the tree's space.
    #[inline(always)]
    pub fn merged_for(&self, reference: Option<&Linear>) -> Merged {
        let Some(map) = reference else { return self.merged() };
        let mut weights = [0.0; WIDTH];
        for i in (0..WIDTH).filter(|i| self.flux[*i] > 0.0) {
            let axis = Vec3::from([0, 1, 2].map(|k| self.axis[k][i]));
            // A light that shines keeps a weight at any scale.
            weights[i] = map.flux(self.punctual_flux[i], self.area_flux[i], axis).max(MIN_FLUX);
        }
        self.merged_by(&weights)
    }

    /// Merges all lanes into one cluster. The weights are positive where the fluxes are.
    ///
    /// Moments are taken about the centre of the box, then about the mean, so nothing cancels far
    /// from the origin.
    #[inline(always)]
    fn merged_by(&self, weights: &Lanes) -> Merged {
        let total = sum(weights);
        if total <= 0.0 {
            let [x, y, z] = [0, 1, 2].map(|k| self.mean[k][0]);
            return Merged { cluster: Cluster { mean: Vec3::new(x, y, z), ..Cluster::EMPTY }, between: 0.0 };
        }
        let scale = 1.0 / total;
        let mut share = [0.0; WIDTH];
        for i in 0..WIDTH {
            share[i] = weights[i] * scale;
        }
        let aabb = Aabb {
            min: Vec3::from([0, 1, 2].map(|k| least(&self.min[k]))),
            max: Vec3::from([0, 1, 2].map(|k| greatest(&self.max[k]))),
        };
        let center = aabb.center();
        let mut mean = Vec3::ZERO;
        let mut axis = Vec3::ZERO;
        for k in 0..3 {
            let (mut offsets, mut directions) = ([0.0; WIDTH], [0.0; WIDTH]);
            for i in 0..WIDTH {
                // A dark lane may lie anywhere; its share is 0.
                offsets[i] = share[i] * (self.mean[k][i] - center[k]);
                directions[i] = share[i] * self.axis[k][i];
            }
            mean[k] = center[k] + sum(&offsets);
            axis[k] = sum(&directions);
        }
        let axis = if axis.length() > MIN_AXIS { axis } else { Vec3::ZERO };
        let (mut between, mut within) = ([0.0; WIDTH], [0.0; WIDTH]);
        for i in 0..WIDTH {
            let [x, y, z] = [0, 1, 2].map(|k| self.mean[k][i] - mean[k]);
            between[i] = share[i] * (x * x + y * y + z * z);
            within[i] = share[i] * self.variance[i];
        }
        let between = sum(&between);
        let cluster = Cluster {
            aabb,
            flux: sum(&self.flux).min(MAX_FLUX),
            area_flux: sum(&self.area_flux).min(MAX_FLUX),
            punctual_flux: sum(&self.punctual_flux).min(MAX_FLUX),
            mean,
            variance: between + sum(&within),
            axis,
            cos_half_angle: self.cap_about(axis),
            range: greatest(&self.range),
        };
        Merged { cluster, between }
    }

    /// Cosine of the half-angle of the cap about `axis`, a vector of any length, that contains the
    /// caps of all lanes. -1 if the axis is zero.
    #[inline(always)]
    fn cap_about(&self, axis: Vec3) -> f32 {
        let length = axis.length();
        if length <= 0.0 {
            return -1.0;
        }
        let unit = (axis / length).to_array();
        let caps = self.caps_about([[unit[0]; WIDTH], [unit[1]; WIDTH], [unit[2]; WIDTH]]);
        least(&caps)
    }

    /// For each lane the cosine of the half-angle of the cap about the lane's unit vector that
    /// contains the lane's cap. 1 for dark lanes.
    #[inline(always)]
    pub fn caps_about(&self, units: [Lanes; 3]) -> Lanes {
        let mut caps = [0.0; WIDTH];
        for i in 0..WIDTH {
            let [x, y, z] = [self.axis[0][i], self.axis[1][i], self.axis[2][i]];
            let length = (x * x + y * y + z * z).sqrt();
            let inverse = 1.0 / if length > 0.0 { length } else { 1.0 };
            let cap = cap_about(
                [units[0][i], units[1][i], units[2][i]],
                [x * inverse, y * inverse, z * inverse],
                self.cos_half_angle[i],
            );
            caps[i] = if self.flux[i] > 0.0 { cap } else { 1.0 };
        }
        caps
    }
}

/// Reduces all lanes by an operation on two of them. The order is fixed: the halves of the lanes
/// come first, so vector instructions need three steps.
#[inline(always)]
fn reduce(v: &Lanes, operation: impl Fn(f32, f32) -> f32) -> f32 {
    let v = [operation(v[0], v[4]), operation(v[1], v[5]), operation(v[2], v[6]), operation(v[3], v[7])];
    operation(operation(v[0], v[2]), operation(v[1], v[3]))
}

#[inline(always)]
pub(super) fn sum(v: &Lanes) -> f32 {
    reduce(v, |a, b| a + b)
}

#[inline(always)]
fn least(v: &Lanes) -> f32 {
    reduce(v, |a, b| if b < a { b } else { a })
}

#[inline(always)]
fn greatest(v: &Lanes) -> f32 {
    reduce(v, |a, b| if b > a { b } else { a })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Light;

    fn merged(lights: &[Light]) -> Cluster {
        let mut wide = WideCluster::EMPTY;
        lights.iter().enumerate().for_each(|(lane, light)| wide.set(lane, &light.cluster()));
        wide.merged().cluster
    }

    #[test]
    fn a_merged_cluster_far_from_the_origin_matches_sums_in_f64() {
        // Neighbouring f32 positions there are 8 mm apart, and the lights 1 m. Merging must add
        // little to the rounding of the positions.
        let far = Vec3::new(1.0e5, -1.0e5, 1.0e5);
        let lights: Vec<_> = (0..8)
            .map(|i| Light::point(far + Vec3::new(i as f32, 0.25 * i as f32, 0.0), Vec3::splat(1.0 + i as f32)))
            .collect();
        let all = merged(&lights);
        let weight: f64 = lights.iter().map(|l| f64::from(l.flux())).sum();
        let mean =
            lights.iter().map(|l| l.cluster().mean.as_dvec3() * f64::from(l.flux())).sum::<glam::DVec3>() / weight;
        let variance = lights
            .iter()
            .map(|l| (l.cluster().mean.as_dvec3() - mean).length_squared() * f64::from(l.flux()))
            .sum::<f64>()
            / weight;
        assert!((f64::from(all.variance) / variance - 1.0).abs() < 1e-2, "{} {variance}", all.variance);
        assert!(all.mean.as_dvec3().distance(mean) < 0.02);
        assert!((f64::from(all.flux) / weight - 1.0).abs() < 1e-6);
    }

    #[test]
    fn opposite_half_spheres_merge_to_all_directions_and_equal_ones_to_themselves() {
        let facing = |v: Vec3| Light::rectangle(Vec3::ZERO, Vec3::X, v, Vec3::ONE);
        let (up, down) = (facing(Vec3::Y), facing(Vec3::NEG_Y));
        assert_eq!(merged(&[up, down]).cos_half_angle, -1.0);
        let same = merged(&[up, up, up]);
        assert!(same.cos_half_angle <= up.cluster().cos_half_angle && same.cos_half_angle > -2.0e-3);
        assert!((same.axis - up.cluster().axis).length() < 1e-6);
    }

    #[test]
    fn dark_lanes_do_not_widen_the_merged_cluster() {
        let lamp = Light::spot(Vec3::ONE, Vec3::X, 0.1, 0.2, Vec3::ONE);
        let dark = Light::rectangle(Vec3::splat(-50.0), Vec3::X, Vec3::Y, Vec3::ZERO);
        let both = merged(&[dark, lamp, dark]);
        assert_eq!(both.aabb, lamp.aabb());
        assert!((both.cos_half_angle - lamp.cluster().cos_half_angle).abs() < 2.0e-3);
        let none = merged(&[dark, dark]);
        assert!(none.flux == 0.0 && none.aabb.is_empty() && none.mean.is_finite());
    }
}
