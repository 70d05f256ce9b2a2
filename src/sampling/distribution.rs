//! The probabilities of all lights in one pass, for measures that need every one of them.
//!
//! The cut and the ratios are those of `walk.rs`, but probabilities are multiplied from the cut
//! down instead of from a light up: each node is evaluated once for all lights below it.

use crate::math::dice::{choice_pmf, joint_pmf};
use crate::sampling::cut::{Candidates, Choice, CutWork, OwnCut, work_on_cut};
use crate::sampling::view::{NO_INSTANCE, WorldView};
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
        let view = WorldView::of_tree(self.nodes(), shading_point);
        work_on_cut(OwnCut { splits }, &view, Distribution { starts: &[], pmfs });
    }
}

/// Computes the probability of every light of the root's tree and of the instances below it.
/// Returns the lux of all candidates and directional lights.
pub(crate) struct Distribution<'t> {
    /// For each slot the index in `pmfs` of its instance's first light.
    pub starts: &'t [usize],
    /// 0 at first.
    pub pmfs: &'t mut [f32],
}

impl<'a> CutWork<'a> for Distribution<'_> {
    type Output = f32;

    #[inline(always)]
    fn run(self, cut: &impl Candidates<'a>, view: &WorldView<'a, '_>) -> f32 {
        let Self { starts, pmfs } = self;
        let total = cut.total() + view.directional_lux;
        let cut_pmf = if view.directional_lux > 0.0 { choice_pmf(cut.total(), total) } else { 1.0 };
        let (mut stack, mut inner_stack) = (Vec::new(), Vec::new());
        cut.visit(view, |member| {
            let member = Choice { pmf: joint_pmf(cut_pmf, member.pmf), ..member };
            if !member.tree.is_top() {
                let start = if member.tree.instance == NO_INSTANCE { 0 } else { starts[member.tree.instance as usize] };
                let visit = |light: u32, pmf| pmfs[start + light as usize] = pmf;
                return visit_leaves(cut, view, member, &mut inner_stack, visit);
            }
            visit_leaves(cut, view, member, &mut stack, |leaf, pmf| {
                let Some((tree, child)) = view.tree_below(leaf) else { return };
                let start = starts[tree.instance as usize];
                let visit = |light: u32, pmf| pmfs[start + light as usize] = pmf;
                visit_leaves(cut, view, Choice { tree, child, pmf }, &mut inner_stack, visit);
            });
        });
        total
    }
}

/// Visits every leaf at or below a member of a cut with its probability. `stack` is empty before and after.
#[inline(always)]
fn visit_leaves<'a>(
    cut: &impl Candidates<'a>,
    view: &WorldView<'a, '_>,
    Choice { tree, child, pmf }: Choice<'a>,
    stack: &mut Vec<(u32, f32)>,
    mut visit: impl FnMut(u32, f32),
) {
    match child {
        ChildRef::Leaf(leaf) => return visit(leaf, pmf),
        ChildRef::Node(node) => stack.push((node, pmf)),
    }
    while let Some((node, pmf)) = stack.pop() {
        let record = &tree.nodes[node as usize];
        let weights = cut.weights(view, &tree, node, record);
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
