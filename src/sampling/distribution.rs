//! The probabilities of all lights in one pass, for measures that need every one of them.
//!
//! The cut and the ratios are those of `walk.rs`, but probabilities are multiplied from the cut
//! down instead of from a light up: each node is evaluated once for all lights below it.

use crate::math::dice::{choice_pmf, joint_pmf};
use crate::math::simd::{VectorJob, with_vectors};
use crate::sampling::cut::{Candidates, CutSource, InstanceTrees, NO_INSTANCE, NoInstances, OwnCut, TreeView};
use crate::shading::importance::running_sums;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::{ChildRef, LightTree, WIDTH};

impl LightTree {
    /// Computes the probability of every light, by its index: what [`LightTree::pmf`] returns for
    /// each, up to rounding. 0 at the indices of removed lights.
    ///
    /// The shading point is in the tree's space. Replaces the content of `pmfs`. `splits` is as for
    /// [`LightSampler::with_splits`](crate::LightSampler::with_splits). O(lights).
    pub fn distribution(&self, shading_point: &ShadingPoint, splits: usize, pmfs: &mut Vec<f32>) {
        pmfs.clear();
        pmfs.resize(self.lights().len(), 0.0);
        let source = OwnCut { root: TreeView::of_tree(self.nodes(), shading_point), splits, directional_lux: 0.0 };
        with_vectors(DistributionJob { source, directional_lux: 0.0, instance_trees: &NoInstances, starts: &[], pmfs });
    }
}

/// Computes the probability of every light of the root's tree and of the instances below it.
/// Returns the lux of all candidates and directional lights.
pub(crate) struct DistributionJob<'t, C, T> {
    pub source: C,
    /// The illuminance by all directional lights.
    pub directional_lux: f32,
    pub instance_trees: &'t T,
    /// For each slot the index in `pmfs` of its instance's first light.
    pub starts: &'t [usize],
    /// 0 at first.
    pub pmfs: &'t mut [f32],
}

impl<'a, C: CutSource<'a>, T: InstanceTrees<'a>> VectorJob for DistributionJob<'_, C, T> {
    type Output = f32;

    #[inline(always)]
    fn run(self) -> f32 {
        let Self { source, directional_lux, instance_trees, starts, pmfs } = self;
        let cut = source.cut(instance_trees);
        let total = cut.total() + directional_lux;
        let cut_pmf = if directional_lux > 0.0 { choice_pmf(cut.total(), total) } else { 1.0 };
        let (mut stack, mut inner_stack) = (Vec::new(), Vec::new());
        cut.visit(|tree, child, pmf| {
            let pmf = joint_pmf(cut_pmf, pmf);
            if !tree.is_top() {
                let start = if tree.instance == NO_INSTANCE { 0 } else { starts[tree.instance as usize] };
                let visit = |light: u32, pmf| pmfs[start + light as usize] = pmf;
                return visit_leaves(&cut, tree, child, pmf, instance_trees, &mut inner_stack, visit);
            }
            visit_leaves(&cut, tree, child, pmf, instance_trees, &mut stack, |leaf, pmf| {
                let Some((tree, child)) = instance_trees.tree_view(leaf) else { return };
                let start = starts[tree.instance as usize];
                let visit = |light: u32, pmf| pmfs[start + light as usize] = pmf;
                visit_leaves(&cut, &tree, child, pmf, instance_trees, &mut inner_stack, visit);
            });
        });
        total
    }
}

/// Visits every leaf of a tree at or below `child` with its probability by a cut; `pmf` is that of
/// `child`. `stack` is empty before and after.
#[inline(always)]
fn visit_leaves<'a>(
    cut: &impl Candidates<'a>,
    tree: &TreeView<'a>,
    child: ChildRef,
    pmf: f32,
    instance_trees: &impl InstanceTrees<'a>,
    stack: &mut Vec<(u32, f32)>,
    mut visit: impl FnMut(u32, f32),
) {
    match child {
        ChildRef::Leaf(leaf) => return visit(leaf, pmf),
        ChildRef::Node(node) => stack.push((node, pmf)),
    }
    while let Some((node, pmf)) = stack.pop() {
        let record = &tree.nodes[node as usize];
        let weights = cut.weights(tree, node, record, instance_trees);
        let total = running_sums(&weights)[WIDTH - 1];
        for slot in 0..WIDTH {
            if weights[slot] <= 0.0 {
                continue;
            }
            let pmf = joint_pmf(pmf, choice_pmf(weights[slot], total));
            match record.child(slot) {
                Some(ChildRef::Leaf(leaf)) => visit(leaf, pmf),
                Some(ChildRef::Node(node)) => stack.push((node, pmf)),
                None => {}
            }
        }
    }
}
