//! Opens a tree: finds its openings, the clusters of a cut through it, which hold each light once.
//!
//! The top level leads into the tree at its openings. That of a tree as a whole is its root alone. The
//! root is split first, then repeatedly the cluster with the largest box, until there are as many
//! openings as wanted. So all openings are about equally large, and the first that a tree divided by
//! side has are its sides.

use std::collections::BinaryHeap;

use super::LightTree;
use super::node::{ChildRef, LEAF, WIDTH};
use crate::cluster::Cluster;

/// A cluster of a cut through a tree: the child of a node. A walk down enters the tree there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Opening {
    /// Where the child is: `node * WIDTH + slot`.
    pub place: u32,
    /// The child, as in [`Node::children`](super::Node::children).
    pub child_bits: u32,
}

impl LightTree {
    /// At most `most` openings, in the order of their places; empty if the root has more children.
    ///
    /// O(most · log most).
    pub(crate) fn openings(&self, most: usize) -> Vec<Opening> {
        let count = |node: u32| self.nodes().get(node as usize).map_or(0, |node| node.count());
        let (mut openings, mut clusters) = (Vec::new(), BinaryHeap::new());
        if count(0) > most {
            return openings;
        }
        let mut next = Some(0);
        while let Some(node) = next {
            for opening in self.children(node) {
                match ChildRef::of(opening.child_bits) {
                    // Of equal boxes the one with the least place.
                    Some(ChildRef::Node(child)) => {
                        let extent = self.opening_box_sq(&opening).to_bits();
                        clusters.push((extent, !opening.place, child));
                    }
                    _ => openings.push(opening),
                }
            }
            next = None;
            if let Some((.., child)) = clusters.peek()
                && openings.len() + clusters.len() - 1 + count(*child) <= most
            {
                next = clusters.pop().map(|(.., child)| child);
            }
        }
        openings.extend(clusters.into_iter().map(|(_, place, child_bits)| Opening { place: !place, child_bits }));
        openings.sort_unstable_by_key(|opening| opening.place);
        openings
    }

    /// Whether these openings, in the order of their places, are still a cut of the tree.
    /// O(openings).
    pub(crate) fn has_openings(&self, openings: &[Opening]) -> bool {
        let mut below = vec![0];
        let mut found = 0;
        while let Some(node) = below.pop() {
            for opening in self.children(node) {
                match openings.binary_search_by_key(&opening.place, |opening| opening.place) {
                    Ok(index) if openings[index] == opening => found += 1,
                    Ok(_) => return false,
                    Err(_) => match ChildRef::of(opening.child_bits) {
                        Some(ChildRef::Node(child)) => below.push(child),
                        _ => return false,
                    },
                }
            }
        }
        found == openings.len()
    }

    /// The cluster of a opening, in the tree's space.
    pub(crate) fn opening_cluster(&self, opening: &Opening) -> Cluster {
        match ChildRef::of(opening.child_bits) {
            Some(ChildRef::Leaf(light)) => self.lights()[light as usize].cluster(),
            _ => self.nodes()[opening.place as usize / WIDTH].cluster(opening.place as usize % WIDTH),
        }
    }

    fn opening_box_sq(&self, opening: &Opening) -> f32 {
        self.opening_cluster(opening).aabb.extent().length_squared().max(0.0)
    }

    /// The children of a node; none if there is no such node.
    fn children(&self, node: u32) -> impl Iterator<Item = Opening> + '_ {
        let record = self.nodes().get(node as usize);
        let opening = move |slot: usize| {
            let child_bits = record?.children[slot];
            ChildRef::of(child_bits).map(|_| Opening { place: node * WIDTH as u32 + slot as u32, child_bits })
        };
        (0..WIDTH).filter_map(opening)
    }
}

impl Opening {
    /// The light that is the opening; `None` if it is a cluster.
    pub fn light(&self) -> Option<u32> {
        (self.child_bits & LEAF != 0).then_some(self.child_bits & !LEAF)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;

    fn lamps(count: usize) -> Vec<Light> {
        let at = |i: usize| Vec3::new((i * 37 % 101) as f32, (i % 5) as f32, (i * 53 % 97) as f32);
        (0..count).map(|i| Light::point(at(i), Vec3::ONE)).collect()
    }

    /// How often each light is in a opening.
    fn counts(tree: &LightTree, openings: &[Opening]) -> Vec<u32> {
        let mut counts = vec![0; tree.lights().len()];
        let mut below: Vec<u32> = openings.iter().map(|opening| opening.child_bits).collect();
        while let Some(child_bits) = below.pop() {
            match ChildRef::of(child_bits) {
                Some(ChildRef::Leaf(light)) => counts[light as usize] += 1,
                Some(ChildRef::Node(node)) => below.extend(tree.children(node).map(|child| child.child_bits)),
                None => {}
            }
        }
        counts
    }

    #[test]
    fn openings_hold_each_light_once_and_are_as_many_as_fit() {
        let tree = LightTree::new(lamps(700)).expect("valid");
        assert!(tree.openings(3).is_empty(), "the root has eight children");
        for most in [8, 9, 50, 300, 699, 700, 5000] {
            let openings = tree.openings(most);
            assert!(counts(&tree, &openings).iter().all(|count| *count == 1), "{most}");
            assert!(openings.len() <= most && openings.len() + WIDTH > most.min(700), "{}", openings.len());
            assert!(openings.windows(2).all(|pair| pair[0].place < pair[1].place));
            assert!(tree.has_openings(&openings) && !tree.has_openings(&openings[1..]));
        }
        assert!(tree.openings(5000).iter().all(|opening| opening.light().is_some()));
        assert!(LightTree::default().openings(9).is_empty() && LightTree::default().has_openings(&[]));
    }

    #[test]
    fn the_largest_clusters_are_divided_first() {
        let tree = LightTree::new(lamps(700)).expect("valid");
        let openings = tree.openings(60);
        let largest = openings.iter().map(|opening| tree.opening_box_sq(opening)).fold(0.0, f32::max);
        let parents = openings.iter().map(|opening| opening.place / WIDTH as u32).filter(|node| *node > 0);
        // Boxes are stored coarsely, each on the grid of its parent.
        for node in parents {
            let place = tree.nodes()[node as usize].parent;
            let parent = tree.opening_box_sq(&Opening { place, child_bits: node });
            assert!(parent >= 0.9 * largest, "{parent} {largest}");
        }
    }

    #[test]
    fn openings_are_no_longer_those_of_a_tree_that_lights_came_to_or_left() {
        let mut tree = LightTree::new(lamps(700)).expect("valid");
        let openings = tree.openings(700);
        tree.remove_lights(&[5]).expect("it is there");
        assert!(!tree.has_openings(&openings));
        let mut tree = LightTree::new(lamps(700)).expect("valid");
        tree.add_lights(&[Light::point(Vec3::splat(2.0), Vec3::ONE)]).expect("valid");
        assert!(!tree.has_openings(&openings));
        // Below the openings, anything may change.
        let openings = tree.openings(8);
        tree.add_lights(&[Light::point(Vec3::splat(3.0), Vec3::ONE)]).expect("valid");
        assert!(tree.has_openings(&openings));
    }
}
