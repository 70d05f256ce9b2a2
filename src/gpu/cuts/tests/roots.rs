//! What a shader does for a point whose cell has no cut: it chooses one of the roots, and walks down from there by
//! rough estimates.

use crate::math::dice::{Dice, choice_pmf};
use crate::sampling::cut::{Candidates, Choice, InstanceTrees, NO_INSTANCE, TreeView};
use crate::sampling::sample::LightSampler;
use crate::sampling::walk::{Outcome, draw};
use crate::shading::importance::ChildImportances;
use crate::shading::rough::rough_weights;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::{ChildRef, Lanes, Node, WIDTH};

/// The root of the top level and that of the sky.
struct Roots<'a> {
    roots: Vec<TreeView<'a>>,
    directional_lux: f32,
}

fn weights<'a>(tree: &TreeView<'a>, node: u32, record: &Node, trees: &impl InstanceTrees<'a>) -> Lanes {
    let mut children = ChildImportances { importance: rough_weights(record, &tree.local), doubt: [0.0; WIDTH] };
    trees.weigh_masks(tree, node, record, &mut children);
    children.importance
}

impl<'a> Roots<'a> {
    fn new(sampler: &LightSampler<'a>, at: &ShadingPoint, trees: &impl InstanceTrees<'a>) -> Self {
        let top = sampler
            .view_at(NO_INSTANCE, at)
            .filter(|top| top.nodes.first().is_some_and(|root| root.flux.iter().any(|flux| *flux > 0)));
        Self { roots: top.into_iter().chain(trees.sky()).collect(), directional_lux: sampler.directional_lux(at) }
    }
}

impl<'a> Candidates<'a> for Roots<'a> {
    /// Each has as much as all directional lights together.
    fn total(&self) -> f32 {
        self.roots.len() as f32 * if self.directional_lux > 0.0 { self.directional_lux } else { 1.0 }
    }

    fn choose(&self, dice: &mut Dice) -> Option<Choice<'a>> {
        let count = self.roots.len() as f32;
        let point = dice.point(count);
        let index = (point as usize).min(self.roots.len() - 1);
        let tree = *self.roots.get(index)?;
        dice.remap((point - index as f32) / count, 1.0 / count);
        Some(Choice { tree, child: ChildRef::Node(0), pmf: 1.0 / count })
    }

    fn pmf(&self, _: &TreeView<'a>, _: u32, _: usize) -> Option<f32> {
        unreachable!("it only draws")
    }

    fn weights(&self, tree: &TreeView<'a>, node: u32, record: &Node, trees: &impl InstanceTrees<'a>) -> Lanes {
        weights(tree, node, record, trees)
    }

    fn visit(&self, _: impl FnMut(&TreeView<'a>, ChildRef, f32)) {
        unreachable!("it only draws")
    }
}

/// The instance, the light and its probability; `u32::MAX` for a directional light.
pub(super) fn pick(sampler: &LightSampler<'_>, at: &ShadingPoint, u: [f32; 2]) -> Option<(u32, u32, f32)> {
    let lux = sampler.directional_lux(at);
    let trees = sampler.world_trees(at);
    let outcome = match sampler.hidden(at) {
        Some(hidden) => {
            let trees = trees.without(hidden, None);
            draw(&Roots::new(sampler, at, &trees), lux, u, &trees)
        }
        None => draw(&Roots::new(sampler, at, &trees), lux, u, &trees),
    };
    match outcome {
        Outcome::Light(found) => Some((found.instance, found.light, found.pmf)),
        Outcome::Directional { total, .. } => Some((u32::MAX, 0, choice_pmf(lux, total))),
        Outcome::Nothing => None,
    }
}
