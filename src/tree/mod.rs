//! The bottom level: one light tree per object.

mod apply;
mod attributes;
#[cfg(feature = "bake")]
mod bake;
mod build;
mod check;
pub(crate) mod cost;
mod dirty;
mod edited;
mod freeze;
mod insert;
mod memory;
mod node;
mod pack;
mod placed;
mod rebuild;
mod refit;
mod refitted;
mod remove;
mod openings;
#[cfg(feature = "bake")]
mod ordered;
mod shape;
mod state;
mod units;
#[cfg(test)]
pub(crate) mod testing;
mod wide;

pub use attributes::{Attribute, Attributes};
pub use check::CheckError;
pub use memory::TreeMemory;
pub use node::{Bytes, ChildRef, EMPTY_SLOT, LEAF, MAX_LIGHTS, NO_LEAF, NO_PARENT, Node, WIDTH};
pub(crate) use openings::Opening;
#[cfg(feature = "gpu-plan")]
pub(crate) use pack::{ALL_SURFACES, CAP_STEPS, DIRECTION_STEPS, LEAST_NORMAL_CODE, STEPS};
pub(crate) use pack::{FluxShares, Unpacked};
pub(crate) use refitted::Refitted;

pub(crate) use build::{MAX_EXTRA_UNITS, TreeBuild};
#[cfg(feature = "gpu-plan")]
pub(crate) use shape::BY_IDENTITY;
#[cfg(test)]
pub(crate) use shape::shape;
pub(crate) use shape::{BuildItem, EXIT, Planes, divide};
pub(crate) use units::units_of_build;
pub(crate) use wide::{Lanes, WideCluster};

use std::collections::BTreeSet;
use std::fmt;

use attributes::Quality;
use edited::Edited;
use state::TreeState;

use crate::cluster::{Cluster, Linear};
use crate::effects::EffectCounts;
use crate::error::{ValueError, WorldError};
use crate::light::Light;
use crate::rare::Rare;

/// A light tree: lights, and a tree of nodes with up to eight children over them.
///
/// A build stores nodes depth first: a parent before its children, and every subtree contiguous.
/// [`LightTree::set_lights`] changes lights in place, and [`LightTree::refit`] brings the nodes up
/// to date. [`LightTree::add_lights`] and [`LightTree::remove_lights`] change the nodes near a light
/// only. [`LightWorld`](crate::LightWorld) does all of this for its trees.
#[derive(Clone, Default)]
pub struct LightTree {
    /// [`Light::REMOVED`] at the indices of removed lights.
    lights: Vec<Light>,
    /// The effects of all lights.
    effects: Rare<EffectCounts>,
    /// For each light the place of its leaf, `node * WIDTH + slot`. [`NO_LEAF`] for removed lights.
    leaves: Vec<u32>,
    /// The packed nodes, which are sampled.
    nodes: Vec<Node>,
    /// The number of lights in each node's subtree.
    light_counts: Vec<u32>,
    state: TreeState,
    quality: Quality,
    /// What additions and removals of lights have changed since the build.
    edited: Rare<Edited>,
    /// The builds of the whole tree so far.
    builds: u32,
    /// The cluster of all lights.
    root: Cluster,
    /// The clusters of the sides, which are the children of the root; empty if the tree is not
    /// divided by direction.
    sides: Box<[Cluster]>,
    maps: Maps,
}

/// The maps of the instance for which a tree is made, if it stretches or scales.
#[derive(Clone, Default)]
struct Maps {
    /// Builds divide the lights as they lie in the world.
    reference: Option<Box<Linear>>,
    /// The same as of the last build: refits weigh the lights as they shine in the world.
    weights: Option<Box<Linear>>,
}

impl Maps {
    fn of_build(reference: Option<Box<Linear>>) -> Self {
        Self { weights: reference.clone(), reference }
    }
}

/// The flux of a tree in lumens, separated by how a transform changes it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct FluxByKind {
    /// Flux of points and spots.
    pub punctual: f32,
    /// Flux of rectangles, triangles and spheres.
    pub area: f32,
}

impl LightTree {
    /// Builds a tree. Lights keep their order. A tree may have no lights.
    ///
    /// # Errors
    /// [`WorldError::Entry`] for the first invalid light, [`WorldError::Value`] for more
    /// than [`MAX_LIGHTS`] lights.
    ///
    /// O(n log n). Source: CK18 4.2-4.4, see `tree/shape`.
    pub fn new(lights: Vec<Light>) -> Result<Self, WorldError> {
        Self::with_reference(lights, None)
    }

    /// [`LightTree::new`] for a map for which the lights are divided and weighted.
    pub(crate) fn with_reference(lights: Vec<Light>, reference: Option<Linear>) -> Result<Self, WorldError> {
        check_light_count(lights.len())?;
        check_lights(lights.iter().enumerate())?;
        Ok(Self::build_for(lights, reference.map(Box::new), BTreeSet::new()))
    }

    /// Lights without nodes, which cannot be sampled.
    pub(crate) fn of_lights(lights: &[Light]) -> Self {
        Self { lights: lights.to_vec(), ..Self::default() }
    }

    /// The lights by index: in the order in which they were given, then those that were added. A
    /// removed light keeps its place in this list until its index is used again; what stands there
    /// is dark, and [`Light::is_removed`] tells it from lights.
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// The number of lights, without those that were removed. O(1).
    pub fn light_count(&self) -> usize {
        self.lights.len() - self.edited.vacant().len()
    }

    /// The number of lights that have each effect.
    pub fn effects(&self) -> &EffectCounts {
        &self.effects
    }

    /// The nodes, the root first. Nodes that removals of lights have left have no children.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// For each light the place of its leaf, `node * WIDTH + slot`; see [`WIDTH`]. [`NO_LEAF`] for a
    /// light that was removed.
    pub fn leaves(&self) -> &[u32] {
        &self.leaves
    }

    /// The four attributes of SS as of the last build or refit.
    /// [`LightTree::refit_without_attributes`] does not update them.
    pub fn attributes(&self) -> Attributes {
        self.quality.attributes
    }

    /// The flux of all lights by kind, in lumens.
    pub fn flux(&self) -> FluxByKind {
        FluxByKind { punctual: self.root.punctual_flux, area: self.root.area_flux }
    }

    /// The cluster of all lights as of the last build or refit, at full precision. The root's
    /// children are packed and therefore wider.
    pub fn cluster(&self) -> Cluster {
        self.root
    }

    /// The clusters of the tree's sides at full precision, as of the last build or refit. They are
    /// the children of the root. Empty if the tree is not divided: if all of its lights shine to
    /// the same side or to all sides, or if it has fewer than 16 or more than 256 lights.
    pub fn sides(&self) -> &[Cluster] {
        &self.sides
    }

    /// The indices without a light, in ascending order.
    pub(crate) fn vacant_indices(&self) -> &BTreeSet<u32> {
        self.edited.vacant()
    }

    /// The lights whose leaves have moved since [`LightTree::forget_refitted`] was last called. A
    /// light may occur several times.
    pub(crate) fn moved_leaves(&self) -> &[u32] {
        &self.edited.moved
    }

    /// The nodes that refits have written since [`LightTree::forget_refitted`] was last called.
    pub(crate) fn refitted(&self) -> Refitted<'_> {
        self.state.refitted()
    }

    /// Empties the lists of [`LightTree::refitted`] nodes and of [`LightTree::moved_leaves`].
    pub(crate) fn forget_refitted(&mut self) {
        self.state.forget_refitted();
        self.forget_moved();
    }

    fn forget_moved(&mut self) {
        if !self.edited.moved.is_empty() {
            self.edited.moved.clear();
        }
    }

    /// The map for which builds divide and weigh the lights; `None` for the tree's own space.
    pub(crate) fn reference(&self) -> Option<&Linear> {
        self.maps.reference.as_deref()
    }

    /// The number of builds of the whole tree so far.
    pub(crate) fn builds(&self) -> u32 {
        self.builds
    }

    /// The map that refits weigh the lights for; `None` for the tree's own space.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn weights(&self) -> Option<&Linear> {
        self.maps.weights.as_deref()
    }

    /// Sets that map for later builds.
    pub(crate) fn set_reference(&mut self, reference: Option<Linear>) {
        self.maps.reference = reference.map(Box::new);
    }
}

impl fmt::Debug for LightTree {
    /// Summarises the tree: its lights and nodes may be megabytes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LightTree")
            .field("lights", &self.light_count())
            .field("nodes", &self.nodes.len())
            .field("is_frozen", &self.is_frozen())
            .field("effects", &*self.effects)
            .field("cluster", &self.root)
            .field("attributes", &self.quality.attributes)
            .finish_non_exhaustive()
    }
}

/// Checks that each of these indices is that of a light. `count` indices are known; `light` returns
/// what is at an index.
pub(crate) fn check_indices<'a>(
    mut indices: impl Iterator<Item = u32>,
    count: usize,
    light: impl Fn(usize) -> Option<&'a Light>,
) -> Result<(), WorldError> {
    indices.try_for_each(|index| match light(index as usize) {
        _ if index as usize >= count => Err(WorldError::NoSuchLight { index, count }),
        Some(light) if !light.is_removed() => Ok(()),
        _ => Err(WorldError::RemovedLight { index }),
    })
}

/// Checks that no index occurs twice in a list of lights to remove.
pub(crate) fn check_distinct(indices: &[u32]) -> Result<(), WorldError> {
    let mut sorted = indices.to_vec();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(WorldError::RemovedLight { index: pair[0] }),
        None => Ok(()),
    }
}

pub(crate) fn check_light_count(given: usize) -> Result<(), WorldError> {
    let refused = || ValueError::new("the number of lights in one tree", given as f64, 0.0, MAX_LIGHTS as f64);
    if given > MAX_LIGHTS { Err(refused().into()) } else { Ok(()) }
}

pub(crate) fn check_lights<'a>(mut lights: impl Iterator<Item = (usize, &'a Light)>) -> Result<(), WorldError> {
    lights.try_for_each(|(index, light)| check_light(index, light))
}

fn check_light(index: usize, light: &Light) -> Result<(), WorldError> {
    light.validate().map_err(|source| WorldError::entry("light", index, source))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn a_tree_takes_as_many_lights_as_31_bits_can_name_and_no_more() {
        assert!(check_light_count(MAX_LIGHTS).is_ok());
        let error = check_light_count(MAX_LIGHTS + 1).expect_err("one too many").to_string();
        assert_eq!(error, "the number of lights in one tree is 2147483648; it must be from 0 to 2147483647");
    }

    #[test]
    fn the_debug_text_of_a_large_tree_is_short() {
        let tree = LightTree::build(vec![Light::point(Vec3::ONE, Vec3::ONE); 1000]);
        let text = format!("{tree:?}");
        assert!(text.contains("lights: 1000") && text.len() < 2000, "{text}");
    }
}
