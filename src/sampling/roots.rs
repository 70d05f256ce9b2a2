//! Chooses from the roots of the trees, as a shader does for a point whose cell has no cut.
//!
//! Twin of the choice without a row in `shaders/row_walk.wgsl`.

use crate::math::dice::Dice;
use crate::sampling::cut::{Candidates, Choice, CutSource, InstanceTrees, TreeView, seen_importances};
use crate::shading::importance::ChildImportances;
use crate::shading::rough::rough_weights;
use crate::tree::{ChildRef, Lanes, Node, WIDTH};

/// The weights of a node's children by [rough estimates](rough_weights).
#[inline(always)]
pub(crate) fn seen_rough_weights<'a>(
    tree: &TreeView<'a>,
    node: u32,
    record: &Node,
    trees: &impl InstanceTrees<'a>,
) -> Lanes {
    if !trees.hides() {
        return rough_weights(record, &tree.local);
    }
    let mut children = ChildImportances { importance: rough_weights(record, &tree.local), doubt: [0.0; WIDTH] };
    trees.weigh_masks(tree, node, record, &mut children);
    children.importance
}

/// The roots that a point chooses from.
pub(crate) struct FromRoots<'a> {
    /// That of the top level.
    pub top: TreeView<'a>,
    /// The illuminance by directional lights at the point.
    pub directional_lux: f32,
}

/// The root of the top level if it has lights, and that of the sky if the point sees it. Each has the same part, which
/// is that of all directional lights together.
pub(crate) struct Roots<'a> {
    roots: [Option<TreeView<'a>>; 2],
    directional_lux: f32,
}

impl<'a> CutSource<'a> for FromRoots<'a> {
    type Cut = Roots<'a>;

    #[inline(always)]
    fn cut(self, trees: &impl InstanceTrees<'a>) -> Roots<'a> {
        let Self { top, directional_lux } = self;
        let is_lit = top.nodes.first().is_some_and(|root| root.flux.iter().any(|flux| *flux > 0));
        Roots { roots: [is_lit.then_some(top), trees.sky()], directional_lux }
    }
}

impl<'a> Roots<'a> {
    fn roots(&self) -> impl Iterator<Item = &TreeView<'a>> {
        self.roots.iter().flatten()
    }

    fn count(&self) -> f32 {
        self.roots().count() as f32
    }
}

impl<'a> Candidates<'a> for Roots<'a> {
    fn total(&self) -> f32 {
        self.count() * if self.directional_lux > 0.0 { self.directional_lux } else { 1.0 }
    }

    fn choose(&self, dice: &mut Dice) -> Option<Choice<'a>> {
        let count = self.count();
        let point = dice.point(count);
        let index = (point as usize).min(self.roots().count().checked_sub(1)?);
        let tree = *self.roots().nth(index)?;
        dice.remap((point - index as f32) / count, 1.0 / count);
        Some(Choice { tree, child: ChildRef::Node(0), pmf: 1.0 / count })
    }

    fn pmf(&self, _: &TreeView<'a>, _: u32, _: usize) -> Option<f32> {
        None
    }

    fn root_pmf(&self, tree: &TreeView<'a>) -> f32 {
        let is_root = self.roots().any(|root| root.instance == tree.instance);
        if is_root { 1.0 / self.count() } else { 0.0 }
    }

    /// By the importances of a segment, for which there are no rough estimates.
    #[inline(always)]
    fn weights(&self, tree: &TreeView<'a>, node: u32, record: &Node, trees: &impl InstanceTrees<'a>) -> Lanes {
        match tree.local.segment {
            Some(_) => seen_importances(tree, node, record, trees).weights(),
            None => seen_rough_weights(tree, node, record, trees),
        }
    }

    fn visit(&self, mut visit: impl FnMut(&TreeView<'a>, ChildRef, f32)) {
        self.roots().for_each(|tree| visit(tree, ChildRef::Node(0), 1.0 / self.count()));
    }
}
