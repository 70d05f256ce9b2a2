//! Which parts of each record are stored: the parts that the effects of the world need, in
//! multiples of 16 bytes.
//!
//! A uniform holds the strides and offsets, so any variant of the shaders reads any stored layout
//! (`shaders/stored.wgsl`, the twin of this file). A variant skips the parts that it has no use
//! for. For a part that is not stored it uses the values of a record without that effect.

use std::mem::offset_of;
use std::ops::Range;

use super::layout::{InstanceRecord, LightRecord, Strides};
use super::node_record::NodeRecord;
use crate::effects::Effects;
use crate::top::masks::NodeMasks;

/// Bytes of a `vec4<u32>`, the unit of strides and offsets.
const QUAD: usize = 16;
/// Bytes of a `u32`.
const WORD: usize = 4;
/// The most parts that a record is divided into.
const MAX_PARTS: usize = 4;

/// The offsets of a node's children and parent, in quads; the same in every layout.
pub(crate) const NODE_CHILDREN: u32 = quads(offset_of!(NodeRecord, children));
pub(crate) const NODE_TAIL: u32 = quads(offset_of!(NodeRecord, parent));
/// The offsets of an instance's flags and tree and of its first part, in quads.
pub(crate) const INSTANCE_TREE: u32 = quads(offset_of!(InstanceRecord, flags));
pub(crate) const INSTANCE_PART: u32 = quads(offset_of!(InstanceRecord, first_part));
/// The strides of lights where all are points, and of instances where all are rigid and none has a
/// factor or a mask, in quads.
pub(crate) const POINT_STRIDE: u32 = quads(offset_of!(LightRecord, b));
pub(crate) const RIGID_STRIDE: u32 = quads(offset_of!(InstanceRecord, to_local));
/// The quads of an instance's factor and mask, which are the last of its record where they are stored,
/// but for the sector.
pub(crate) const FACTOR_QUADS: u32 = quads(offset_of!(InstanceRecord, sector) - offset_of!(InstanceRecord, factor));
/// The quads of the masks of a node of the top level: the shares of the node, then two for the children.
pub(crate) const MASK_QUADS: u32 = quads(size_of::<NodeMasks>());
/// The quads of an instance where nothing but the sector is left out.
pub(crate) const WITHOUT_SECTOR: u32 = quads(offset_of!(InstanceRecord, sector));

const fn quads(bytes: usize) -> u32 {
    assert!(bytes.is_multiple_of(QUAD), "parts of records start at multiples of 16 bytes");
    (bytes / QUAD) as u32
}

/// The effects that need more of a light than its first 32 bytes.
const SHAPES: Effects =
    Effects::CONES.union(Effects::RANGES).union(Effects::AREAS).union(Effects::DIRECTIONAL).union(Effects::PROFILES);

/// The effects that need the lobes of nodes.
const LOBES: Effects = Effects::CONES.union(Effects::RANGES);

/// The effects that need the factor and the mask of an instance.
const APPEARANCES: Effects = Effects::FACTORS.union(Effects::MASKS);

impl Strides {
    /// The strides that a world of these effects is stored with.
    pub(crate) fn of(effects: Effects) -> Self {
        let (nodes, instances) = (Stored::nodes(effects), Stored::instances(effects));
        let lobes = quads(nodes.offset(offset_of!(NodeRecord, lobes)));
        Self {
            node: quads(nodes.bytes()),
            lobes: if effects.intersects(LOBES) { lobes } else { 0 },
            light: quads(Stored::lights(effects).bytes()),
            instance: quads(instances.bytes()),
            sector: quads(instances.offset(offset_of!(InstanceRecord, sector))),
        }
    }
}

/// The parts of a record that are stored, without gaps between them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Stored {
    /// Ranges of bytes of the whole record, in ascending order, then empty ones.
    parts: [Range<usize>; MAX_PARTS],
    /// Bytes of the whole record.
    whole: usize,
}

/// The value of a word that is not stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Missing {
    /// The same value in every record.
    Value(u32),
    /// The value of another word of the same record, which every layout stores.
    Word(usize),
}

impl Stored {
    /// The layout that stores whole records.
    pub(crate) fn whole<T>() -> Self {
        Self::with_optional::<T>(size_of::<T>(), std::iter::empty())
    }

    /// The layout of nodes in a world of these effects.
    pub(crate) fn nodes(effects: Effects) -> Self {
        let lobes = offset_of!(NodeRecord, lobes);
        let optional = [(LOBES, lobes..size_of::<NodeRecord>())];
        Self::with_optional::<NodeRecord>(lobes, optional.into_iter().filter(|(any, _)| effects.intersects(*any)))
    }

    /// The layout of lights in a world of these effects.
    pub(crate) fn lights(effects: Effects) -> Self {
        let b = offset_of!(LightRecord, b);
        let optional = [(SHAPES, b..size_of::<LightRecord>())];
        Self::with_optional::<LightRecord>(b, optional.into_iter().filter(|(shapes, _)| effects.intersects(*shapes)))
    }

    /// The layout of instances in a world of these effects.
    pub(crate) fn instances(effects: Effects) -> Self {
        let [local, factor] = [offset_of!(InstanceRecord, to_local), offset_of!(InstanceRecord, factor)];
        let sector = offset_of!(InstanceRecord, sector);
        let optional = [
            (Effects::NON_RIGID, local..factor),
            (APPEARANCES, factor..sector),
            (Effects::SECTORS, sector..size_of::<InstanceRecord>()),
        ];
        let stored = optional.into_iter().filter(|(any, _)| effects.intersects(*any));
        Self::with_optional::<InstanceRecord>(local, stored)
    }

    /// The first `core` bytes and some of the parts after them.
    fn with_optional<T>(core: usize, optional: impl Iterator<Item = (Effects, Range<usize>)>) -> Self {
        let mut parts = [const { 0..0 }; MAX_PARTS];
        parts[0] = 0..core;
        // No record has more parts, which the tests of the strides see.
        parts[1..].iter_mut().zip(optional).for_each(|(part, (_, stored))| *part = stored);
        Self { parts, whole: size_of::<T>() }
    }

    /// Bytes from one record to the next.
    pub(crate) fn bytes(&self) -> usize {
        self.parts.iter().map(Range::len).sum()
    }

    /// The offset in the stored record of a byte of the whole record. If it is not stored, that of
    /// the next one that is, or the end.
    fn offset(&self, byte: usize) -> usize {
        let before = |part: &Range<usize>| part.end.min(byte).saturating_sub(part.start);
        self.parts.iter().map(before).sum()
    }

    /// The words of the whole record that are stored, in ascending order.
    pub(crate) fn words(&self) -> impl Iterator<Item = usize> {
        self.parts.iter().flat_map(|part| part.start / WORD..part.end / WORD)
    }

    /// The offset in the stored record of a word of the whole record, both counted in words; `None`
    /// if the word is not stored.
    pub(crate) fn word_offset(&self, word: usize) -> Option<usize> {
        let byte = word * WORD;
        self.parts.iter().any(|part| part.contains(&byte)).then(|| self.offset(byte) / WORD)
    }

    /// The stored bytes of a whole record, which are as many as `bytes`.
    #[cfg(feature = "parallel")]
    pub(crate) fn strip(&self, record: &[u8], mut bytes: &mut [u8]) {
        for part in &self.parts {
            let (own, rest) = bytes.split_at_mut(part.len());
            own.copy_from_slice(&record[part.clone()]);
            bytes = rest;
        }
    }

    /// Appends the stored bytes of whole records, which are given as bytes.
    pub(crate) fn strip_into(&self, records: &[u8], bytes: &mut Vec<u8>) {
        if self.bytes() == self.whole {
            return bytes.extend_from_slice(records);
        }
        bytes.reserve(records.len() / self.whole * self.bytes());
        for record in records.chunks_exact(self.whole) {
            self.parts.iter().for_each(|part| bytes.extend_from_slice(&record[part.clone()]));
        }
    }
}

/// A word of a node without lobes.
pub(crate) fn missing_of_node(word: usize) -> Missing {
    Missing::Value(bytemuck::cast_slice(std::slice::from_ref(&NodeRecord::EMPTY))[word])
}

/// A word of a light in a world of point lights.
pub(crate) fn missing_of_light(word: usize) -> Missing {
    Missing::Value(bytemuck::cast_slice(std::slice::from_ref(&LightRecord::DARK))[word])
}

/// A word of an instance without factor, mask and sector, or of the inverse of a rigid instance: the inverse is
/// the transpose, and all scales are 1.
pub(crate) fn missing_of_instance(word: usize) -> Missing {
    let [to_world, to_local] = [offset_of!(InstanceRecord, to_world), offset_of!(InstanceRecord, to_local)];
    if word >= offset_of!(InstanceRecord, factor) / WORD {
        return Missing::Value(bytemuck::cast_slice(std::slice::from_ref(&InstanceRecord::NONE))[word]);
    }
    let (row, column) = ((word - to_local / WORD) / 4, (word - to_local / WORD) % 4);
    match column {
        3 => Missing::Value(1.0_f32.to_bits()),
        _ => Missing::Word(to_world / WORD + 4 * column + row),
    }
}

/// The words of the lobe of a child whose lobe is not stored.
pub(crate) fn missing_lobe() -> &'static [u32] {
    const EMPTY: NodeRecord = NodeRecord::EMPTY;
    let words: &[u32] = bytemuck::cast_slice(std::slice::from_ref(&EMPTY));
    &words[offset_of!(NodeRecord, lobes) / WORD..][..QUAD / WORD / 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strides_depend_on_the_effects() {
        let bytes = |effects| {
            let strides = Strides::of(effects);
            [strides.node, strides.light, strides.instance].map(|quads| quads as usize * QUAD)
        };
        let whole = [size_of::<NodeRecord>(), size_of::<LightRecord>(), size_of::<InstanceRecord>()];
        assert_eq!((bytes(Effects::all()), whole), ([224, 64, 160], [224, 64, 160]));
        assert_eq!(bytes(Effects::empty()), [160, 32, 80]);
        assert_eq!(bytes(Effects::MOVING | Effects::TWO_SIDED), [160, 32, 80]);
        assert_eq!(bytes(Effects::RANGES), [224, 64, 80]);
        assert_eq!(bytes(Effects::CONES), [224, 64, 80]);
        // What docs/memory.md says of nodes and lights.
        let [[least_node, least_light, _], [node, light, _]] = [Effects::empty(), Effects::CONES].map(bytes);
        for row in [
            format!("| node of a tree | {least_node}; {node} with cones or ranges |"),
            format!("| light | {least_light} if there are only points without range, else {light} |"),
        ] {
            assert!(include_str!("../../docs/memory.md").contains(&row), "{row}");
        }
        assert_eq!(bytes(Effects::AREAS | Effects::NON_RIGID), [160, 64, 128]);
        assert_eq!(bytes(Effects::DIRECTIONAL), [160, 64, 80]);
        assert_eq!(bytes(Effects::FACTORS), [160, 32, 96]);
        assert_eq!(bytes(Effects::MASKS), [160, 32, 96]);
        assert_eq!(bytes(Effects::FACTORS | Effects::NON_RIGID), [160, 32, 144]);
        assert_eq!(bytes(Effects::SECTORS), [160, 32, 96]);
        assert_eq!(bytes(Effects::SECTORS | Effects::MASKS), [160, 32, 112]);
        assert_eq!(bytes(Effects::SECTORS | Effects::NON_RIGID), [160, 32, 144]);
        assert_eq!(Strides::of(Effects::FACTORS | Effects::NON_RIGID).sector, 9);
        assert_eq!(Strides::of(Effects::empty()).sector, RIGID_STRIDE);
        assert_eq!(Strides::of(Effects::SECTORS | Effects::NON_RIGID).sector, 8);
        assert_eq!(Strides::of(Effects::all()).sector, WITHOUT_SECTOR);
        assert_eq!(Strides::of(Effects::empty()).lobes, 0);
        assert_eq!(Strides::of(Effects::RANGES).lobes, 10);
        assert_eq!(Strides::of(Effects::CONES | Effects::RANGES).lobes, 10);
    }

    #[test]
    fn strip_leaves_out_the_parts_that_are_not_stored() {
        let bytes: Vec<u8> = (0..=255).collect();
        let record = &bytes[..size_of::<InstanceRecord>()];
        let two: Vec<u8> = [record, record].concat();
        let strip = |effects| {
            let mut bytes = vec![7];
            Stored::instances(effects).strip_into(&two, &mut bytes);
            assert_eq!(bytes.remove(0), 7, "the bytes are appended");
            bytes
        };
        assert_eq!(strip(Effects::all()), two);
        let stripped = strip(Effects::SECTORS);
        let expected = [&record[..80], &record[144..160]].concat();
        assert_eq!(stripped, [&expected[..], &expected[..]].concat());
        let words: Vec<usize> = Stored::instances(Effects::SECTORS).words().collect();
        assert_eq!((words.len(), words[19], words[20]), (24, 19, 36));
        assert_eq!(Stored::instances(Effects::SECTORS).word_offset(37), Some(21));
        assert_eq!(Stored::instances(Effects::SECTORS).word_offset(20), None);
    }
}
