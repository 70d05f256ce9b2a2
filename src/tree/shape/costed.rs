//! Groups of lights with their costs, from which the children of a node are chosen.

use super::children::ChildGroup;
use super::group::Group;

/// Groups with a smaller share of the diagonal of their node are tiny. A node stores mean positions
/// to 1/65,025 of its extent.
pub(super) const TINY_SHARE: f32 = 1.0e-3;

/// A group with its cost relative to the node that it is a child of.
#[derive(Clone, Copy)]
pub(super) struct CostedGroup {
    pub group: Group,
    cost: f32,
    /// See [`ChildGroup::is_tiny`].
    pub is_tiny: bool,
}

impl CostedGroup {
    /// The group of a node, the only one to split.
    #[inline(always)]
    pub fn whole(group: &Group) -> Self {
        Self { group: *group, cost: 0.0, is_tiny: false }
    }

    /// Two groups below the node over `whole`.
    #[inline(always)]
    pub fn parts(whole: &Group, parts: &[Group; 2]) -> [Self; 2] {
        let costs = whole.costs([&parts[0], &parts[1]]);
        let most_sq = TINY_SHARE * TINY_SHARE * whole.sums.diagonal_sq();
        let is_tiny = |part: &Group| part.sums.diagonal_sq() < most_sq;
        [0, 1].map(|side| Self { group: parts[side], cost: costs[side], is_tiny: is_tiny(&parts[side]) })
    }
}

impl ChildGroup for CostedGroup {
    type Cost = f32;

    #[inline(always)]
    fn count(&self) -> usize {
        self.group.count
    }

    #[inline(always)]
    fn cost(&self) -> f32 {
        self.cost
    }

    #[inline(always)]
    fn is_tiny(&self) -> bool {
        self.is_tiny
    }
}
