//! Walks a binary tree of lights: one light by chance, or the chances of all of them.

use super::bounds::LightBounds;
use super::saoh::{self, LEAF};
use girandole::{Light, ShadingPoint};

/// How a published sampler sees groups of lights.
pub trait Formula: Sync {
    /// What a node keeps of its bounds.
    type Bounds: Copy + Send + Sync;

    /// Of one light.
    fn bounds(light: &Light) -> LightBounds;

    /// Of a node.
    fn pack(bounds: &LightBounds) -> Self::Bounds;

    /// The chance of the first of two children, each with its light if it is a leaf; `None` if neither sends light.
    fn first_chance(&self, children: [(&Self::Bounds, Option<&Light>); 2], shading_point: &ShadingPoint)
    -> Option<f32>;
}

#[derive(Clone, Copy)]
struct BinaryNode<B> {
    bounds: B,
    /// The second child's index (the first is the next node), or [`LEAF`] and a light's.
    target: u32,
}

/// A binary tree with one light a leaf. Lights without power are left out.
pub struct BinaryTree<F: Formula> {
    formula: F,
    lights: Vec<Light>,
    nodes: Vec<BinaryNode<F::Bounds>>,
}

impl<F: Formula> BinaryTree<F> {
    /// Builds over lights in the world.
    pub fn new(formula: F, lights: Vec<Light>) -> Self {
        let mut bounds: Vec<(u32, LightBounds)> =
            lights.iter().zip(0..).map(|(light, index)| (index, F::bounds(light))).collect();
        bounds.retain(|(_, light)| light.power > 0.0);
        let nodes = saoh::build(&mut bounds)
            .iter()
            .map(|node| BinaryNode { bounds: F::pack(&node.bounds), target: node.target })
            .collect();
        Self { formula, lights, nodes }
    }

    /// Of all nodes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }

    /// Chooses a light, with its chance. `u` in [0, 1), in f64 so that deep choices are still random.
    pub fn pick(&self, shading_point: &ShadingPoint, mut u: f64) -> Option<(u32, f32)> {
        let mut index = 0;
        let mut pmf = 1.0;
        loop {
            let node = self.nodes.get(index)?;
            if node.target & LEAF != 0 {
                return Some((node.target & !LEAF, pmf));
            }
            let first = self.first_chance(index, shading_point)?;
            let share = f64::from(first);
            if u < share {
                (index, u) = (index + 1, u / share);
                pmf *= first;
            } else {
                (index, u) = (node.target as usize, (u - share) / (1.0 - share));
                pmf *= 1.0 - first;
            }
            u = u.min(1.0 - f64::EPSILON);
        }
    }

    /// The chance of each light.
    pub fn pmfs(&self, shading_point: &ShadingPoint) -> Vec<f32> {
        let mut pmfs = vec![0.0; self.lights.len()];
        let mut open = if self.nodes.is_empty() { Vec::new() } else { vec![(0, 1.0)] };
        while let Some((index, chance)) = open.pop() {
            let target = self.nodes[index].target;
            if target & LEAF != 0 {
                pmfs[(target & !LEAF) as usize] = chance;
            } else if let Some(first) = self.first_chance(index, shading_point) {
                let both = [(index + 1, chance * first), (target as usize, chance * (1.0 - first))];
                open.extend(both.into_iter().filter(|(_, chance)| *chance > 0.0));
            }
        }
        pmfs
    }

    fn first_chance(&self, parent: usize, shading_point: &ShadingPoint) -> Option<f32> {
        let children = [parent + 1, self.nodes[parent].target as usize].map(|index| {
            let node = &self.nodes[index];
            let light = (node.target & LEAF != 0).then(|| &self.lights[(node.target & !LEAF) as usize]);
            (&node.bounds, light)
        });
        self.formula.first_chance(children, shading_point)
    }
}
