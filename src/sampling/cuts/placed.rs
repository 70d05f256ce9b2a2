//! Samples from the cuts that cells share.

use crate::math::dice::{Dice, choice_pmf, joint_pmf};
use crate::sampling::cut::{Candidates, Choice, CutSource, choose_lane};
use crate::sampling::cuts::shared::{CONTESTED, Contested, MIN_SIDE, NodeId, SharedCut};
use crate::sampling::cuts::table::{CutTable, CutsInUse};
use crate::sampling::sample::LightSampler;
use crate::sampling::view::{TreeView, WorldView};
use crate::shading::importance::running_sums;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::{Lanes, Node, WIDTH};

/// A shared cut at one of the points of its cell.
pub(crate) struct PlacedCut<'a, 's> {
    pub cut: &'a SharedCut,
    sampler: &'s LightSampler<'a>,
    shading_point: &'s ShadingPoint,
}

impl<'a> CutSource<'a> for PlacedCut<'a, '_> {
    type Cut = WeighedCut<'a>;

    #[inline(always)]
    fn cut(self, view: &WorldView<'a, '_>) -> WeighedCut<'a> {
        let Self { cut, sampler, shading_point } = self;
        let mut lanes = [[0.0; WIDTH]; CONTESTED];
        let learnt = cut.contested().next().and_then(|_| sampler.learnt(shading_point));
        let mut sum = cut.rest;
        for (contested, lanes) in cut.contested().zip(&mut lanes) {
            let id = cut.nodes[usize::from(contested.node)];
            let Some(tree) = view.tree(id.instance) else { continue };
            let Some(record) = tree.nodes.get(id.node as usize) else { continue };
            let mut weights = view.rough_weights(&tree, id.node, record);
            if let Some(learnt) = &learnt {
                let shares = learnt.shares(record, &tree.local, &view.to_world(&tree));
                weights.iter_mut().zip(shares).for_each(|(weight, share)| *weight *= share);
            }
            *lanes = contested.among(weights);
            sum += running_sums(lanes)[WIDTH - 1];
        }
        WeighedCut { cut, directional_lux: view.directional_lux, lanes, sum }
    }
}

impl Contested {
    /// Whether a child of a node is one of the candidates.
    pub fn has(&self, node: usize, slot: usize) -> bool {
        usize::from(self.node) == node && self.children >> slot & 1 == 1
    }

    /// The weights of the children that are candidates.
    fn among(self, weights: Lanes) -> Lanes {
        std::array::from_fn(|slot| if self.children >> slot & 1 == 1 { weights[slot] } else { 0.0 })
    }
}

/// A shared cut at a point that has weighed the children of contested nodes.
pub(crate) struct WeighedCut<'a> {
    cut: &'a SharedCut,
    /// The illuminance by directional lights at the point.
    directional_lux: f32,
    lanes: [Lanes; CONTESTED],
    /// What all candidates weigh.
    sum: f32,
}

impl<'a> WeighedCut<'a> {
    /// A child, counted through all nodes, as a candidate.
    fn choice(&self, view: &WorldView<'a, '_>, child: usize, pmf: f32) -> Option<Choice<'a>> {
        let id = self.cut.nodes[child / WIDTH];
        let tree = view.tree(id.instance)?;
        let child = tree.nodes.get(id.node as usize)?.child(child % WIDTH)?;
        Some(Choice { tree, child, pmf })
    }

    /// The probability of a child of one of the nodes.
    fn child_pmf(&self, node: usize, slot: usize) -> f32 {
        let cut = self.cut;
        match cut.contested.iter().position(|other| other.has(node, slot)) {
            Some(k) => choice_pmf(self.lanes[k][slot], self.sum),
            None if cut.rest > 0.0 => {
                let [_, units] = cut.units(node * WIDTH + slot);
                joint_pmf(choice_pmf(cut.rest, self.sum), units as f32 / cut.total() as f32)
            }
            None => 0.0,
        }
    }

    /// Chooses among the candidates that the cell has weighed.
    fn choose_shared(&self, view: &WorldView<'a, '_>, dice: &mut Dice) -> Option<Choice<'a>> {
        let (sums, total) = (self.cut.sums(), self.cut.total());
        let point = dice.point(total as f32);
        let unit = (point as u32).min(total.checked_sub(1)?);
        let child = sums.partition_point(|sum| *sum <= unit);
        let [before, units] = self.cut.units(child);
        let pmf = units as f32 / total as f32;
        dice.remap((point - before as f32) / total as f32, pmf);
        self.choice(view, child, pmf)
    }
}

impl<'a> Candidates<'a> for WeighedCut<'a> {
    /// On the scale of the point's own directional lights, so that the part of samples that goes to them
    /// is that of the cell.
    fn total(&self) -> f32 {
        if self.cut.count == 0 {
            0.0
        } else if self.directional_lux > 0.0 {
            self.directional_lux / self.cut.directional.max(MIN_SIDE)
        } else {
            1.0
        }
    }

    /// Chooses among the candidates that the cell has weighed; the children of each contested node may then take the
    /// place of what was chosen before.
    fn choose(&self, view: &WorldView<'a, '_>, dice: &mut Dice) -> Option<Choice<'a>> {
        let mut choice = self.choose_shared(view, dice);
        let mut sum = self.cut.rest;
        for (contested, lanes) in self.cut.contested().zip(&self.lanes) {
            let sums = running_sums(lanes);
            let (of_node, before) = (sums[WIDTH - 1], sum);
            sum += of_node;
            if sum <= 0.0 {
                continue;
            }
            let point = dice.point(sum);
            if point >= of_node && before > 0.0 {
                let part = choice_pmf(before, sum);
                dice.remap((point - of_node) / sum, part);
                choice = choice.map(|choice| Choice { pmf: joint_pmf(choice.pmf, part), ..choice });
                continue;
            }
            let (slot, offset) = choose_lane(lanes, &sums, point);
            let pmf = choice_pmf(lanes[slot], sum);
            dice.remap(offset / sum, pmf);
            choice = Some(self.choice(view, usize::from(contested.node) * WIDTH + slot, pmf)?);
        }
        choice
    }

    fn pmf(&self, tree: &TreeView<'a>, node: u32, slot: usize) -> Option<f32> {
        let id = NodeId { instance: tree.instance, node };
        self.cut.nodes[..self.cut.count].iter().position(|other| *other == id).map(|index| self.child_pmf(index, slot))
    }

    /// By rough estimates.
    #[inline(always)]
    fn weights(&self, view: &WorldView<'a, '_>, tree: &TreeView<'a>, node: u32, record: &Node) -> Lanes {
        view.rough_weights(tree, node, record)
    }

    fn visit(&self, view: &WorldView<'a, '_>, mut visit: impl FnMut(Choice<'a>)) {
        for index in 0..self.cut.count {
            for slot in 0..WIDTH {
                let pmf = self.child_pmf(index, slot);
                if pmf > 0.0
                    && let Some(choice) = self.choice(view, index * WIDTH + slot, pmf)
                {
                    visit(choice);
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
    pub(crate) fn shared_cut<'s>(&'s self, shading_point: &'s ShadingPoint) -> Option<PlacedCut<'a, 's>> {
        let cut = self.cuts.as_ref()?.cut(shading_point)?;
        Some(PlacedCut { cut, sampler: self, shading_point })
    }
}
