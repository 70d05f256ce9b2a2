//! The bottom level: one light tree per object.

mod attributes;
mod build;
mod check;
mod cost;
mod dirty;
mod freeze;
mod node;
mod rebuild;
mod refit;
mod shape;
mod wide;

pub use attributes::{Attribute, Attributes};
pub use check::CheckError;
pub(crate) use cost::DIAGONAL_WEIGHT;
pub use node::{Bytes, EMPTY_SLOT, LEAF, MAX_LIGHTS, NO_PARENT, Node, Target, WIDTH};
#[cfg(feature = "gpu")]
pub(crate) use node::{CAP_STEPS, DIRECTION_STEPS, STEPS};
pub(crate) use node::{UNLIMITED_RANGE, Unpacked};
#[cfg(feature = "gpu")]
pub(crate) use shape::{FULL, SPARSE_COUNTS};
#[cfg(test)]
pub(crate) use shape::{Item, shape};
pub(crate) use shape::{fills_nodes, middle};
pub(crate) use wide::{Lanes, WideCluster};

pub(crate) use rebuild::Part;

use dirty::Dirty;

use crate::cluster::Cluster;
use crate::effects::EffectCounts;
use crate::error::WorldError;
use crate::light::Light;

/// Lights and the wide tree over them. Nodes lie depth first: a parent before its children, every subtree in one piece.
///
/// A tree is bound to its number of lights; [`LightTree::set`] changes lights in place and [`LightTree::refit`] brings
/// the nodes up to date. [`LightWorld`](crate::LightWorld) does both for the trees that it holds.
#[derive(Clone, Debug, Default)]
pub struct LightTree {
    lights: Vec<Light>,
    /// What the lights call for.
    effects: EffectCounts,
    /// For each light `node * WIDTH + slot` of its leaf.
    leaves: Vec<u32>,
    /// What is sampled.
    nodes: Vec<Node>,
    /// What each node is packed from; lights' lanes follow `set`, nodes' lanes the refit. A frozen tree has none.
    wide: Vec<WideCluster>,
    /// Nodes that belong to each node's subtree, itself and spare ones included; 0 for a spare node.
    spans: Vec<u32>,
    /// Lights in each node's subtree.
    sizes: Vec<u32>,
    /// Splitting cost of each subtree relative to how its lights lie, when it was built.
    fresh: Vec<f32>,
    /// Lights that [`LightTree::rebuild_worst`] may still rebuild.
    credit: usize,
    /// Each subtree's part of the attributes.
    terms: Vec<attributes::Terms>,
    /// Some of the terms are older than the nodes.
    is_unmeasured: bool,
    /// Nodes with lanes that changed since the last refit.
    dirty: Dirty,
    tasks: refit::Tasks,
    /// All lights.
    root: Cluster,
    attributes: Attributes,
}

/// A tree's flux, by how a transform changes it. Lumens.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FluxByKind {
    /// Of points and spots.
    pub punctual: f32,
    /// Of rectangles, triangles and spheres.
    pub area: f32,
}

impl LightTree {
    /// Builds a tree. Lights keep their order; a tree of no lights is fine.
    ///
    /// # Errors
    /// [`WorldError::Light`] for the first bad light, [`WorldError::TooManyLights`] past [`MAX_LIGHTS`].
    ///
    /// O(n log n). Source: CK18 4.2-4.4, see `tree/shape`.
    pub fn new(lights: Vec<Light>) -> Result<Self, WorldError> {
        check_light_count(lights.len())?;
        check_lights(lights.iter().enumerate())?;
        Ok(Self::build(lights))
    }

    /// The lights, in the order they were given.
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// How many of the lights have each effect.
    pub fn effects(&self) -> &EffectCounts {
        &self.effects
    }

    /// The nodes, the root first.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// `node * WIDTH + slot` of each light's leaf.
    pub fn leaves(&self) -> &[u32] {
        &self.leaves
    }

    /// The four attributes of SS as of the last build or refit, but for [`LightTree::refit_without_attributes`].
    pub fn attributes(&self) -> Attributes {
        self.attributes
    }

    /// The flux of all lights by kind, in lumens.
    pub fn flux(&self) -> FluxByKind {
        let Cluster { flux, area_flux, .. } = self.cluster();
        FluxByKind { punctual: (flux - area_flux).max(0.0), area: area_flux }
    }

    /// All lights as one cluster, exactly: the root's children are packed wider.
    pub fn cluster(&self) -> Cluster {
        self.root
    }

    /// Replaces lights; the nodes follow at the next [`LightTree::refit`]. A frozen tree thaws, which allocates.
    ///
    /// # Errors
    /// [`WorldError::NoSuchLight`] or [`WorldError::Light`]; then no light has changed.
    pub fn set_lights(&mut self, changes: &[(u32, Light)]) -> Result<(), WorldError> {
        self.check_changes(changes)?;
        self.apply(changes);
        Ok(())
    }

    /// [`LightTree::set`] for changes that are known to be fine.
    pub(crate) fn apply(&mut self, changes: &[(u32, Light)]) {
        if !changes.is_empty() {
            self.thaw();
        }
        for (index, light) in changes {
            let former = std::mem::replace(&mut self.lights[*index as usize], *light);
            self.effects.remove(former.effects());
            self.effects.add(light.effects());
            let place = self.leaves[*index as usize] as usize;
            self.wide[place / WIDTH].set(place % WIDTH, &light.cluster());
            self.dirty.insert(place / WIDTH);
        }
    }

    /// Whether [`LightTree::set`] would take these changes.
    pub(crate) fn check_changes(&self, changes: &[(u32, Light)]) -> Result<(), WorldError> {
        let count = self.lights.len();
        if let Some((index, _)) = changes.iter().find(|(index, _)| *index as usize >= count) {
            return Err(WorldError::NoSuchLight { index: *index, count });
        }
        check_lights(changes.iter().map(|(i, l)| (*i as usize, l)))
    }

    /// Builds the nodes anew from the present lights.
    pub fn rebuild(&mut self) {
        *self = Self::build(std::mem::take(&mut self.lights));
    }
}

fn check_light_count(given: usize) -> Result<(), WorldError> {
    if given > MAX_LIGHTS { Err(WorldError::TooManyLights { given, limit: MAX_LIGHTS }) } else { Ok(()) }
}

fn check_lights<'a>(mut lights: impl Iterator<Item = (usize, &'a Light)>) -> Result<(), WorldError> {
    lights.try_for_each(|(index, light)| light.validate().map_err(|source| WorldError::Light { index, source }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_light_limit_follows_from_the_leaf_bit_and_is_tested_on_both_sides() {
        assert!(check_light_count(MAX_LIGHTS).is_ok());
        assert_eq!(
            check_light_count(MAX_LIGHTS + 1),
            Err(WorldError::TooManyLights { given: MAX_LIGHTS + 1, limit: MAX_LIGHTS })
        );
        // The largest index, with the leaf bit, is not the mark of an empty slot.
        assert_ne!((MAX_LIGHTS - 1) as u32 | LEAF, EMPTY_SLOT);
    }
}
