//! The chances of all lights in one pass, for measures that need every one of them.
//!
//! The same cut and the same ratios as in `walk.rs`, but joined from the cut down instead of from a light up: a node is
//! weighed once for all lights below it.

use crate::counts::SplitCount;
use crate::dice::{joint, share};
use crate::importance::{running_sums, see};
use crate::shading_point::ShadingPoint;
use crate::simd::{Job, with_vectors};
use crate::tree::{LightTree, Target, WIDTH};
use crate::walk::{Cut, Forest, NO_INSTANCE, NoForest, Scene};

impl LightTree {
    /// The chance of every light, by its index: what [`LightTree::pmf`] tells of each, up to rounding. O(lights).
    ///
    /// Fills `chances`, whatever it held. As [`LightSampler::distribution`](crate::LightSampler::distribution); `splits` as in
    /// [`LightSampler::with_splits`](crate::LightSampler::with_splits).
    pub fn distribution(&self, shading_point: &ShadingPoint, splits: SplitCount, chances: &mut Vec<f32>) {
        chances.clear();
        chances.resize(self.lights().len(), 0.0);
        let root = Scene::alone(self.nodes(), shading_point);
        with_vectors(Spread { root, splits, beside: 0.0, forest: &NoForest, starts: &[], chances });
    }
}

/// Gives every light of the root's tree and those behind it its chance; returns the lux of all and what stands `beside`.
pub(crate) struct Spread<'a, 'f, F> {
    pub root: Scene<'a>,
    pub splits: SplitCount,
    pub beside: f32,
    pub forest: &'f F,
    /// Where the lights of the instance in each slot begin.
    pub starts: &'f [usize],
    /// 0 at first.
    pub chances: &'f mut [f32],
}

impl<'a, F: Forest<'a>> Job for Spread<'a, '_, F> {
    type Output = f32;

    #[inline(always)]
    fn run(self) -> f32 {
        let Self { root, splits, beside, forest, starts, chances } = self;
        let cut = Cut::new(root, splits, forest);
        let total = cut.total() + beside;
        let of_trees = if beside > 0.0 { share(cut.total(), total) } else { 1.0 };
        let (mut stack, mut inner) = (Vec::new(), Vec::new());
        for (scene, target, chance) in cut.candidates() {
            let chance = joint(of_trees, chance);
            if !scene.is_top {
                let start = if scene.instance == NO_INSTANCE { 0 } else { starts[scene.instance as usize] };
                below(scene, target, chance, &mut inner, |light, chance| chances[start + light as usize] = chance);
                continue;
            }
            below(scene, target, chance, &mut stack, |slot, chance| {
                let Some(tree) = forest.enter(slot).filter(|tree| !tree.nodes.is_empty()) else { return };
                let start = starts[slot as usize];
                let found = |light: u32, chance| chances[start + light as usize] = chance;
                below(&tree, Target::Node(0), chance, &mut inner, found);
            });
        }
        total
    }
}

/// Every leaf of a tree at or below `target`, with its chance, given that of `target`. `stack` is empty, before and
/// after.
#[inline(always)]
fn below(scene: &Scene<'_>, target: Target, chance: f32, stack: &mut Vec<(u32, f32)>, mut found: impl FnMut(u32, f32)) {
    match target {
        Target::Leaf(leaf) => return found(leaf, chance),
        Target::Node(node) => stack.push((node, chance)),
    }
    while let Some((node, chance)) = stack.pop() {
        let record = &scene.nodes[node as usize];
        let values = see(record, &scene.view).importance;
        let total = running_sums(&values)[WIDTH - 1];
        for slot in 0..WIDTH {
            if values[slot] <= 0.0 {
                continue;
            }
            let chance = joint(chance, share(values[slot], total));
            match record.target(slot) {
                Some(Target::Leaf(leaf)) => found(leaf, chance),
                Some(Target::Node(node)) => stack.push((node, chance)),
                None => {}
            }
        }
    }
}
