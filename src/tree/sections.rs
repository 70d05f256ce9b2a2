//! Divides a tree into sections: the clusters of a cut, which hold each light once.
//!
//! The root is split first, then repeatedly the cluster with the largest box, until there are as
//! many sections as wanted. So all sections are about equally large.

use std::collections::BinaryHeap;

use super::LightTree;
use super::node::{ChildRef, LEAF, WIDTH};
use crate::cluster::Cluster;

/// A cluster of a cut through a tree: the child of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Section {
    /// Where the child is: `node * WIDTH + slot`.
    pub place: u32,
    /// The child, as in [`Node::children`](super::Node::children).
    pub child_bits: u32,
}

impl LightTree {
    /// At most `most` sections, in the order of their places; empty if the root has more children.
    ///
    /// O(most · log most).
    pub(crate) fn sections(&self, most: usize) -> Vec<Section> {
        let count = |node: u32| self.nodes().get(node as usize).map_or(0, |node| node.count());
        let (mut sections, mut clusters) = (Vec::new(), BinaryHeap::new());
        if count(0) > most {
            return sections;
        }
        let mut next = Some(0);
        while let Some(node) = next {
            for section in self.children(node) {
                match ChildRef::of(section.child_bits) {
                    // Of equal boxes the one with the least place.
                    Some(ChildRef::Node(child)) => {
                        let extent = self.section_box_sq(&section).to_bits();
                        clusters.push((extent, !section.place, child));
                    }
                    _ => sections.push(section),
                }
            }
            next = None;
            if let Some((.., child)) = clusters.peek()
                && sections.len() + clusters.len() - 1 + count(*child) <= most
            {
                next = clusters.pop().map(|(.., child)| child);
            }
        }
        sections.extend(clusters.into_iter().map(|(_, place, child_bits)| Section { place: !place, child_bits }));
        sections.sort_unstable_by_key(|section| section.place);
        sections
    }

    /// Whether these sections, in the order of their places, are still a cut of the tree.
    /// O(sections).
    pub(crate) fn has_sections(&self, sections: &[Section]) -> bool {
        let mut below = vec![0];
        let mut found = 0;
        while let Some(node) = below.pop() {
            for section in self.children(node) {
                match sections.binary_search_by_key(&section.place, |section| section.place) {
                    Ok(index) if sections[index] == section => found += 1,
                    Ok(_) => return false,
                    Err(_) => match ChildRef::of(section.child_bits) {
                        Some(ChildRef::Node(child)) => below.push(child),
                        _ => return false,
                    },
                }
            }
        }
        found == sections.len()
    }

    /// The cluster of a section, in the tree's space.
    pub(crate) fn section_cluster(&self, section: &Section) -> Cluster {
        match ChildRef::of(section.child_bits) {
            Some(ChildRef::Leaf(light)) => self.lights()[light as usize].cluster(),
            _ => self.nodes()[section.place as usize / WIDTH].cluster(section.place as usize % WIDTH),
        }
    }

    fn section_box_sq(&self, section: &Section) -> f32 {
        self.section_cluster(section).aabb.extent().length_squared().max(0.0)
    }

    /// The children of a node; none if there is no such node.
    fn children(&self, node: u32) -> impl Iterator<Item = Section> + '_ {
        let record = self.nodes().get(node as usize);
        let section = move |slot: usize| {
            let child_bits = record?.children[slot];
            ChildRef::of(child_bits).map(|_| Section { place: node * WIDTH as u32 + slot as u32, child_bits })
        };
        (0..WIDTH).filter_map(section)
    }
}

impl Section {
    /// The light that is the section; `None` if it is a cluster.
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

    /// How often each light is in a section.
    fn counts(tree: &LightTree, sections: &[Section]) -> Vec<u32> {
        let mut counts = vec![0; tree.lights().len()];
        let mut below: Vec<u32> = sections.iter().map(|section| section.child_bits).collect();
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
    fn sections_hold_each_light_once_and_are_as_many_as_fit() {
        let tree = LightTree::new(lamps(700)).expect("valid");
        assert!(tree.sections(3).is_empty(), "the root has eight children");
        for most in [8, 9, 50, 300, 699, 700, 5000] {
            let sections = tree.sections(most);
            assert!(counts(&tree, &sections).iter().all(|count| *count == 1), "{most}");
            assert!(sections.len() <= most && sections.len() + WIDTH > most.min(700), "{}", sections.len());
            assert!(sections.windows(2).all(|pair| pair[0].place < pair[1].place));
            assert!(tree.has_sections(&sections) && !tree.has_sections(&sections[1..]));
        }
        assert!(tree.sections(5000).iter().all(|section| section.light().is_some()));
        assert!(LightTree::default().sections(9).is_empty() && LightTree::default().has_sections(&[]));
    }

    #[test]
    fn the_largest_clusters_are_divided_first() {
        let tree = LightTree::new(lamps(700)).expect("valid");
        let sections = tree.sections(60);
        let largest = sections.iter().map(|section| tree.section_box_sq(section)).fold(0.0, f32::max);
        let parents = sections.iter().map(|section| section.place / WIDTH as u32).filter(|node| *node > 0);
        // Boxes are stored coarsely, each on the grid of its parent.
        for node in parents {
            let place = tree.nodes()[node as usize].parent;
            let parent = tree.section_box_sq(&Section { place, child_bits: node });
            assert!(parent >= 0.9 * largest, "{parent} {largest}");
        }
    }

    #[test]
    fn sections_are_no_longer_those_of_a_tree_that_lights_came_to_or_left() {
        let mut tree = LightTree::new(lamps(700)).expect("valid");
        let sections = tree.sections(700);
        tree.remove_lights(&[5]).expect("it is there");
        assert!(!tree.has_sections(&sections));
        let mut tree = LightTree::new(lamps(700)).expect("valid");
        tree.add_lights(&[Light::point(Vec3::splat(2.0), Vec3::ONE)]).expect("valid");
        assert!(!tree.has_sections(&sections));
        // Below the sections, anything may change.
        let sections = tree.sections(8);
        tree.add_lights(&[Light::point(Vec3::splat(3.0), Vec3::ONE)]).expect("valid");
        assert!(tree.has_sections(&sections));
    }
}
