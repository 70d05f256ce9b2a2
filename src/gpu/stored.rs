//! What is stored of each record: the pieces that the effects of the world call for.
//!
//! Nodes are arrays of 16 bytes with a stride that a uniform tells, so any variant of the shaders reads any of them:
//! what the variant has no use for it skips, and what is not stored it takes to be as where nothing has it.

use std::mem::offset_of;

use crate::effects::Effects;
use crate::tree::Node;

/// Bytes of a `vec4<u32>`, in which strides and places are counted.
pub(crate) const QUAD: usize = 16;

/// Where a node has its targets, flux, boxes, and parent: the same in every layout, counted in [`QUAD`].
pub(crate) const NODE_TARGETS: usize = quads(offset_of!(Node, targets));
pub(crate) const NODE_FLUX: usize = quads(offset_of!(Node, flux));
pub(crate) const NODE_BOXES: usize = quads(offset_of!(Node, low));
pub(crate) const NODE_TAIL: usize = quads(offset_of!(Node, parent));
const NODE_CONES: usize = quads(offset_of!(Node, axis));
const NODE_RANGE: usize = quads(offset_of!(Node, range));
const NODE_END: usize = quads(size_of::<Node>());

const fn quads(bytes: usize) -> usize {
    assert!(bytes.is_multiple_of(QUAD), "pieces are whole");
    bytes / QUAD
}

/// How nodes are stored; part of `LightParams` and `TopPass`, in [`QUAD`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct NodeLayout {
    /// From one node to the next.
    pub stride: u32,
    /// Where a node's cones are; 0 if they are not stored.
    pub cones: u32,
    /// Where a node's ranges are; 0 if they are not stored.
    pub range: u32,
}

impl NodeLayout {
    /// What a world of these effects needs.
    pub(crate) fn of(effects: Effects) -> Self {
        let mut stride = NODE_CONES;
        let mut place = |effect, quads| {
            let at = stride;
            let is_stored = effects.contains(effect);
            stride += if is_stored { quads } else { 0 };
            if is_stored { at as u32 } else { 0 }
        };
        let cones = place(Effects::CONES, NODE_RANGE - NODE_CONES);
        let range = place(Effects::RANGES, NODE_END - NODE_RANGE);
        Self { stride: stride as u32, cones, range }
    }
}

/// The words of a node's cones and of its ranges where nothing has one.
pub(crate) fn node_without() -> [Vec<u32>; 2] {
    let words: &[u32] = bytemuck::cast_slice(std::slice::from_ref(&Node::EMPTY));
    [words[4 * NODE_CONES..4 * NODE_RANGE].to_vec(), words[4 * NODE_RANGE..].to_vec()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_has_the_bytes_that_its_effects_need() {
        let bytes = |effects| NodeLayout::of(effects).stride as usize * QUAD;
        assert_eq!(bytes(Effects::empty()), 160);
        assert_eq!(bytes(Effects::RANGES), 176);
        assert_eq!(bytes(Effects::CONES), 192);
        assert_eq!(bytes(Effects::all()), size_of::<Node>());
        assert_eq!(NodeLayout::of(Effects::all() - Effects::CONES), NodeLayout { stride: 11, cones: 0, range: 10 });
    }
}
