//! The samplers of a [`Street`]. Each gets the lights in f32, in the way in which it would hold them.

use super::street::{Street, moved};
use crate::measuring::emitter::{Emitter, Receiver};
use crate::measuring::reference::choice::{Below, Tree, distribution};
use crate::measuring::reference::place::{Map, View};
use crate::measuring::reference::rough::walk;
use girandole::glam::{DMat3, DVec3};
use girandole::{InstanceKey, LightId, LightSampler, LightTree, LightWorld, Placement, Policy, WorldError};
use std::collections::BTreeMap;

/// A sampler of the lights of a [`Street`] that was moved away from zero.
pub enum Subject {
    TwoLevel(Box<TwoLevel>),
    /// One tree of this library over all lights in f32 and in the space of the world, which was moved by so much.
    Flat(Box<LightTree>, DVec3),
}

impl Subject {
    /// Both samplers.
    pub fn both(street: &Street, shift: DVec3) -> Result<[Self; 2], WorldError> {
        let in_the_world = |light: &Emitter| moved(light, 1.0, &DMat3::IDENTITY, shift).rounded();
        let tree = LightTree::new(street.lights().iter().map(in_the_world).collect())?;
        Ok([Self::TwoLevel(Box::new(TwoLevel::new(street, shift)?)), Self::Flat(Box::new(tree), shift)])
    }

    /// The name in the table.
    pub fn name(&self) -> &'static str {
        if matches!(self, Self::TwoLevel(_)) { "girandole" } else { "girandole flat" }
    }

    /// The probability of each light, in the order of [`Street::lights`], as the sampler computes
    /// it in f32. The shading point is that of the street before it was moved.
    pub fn pmfs(&self, at: &Receiver) -> Vec<f32> {
        let mut pmfs = Vec::new();
        match self {
            Self::TwoLevel(levels) => {
                levels.world.sampler().distribution(&at.rounded(levels.origin()), &mut pmfs);
                levels.in_street_order(&pmfs)
            }
            Self::Flat(tree, shift) => {
                tree.distribution(&at.rounded(-*shift), 6, &mut pmfs);
                pmfs
            }
        }
    }

    /// The same probabilities by the same formula and the same tree in f64, from a shading point that was not
    /// rounded, and from the nodes as they are stored: what packing does to them is a part of the formula. `None` for
    /// one tree: its nodes hold what rounding has left of the lights, so that it has no exact nodes.
    pub fn exact_pmfs(&self, at: &Receiver) -> Option<Vec<f64>> {
        let Self::TwoLevel(levels) = self else { return None };
        let sampler = levels.world.sampler();
        let view = View::of(at.position - levels.origin(), at.normal);
        let top = Tree { nodes: sampler.top_nodes(), view, instance: None };
        levels.by_light(distribution(&top, 6, 0.0, &|leaf| levels.below(&sampler, leaf, view)).lights)
    }
}

/// This library with two levels: placements are f64, and the origin moves to the scene.
pub struct TwoLevel {
    world: LightWorld,
    shift: DVec3,
    shown: BTreeMap<InstanceKey, Shown>,
}

/// An instance as the street has it, without rounding.
struct Shown {
    map: Map,
    position: DVec3,
    /// The first of its lights in the street's order.
    start: usize,
}

impl TwoLevel {
    pub fn new(street: &Street, shift: DVec3) -> Result<Self, WorldError> {
        let mut world = LightWorld::new();
        world.set_origin_near(shift)?;
        let add =
            |lights: &Vec<Emitter>| Ok(world.add_tree(LightTree::new(lights.iter().map(Emitter::rounded).collect())?));
        let trees = street.objects.iter().map(add).collect::<Result<Vec<_>, WorldError>>()?;
        let (mut shown, mut start) = (BTreeMap::new(), 0);
        for instance in &street.instances {
            let placement = Placement { linear: instance.turn.as_mat3(), translation: instance.position + shift };
            let key = world.add_instance(trees[instance.object], placement, Policy::Static)?;
            shown.insert(key, Shown { map: Map::new(instance.turn), position: instance.position, start });
            start += street.objects[instance.object].len();
        }
        Ok(Self { world, shift, shown })
    }

    /// The world that holds the street.
    pub fn world(&self) -> &LightWorld {
        &self.world
    }

    /// The probabilities of a walk from the root, in f64, as [`Subject::exact_pmfs`]; and whether rounding may turn one
    /// of its decisions.
    pub fn exact_walk(&self, at: &Receiver) -> (Option<Vec<f64>>, bool) {
        let sampler = self.world.sampler();
        let view = View::of(at.position - self.origin(), at.normal);
        let top = Tree { nodes: sampler.top_nodes(), view, instance: None };
        let found = walk(&top, &|leaf| self.below(&sampler, leaf, view));
        (self.by_light(found.lights), found.is_close)
    }

    /// The probabilities in the order of the street's lights.
    fn by_light(&self, lights: Vec<((Option<u32>, u32), f64)>) -> Option<Vec<f64>> {
        let mut pmfs = vec![0.0; self.world.sampler().all_lights().count()];
        for ((slot, light), pmf) in lights {
            let shown = slot.and_then(|slot| self.world.instance_at(slot)).map(|instance| &self.shown[&instance]);
            pmfs[shown?.start + light as usize] = pmf;
        }
        Some(pmfs)
    }

    /// Probabilities in the order of [`Street::lights`], from those in the order of
    /// [`LightSampler::all_lights`].
    pub fn in_street_order(&self, own: &[f32]) -> Vec<f32> {
        let mut pmfs = vec![0.0; own.len()];
        for (light, pmf) in self.world.sampler().all_lights().zip(own) {
            if let LightId::Local { instance, light } = light {
                pmfs[self.shown[&instance].start + light as usize] = *pmf;
            }
        }
        pmfs
    }

    /// The world's origin in the space of the street.
    pub fn origin(&self) -> DVec3 {
        self.world.origin() - self.shift
    }

    /// The tree of the top level's leaf and the place in it, as a shading point sees it.
    fn below(&self, sampler: &LightSampler<'_>, leaf: u32, view: View) -> Below<'_> {
        let (instance, target) = sampler.top_leaf(leaf)?;
        let tree = self.world.tree(self.world.instance(instance)?.tree)?;
        let Shown { map, position, .. } = self.shown.get(&instance)?;
        let view = view.in_tree(map, *position - self.origin(), 1.0);
        Some((Tree { nodes: tree.nodes(), view, instance: self.world.slot(instance) }, target))
    }
}
