//! A tree of boxes as shaders walk it: without a stack.
//!
//! Nodes are in the order in which a ray meets them, parents ahead of their children. Each says where to go on
//! for a ray that misses its box. The greater of two children comes first, since a ray more likely hits it.

use bevy::math::Vec3;
use bytemuck::{Pod, Zeroable};
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::{Boundable, BvhBuildParams};

/// A box in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub min: Vec3,
    pub max: Vec3,
}

impl Bounds {
    /// The box around nothing.
    pub const NONE: Self = Self { min: Vec3::MAX, max: Vec3::MIN };

    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().map(|point| Self { min: point, max: point }).fold(Self::NONE, Self::with)
    }

    pub fn with(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Half of the area of its surface.
    pub fn half_area(self) -> f32 {
        let size = (self.max - self.min).max(Vec3::ZERO);
        size.x * size.y + size.y * size.z + size.z * size.x
    }
}

impl Boundable for Bounds {
    fn aabb(&self) -> Aabb {
        Aabb::new(self.min.to_array().into(), self.max.to_array().into())
    }
}

/// A node, two `vec4<u32>` in the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct FlatNode {
    pub min: [f32; 3],
    /// The node after the last one below this.
    pub next: u32,
    pub max: [f32; 3],
    /// The first item times eight, and the number of items; 0 for a node with children, which follow it.
    pub items: u32,
}

impl FlatNode {
    pub fn bounds(&self) -> Bounds {
        Bounds { min: self.min.into(), max: self.max.into() }
    }

    pub fn set_bounds(&mut self, bounds: Bounds) {
        (self.min, self.max) = (bounds.min.to_array(), bounds.max.to_array());
    }

    /// The items of a leaf; empty for a node with children.
    pub fn range(&self) -> std::ops::Range<usize> {
        let first = (self.items >> 3) as usize;
        first..first + (self.items & 7) as usize
    }
}

/// A tree over boxes.
#[derive(Clone, Debug, Default)]
pub struct Flat {
    pub nodes: Vec<FlatNode>,
    /// The boxes in the order of the items.
    pub order: Vec<u32>,
}

impl Flat {
    /// The tree over finite boxes, with at most seven items in a leaf. O(n log n).
    pub fn build(boxes: &[Bounds], leaf_items: u32, params: BvhBuildParams) -> Self {
        if boxes.is_empty() {
            return Self::default();
        }
        let params = BvhBuildParams { pre_split: false, max_prims_per_leaf: leaf_items.min(7), ..params };
        let tree = build_bvh2(boxes, params, &mut Default::default());
        let mut flat = Self { nodes: Vec::with_capacity(tree.nodes.len()), order: tree.primitive_indices };
        // A node to visit, or one of which all is visited that is below it.
        let mut steps = vec![(0, false)];
        while let Some((index, is_done)) = steps.pop() {
            if is_done {
                flat.nodes[index].next = flat.nodes.len() as u32;
                continue;
            }
            let node = &tree.nodes[index];
            let items = if node.prim_count > 0 { node.first_index << 3 | node.prim_count } else { 0 };
            let [min, max] = [node.min, node.max].map(|corner| corner.to_array());
            steps.push((flat.nodes.len(), true));
            flat.nodes.push(FlatNode { min, max, next: 0, items });
            if node.prim_count == 0 {
                let first = node.first_index as usize;
                let area = |child: usize| tree.nodes[child].aabb().half_area();
                let (greater, lesser) =
                    if area(first) < area(first + 1) { (first + 1, first) } else { (first, first + 1) };
                steps.extend([(lesser, false), (greater, false)]);
            }
        }
        flat
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_walk_without_a_stack_visits_each_item_once_and_skips_what_is_below_a_node() {
        for count in [1_u32, 2, 3, 5, 100, 3000] {
            let boxes: Vec<_> = (0..count)
                .map(|i| {
                    let place = Vec3::new((i * 7 % 101) as f32, (i * 13 % 37) as f32, (i % 11) as f32);
                    Bounds::around([place, place + 0.5 + (i % 5) as f32])
                })
                .collect();
            let most = 1 + count % 7;
            let flat = Flat::build(&boxes, most, BvhBuildParams::medium_build());
            let mut seen = vec![0; boxes.len()];
            for (index, node) in flat.nodes.iter().enumerate() {
                assert!(node.next as usize > index && node.next as usize <= flat.nodes.len());
                assert!(node.range().len() <= most as usize);
                let mut around = Bounds::NONE;
                for below in &flat.nodes[index..node.next as usize] {
                    for item in below.range() {
                        around = around.with(boxes[flat.order[item] as usize]);
                    }
                }
                assert_eq!(around, node.bounds(), "{count} boxes, node {index}");
                node.range().for_each(|item| seen[flat.order[item] as usize] += 1);
            }
            assert!(seen.iter().all(|times| *times == 1));
        }
        assert!(Flat::build(&[], 4, BvhBuildParams::medium_build()).nodes.is_empty());
    }
}
