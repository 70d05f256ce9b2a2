//! Makes a tree from lights: its shape, then its nodes.

use super::LightTree;
use super::attributes::{Attributes, Terms};
use super::dirty::Dirty;
use super::node::Node;
use super::rebuild::{Member, items, with_spare};
use super::refit::Tasks;
use super::shape::shape;
use super::wide::WideCluster;
use crate::cluster::Cluster;
use crate::effects::EffectCounts;
use crate::light::Light;

/// Fewer lights are not worth another thread.
#[cfg(feature = "parallel")]
const PARALLEL_LIGHTS: usize = 4096;

impl LightTree {
    /// Builds from valid lights.
    pub(crate) fn build(lights: Vec<Light>) -> Self {
        let members = members(&lights);
        let shapes = shape(&mut items(&members));
        let count = with_spare(shapes.len());
        let mut tree = Self {
            leaves: vec![0; lights.len()],
            effects: effects_of(&lights),
            lights,
            nodes: vec![Node::EMPTY; count],
            wide: vec![WideCluster::EMPTY; count],
            spans: vec![0; count],
            sizes: vec![0; count],
            fresh: vec![0.0; count],
            credit: 0,
            terms: vec![Terms::default(); count],
            is_unmeasured: false,
            dirty: Dirty::none(count),
            tasks: Tasks::default(),
            root: Cluster::EMPTY,
            attributes: Attributes::default(),
        };
        if count > 0 {
            tree.place(&shapes, &members, 0, count);
        }
        tree
    }
}

fn effects_of(lights: &[Light]) -> EffectCounts {
    let mut counts = EffectCounts::default();
    lights.iter().for_each(|light| counts.add(light.effects()));
    counts
}

fn members(lights: &[Light]) -> Vec<Member> {
    let member = |(index, light): (usize, &Light)| Member { light: index as u32, cluster: light.cluster() };
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        lights.par_iter().enumerate().with_min_len(PARALLEL_LIGHTS).map(member).collect()
    }
    #[cfg(not(feature = "parallel"))]
    lights.iter().enumerate().map(member).collect()
}
