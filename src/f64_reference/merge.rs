//! The cluster that several clusters merge to (docs/math.md, Moments and Caps).

use std::f64::consts::PI;

use glam::DVec3;

use crate::cluster::Cluster;

/// A merged cluster.
#[derive(Clone, Copy, Debug)]
pub(super) struct Merged {
    pub flux: f64,
    pub area_flux: f64,
    pub mean: DVec3,
    pub variance: f64,
    pub axis: DVec3,
    /// The least half-angle about the mean direction that holds the caps of all lit clusters,
    /// without padding; π for all directions.
    pub half_angle: f64,
}

/// The angle between two directions, which need not be of unit length.
pub(super) fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

pub(super) fn merged(clusters: &[Cluster]) -> Merged {
    let lit = || clusters.iter().filter(|cluster| cluster.flux > 0.0);
    let flux: f64 = lit().map(|cluster| f64::from(cluster.flux)).sum();
    let weighted = |f: &dyn Fn(&Cluster) -> DVec3| lit().map(|c| f(c) * f64::from(c.flux)).sum::<DVec3>() / flux;
    let mean = weighted(&|cluster| cluster.mean.as_dvec3());
    let axis = weighted(&|cluster| cluster.axis.as_dvec3());
    let spread = |c: &Cluster| f64::from(c.variance) + c.mean.as_dvec3().distance_squared(mean);
    let reach = |c: &Cluster| {
        let cos = f64::from(c.cos_half_angle);
        if cos <= -1.0 { PI } else { (angle(axis, c.axis.as_dvec3()) + cos.min(1.0).acos()).min(PI) }
    };
    Merged {
        flux,
        area_flux: lit().map(|cluster| f64::from(cluster.area_flux)).sum(),
        mean,
        variance: lit().map(|cluster| spread(cluster) * f64::from(cluster.flux)).sum::<f64>() / flux,
        axis,
        half_angle: if axis.length() <= 1.0e-12 { PI } else { lit().map(reach).fold(0.0, f64::max) },
    }
}
