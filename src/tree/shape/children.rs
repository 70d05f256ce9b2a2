//! Chooses which groups of lights become the children of one node.
//!
//! Bottom-level and top-level builds choose alike: the costliest group that no node can hold is
//! replaced by its two parts while the node has room, then the smallest groups are inlined. Both
//! keep nodes full, which decides the memory of a tree and the time of its refits.

use super::group::Group;
use crate::tree::WIDTH;

/// Groups with a smaller share of the diagonal of their node are tiny. A node stores mean positions
/// to 1/65,025 of its extent.
pub(super) const TINY_SHARE: f32 = 1.0e-3;

/// Consecutive lights (in a top level, parts of instances) below a node.
#[derive(Clone, Copy)]
pub(super) struct Child {
    pub group: Group,
    /// Relative to the node.
    cost: f32,
    /// The group is so small beside its node that the node could not tell its lights apart. It stays whole: it gets
    /// a node of its own, whose grid is as small as the group.
    is_tiny: bool,
}

/// The division of a group among the children of a node, one split at a time.
#[derive(Default)]
pub(super) struct ChildChooser {
    children: Vec<Child>,
}

impl ChildChooser {
    /// Starts with the group of the node as the only child.
    pub fn start(&mut self, whole: &Group) {
        self.children.clear();
        self.children.reserve(WIDTH);
        self.children.push(Child { group: *whole, cost: 0.0, is_tiny: false });
    }

    /// The place of the group to split next, which has more than [`WIDTH`] lights. `None` if the
    /// node is full or can hold each group.
    pub fn next_split(&self) -> Option<usize> {
        if self.children.len() >= WIDTH {
            return None;
        }
        // The costliest group that no node can hold; of equals the largest, then the first.
        let mut costliest: Option<usize> = None;
        let rank = |i: usize| (self.children[i].cost, self.children[i].group.count);
        for (i, child) in self.children.iter().enumerate() {
            let is_whole = child.group.count <= WIDTH || child.is_tiny;
            if !is_whole && costliest.is_none_or(|best| rank(i) > rank(best)) {
                costliest = Some(i);
            }
        }
        costliest
    }

    /// The group at a place.
    pub fn group(&self, place: usize) -> &Group {
        &self.children[place].group
    }

    /// The number of lights in the groups before a place.
    pub fn first_light(&self, place: usize) -> usize {
        self.children[..place].iter().map(|child| child.group.count).sum()
    }

    /// Replaces the group at a place by its two parts. `whole` is the group of the node. Parts for which `stays_whole`
    /// is true are not split further.
    pub fn replace(&mut self, place: usize, parts: &[Group; 2], whole: &Group, stays_whole: impl Fn(&Group) -> bool) {
        let costs = whole.costs([&parts[0], &parts[1]]);
        let most_sq = TINY_SHARE * TINY_SHARE * whole.sums.diagonal_sq();
        let [left, right] = [0, 1].map(|side| {
            let group = parts[side];
            let is_tiny = group.sums.diagonal_sq() < most_sq || stays_whole(&group);
            Child { group, cost: costs[side], is_tiny }
        });
        self.children[place] = left;
        self.children.insert(place + 1, right);
    }

    /// The groups, in the order of their lights.
    pub fn groups(&self) -> impl Iterator<Item = &Group> {
        self.children.iter().map(|child| &child.group)
    }

    /// The children of the node, in the order of their lights, and whether each is inlined: its lights are
    /// children of the node themselves. The smallest groups are inlined while there is room.
    pub fn children(&self) -> impl Iterator<Item = (&Group, bool)> {
        let children = &self.children;
        let mut is_inlined = [false; WIDTH];
        let mut room = WIDTH - children.len();
        let count = |place: usize| children[place].group.count;
        // The smallest group first, since it takes the least room; of equals the first.
        while let Some(place) = (0..children.len())
            .filter(|i| count(*i) > 1 && !children[*i].is_tiny && !is_inlined[*i])
            .min_by_key(|i| count(*i))
            && count(place) - 1 <= room
        {
            is_inlined[place] = true;
            room -= count(place) - 1;
        }
        self.groups().zip(is_inlined)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::group::BuildItem;
    use super::*;
    use crate::cluster::{Aabb, Cluster};

    /// A group in which each light costs as much.
    fn lights(count: usize) -> Group {
        let aabb = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
        let item = BuildItem::new(&Cluster { aabb, flux: 1.0, ..Cluster::EMPTY }, 0);
        Group::around(&vec![item; count])
    }

    /// Divides a group of `whole` lights. `split` is given the place of a group's first light below the node and the
    /// count of a group of more than [`WIDTH`] lights, and returns that of its left part; `None` ends the division.
    fn choose(whole: usize, mut split: impl FnMut(usize, usize) -> Option<usize>) -> ChildChooser {
        let (whole, mut chooser) = (lights(whole), ChildChooser::default());
        chooser.start(&whole);
        while let Some(place) = chooser.next_split() {
            let count = chooser.group(place).count;
            let Some(left) = split(chooser.first_light(place), count) else { break };
            chooser.replace(place, &[lights(left), lights(count - left)], &whole, |_| false);
        }
        chooser
    }

    /// The counts of the children of a node over `whole` lights, inlined ones in parentheses, and the
    /// places of the splits.
    fn children(whole: usize, left: impl Fn(usize) -> usize) -> (String, Vec<usize>) {
        let mut places = Vec::new();
        let children = choose(whole, |first, count| {
            places.push(first);
            Some(left(count))
        });
        let name = |(group, is_inlined): (&Group, bool)| {
            if is_inlined { format!("({})", group.count) } else { group.count.to_string() }
        };
        (children.children().map(name).collect::<Vec<_>>().join(" "), places)
    }

    #[test]
    fn the_costliest_group_is_split_until_the_node_is_full_and_the_first_of_equals_first() {
        let half = |count| count / 2;
        assert_eq!(children(160, half), ("20 20 20 20 20 20 20 20".into(), vec![0, 0, 80, 0, 40, 80, 120]));
        assert_eq!(children(33, half), ("8 8 8 (4) 5".into(), vec![0, 16, 0, 24]));
    }

    #[test]
    fn the_smallest_groups_that_fit_are_inlined_and_single_lights_stay() {
        assert_eq!(children(0, |_| 1).0, "0");
        assert_eq!(children(1, |_| 1).0, "1");
        assert_eq!(children(8, |_| 1).0, "(8)");
        assert_eq!(children(9, |_| 1).0, "1 8");
        assert_eq!(children(9, |_| 3).0, "(3) 6");
        assert_eq!(children(10, |_| 4).0, "(4) 6");
        assert_eq!(children(12, |_| 2).0, "(2) (2) 8");
        assert_eq!(children(20, |count| if count == 20 { 4 } else { 8 }).0, "(4) 8 8");
    }

    #[test]
    fn a_group_that_cannot_be_split_stays_whole() {
        let children = choose(100, |_, _| None);
        assert_eq!(
            children.children().map(|(group, is_inlined)| (group.count, is_inlined)).collect::<Vec<_>>(),
            [(100, false)]
        );
    }
}
