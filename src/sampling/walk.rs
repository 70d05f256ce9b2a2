//! Draws a light: chooses a candidate of the cut and descends from it to a leaf. Computes the
//! probability of a light on the way up.
//!
//! `shaders/row_walk.wgsl` does the same for the cuts of cells. No trail of the way down is recorded: the nodes know their parents,
//! so the depth of trees has no limit.

use crate::math::dice::{Dice, choice_pmf, joint_pmf};
use crate::sampling::cut::{Candidates, Choice, CutWork, choose_lane};
use crate::sampling::view::{NO_INSTANCE, TreeView, WorldView};
use crate::shading::importance::running_sums;
use crate::tree::{ChildRef, NO_PARENT, Opening, WIDTH};

/// A light of a tree and the probability of its choice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TreeLight {
    /// See [`TreeView::instance`].
    pub instance: u32,
    pub light: u32,
    pub pmf: f32,
}

/// The result of a draw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outcome {
    Light(TreeLight),
    /// The directional light `offset` lux into the illuminance by all of them. `total` includes the
    /// trees.
    Directional {
        offset: f32,
        total: f32,
    },
    /// Bounds prove that no light arrives.
    Nothing,
}

/// Draws a light of a cut, or a directional light.
#[inline(always)]
pub(crate) fn draw<'a>(cut: &impl Candidates<'a>, view: &WorldView<'a, '_>, u: [f32; 2]) -> Outcome {
    let total = cut.total() + view.directional_lux;
    if total <= 0.0 {
        return Outcome::Nothing;
    }
    let (mut outer, inner) = (Dice::new(u[0], u[1]), Dice::new(u[1], u[0]));
    let mut pmf = 1.0;
    if view.directional_lux > 0.0 {
        let point = outer.point(total);
        if point >= cut.total() {
            return Outcome::Directional { offset: point - cut.total(), total };
        }
        pmf = choice_pmf(cut.total(), total);
        outer.remap(point / total, pmf);
    }
    match descend(cut, view, outer, inner) {
        Some(light) => Outcome::Light(TreeLight { pmf: joint_pmf(pmf, light.pmf), ..light }),
        None => Outcome::Nothing,
    }
}

/// Chooses a light. The numbers of `outer` decide in the root's tree, those of `inner` in the tree
/// of an instance. `None` if everything below a node is proved dark.
#[inline(always)]
fn descend<'a>(
    cut: &impl Candidates<'a>,
    view: &WorldView<'a, '_>,
    mut outer: Dice,
    mut inner: Dice,
) -> Option<TreeLight> {
    let Choice { mut tree, mut child, mut pmf } = cut.choose(view, &mut outer)?;
    loop {
        let node = match child {
            ChildRef::Leaf(leaf) if tree.is_top() => {
                (tree, child) = view.tree_below(leaf)?;
                match child {
                    ChildRef::Node(node) => node,
                    ChildRef::Leaf(light) => return Some(TreeLight { instance: tree.instance, light, pmf }),
                }
            }
            ChildRef::Leaf(light) => return Some(TreeLight { instance: tree.instance, light, pmf }),
            ChildRef::Node(node) => node,
        };
        let dice = if tree.instance == NO_INSTANCE { &mut outer } else { &mut inner };
        let record = tree.nodes.get(node as usize)?;
        let weights = cut.weights(view, &tree, node, record);
        let sums = running_sums(&weights);
        let total = sums[WIDTH - 1];
        if total <= 0.0 {
            return None;
        }
        let (slot, offset) = choose_lane(&weights, &sums, dice.point(total));
        let child_pmf = choice_pmf(weights[slot], total);
        pmf = joint_pmf(pmf, child_pmf);
        dice.remap(offset / total, child_pmf);
        child = record.child(slot)?;
    }
}

/// The way from the leaf of a light to a root.
#[derive(Clone, Copy)]
pub(crate) struct LeafPath<'a> {
    pub tree: TreeView<'a>,
    /// The place of the leaf in the tree: `node * WIDTH + slot`.
    pub place: u32,
    /// How it goes on above the tree, if there is a top level.
    pub top: Option<TopPath<'a>>,
}

/// The way from a tree to the top level.
#[derive(Clone, Copy)]
pub(crate) struct TopPath<'a> {
    pub tree: TreeView<'a>,
    /// The places of the leaves that are the parts of the instance.
    pub places: &'a [u32],
    /// The openings of the tree, in the order of their places; none if it is one part.
    pub openings: &'a [Opening],
}

impl<'a> LeafPath<'a> {
    /// Goes on in the top level if the way has come to a part of the instance: to its root or to an
    /// opening. Returns false if the way ends here.
    #[inline(always)]
    pub fn enter_top(&mut self) -> bool {
        let part = match &self.top {
            _ if self.place == NO_PARENT => 0,
            None => return true,
            Some(top) => match top.openings.binary_search_by_key(&self.place, |opening| opening.place) {
                Ok(part) => part,
                Err(_) => return true,
            },
        };
        let Some(TopPath { tree, places, .. }) = self.top.take() else { return false };
        let Some(place) = places.get(part) else { return false };
        (self.tree, self.place) = (tree, *place);
        // A dark part has no leaf.
        *place != NO_PARENT
    }
}

/// The probability that [`descend`] ends at a leaf.
#[inline(always)]
fn climb<'a>(cut: &impl Candidates<'a>, leaf: &LeafPath<'a>, view: &WorldView<'a, '_>) -> f32 {
    let mut path = *leaf;
    let mut pmf = 1.0;
    while path.enter_top() {
        let LeafPath { tree, place, .. } = &path;
        let (node, slot) = (place / WIDTH as u32, *place as usize % WIDTH);
        if let Some(in_cut) = cut.pmf(tree, node, slot) {
            return joint_pmf(pmf, in_cut);
        }
        let record = &tree.nodes[node as usize];
        let weights = cut.weights(view, tree, node, record);
        pmf = joint_pmf(pmf, choice_pmf(weights[slot], running_sums(&weights)[WIDTH - 1]));
        if pmf <= 0.0 {
            return 0.0;
        }
        if record.parent == NO_PARENT && path.top.is_none() {
            return joint_pmf(pmf, cut.root_pmf(tree));
        }
        path.place = record.parent;
    }
    0.0
}

/// Draws one light by two random numbers.
pub(crate) struct Draw(pub [f32; 2]);

impl<'a> CutWork<'a> for Draw {
    type Output = Outcome;

    #[inline(always)]
    fn run(self, cut: &impl Candidates<'a>, view: &WorldView<'a, '_>) -> Outcome {
        draw(cut, view, self.0)
    }
}

/// Computes the probability that [`Draw`] chooses a light.
#[allow(clippy::large_enum_variant, reason = "one exists at a time, on the stack")]
pub(crate) enum PmfOf<'a> {
    Light(LeafPath<'a>),
    /// A directional light that brings so many lux.
    Directional(f32),
}

impl<'a> CutWork<'a> for PmfOf<'a> {
    type Output = f32;

    #[inline(always)]
    fn run(self, cut: &impl Candidates<'a>, view: &WorldView<'a, '_>) -> f32 {
        let total = cut.total() + view.directional_lux;
        match self {
            _ if total <= 0.0 => 0.0,
            PmfOf::Light(leaf) => {
                let pmf = if view.directional_lux > 0.0 { choice_pmf(cut.total(), total) } else { 1.0 };
                joint_pmf(pmf, climb(cut, &leaf, view))
            }
            PmfOf::Directional(lux) => choice_pmf(lux, total),
        }
    }
}
