//! What is stored of each record: the pieces that the effects of the world call for, in multiples of 16 bytes.
//!
//! Strides and places are told by a uniform, so any variant of the shaders reads any layout (`shaders/stored.wgsl`, its
//! twin): what the variant has no use for it skips, and what is not stored it takes to be as where nothing has it.

use std::mem::offset_of;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::layout::{InstanceRecord, LightRecord};
use crate::effects::Effects;
use crate::tree::Node;

/// Bytes of a `vec4<u32>`, in which strides and places are counted.
const QUAD: usize = 16;
/// Bytes of a word.
const WORD: usize = 4;

/// Where a node has its targets, flux, boxes, and parent in every layout, counted in [`QUAD`].
pub(crate) const NODE_TARGETS: u32 = quads(offset_of!(Node, targets));
pub(crate) const NODE_FLUX: u32 = quads(offset_of!(Node, flux));
pub(crate) const NODE_BOXES: u32 = quads(offset_of!(Node, low));
pub(crate) const NODE_TAIL: u32 = quads(offset_of!(Node, parent));
/// Where an instance has its tree, and its place in the top level.
pub(crate) const INSTANCE_TREE: u32 = quads(offset_of!(InstanceRecord, flags));
pub(crate) const INSTANCE_PLACE: u32 = quads(offset_of!(InstanceRecord, top_place));
/// From one record to the next where nothing but points, or instances that are only turned and moved, are stored.
pub(crate) const POINT_STRIDE: u32 = quads(offset_of!(LightRecord, b));
pub(crate) const RIGID_STRIDE: u32 = quads(offset_of!(InstanceRecord, to_local));

const fn quads(bytes: usize) -> u32 {
    assert!(bytes.is_multiple_of(QUAD), "pieces are whole");
    (bytes / QUAD) as u32
}

/// Effects for which a light is more than a point.
const SHAPES: Effects = Effects::CONES.union(Effects::RANGES).union(Effects::AREAS).union(Effects::DIRECTIONAL);

/// Strides of all records; part of `LightParams` and `TopPass`, counted in [`QUAD`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub(crate) struct Strides {
    /// From one node to the next.
    pub node: u32,
    /// Where a node's cones are; 0 if they are not stored.
    pub cones: u32,
    /// Where a node's ranges are; 0 if they are not stored.
    pub range: u32,
    /// From one light to the next.
    pub light: u32,
    /// From one instance to the next.
    pub instance: u32,
}

impl Strides {
    /// What a world of these effects is stored in.
    pub(crate) fn of(effects: Effects) -> Self {
        let nodes = Stored::nodes(effects);
        let place = |effect, byte: usize| if effects.contains(effect) { quads(nodes.place(byte)) } else { 0 };
        Self {
            node: quads(nodes.bytes()),
            cones: place(Effects::CONES, offset_of!(Node, axis)),
            range: place(Effects::RANGES, offset_of!(Node, range)),
            light: quads(Stored::lights(effects).bytes()),
            instance: quads(Stored::instances(effects).bytes()),
        }
    }
}

/// Which bytes of a record are stored, one piece behind the other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Stored {
    pieces: Vec<Range<usize>>,
    /// Of the whole record.
    whole: usize,
}

/// What a word is where it is not stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Missing {
    /// The same in every record.
    Value(u32),
    /// What another word of the record is, which every layout stores.
    Word(usize),
}

impl Stored {
    /// All of a record.
    pub(crate) fn whole<T>() -> Self {
        Self::parts::<T>(size_of::<T>(), std::iter::empty())
    }

    pub(crate) fn nodes(effects: Effects) -> Self {
        let [cones, range] = [offset_of!(Node, axis), offset_of!(Node, range)];
        let optional = [(Effects::CONES, cones..range), (Effects::RANGES, range..size_of::<Node>())];
        Self::parts::<Node>(cones, optional.into_iter().filter(|(effect, _)| effects.contains(*effect)))
    }

    pub(crate) fn lights(effects: Effects) -> Self {
        let b = offset_of!(LightRecord, b);
        let optional = [(SHAPES, b..size_of::<LightRecord>())];
        Self::parts::<LightRecord>(b, optional.into_iter().filter(|(shapes, _)| effects.intersects(*shapes)))
    }

    pub(crate) fn instances(effects: Effects) -> Self {
        let local = offset_of!(InstanceRecord, to_local);
        let optional = [(Effects::NON_RIGID, local..size_of::<InstanceRecord>())];
        Self::parts::<InstanceRecord>(local, optional.into_iter().filter(|(effect, _)| effects.contains(*effect)))
    }

    /// What is always stored, and what else.
    fn parts<T>(core: usize, more: impl Iterator<Item = (Effects, Range<usize>)>) -> Self {
        let pieces = std::iter::once(0..core).chain(more.map(|(_, piece)| piece)).collect();
        Self { pieces, whole: size_of::<T>() }
    }

    /// Bytes from one record to the next.
    pub(crate) fn bytes(&self) -> usize {
        self.pieces.iter().map(Range::len).sum()
    }

    /// Where a byte of the record that is stored lies among those that are.
    fn place(&self, byte: usize) -> usize {
        let before = |piece: &Range<usize>| piece.end.min(byte).saturating_sub(piece.start);
        self.pieces.iter().map(before).sum()
    }

    /// The words of the record that are stored, in order.
    pub(crate) fn words(&self) -> impl Iterator<Item = usize> {
        self.pieces.iter().flat_map(|piece| piece.start / WORD..piece.end / WORD)
    }

    /// Where a word of the record lies among those that are stored.
    pub(crate) fn place_of_word(&self, word: usize) -> Option<usize> {
        let byte = word * WORD;
        self.pieces.iter().any(|piece| piece.contains(&byte)).then(|| self.place(byte) / WORD)
    }

    /// The stored bytes of whole records; `None` where they are stored as they are.
    pub(crate) fn strip(&self, records: &[u8]) -> Option<Vec<u8>> {
        if self.bytes() == self.whole {
            return None;
        }
        let mut bytes = Vec::with_capacity(records.len() / self.whole * self.bytes());
        for record in records.chunks_exact(self.whole) {
            self.pieces.iter().for_each(|piece| bytes.extend_from_slice(&record[piece.clone()]));
        }
        Some(bytes)
    }
}

/// A node's word where nothing has a cone or a range.
pub(crate) fn missing_of_node(word: usize) -> Missing {
    Missing::Value(bytemuck::cast_slice(std::slice::from_ref(&Node::EMPTY))[word])
}

/// A light's word where there are nothing but points.
pub(crate) fn missing_of_light(word: usize) -> Missing {
    Missing::Value(bytemuck::cast_slice(std::slice::from_ref(&LightRecord::DARK))[word])
}

/// An instance's word where all are only turned and moved: the way back is the transpose, and no scale.
pub(crate) fn missing_of_instance(word: usize) -> Missing {
    let [to_world, to_local] = [offset_of!(InstanceRecord, to_world), offset_of!(InstanceRecord, to_local)];
    let (row, column) = ((word - to_local / WORD) / 4, (word - to_local / WORD) % 4);
    match column {
        3 => Missing::Value(1.0_f32.to_bits()),
        _ => Missing::Word(to_world / WORD + 4 * column + row),
    }
}

/// The words of a node's cones and of its ranges where nothing has one, for the shaders.
pub(crate) fn node_without() -> [(&'static str, &'static [u32]); 2] {
    const EMPTY: Node = Node::EMPTY;
    let words: &[u32] = bytemuck::cast_slice(std::slice::from_ref(&EMPTY));
    let [cones, range] = [offset_of!(Node, axis) / WORD, offset_of!(Node, range) / WORD];
    [("NO_CONES", &words[cones..range]), ("NO_RANGES", &words[range..])]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_have_the_bytes_that_their_effects_need() {
        let bytes = |effects| {
            let strides = Strides::of(effects);
            [strides.node, strides.light, strides.instance].map(|quads| quads as usize * QUAD)
        };
        let whole = [size_of::<Node>(), size_of::<LightRecord>(), size_of::<InstanceRecord>()];
        assert_eq!((bytes(Effects::all()), whole), ([208, 64, 128], [208, 64, 128]));
        assert_eq!(bytes(Effects::empty()), [160, 32, 80]);
        assert_eq!(bytes(Effects::MOVING | Effects::TWO_SIDED), [160, 32, 80]);
        assert_eq!(bytes(Effects::RANGES), [176, 64, 80]);
        assert_eq!(bytes(Effects::CONES), [192, 64, 80]);
        assert_eq!(bytes(Effects::AREAS | Effects::NON_RIGID), [160, 64, 128]);
        assert_eq!(bytes(Effects::DIRECTIONAL), [160, 64, 80]);
        let places = |effects| (Strides::of(effects).cones, Strides::of(effects).range);
        assert_eq!(places(Effects::empty()), (0, 0));
        assert_eq!(places(Effects::RANGES), (0, 10));
        assert_eq!(places(Effects::CONES | Effects::RANGES), (10, 12));
    }

    #[test]
    fn records_are_stripped_of_what_is_not_stored() {
        let bytes: Vec<u8> = (0..=255).collect();
        let record = &bytes[..size_of::<Node>()];
        let two: Vec<u8> = [record, record].concat();
        assert_eq!(Stored::nodes(Effects::all()).strip(&two), None);
        let stripped = Stored::nodes(Effects::RANGES).strip(&two).expect("cones are not stored");
        let expected = [&record[..160], &record[192..208]].concat();
        assert_eq!(stripped, [&expected[..], &expected[..]].concat());
        let words: Vec<usize> = Stored::nodes(Effects::RANGES).words().collect();
        assert_eq!((words.len(), words[39], words[40]), (44, 39, 48));
        assert_eq!(Stored::nodes(Effects::RANGES).place_of_word(49), Some(41));
        assert_eq!(Stored::nodes(Effects::RANGES).place_of_word(40), None);
    }
}
