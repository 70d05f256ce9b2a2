//! What a build knows of each light.

use super::shape::BuildItem;
use crate::cluster::{Aabb, Cluster, Linear};
use crate::light::{Light, MIN_FLUX};

/// A light that a build places in a leaf.
#[derive(Clone, Copy)]
pub(super) struct PlacedLight {
    /// Its index in the tree.
    pub index: u32,
    pub cluster: Cluster,
}

impl PlacedLight {
    pub const NONE: Self = Self { index: u32::MAX, cluster: Cluster::EMPTY };

    #[inline(always)]
    pub fn new(index: usize, light: &Light) -> Self {
        Self { index: index as u32, cluster: light.cluster() }
    }
}

/// The items of a shape: the lights, named by their places in the list. `reference` is that of the
/// tree.
pub(super) fn build_items(lights: &[PlacedLight], reference: Option<&Linear>) -> Vec<BuildItem> {
    (0..).zip(lights).map(|(place, light)| build_item(&light.cluster, place, reference)).collect()
}

/// One item of a shape.
#[inline(always)]
pub(super) fn build_item(cluster: &Cluster, place: u32, reference: Option<&Linear>) -> BuildItem {
    match reference {
        Some(map) if cluster.flux > 0.0 => {
            let flux = map.flux(cluster.punctual_flux, cluster.area_flux, cluster.axis).max(MIN_FLUX);
            BuildItem::new(&Cluster { flux, ..stretched(cluster, map) }, place)
        }
        _ => BuildItem::new(cluster, place),
    }
}

/// A cluster whose box, mean and direction are stretched along the axes of the tree as much as a map
/// stretches these axes. The map itself would turn the clusters, and the boxes of nodes do not turn:
/// they would be cut across their edges (docs/decisions.md, 51).
fn stretched(cluster: &Cluster, map: &Linear) -> Cluster {
    let scale = map.axis_scales();
    // Normals of surfaces turn to the axes that are stretched least.
    let axis = if cluster.area_flux > 0.0 { cluster.axis / scale } else { cluster.axis * scale };
    Cluster {
        aabb: Aabb { min: cluster.aabb.min * scale, max: cluster.aabb.max * scale },
        mean: cluster.mean * scale,
        axis: axis.normalize_or_zero() * cluster.axis.length(),
        ..*cluster
    }
}
