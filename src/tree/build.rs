//! Builds a tree over lights: first its shape, then its nodes.
//!
//! `tree/shape/` divides the lights by cost, from the root down (docs/math.md, "Building a tree").
//! `layout.rs` links the nodes and writes the clusters of the lights, and a refit computes the rest.

use std::collections::BTreeSet;

use super::LightTree;
use super::attributes::Attributes;
use super::edited::Edited;
use super::layout::{PlacedLight, build_items};
use super::node::{NO_LEAF, Node};
use super::refit_data::RefitData;
use super::shape::{TreeShape, shape_tree};
use crate::cluster::{Cluster, Linear};
use crate::effects::EffectCounts;
use crate::light::Light;
use crate::rare::Rare;

/// The clusters of more lights than this are computed by several threads; for fewer, waking a
/// thread costs more than it saves.
#[cfg(feature = "parallel")]
const PARALLEL_LIGHTS: usize = 4096;

impl LightTree {
    /// Builds a tree over valid lights.
    #[cfg(test)]
    pub(crate) fn build(lights: Vec<Light>) -> Self {
        Self::build_for(lights, None, BTreeSet::new())
    }

    /// Builds a tree over valid lights that is shaped as its image under `reference` would be. The
    /// indices in `vacant` have no light.
    pub(crate) fn build_for(lights: Vec<Light>, reference: Option<Box<Linear>>, vacant: BTreeSet<u32>) -> Self {
        let placed = if vacant.is_empty() { Self::placed_lights(&lights) } else { placed_lights_of_some(&lights) };
        let shape = shape_tree(&mut build_items(&placed, reference.as_deref()));
        Self::of_shape(lights, &placed, &shape, reference, vacant)
    }

    /// Makes a tree of a shape over some of the lights, `placed`.
    pub(super) fn of_shape(
        lights: Vec<Light>,
        placed: &[PlacedLight],
        shape: &TreeShape,
        reference: Option<Box<Linear>>,
        vacant: BTreeSet<u32>,
    ) -> Self {
        let count = shape.nodes.len();
        let mut tree = Self {
            leaves: vec![NO_LEAF; lights.len()],
            effects: Rare::default(),
            lights,
            nodes: vec![Node::EMPTY; count],
            refit_data: if count > 0 { RefitData::new(count).into() } else { Rare::default() },
            spans: vec![0; count],
            light_counts: vec![0; count],
            built_cost: 0.0,
            cost: 0.0,
            has_stale_sums: false,
            is_frozen: false,
            is_only_node_dirty: false,
            is_only_node_refitted: false,
            edited: Edited::of_build(vacant),
            builds: 0,
            root: Cluster::EMPTY,
            sides: vec![Cluster::EMPTY; shape.sides].into(),
            weights: reference.clone(),
            reference,
            attributes: Attributes::default(),
        };
        tree.count_all_effects();
        if count > 0 {
            tree.lay_out(&shape.nodes, placed);
        }
        tree
    }

    /// Counts the effects of all lights.
    fn count_all_effects(&mut self) {
        let mut counts = EffectCounts::default();
        self.lights.iter().filter(|light| !light.is_removed()).for_each(|light| counts.add(light.effects()));
        if counts != EffectCounts::default() {
            self.effects = counts.into();
        }
    }

    /// The clusters of all lights.
    pub(super) fn placed_lights(lights: &[Light]) -> Vec<PlacedLight> {
        let placed = |(index, light): (usize, &Light)| PlacedLight::new(index, light);
        #[cfg(feature = "parallel")]
        {
            use rayon::prelude::*;
            lights.par_iter().enumerate().with_min_len(PARALLEL_LIGHTS).map(placed).collect()
        }
        #[cfg(not(feature = "parallel"))]
        lights.iter().enumerate().map(placed).collect()
    }
}

/// Counts the effects of one more light.
pub(super) fn count_effects(counts: &mut Rare<EffectCounts>, light: &Light) {
    let effects = light.effects();
    if !effects.is_empty() {
        counts.add(effects);
    }
}

/// The clusters of all lights that were not removed.
fn placed_lights_of_some(lights: &[Light]) -> Vec<PlacedLight> {
    let present = lights.iter().enumerate().filter(|(_, light)| !light.is_removed());
    present.map(|(index, light)| PlacedLight::new(index, light)).collect()
}
