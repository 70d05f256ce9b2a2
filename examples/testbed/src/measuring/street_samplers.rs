//! The samplers that are compared. Each gets the lights in f32, in the way in which it would hold
//! them.

use super::street::{Street, moved};
use crate::measuring::baselines::{BinaryTree, Cycles, Formula, Pbrt};
use crate::measuring::emitter::{Emitter, Receiver};
use crate::measuring::reference::choice::{Below, Tree, distribution};
use crate::measuring::reference::place::{Map, View};
use crate::measuring::reference::rough::walk;
use girandole::glam::{DMat3, DVec3};
use girandole::{InstanceKey, Light, LightId, LightSampler, LightTree, LightWorld, Placement, Policy, WorldError};
use std::collections::BTreeMap;

/// A sampler of the lights of a [`Street`] that was moved away from zero.
pub trait Subject: Sync {
    /// The name in the table.
    fn name(&self) -> &'static str;

    /// The probability of each light, in the order of [`Street::lights`], as the sampler computes
    /// it in f32. The shading point is that of the street before it was moved.
    fn pmfs(&self, at: &Receiver<f64>) -> Vec<f32>;

    /// The same probabilities by the same formula and the same tree in f64, from lights and a
    /// shading point that were not rounded. `None` where there is no such evaluation.
    fn exact_pmfs(&self, at: &Receiver<f64>) -> Option<Vec<f64>>;
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
        let add = |lights: &Vec<Emitter<f64>>| {
            Ok(world.add_tree(LightTree::new(lights.iter().map(Emitter::rounded).collect())?))
        };
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
    pub fn exact_walk(&self, at: &Receiver<f64>) -> (Option<Vec<f64>>, bool) {
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

impl Subject for TwoLevel {
    fn name(&self) -> &'static str {
        "girandole"
    }

    fn pmfs(&self, at: &Receiver<f64>) -> Vec<f32> {
        let mut own = Vec::new();
        self.world.sampler().distribution(&at.rounded(self.origin()), &mut own);
        self.in_street_order(&own)
    }

    /// From the nodes as they are stored: what packing does to them is a part of the formula.
    fn exact_pmfs(&self, at: &Receiver<f64>) -> Option<Vec<f64>> {
        let sampler = self.world.sampler();
        let view = View::of(at.position - self.origin(), at.normal);
        let top = Tree { nodes: sampler.top_nodes(), view, instance: None };
        let below = |leaf| self.below(&sampler, leaf, view);
        self.by_light(distribution(&top, 6, 0.0, &below).lights)
    }
}

/// One tree of this library over all lights in f32 and in the space of the world.
pub struct Flat {
    tree: LightTree,
    shift: DVec3,
}

impl Flat {
    pub fn new(street: &Street, shift: DVec3) -> Result<Self, WorldError> {
        Ok(Self { tree: LightTree::new(in_the_world(&street.lights(), shift))?, shift })
    }
}

impl Subject for Flat {
    fn name(&self) -> &'static str {
        "girandole flat"
    }

    fn pmfs(&self, at: &Receiver<f64>) -> Vec<f32> {
        let mut pmfs = Vec::new();
        self.tree.distribution(&at.rounded(-self.shift), 6, &mut pmfs);
        pmfs
    }

    /// `None`: its nodes hold what rounding has left of the lights, so that it has no exact nodes.
    fn exact_pmfs(&self, _: &Receiver<f64>) -> Option<Vec<f64>> {
        None
    }
}

/// A published tree over all lights in f32 and in the space of the world.
pub struct Published<F: Formula<f32> + Formula<f64>> {
    name: &'static str,
    tree: BinaryTree<F, f32>,
    exact: BinaryTree<F, f64>,
    shift: DVec3,
}

impl<F: Formula<f32> + Formula<f64> + Copy> Published<F> {
    pub fn new(name: &'static str, formula: F, street: &Street, shift: DVec3) -> Self {
        let lights = street.lights();
        let rounded = in_the_world(&lights, shift);
        let emitters = rounded.iter().map(Emitter::from).collect();
        // Far away, triangles without area are dark in f32, but not in f64.
        let shape = BinaryTree::with_dark_lights(formula, rounded);
        // Both merge the bounds of two children, so that they differ in rounding alone.
        Self { name, tree: shape.with_lights::<f32>(emitters), exact: shape.with_lights::<f64>(lights), shift }
    }
}

impl<F: Formula<f32> + Formula<f64>> Subject for Published<F> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn pmfs(&self, at: &Receiver<f64>) -> Vec<f32> {
        self.tree.pmfs(&at.rounded(-self.shift))
    }

    fn exact_pmfs(&self, at: &Receiver<f64>) -> Option<Vec<f64>> {
        Some(self.exact.pmfs(*at))
    }
}

/// All samplers.
pub fn all(street: &Street, shift: DVec3) -> Result<[Box<dyn Subject>; 4], WorldError> {
    Ok([
        Box::new(TwoLevel::new(street, shift)?),
        Box::new(Flat::new(street, shift)?),
        Box::new(Published::new("pbrt", Pbrt { is_opaque: false }, street, shift)),
        Box::new(Published::new("cycles", Cycles, street, shift)),
    ])
}

/// Lights in f32, after a shift in f64.
fn in_the_world(lights: &[Emitter<f64>], shift: DVec3) -> Vec<Light> {
    lights.iter().map(|light| moved(light, 1.0, &DMat3::IDENTITY, shift).rounded()).collect()
}
