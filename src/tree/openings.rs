//! What an opened tree consists of: its *openings*, through which the top level leads into it.
//!
//! They are the children of the root, which are the sides of a tree that is divided by side, or all lights.

use super::LightTree;
use super::node::{ChildRef, EMPTY_SLOT, LEAF, NO_LEAF, WIDTH};
use crate::cluster::Cluster;

/// A child of a node. A walk down from the top level enters the tree there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Opening {
    /// Where the child is: `node * WIDTH + slot`.
    pub place: u32,
    /// The child, as in [`Node::children`](super::Node::children).
    pub child_bits: u32,
}

impl LightTree {
    /// The children of the root, in the order of their places.
    pub(crate) fn below_root(&self) -> Box<[Opening]> {
        let children = self.nodes().first().map_or([EMPTY_SLOT; WIDTH], |root| root.children);
        let opening = |(child_bits, place): (u32, u32)| ChildRef::of(child_bits).map(|_| Opening { place, child_bits });
        children.into_iter().zip(0..).filter_map(opening).collect()
    }

    /// All lights, in the order of their places. O(lights · log lights).
    pub(crate) fn all_lights(&self) -> Box<[Opening]> {
        let of_light = |(place, light): (&u32, u32)| Opening { place: *place, child_bits: LEAF | light };
        let lights = self.leaves().iter().zip(0..).filter(|(place, _)| **place != NO_LEAF);
        let mut openings: Box<[Opening]> = lights.map(of_light).collect();
        openings.sort_unstable_by_key(|opening| opening.place);
        openings
    }

    /// The cluster of an opening, in the tree's space.
    pub(crate) fn opening_cluster(&self, opening: &Opening) -> Cluster {
        match ChildRef::of(opening.child_bits) {
            Some(ChildRef::Leaf(light)) => self.lights()[light as usize].cluster(),
            _ => self.nodes()[opening.place as usize / WIDTH].cluster(opening.place as usize % WIDTH),
        }
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

    #[test]
    fn openings_are_the_children_of_the_root_or_each_light_once() {
        let mut tree = LightTree::new(lamps(700)).expect("valid");
        for round in 0..2 {
            let leaves = tree.all_lights();
            assert!(leaves.windows(2).all(|pair| pair[0].place < pair[1].place));
            let mut lights: Vec<u32> = leaves.iter().map(|leaf| leaf.light().expect("a light")).collect();
            lights.sort_unstable();
            lights.dedup();
            assert_eq!((lights.len(), leaves.len()), (tree.light_count(), tree.light_count()));
            let places: Vec<u32> = tree.below_root().iter().map(|opening| opening.place).collect();
            assert_eq!(places, (0..WIDTH as u32).collect::<Vec<_>>());
            tree.remove_lights(&[80 + 2 * round, 81 + 2 * round]).expect("they are there");
            tree.refit();
            tree.add_lights(&[Light::point(Vec3::splat(2.0), Vec3::ONE)]).expect("valid");
        }
        let empty = LightTree::default();
        assert!(empty.all_lights().is_empty() && empty.below_root().is_empty());
    }
}
