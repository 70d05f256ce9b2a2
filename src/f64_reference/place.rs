//! Clusters in the world (docs/math.md, Placements).

use std::f64::consts::PI;

use glam::DVec3;

use crate::cluster::Cluster;
use testbed::measuring::reference::place::Map;

/// A cluster in f64 without its cap.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    pub flux: f64,
    pub mean: DVec3,
    pub variance: f64,
    pub axis: DVec3,
    /// The half-angle of the cap about the axis; π for all directions.
    pub half_angle: f64,
}

/// A cluster of a tree in the world.
pub(super) fn placed(cluster: &Cluster, map: &Map, translation: DVec3, brightness: f64) -> Placed {
    let length = cluster.axis.as_dvec3().length();
    let axis = cluster.axis.as_dvec3().normalize_or_zero();
    let (punctual, area) = (f64::from(cluster.punctual_flux), f64::from(cluster.area_flux));
    let half_angle = f64::from(cluster.cos_half_angle).clamp(-1.0, 1.0).acos();
    let (image, half_angle) = map.cap([area > 0.0, area > 0.0 && punctual <= 0.0], axis, half_angle);
    Placed {
        flux: (punctual + area * map.area_factor(axis, length)) * brightness,
        mean: map.linear * cluster.mean.as_dvec3() + translation,
        variance: f64::from(cluster.variance) * map.mean_square(),
        axis: if length > 0.0 { image * length } else { DVec3::ZERO },
        half_angle: half_angle.unwrap_or(PI),
    }
}
