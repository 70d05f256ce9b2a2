//! Chooses from the roots of the trees, as a shader does for a point whose cell has no cut.
//!
//! Twin of the choice without a row in `shaders/row_walk.wgsl`.

use crate::math::dice::Dice;
use crate::sampling::cut::{Candidates, Choice, CutSource};
use crate::sampling::view::{TreeView, WorldView};
use crate::tree::{ChildRef, Lanes, Node};

/// Chooses from the roots.
pub(crate) struct FromRoots;

/// The root of the top level if it has lights, and that of the sky if the point sees it. Each has the same part, which
/// is that of all directional lights together.
pub(crate) struct Roots<'a> {
    roots: [Option<TreeView<'a>>; 2],
    /// The illuminance by directional lights at the point.
    directional_lux: f32,
}

impl<'a> CutSource<'a> for FromRoots {
    type Cut = Roots<'a>;

    #[inline(always)]
    fn cut(self, view: &WorldView<'a, '_>) -> Roots<'a> {
        let is_lit = view.root.nodes.first().is_some_and(|root| root.flux.iter().any(|flux| *flux > 0));
        Roots { roots: [is_lit.then_some(view.root), view.sky()], directional_lux: view.directional_lux }
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

    fn choose(&self, _: &WorldView<'a, '_>, dice: &mut Dice) -> Option<Choice<'a>> {
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
    fn weights(&self, view: &WorldView<'a, '_>, tree: &TreeView<'a>, node: u32, record: &Node) -> Lanes {
        match tree.local.segment {
            Some(_) => view.importances(tree, node, record).weights(),
            None => view.rough_weights(tree, node, record),
        }
    }

    fn visit(&self, _: &WorldView<'a, '_>, visit: impl FnMut(Choice<'a>)) {
        let pmf = 1.0 / self.count();
        self.roots().map(|tree| Choice { tree: *tree, child: ChildRef::Node(0), pmf }).for_each(visit);
    }
}
