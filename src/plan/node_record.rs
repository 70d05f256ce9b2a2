//! A node as shaders read it. `LightNode` in WGSL; 224 bytes.
//!
//! A CPU weighs all children of a node at once, so [`Node`] has an array for each property. An
//! invocation of a shader weighs one after the other, so this record has the properties of each child
//! side by side: two reads of 16 bytes for a child.

use bytemuck::{Pod, Zeroable};

use crate::tree::{LightTree, Node, WIDTH};

/// A node. `LightNode` in WGSL.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct NodeRecord {
    /// As in [`Node`].
    pub origin: [f32; 3],
    pub steps: u32,
    pub children: [ChildRecord; WIDTH],
    /// As in [`Node`].
    pub parent: u32,
    pub area_ratios: u32,
    /// Of the root of a tree: the index of its first light, and how many lights it has.
    pub lights: [u32; 2],
    pub lobes: [LobeRecord; WIDTH],
}

/// What a node says about each child. `LightPackedChild` in WGSL. The fields are those of [`Node`].
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct ChildRecord {
    pub child_bits: u32,
    pub low: [u8; 3],
    pub deviation: u8,
    pub high: [u8; 3],
    pub mean: [u8; 3],
    pub flux: u16,
}

/// The directions and the range of the emission of a child.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct LobeRecord {
    pub axis: [i8; 3],
    pub cap: u8,
    pub shortness: u8,
    pub padding: u8,
    pub range: u16,
}

/// The nodes of a tree on the GPU, where each tree has a root, which says how many lights it has.
pub(crate) fn stored_nodes(tree: &LightTree) -> &[Node] {
    if tree.nodes().is_empty() { &[Node::EMPTY] } else { tree.nodes() }
}

impl NodeRecord {
    /// The record of a node.
    pub fn of(node: &Node) -> Self {
        let mut record = Self {
            origin: node.origin,
            steps: node.steps,
            children: [ChildRecord { child_bits: 0, low: [0; 3], deviation: 0, high: [0; 3], mean: [0; 3], flux: 0 };
                WIDTH],
            parent: node.parent,
            area_ratios: node.area_ratios,
            lights: [0; 2],
            lobes: [LobeRecord { axis: [0; 3], cap: 0, shortness: 0, padding: 0, range: 0 }; WIDTH],
        };
        for i in 0..WIDTH {
            record.children[i] = ChildRecord {
                child_bits: node.children[i],
                low: [node.low[0][i], node.low[1][i], node.low[2][i]],
                deviation: node.deviation[i],
                high: [node.high[0][i], node.high[1][i], node.high[2][i]],
                mean: [node.mean[0][i], node.mean[1][i], node.mean[2][i]],
                flux: node.flux[i],
            };
            record.lobes[i] = LobeRecord {
                axis: [node.axis[0][i], node.axis[1][i], node.axis[2][i]],
                cap: node.cap[i],
                shortness: node.shortness[i],
                padding: 0,
                range: node.range[i],
            };
        }
        record
    }

    /// The node of a record.
    #[cfg(test)]
    pub fn node(&self) -> Node {
        let mut node = Node {
            origin: self.origin,
            steps: self.steps,
            parent: self.parent,
            area_ratios: self.area_ratios,
            ..Node::EMPTY
        };
        for (i, (child, lobe)) in self.children.iter().zip(&self.lobes).enumerate() {
            node.children[i] = child.child_bits;
            (node.deviation[i], node.flux[i]) = (child.deviation, child.flux);
            for k in 0..3 {
                (node.low[k][i], node.high[k][i], node.mean[k][i]) = (child.low[k], child.high[k], child.mean[k]);
                node.axis[k][i] = lobe.axis[k];
            }
            (node.cap[i], node.shortness[i], node.range[i]) = (lobe.cap, lobe.shortness, lobe.range);
        }
        node
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_has_all_of_a_node() {
        let bytes: Vec<u8> = (0..size_of::<Node>()).map(|i| (i * 37 % 251) as u8).collect();
        let node: Node = bytemuck::pod_read_unaligned(&bytes);
        assert_eq!(NodeRecord::of(&node).node(), node);
    }
}
