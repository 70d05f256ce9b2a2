//! Brings the nodes up to date with lights that moved, turned or dimmed, bottom up, and measures the attributes.

use super::attributes::{self, Terms};
use super::node::{Child, LEAF, Node};
use super::{FluxByKind, LightTree};
use crate::cluster::{Cluster, MOST_FLUX};
use crate::light::Light;

/// Levels with fewer nodes are refitted on one thread: a node takes about a microsecond, waking a thread several.
#[cfg(feature = "parallel")]
const PARALLEL_NODES: usize = 128;

impl LightTree {
    /// Recomputes every node from the present lights. The shape of the tree stays; nothing is allocated.
    ///
    /// Every cluster is made from the lights anew, so a million refits drift no further than one. O(n).
    pub fn refit(&mut self) {
        let lights = &self.lights;
        for level in (0..self.levels.len().saturating_sub(1)).rev() {
            let (start, end) = (self.levels[level] as usize, self.levels[level + 1] as usize);
            let (upper, below) = self.nodes.split_at_mut(end);
            let refit_one = |(node, terms): (&mut Node, &mut Terms)| *terms = refit_node(node, end, below, lights);
            let (nodes, terms) = (&mut upper[start..], &mut self.terms[start..end]);
            #[cfg(feature = "parallel")]
            if nodes.len() >= PARALLEL_NODES {
                use rayon::prelude::*;
                nodes.par_iter_mut().zip(terms).for_each(refit_one);
                continue;
            }
            nodes.iter_mut().zip(terms).for_each(refit_one);
        }
        let root = self.nodes.first().map_or(Cluster::EMPTY, Node::cluster);
        self.attributes = attributes::sum(&self.terms, &root);
        self.flux = flux_by_kind(lights);
    }
}

/// Refits one node whose children lie in `below`, which starts at node `first_below`.
fn refit_node(node: &mut Node, first_below: usize, below: &[Node], lights: &[Light]) -> Terms {
    let mut all = Cluster::EMPTY;
    for child in &mut node.children[..node.count as usize] {
        let cluster = if child.target & LEAF != 0 {
            lights[(child.target & !LEAF) as usize].cluster()
        } else {
            below[child.target as usize - first_below].cluster()
        };
        *child = Child::pack(&cluster, child.target);
        all = all.merge(&child.cluster());
    }
    Terms::of(node, &all)
}

fn flux_by_kind(lights: &[Light]) -> FluxByKind {
    let (mut punctual, mut area) = (0.0_f64, 0.0_f64);
    for light in lights {
        let flux = f64::from(light.flux());
        if light.area().is_some() { area += flux } else { punctual += flux }
    }
    let most = f64::from(MOST_FLUX);
    FluxByKind { punctual: punctual.min(most) as f32, area: area.min(most) as f32 }
}
