//! Samples from the cuts that cells share.

use crate::math::dice::Dice;
use crate::sampling::cut::{Candidates, Choice, CutSource, InstanceTrees, TreeView};
use crate::sampling::cuts::shared::{MIN_SIDE, NodeId, SharedCut};
use crate::sampling::cuts::table::{CutTable, CutsInUse};
use crate::sampling::roots::seen_rough_weights;
use crate::sampling::sample::LightSampler;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::{ChildRef, Lanes, Node, WIDTH};

/// A shared cut at one of the points of its cell.
#[derive(Clone, Copy)]
pub(crate) struct PlacedCut<'a, 's> {
    pub cut: &'a SharedCut,
    pub sampler: &'s LightSampler<'a>,
    pub shading_point: &'s ShadingPoint,
    /// The illuminance by directional lights at the point.
    pub directional_lux: f32,
}

impl<'a> PlacedCut<'a, '_> {
    fn tree(&self, node: NodeId) -> Option<TreeView<'a>> {
        self.sampler.view_at(node.instance, self.shading_point)
    }
}

impl<'a> CutSource<'a> for PlacedCut<'a, '_> {
    type Cut = Self;

    fn cut(self, _: &impl InstanceTrees<'a>) -> Self {
        self
    }
}

impl<'a> Candidates<'a> for PlacedCut<'a, '_> {
    /// On the scale of the point's own directional lights, so that the part of samples that goes to them
    /// is that of the cell.
    fn total(&self) -> f32 {
        if self.cut.total() == 0 {
            0.0
        } else if self.directional_lux > 0.0 {
            self.directional_lux / self.cut.directional.max(MIN_SIDE)
        } else {
            1.0
        }
    }

    fn choose(&self, dice: &mut Dice) -> Option<Choice<'a>> {
        let (sums, total) = (self.cut.sums(), self.cut.total());
        if total == 0 {
            return None;
        }
        let point = dice.point(total as f32);
        let unit = (point as u32).min(total - 1);
        let child = sums.partition_point(|sum| *sum <= unit);
        let [before, units] = self.cut.units(child);
        let pmf = units as f32 / total as f32;
        dice.remap((point - before as f32) / total as f32, pmf);
        let id = self.cut.nodes[child / WIDTH];
        let tree = self.tree(id)?;
        Some(Choice { child: tree.nodes.get(id.node as usize)?.child(child % WIDTH)?, tree, pmf })
    }

    fn pmf(&self, tree: &TreeView<'a>, node: u32, slot: usize) -> Option<f32> {
        let id = NodeId { instance: tree.instance, node };
        let index = self.cut.nodes[..self.cut.count].iter().position(|other| *other == id)?;
        let [_, units] = self.cut.units(index * WIDTH + slot);
        Some(units as f32 / self.cut.total() as f32)
    }

    /// By [rough estimates](rough_weights).
    #[inline(always)]
    fn weights(&self, tree: &TreeView<'a>, node: u32, record: &Node, trees: &impl InstanceTrees<'a>) -> Lanes {
        seen_rough_weights(tree, node, record, trees)
    }

    fn visit(&self, mut visit: impl FnMut(&TreeView<'a>, ChildRef, f32)) {
        for (index, id) in self.cut.nodes[..self.cut.count].iter().enumerate() {
            let Some(tree) = self.tree(*id) else { continue };
            let Some(record) = tree.nodes.get(id.node as usize) else { continue };
            for slot in 0..WIDTH {
                let [_, units] = self.cut.units(index * WIDTH + slot);
                if let Some(child) = record.child(slot).filter(|_| units > 0) {
                    visit(&tree, child, units as f32 / self.cut.total() as f32);
                }
            }
        }
    }
}

impl<'a> LightSampler<'a> {
    /// Returns the same sampler with cuts that neighbours share. All methods use them, with exact
    /// probabilities: call them with the same table, as built, for one estimate.
    ///
    /// Where the table has no cut for the cell of a shading point, or was built before the last change of
    /// the world, the sampler returns the same bits as without it and without learnt visibility. Choices from a cut follow the [learnt
    /// visibility](Self::with_visibility) that the table was [built](crate::CutTable::build) with; the sampler's own then
    /// only weighs the candidates of [`resample`](Self::resample).
    pub fn with_cuts(self, table: &'a CutTable) -> Self {
        Self { cuts: Some(CutsInUse::new(table, self.top.id, self.world.origin())), ..self }
    }

    /// Marks a shading point in the table of the sampler: its cell will have a cut from the next
    /// [`CutTable::build`] on. Any threads may call this at once. Without a table, for segments and, if
    /// the table has no view, for glossy points, nothing happens.
    pub fn mark(&self, shading_point: &ShadingPoint) {
        if let Some(cuts) = &self.cuts {
            cuts.mark(shading_point);
        }
    }

    /// The cut that a shading point shares, at that point.
    #[inline]
    pub(crate) fn shared_cut<'s>(
        &'s self,
        shading_point: &'s ShadingPoint,
        directional_lux: f32,
    ) -> Option<PlacedCut<'a, 's>> {
        let cut = self.cuts.as_ref()?.cut(shading_point)?;
        Some(PlacedCut { cut, sampler: self, shading_point, directional_lux })
    }
}
