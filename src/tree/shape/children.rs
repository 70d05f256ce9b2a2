//! Chooses which groups of lights become the children of one node.
//!
//! Bottom-level and top-level builds choose alike: the costliest group that no node can hold is
//! replaced by its two parts while the node has room, then the smallest groups are inlined. Both
//! keep nodes full, which decides the memory of a tree and the time of its refits.

use crate::tree::WIDTH;

/// Consecutive lights (in a top level, units) below a node.
pub(crate) trait ChildGroup: Copy {
    /// Orders groups by how much a split of them gains.
    type Cost: PartialOrd;

    /// The number of lights.
    fn count(&self) -> usize;
    /// The cost of the group.
    fn cost(&self) -> Self::Cost;
    /// Whether the group is so small beside its node that the node could not tell its lights apart.
    /// Such a group stays whole: it gets a node of its own, whose grid is as small as the group.
    fn is_tiny(&self) -> bool;
}

/// The division of a group among the children of a node, one split at a time.
pub(crate) struct ChildChooser<G> {
    groups: [G; WIDTH],
    count: usize,
}

impl<G: ChildGroup> ChildChooser<G> {
    /// Starts with the group `whole` as the only child.
    #[inline(always)]
    pub fn new(whole: G) -> Self {
        Self { groups: [whole; WIDTH], count: 1 }
    }

    /// The place of the group to split next, which has more than [`WIDTH`] lights. `None` if the
    /// node is full or can hold each group.
    #[inline(always)]
    pub fn next_split(&self) -> Option<usize> {
        if self.count >= WIDTH {
            return None;
        }
        // The costliest group that no node can hold; of equals the largest, then the first.
        let mut costliest: Option<usize> = None;
        let rank = |i: usize| (self.groups[i].cost(), self.groups[i].count());
        for i in 0..self.count {
            let is_whole = self.groups[i].count() <= WIDTH || self.groups[i].is_tiny();
            if !is_whole && costliest.is_none_or(|best| rank(i) > rank(best)) {
                costliest = Some(i);
            }
        }
        costliest
    }

    /// The group at a place.
    #[inline(always)]
    pub fn group(&self, place: usize) -> &G {
        &self.groups[place]
    }

    /// The number of lights in the groups before a place.
    #[inline(always)]
    pub fn first_light(&self, place: usize) -> usize {
        self.groups[..place].iter().map(G::count).sum()
    }

    /// Replaces the group at a place by its two parts.
    #[inline(always)]
    pub fn replace(&mut self, place: usize, parts: &[G; 2]) {
        self.groups.copy_within(place + 1..self.count, place + 2);
        self.groups[place..place + 2].copy_from_slice(parts);
        self.count += 1;
    }

    /// Starts again with the group `whole`.
    #[inline(always)]
    pub fn restart(&mut self, whole: G) {
        (self.groups[0], self.count) = (whole, 1);
    }

    /// The children of the node, in the order of their lights, and whether each is inlined: its lights are
    /// children of the node themselves. The smallest groups are inlined while there is room.
    #[inline(always)]
    pub fn children(&self) -> impl Iterator<Item = (&G, bool)> {
        let Self { groups, count } = self;
        let mut is_inlined = [false; WIDTH];
        let mut room = WIDTH - count;
        // The smallest group first, since it takes the least room; of equals the first.
        while let Some(place) = (0..*count)
            .filter(|i| groups[*i].count() > 1 && !groups[*i].is_tiny() && !is_inlined[*i])
            .min_by_key(|i| groups[*i].count())
            && groups[place].count() - 1 <= room
        {
            is_inlined[place] = true;
            room -= groups[place].count() - 1;
        }
        groups[..*count].iter().zip(is_inlined)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A group that costs its number of lights.
    #[derive(Clone, Copy)]
    struct Lights(usize);

    impl ChildGroup for Lights {
        type Cost = usize;

        fn count(&self) -> usize {
            self.0
        }

        fn cost(&self) -> usize {
            self.0
        }

        fn is_tiny(&self) -> bool {
            false
        }
    }

    /// Divides the group `whole`. `split` is given the place of a group's first light below the node and
    /// a group of more than [`WIDTH`] lights, and returns its two parts; `None` ends the division.
    fn choose(whole: usize, mut split: impl FnMut(usize, &Lights) -> Option<[Lights; 2]>) -> ChildChooser<Lights> {
        let mut chooser = ChildChooser::new(Lights(whole));
        while let Some(place) = chooser.next_split() {
            let Some(parts) = split(chooser.first_light(place), chooser.group(place)) else { break };
            chooser.replace(place, &parts);
        }
        chooser
    }

    /// The counts of the children of a node over `whole` lights, inlined ones in parentheses, and the
    /// places of the splits.
    fn children(whole: usize, left: impl Fn(usize) -> usize) -> (String, Vec<usize>) {
        let mut places = Vec::new();
        let children = choose(whole, |first, group| {
            places.push(first);
            let left = left(group.0);
            Some([Lights(left), Lights(group.0 - left)])
        });
        let name = |(group, is_inlined): (&Lights, bool)| {
            if is_inlined { format!("({})", group.0) } else { group.0.to_string() }
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
            children.children().map(|(group, is_inlined)| (group.0, is_inlined)).collect::<Vec<_>>(),
            [(100, false)]
        );
    }
}
