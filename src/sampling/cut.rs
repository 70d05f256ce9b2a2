//! The cut through the trees that a light is chosen from: the clusters near the shading point are
//! split, so that one larger choice is made among all candidates that are left.
//!
//! Based on CK18 5 (adaptive tree splitting). Shaders have no such cut (docs/decisions.md, 90). Differs: one light is
//! chosen among all candidates together, instead of one light for each; and the number of splits is
//! bounded, and with it the time. Bottom-level trees and the top level are split alike, and a
//! split continues from a leaf of the top level into the instance's tree.
//!
//! `docs/math.md`, "The cut", calls these candidates the members of the cut. Resampling has other
//! candidates: the lights of several picks. A child is *unresolved* if its node cannot tell where it
//! is, because the shading point is too near (`docs/math.md`, "Children that a node cannot resolve").
//! Its importance has a negative sign until the last split.

use crate::math::dice::{Dice, choice_pmf};
use crate::math::simd::{VectorJob, with_vectors};
use crate::sampling::view::{TreeView, WorldView};
use crate::shading::importance::{
    ChildImportances, UNRESOLVED_DOUBT, resolved_sum, running_sums, scale_unresolved, unresolved_scale, unresolved_sum,
};
use crate::tree::{ChildRef, Lanes, Node, WIDTH};

/// The most splits of a sampler: see [`LightSampler::with_splits`](crate::LightSampler::with_splits).
pub const MAX_SPLITS: usize = 7;

/// The splits of a sampler that is told no number. A sample then takes about as long as one by pbrt-v4's formula
/// (docs/decisions.md, 13).
pub(crate) const DEFAULT_SPLITS: usize = 6;

/// A candidate is split only while its doubt is more than this share of the importance of all
/// candidates.
pub(crate) const MIN_DOUBT: f32 = 0.002;

/// What a light is chosen from before the walk down the trees: the candidates of one shading point, or
/// those that a cell shares.
pub(crate) trait Candidates<'a> {
    /// What all candidates bring together, in lux.
    fn total(&self) -> f32;

    /// Chooses a candidate, and remaps the number for the next choice; `None` if there are none.
    fn choose(&self, view: &WorldView<'a, '_>, dice: &mut Dice) -> Option<Choice<'a>>;

    /// The probability of a node's child; `None` if the node was not split, and 0 if the child was.
    fn pmf(&self, tree: &TreeView<'a>, node: u32, slot: usize) -> Option<f32>;

    /// The probability of the root of a tree, if roots are candidates.
    fn root_pmf(&self, _: &TreeView<'a>) -> f32 {
        0.0
    }

    /// What a walk below the candidates chooses one of a node's children by. 0 where masks hide all lights.
    #[inline(always)]
    fn weights(&self, view: &WorldView<'a, '_>, tree: &TreeView<'a>, node: u32, record: &Node) -> Lanes {
        view.importances(tree, node, record).weights()
    }

    /// Visits every candidate that may be chosen, with its probability.
    fn visit(&self, view: &WorldView<'a, '_>, visit: impl FnMut(Choice<'a>));
}

/// Where the candidates of a shading point come from.
pub(crate) trait CutSource<'a> {
    type Cut: Candidates<'a>;

    /// The candidates.
    fn cut(self, view: &WorldView<'a, '_>) -> Self::Cut;
}

/// Work on the candidates of a shading point.
pub(crate) trait CutWork<'a> {
    type Output;

    /// Every implementation, and every function that it calls, must be `#[inline(always)]`.
    fn run(self, cut: &impl Candidates<'a>, view: &WorldView<'a, '_>) -> Self::Output;
}

/// Does some work on the candidates of a shading point, with the vector instructions of the machine.
#[inline]
pub(crate) fn work_on_cut<'a, W: CutWork<'a>>(
    source: impl CutSource<'a>,
    view: &WorldView<'a, '_>,
    work: W,
) -> W::Output {
    with_vectors(CutJob { source, view, work })
}

struct CutJob<'v, 'a, 's, S, W> {
    source: S,
    view: &'v WorldView<'a, 's>,
    work: W,
}

impl<'a, S: CutSource<'a>, W: CutWork<'a>> VectorJob for CutJob<'_, 'a, '_, S, W> {
    type Output = W::Output;

    #[inline(always)]
    fn run(self) -> W::Output {
        self.work.run(&self.source.cut(self.view), self.view)
    }
}

/// Splits the trees for one shading point, up to so many times.
pub(crate) struct OwnCut {
    pub splits: usize,
}

impl<'a> CutSource<'a> for OwnCut {
    type Cut = Cut<'a>;

    #[inline(always)]
    fn cut(self, view: &WorldView<'a, '_>) -> Cut<'a> {
        Cut::new(self.splits, view)
    }
}

/// The nodes whose children may be candidates: the root and one node for each split.
const MAX_NODES: usize = MAX_SPLITS + 1;

/// The bits of a key that name a slot.
const SLOT_BITS: u32 = WIDTH as u32 - 1;

/// The low bits of a key, which do not belong to the doubt. They hold the slot of a child, and in a
/// shader its number among the children of all split nodes. So both compare the same bits of doubts.
const CHILD_BITS: u32 = (MAX_NODES * WIDTH) as u32 - 1;

/// The candidates of a shading point: the children of the nodes that were split.
///
/// The cut depends on the shading point and on the directional lights, and on no random number, so
/// the probability of any light can be computed later. It has one array per property, which keeps
/// the data in registers.
pub(crate) struct Cut<'a> {
    /// The trees of the split nodes, the root's first.
    trees: [Option<TreeView<'a>>; MAX_NODES],
    tree_count: usize,
    /// The number of split nodes.
    node_count: usize,
    /// For each split node the index of its tree in `trees`.
    tree_of: [usize; MAX_NODES],
    /// The index of each split node in its tree.
    nodes: [u32; MAX_NODES],
    /// The importance of each child; 0 for a child that was split itself. After the last split the
    /// weights: no importance is negative then, and unresolved ones are limited.
    weights: [Lanes; MAX_NODES],
    /// How much light the estimate of a child may be wrong by: the importance times the relative
    /// doubt. 0 for what cannot be split.
    doubts: [Lanes; MAX_NODES],
    has_unresolved: bool,
    /// The sums of the weights, without unresolved children until the last split.
    totals: [f32; MAX_NODES],
    /// The greatest doubt of each node. The bits of a positive float order as integers do. The last
    /// bits hold 7 less the slot, so the maximum of eight keys takes three steps and finds the
    /// first of equal doubts.
    keys: [u32; MAX_NODES],
    /// The sum of all weights: the estimated illuminance by all candidates, in lux.
    total: f32,
}

impl<'a> Cut<'a> {
    /// Splits the root, that of the sky and then, up to `splits` times, the candidate with the greatest doubt. With a
    /// sky there are at most [`MAX_SPLITS`] with that of its root. Without, if only one child of the root is worth a
    /// split, that one is not counted. So a world in one instance, or with one lamp far away, is sampled as well as
    /// one tree over all lights.
    #[inline(always)]
    fn new(splits: usize, view: &WorldView<'a, '_>) -> Self {
        let mut cut = Cut {
            trees: [const { None }; MAX_NODES],
            tree_count: 0,
            node_count: 0,
            tree_of: [0; MAX_NODES],
            nodes: [0; MAX_NODES],
            weights: [[0.0; WIDTH]; MAX_NODES],
            doubts: [[0.0; WIDTH]; MAX_NODES],
            has_unresolved: false,
            totals: [0.0; MAX_NODES],
            keys: [0; MAX_NODES],
            total: 0.0,
        };
        let mut next = (cut.add_tree(view.root), 0);
        let mut most = splits.min(MAX_SPLITS);
        let mut sky = view.sky();
        loop {
            let (tree, node) = next;
            if cut.add_children(tree, node, view).is_none() {
                break;
            }
            if let Some(sky) = sky.take() {
                most = (most + 1).min(MAX_SPLITS);
                next = (cut.add_tree(sky), 0);
                continue;
            }
            if cut.node_count > most {
                break;
            }
            if cut.node_count == 1 && most > 0 && cut.has_one_doubtful() {
                most = (most + 1).min(MAX_SPLITS);
            }
            let Some((index, slot)) = cut.most_doubtful() else { break };
            next = match cut.child(index, slot) {
                Some(ChildRef::Node(node)) => (cut.tree_of[index], node),
                Some(ChildRef::Leaf(leaf)) => match view.tree_below(leaf) {
                    Some((tree, ChildRef::Node(node))) => (cut.add_tree(tree), node),
                    // The doubt about a single light is 0.
                    _ => break,
                },
                None => break,
            };
            cut.remove(index, slot);
        }
        if cut.has_unresolved {
            let count = cut.node_count;
            limit_unresolved(&mut cut.weights[..count], &mut cut.totals[..count], cut.total + view.directional_lux);
            cut.add_totals();
        }
        cut
    }

    fn tree(&self, index: usize) -> Option<&TreeView<'a>> {
        self.trees[self.tree_of[index]].as_ref()
    }

    fn child(&self, index: usize, slot: usize) -> Option<ChildRef> {
        self.tree(index)?.nodes[self.nodes[index] as usize].child(slot)
    }

    /// Adds a tree. It may be here already, if another part of the same instance was split before.
    #[inline(always)]
    fn add_tree(&mut self, tree: TreeView<'a>) -> usize {
        self.trees[self.tree_count] = Some(tree);
        self.tree_count += 1;
        self.tree_count - 1
    }

    /// Makes a node's children candidates. `None` and no change if there is no such node.
    #[inline(always)]
    fn add_children(&mut self, tree: usize, node: u32, view: &WorldView<'a, '_>) -> Option<()> {
        let seen = self.trees[tree].as_ref()?;
        let TreeView { nodes, local, .. } = seen;
        let record = nodes.get(node as usize)?;
        let mut children = view.importances(seen, node, record);
        if let Some(shares) = view.visible_shares(seen, record) {
            for i in 0..WIDTH {
                children.importance[i] *= shares[i];
            }
        }
        let ChildImportances { importance, doubt } = children;
        let index = self.node_count;
        for i in 0..WIDTH {
            self.doubts[index][i] = importance[i] * doubt[i];
        }
        if children.has_unresolved() {
            self.has_unresolved = true;
            doubt_unresolved(&mut self.doubts[index], &importance, &record.children, local.light_bit);
        }
        self.weights[index] = importance;
        self.tree_of[index] = tree;
        self.nodes[index] = node;
        self.node_count += 1;
        self.sum_up(index);
        Some(())
    }

    /// Removes a candidate, whose own children replace it.
    #[inline(always)]
    fn remove(&mut self, index: usize, slot: usize) {
        self.weights[index][slot] = 0.0;
        self.doubts[index][slot] = 0.0;
        self.sum_up(index);
    }

    /// Brings the sums and the greatest doubt up to date with a node's children.
    #[inline(always)]
    fn sum_up(&mut self, index: usize) {
        // One huge unresolved importance would make the doubts about all others look small.
        self.totals[index] = resolved_sum(&self.weights[index]);
        let mut max_key = 0;
        for slot in 0..WIDTH {
            let key = (self.doubts[index][slot].to_bits() & !CHILD_BITS) | (SLOT_BITS - slot as u32);
            max_key = if key > max_key { key } else { max_key };
        }
        self.keys[index] = max_key;
        self.add_totals();
    }

    #[inline(always)]
    fn add_totals(&mut self) {
        self.total = 0.0;
        for total in &self.totals[..self.node_count] {
            self.total += total;
        }
    }

    /// Whether only one child of the root is worth a split.
    #[inline(always)]
    fn has_one_doubtful(&self) -> bool {
        let least = MIN_DOUBT * self.total;
        self.doubts[0].iter().filter(|doubt| f32::from_bits(doubt.to_bits() & !CHILD_BITS) > least).count() == 1
    }

    /// The candidate with the greatest doubt, the first of equals, as node and slot; `None` if no
    /// split is worth its time.
    #[inline(always)]
    fn most_doubtful(&self) -> Option<(usize, usize)> {
        let (mut index, mut max_key) = (0, self.keys[0]);
        for (other, key) in self.keys[..self.node_count].iter().enumerate() {
            // Slots of different nodes are not compared.
            if *key & !CHILD_BITS > max_key & !CHILD_BITS {
                (index, max_key) = (other, *key);
            }
        }
        let is_worth = f32::from_bits(max_key & !CHILD_BITS) > MIN_DOUBT * self.total;
        is_worth.then_some((index, (SLOT_BITS - (max_key & SLOT_BITS)) as usize))
    }
}

impl<'a> Candidates<'a> for Cut<'a> {
    fn total(&self) -> f32 {
        self.total
    }

    #[inline(always)]
    fn choose(&self, _: &WorldView<'a, '_>, dice: &mut Dice) -> Option<Choice<'a>> {
        if self.total <= 0.0 {
            return None;
        }
        let point = dice.point(self.total);
        let mut before = 0.0;
        let mut chosen = (0, 0.0);
        for (index, total) in self.totals[..self.node_count].iter().enumerate() {
            // If rounding lets the point pass all of them, the last with a weight is chosen.
            if *total > 0.0 && point >= before {
                chosen = (index, before);
            }
            before += total;
        }
        let (index, before) = chosen;
        let weights = &self.weights[index];
        let (slot, offset) = choose_lane(weights, &running_sums(weights), point - before);
        let pmf = choice_pmf(weights[slot], self.total);
        dice.remap(offset / self.total, pmf);
        Some(Choice { tree: *self.tree(index)?, child: self.child(index, slot)?, pmf })
    }

    #[inline(always)]
    fn pmf(&self, tree: &TreeView<'a>, node: u32, slot: usize) -> Option<f32> {
        let is_node = |i: &usize| self.nodes[*i] == node && self.tree(*i).is_some_and(|t| t.instance == tree.instance);
        (0..self.node_count).find(is_node).map(|index| choice_pmf(self.weights[index][slot], self.total))
    }

    #[inline(always)]
    fn visit(&self, _: &WorldView<'a, '_>, mut visit: impl FnMut(Choice<'a>)) {
        for index in 0..self.node_count {
            let Some(tree) = self.tree(index) else { continue };
            for slot in 0..WIDTH {
                let weight = self.weights[index][slot];
                if let Some(child) = self.child(index, slot).filter(|_| weight > 0.0) {
                    visit(Choice { tree: *tree, child, pmf: choice_pmf(weight, self.total) });
                }
            }
        }
    }
}

/// Makes the doubts about a node's unresolved children the greatest. Takes only what it needs: a
/// reference to the whole cut would keep its scalars out of registers.
#[cold]
fn doubt_unresolved(doubts: &mut Lanes, importance: &Lanes, children: &[u32; WIDTH], light_bit: u32) {
    for slot in 0..WIDTH {
        if importance[slot] < 0.0 {
            let is_light = children[slot] & light_bit != 0;
            doubts[slot] = if is_light { 0.0 } else { -importance[slot] * UNRESOLVED_DOUBT };
        }
    }
}

/// Limits the weights of all unresolved candidates together to the weight of the `others`: resolved
/// candidates and directional lights. Adds them to the totals of their nodes.
#[cold]
fn limit_unresolved(weights: &mut [Lanes], totals: &mut [f32], others: f32) {
    let unresolved = weights.iter().map(unresolved_sum).sum();
    let scale = unresolved_scale(others, unresolved);
    for (weights, total) in weights.iter_mut().zip(totals) {
        *weights = scale_unresolved(weights, scale);
        *total = running_sums(weights)[WIDTH - 1];
    }
}

/// A candidate, and the probability that it is chosen.
pub(crate) struct Choice<'a> {
    pub tree: TreeView<'a>,
    pub child: ChildRef,
    pub pmf: f32,
}

/// The lane at a point of the line from 0 to the sum of all lanes, and how far the point lies
/// inside the lane's part. `sums` are the running sums of the weights.
#[inline(always)]
pub(crate) fn choose_lane(weights: &Lanes, sums: &Lanes, point: f32) -> (usize, f32) {
    let mut slot = 0;
    for sum in &sums[..WIDTH - 1] {
        slot += usize::from(*sum <= point);
    }
    // The rounding of the sums may let the point fall between two lanes, on one without a weight.
    if weights[slot] <= 0.0 {
        let has_weight = |slot: &usize| weights[*slot] > 0.0;
        slot = (0..slot).rev().find(has_weight).or_else(|| (slot..WIDTH).find(has_weight)).unwrap_or(slot);
    }
    (slot, point - (sums[slot] - weights[slot]))
}
