//! Walks a binary tree of lights, to choose one light or to compute the probabilities of all.

use super::bounds::LightBounds;
use super::saoh::{self, LEAF};
use crate::measuring::emitter::{Emitter, Receiver};
use crate::measuring::real::Real;
use girandole::Light;

/// The importance that a published sampler gives to groups of lights.
pub trait Formula<R: Real = f32>: Sync {
    /// The bounds in the form that a node stores.
    type Bounds: Copy + Send + Sync;

    /// The bounds of one light.
    fn bounds(light: &Emitter<R>) -> LightBounds<R>;

    /// Converts bounds to the stored form.
    fn pack(bounds: &LightBounds<R>) -> Self::Bounds;

    /// The probability of the first of two children; each comes with its light if it is a leaf.
    /// `None` if neither sends light.
    fn first_probability(&self, children: [(&Self::Bounds, Option<&Emitter<R>>); 2], at: &Receiver<R>) -> Option<R>;
}

#[derive(Clone, Copy)]
pub(super) struct BinaryNode<B> {
    pub(super) bounds: B,
    /// The index of the second child (the first is the next node), or [`LEAF`] and the index of a
    /// light.
    pub(super) target: u32,
}

/// A binary tree with one light per leaf.
pub struct BinaryTree<F: Formula<R>, R: Real = f32> {
    formula: F,
    pub(super) lights: Vec<Emitter<R>>,
    pub(super) nodes: Vec<BinaryNode<F::Bounds>>,
}

impl<F: Formula> BinaryTree<F> {
    /// Builds a tree over lights in world space. Lights without power are left out.
    pub fn new(formula: F, lights: Vec<Light>) -> Self {
        Self::over(formula, lights, |light| light.power > 0.0)
    }

    /// Builds a tree over all lights, of which some may get their power later.
    pub fn with_dark_lights(formula: F, lights: Vec<Light>) -> Self {
        Self::over(formula, lights, |_| true)
    }

    fn over(formula: F, lights: Vec<Light>, is_kept: impl Fn(&LightBounds) -> bool) -> Self {
        let lights: Vec<Emitter<f32>> = lights.iter().map(Emitter::from).collect();
        let mut bounds: Vec<(u32, LightBounds)> =
            lights.iter().zip(0..).map(|(light, index)| (index, F::bounds(light))).collect();
        bounds.retain(|(_, light)| is_kept(light));
        let nodes = saoh::build(&mut bounds)
            .iter()
            .map(|node| BinaryNode { bounds: F::pack(&node.bounds), target: node.target })
            .collect();
        Self { formula, lights, nodes }
    }

    /// A tree of the same shape over other lights, in f32 or f64: its bounds are merged from the
    /// leaves upward. The formula in f64 shows what f32 loses.
    pub fn with_lights<R: Real>(&self, lights: Vec<Emitter<R>>) -> BinaryTree<F, R>
    where
        F: Formula<R> + Copy,
    {
        let mut merged: Vec<Option<LightBounds<R>>> = vec![None; self.nodes.len()];
        // Children come after their parents.
        for (index, node) in self.nodes.iter().enumerate().rev() {
            merged[index] = match node.target & LEAF {
                0 => merged[index + 1].zip(merged[node.target as usize]).map(|(a, b)| a.union(&b)),
                _ => Some(<F as Formula<R>>::bounds(&lights[(node.target & !LEAF) as usize])),
            };
        }
        let nodes = merged.iter().flatten().zip(&self.nodes);
        let nodes = nodes
            .map(|(bounds, node)| BinaryNode { bounds: <F as Formula<R>>::pack(bounds), target: node.target })
            .collect();
        BinaryTree { formula: self.formula, lights, nodes }
    }
}

impl<F: Formula<R>, R: Real> BinaryTree<F, R> {
    /// The size of all nodes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }

    /// Chooses a light and returns its index and probability. `u` in [0, 1) is an f64, so that
    /// choices deep in the tree are still random.
    pub fn pick(&self, at: impl Into<Receiver<R>>, mut u: f64) -> Option<(u32, R)> {
        let at = at.into();
        let mut index = 0;
        let mut pmf = R::one();
        loop {
            let node = self.nodes.get(index)?;
            if node.target & LEAF != 0 {
                return Some((node.target & !LEAF, pmf));
            }
            let first = self.first_probability(index, &at)?;
            let share: f64 = first.into();
            if u < share {
                (index, u) = (index + 1, u / share);
                pmf = pmf * first;
            } else {
                (index, u) = (node.target as usize, (u - share) / (1.0 - share));
                pmf = pmf * (R::one() - first);
            }
            u = u.min(1.0 - f64::EPSILON);
        }
    }

    /// The probability of each light. NaN below a node whose importances are infinite or NaN.
    pub fn pmfs(&self, at: impl Into<Receiver<R>>) -> Vec<R> {
        let at = at.into();
        let mut pmfs = vec![R::zero(); self.lights.len()];
        let mut open = if self.nodes.is_empty() { Vec::new() } else { vec![(0, R::one())] };
        while let Some((index, pmf)) = open.pop() {
            let target = self.nodes[index].target;
            if target & LEAF != 0 {
                pmfs[(target & !LEAF) as usize] = pmf;
            } else if let Some(first) = self.first_probability(index, &at) {
                let both = [(index + 1, pmf * first), (target as usize, pmf * (R::one() - first))];
                open.extend(both.into_iter().filter(|(_, pmf)| *pmf > R::zero() || pmf.is_nan()));
            }
        }
        pmfs
    }

    fn first_probability(&self, parent: usize, at: &Receiver<R>) -> Option<R> {
        let children = [parent + 1, self.nodes[parent].target as usize].map(|index| {
            let node = &self.nodes[index];
            let light = (node.target & LEAF != 0).then(|| &self.lights[(node.target & !LEAF) as usize]);
            (&node.bounds, light)
        });
        self.formula.first_probability(children, at)
    }
}
