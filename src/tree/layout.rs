//! Lays out the nodes of a shape in memory.

use super::LightTree;
use super::node::{EMPTY_SLOT, LEAF, Node, WIDTH};
use super::refitted::Refitted;
use super::shape::{BuildItem, ShapeNode};
use super::tasks::RefitTasks;
use crate::cluster::{Aabb, Cluster, Linear};
use crate::light::{Light, MIN_FLUX};

/// A light to be placed in a leaf.
#[derive(Clone, Copy)]
pub(super) struct PlacedLight {
    /// Its index in the tree.
    pub index: u32,
    pub cluster: Cluster,
}

impl PlacedLight {
    const NONE: Self = Self { index: u32::MAX, cluster: Cluster::EMPTY };

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

impl LightTree {
    /// Lays out the shape of the whole tree over some lights in its empty nodes, and refits.
    pub(super) fn lay_out(&mut self, shape: &[ShapeNode], lights: &[PlacedLight]) {
        for (node, shaped) in shape.iter().enumerate() {
            self.lay_out_node(shaped, node, lights);
        }
        for node in (0..shape.len()).rev() {
            self.count_lights(node);
        }
        self.refit_data.tasks = RefitTasks::new(&self.spans);
        self.refit_all::<true>();
        self.finish_build();
    }

    /// Computes what depends on all nodes of a tree that was laid out and refitted.
    pub(super) fn finish_build(&mut self) {
        self.update_sides();
        self.update_attributes();
        self.built_cost = self.cost;
        if self.nodes.len() == 1 {
            self.is_only_node_refitted = self.refitted() == Refitted::All;
            self.refit_data.take();
        }
    }

    /// Lays out a node of a shape and marks it for the next refit.
    #[inline(always)]
    pub(super) fn lay_out_node(&mut self, shaped: &ShapeNode, node: usize, lights: &[PlacedLight]) {
        let mut children = shaped.children;
        // Load all at once: they are anywhere in memory, and waiting for one after the other takes
        // longer than all the rest.
        let is_light = |child: u32| child != EMPTY_SLOT && child & LEAF != 0;
        let loaded: [PlacedLight; WIDTH] =
            children.map(|child| if is_light(child) { lights[(child & !LEAF) as usize] } else { PlacedLight::NONE });
        for (slot, child) in children[..shaped.count as usize].iter_mut().enumerate() {
            if *child & LEAF != 0 {
                let PlacedLight { index, cluster } = &loaded[slot];
                self.leaves[*index as usize] = (node * WIDTH + slot) as u32;
                self.refit_data.wide[node].set(slot, cluster);
                *child = index | LEAF;
            }
        }
        self.nodes[node] = Node { children, parent: shaped.parent, steps: shaped.count << 24, ..Node::EMPTY };
        self.spans[node] = shaped.span;
        self.refit_data.dirty.flags_mut()[node] = true;
    }

    /// Counts the lights below a node whose child nodes have been counted.
    #[inline(always)]
    pub(super) fn count_lights(&mut self, node: usize) {
        self.light_counts[node] = self.nodes[node].children[..self.nodes[node].count()]
            .iter()
            .map(|child| if child & LEAF != 0 { 1 } else { self.light_counts[*child as usize] })
            .sum();
    }
}
