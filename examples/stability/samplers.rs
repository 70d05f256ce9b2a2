//! The samplers that are compared. Each gets the lights in f32, in the way in which it would hold
//! them.

use super::street::{Street, moved};
use crate::measuring::baselines::{BinaryTree, Cycles, Formula, Pbrt};
use crate::measuring::emitter::{Emitter, Receiver};
use girandole::glam::{DMat3, DVec3};
use girandole::{Light, LightTree, LightWorld, OriginMode, Placement, Policy, SplitCount, WorldError};

/// A sampler of the lights of a [`Street`] that was moved away from zero.
pub trait Subject: Sync {
    /// The name in the table.
    fn name(&self) -> &'static str;

    /// The probability of each light, in the order of [`Street::lights`], as the sampler computes
    /// it in f32. The shading point is that of the street before it was moved.
    fn pmfs(&self, at: &Receiver<f64>) -> Vec<f32>;

    /// The same probabilities by the same formula and the same tree in f64, from lights and a
    /// shading point that were not rounded. `None` where this program has no such evaluation.
    fn exact_pmfs(&self, at: &Receiver<f64>) -> Option<Vec<f64>>;
}

/// This library with two levels: placements are f64, and the origin moves to the scene.
pub struct TwoLevel {
    world: LightWorld,
    shift: DVec3,
    /// For each instance in the world's order, the first of its lights in the street's order.
    starts: Vec<usize>,
    lights_per_instance: Vec<usize>,
}

impl TwoLevel {
    pub fn new(street: &Street, shift: DVec3) -> Result<Self, WorldError> {
        let mut world = LightWorld::new();
        world.set_origin_mode(OriginMode::Following)?;
        world.set_viewpoint(shift)?;
        let add = |lights: &Vec<Emitter<f64>>| world.add_tree(lights.iter().map(Emitter::rounded).collect());
        let trees = street.objects.iter().map(add).collect::<Result<Vec<_>, _>>()?;
        let (mut keys, mut start) = (Vec::new(), 0);
        for instance in &street.instances {
            let placement = Placement { linear: instance.turn.as_mat3(), translation: instance.position + shift };
            keys.push((world.add_instance(trees[instance.object], placement, Policy::Static)?, start));
            start += street.objects[instance.object].len();
        }
        let start = |key| keys.iter().find(|(other, _)| *other == key).map_or(0, |(_, start)| *start);
        let starts: Vec<usize> = world.instances().map(start).collect();
        let count =
            |key| world.instance_tree(key).and_then(|tree| world.tree(tree)).map_or(0, |tree| tree.lights().len());
        let lights_per_instance = world.instances().map(count).collect();
        Ok(Self { world, shift, starts, lights_per_instance })
    }
}

impl Subject for TwoLevel {
    fn name(&self) -> &'static str {
        "girandole"
    }

    fn pmfs(&self, at: &Receiver<f64>) -> Vec<f32> {
        let mut own = Vec::new();
        self.world.sampler().distribution(&at.rounded(self.world.origin() - self.shift), &mut own);
        let mut pmfs = vec![0.0; own.len()];
        let mut rest = own.as_slice();
        for (start, count) in self.starts.iter().zip(&self.lights_per_instance) {
            let (lights, others) = rest.split_at(*count);
            pmfs[*start..][..*count].copy_from_slice(lights);
            rest = others;
        }
        pmfs
    }

    fn exact_pmfs(&self, _: &Receiver<f64>) -> Option<Vec<f64>> {
        None
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
        self.tree.distribution(&at.rounded(-self.shift), SplitCount::DEFAULT, &mut pmfs);
        pmfs
    }

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
