//! Walks a binary tree of lights, to choose one light or to compute the probabilities of all.

use super::bounds::LightBounds;
use super::saoh::{self, LEAF};
use girandole::{Light, ShadingPoint};

/// The importance that a published sampler gives to groups of lights.
pub trait Formula: Sync {
    /// The bounds in the form that a node stores.
    type Bounds: Copy + Send + Sync;

    /// The bounds of one light.
    fn bounds(light: &Light) -> LightBounds;

    /// Converts bounds to the stored form.
    fn pack(bounds: &LightBounds) -> Self::Bounds;

    /// The probability of the first of two children; each comes with its light if it is a leaf.
    /// `None` if neither sends light.
    fn first_probability(
        &self,
        children: [(&Self::Bounds, Option<&Light>); 2],
        shading_point: &ShadingPoint,
    ) -> Option<f32>;
}

#[derive(Clone, Copy)]
pub(super) struct BinaryNode<B> {
    pub(super) bounds: B,
    /// The index of the second child (the first is the next node), or [`LEAF`] and the index of a
    /// light.
    pub(super) target: u32,
}

/// A binary tree with one light per leaf.
pub struct BinaryTree<F: Formula> {
    formula: F,
    pub(super) lights: Vec<Light>,
    pub(super) nodes: Vec<BinaryNode<F::Bounds>>,
}

impl<F: Formula> BinaryTree<F> {
    /// Builds a tree over lights in world space. Lights without power are left out.
    pub fn new(formula: F, lights: Vec<Light>) -> Self {
        Self::over(formula, lights, |light| light.power > 0.0)
    }

    /// Builds a tree over all lights, of which some may get their power later.
    pub(super) fn with_dark_lights(formula: F, lights: Vec<Light>) -> Self {
        Self::over(formula, lights, |_| true)
    }

    fn over(formula: F, lights: Vec<Light>, is_kept: impl Fn(&LightBounds) -> bool) -> Self {
        let mut bounds: Vec<(u32, LightBounds)> =
            lights.iter().zip(0..).map(|(light, index)| (index, F::bounds(light))).collect();
        bounds.retain(|(_, light)| is_kept(light));
        let nodes = saoh::build(&mut bounds)
            .iter()
            .map(|node| BinaryNode { bounds: F::pack(&node.bounds), target: node.target })
            .collect();
        Self { formula, lights, nodes }
    }

    /// The size of all nodes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }

    /// Chooses a light and returns its index and probability. `u` in [0, 1) is an f64, so that
    /// choices deep in the tree are still random.
    pub fn pick(&self, shading_point: &ShadingPoint, mut u: f64) -> Option<(u32, f32)> {
        let mut index = 0;
        let mut pmf = 1.0;
        loop {
            let node = self.nodes.get(index)?;
            if node.target & LEAF != 0 {
                return Some((node.target & !LEAF, pmf));
            }
            let first = self.first_probability(index, shading_point)?;
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

    /// The probability of each light.
    pub fn pmfs(&self, shading_point: &ShadingPoint) -> Vec<f32> {
        let mut pmfs = vec![0.0; self.lights.len()];
        let mut open = if self.nodes.is_empty() { Vec::new() } else { vec![(0, 1.0)] };
        while let Some((index, pmf)) = open.pop() {
            let target = self.nodes[index].target;
            if target & LEAF != 0 {
                pmfs[(target & !LEAF) as usize] = pmf;
            } else if let Some(first) = self.first_probability(index, shading_point) {
                let both = [(index + 1, pmf * first), (target as usize, pmf * (1.0 - first))];
                open.extend(both.into_iter().filter(|(_, pmf)| *pmf > 0.0));
            }
        }
        pmfs
    }

    fn first_probability(&self, parent: usize, shading_point: &ShadingPoint) -> Option<f32> {
        let children = [parent + 1, self.nodes[parent].target as usize].map(|index| {
            let node = &self.nodes[index];
            let light = (node.target & LEAF != 0).then(|| &self.lights[(node.target & !LEAF) as usize]);
            (&node.bounds, light)
        });
        self.formula.first_probability(children, shading_point)
    }
}
