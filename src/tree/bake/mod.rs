//! The baked format: a finished tree as bytes, which are loaded without a build.
//!
//! A file holds what a frozen tree holds, so its loading computes nothing. All numbers have the
//! least significant byte first, on every machine.
//!
//! | bytes | content |
//! |---:|---|
//! | 8 | the mark of the format |
//! | 4, 4 | the mark of the byte order, the version |
//! | 4 | CRC-32 of all other bytes |
//! | 144 | flags, numbers of records, attributes, the cluster of all lights, the reference |
//! | 72 per side | the clusters of the sides |
//! | 56 per light | the lights; zeros for a light that was removed |
//! | 208 per node | the nodes |
//! | 4 per light | the places of the lights; all bits for a light that was removed |
//! | 4 per node | numbers of lights |
//!
//! Files are checked in this order, so that each fault has one name: what the file is, its version,
//! its length, its checksum, its lights, its nodes. Nothing is allocated before the length is
//! known to agree with the numbers of records.

mod content;
mod error;
mod header;
mod light_check;
mod light_record;
mod node_record;
mod sound;
#[cfg(test)]
mod tests;
mod words;

pub use error::BakeError;

use super::attributes::Quality;
use super::edited::Edited;
use super::node::NO_LEAF;
use super::state::TreeState;
use super::{LightTree, Maps};
use crate::cluster::Linear;
use crate::effects::EffectCounts;
use crate::rare::Rare;
use header::{Counts, Header};
use light_record::LIGHT_BYTES;
use node_record::NODE_BYTES;

/// Records that one thread reads in turn.
#[cfg(feature = "parallel")]
const RECORDS_PER_TASK: usize = 4096;

impl LightTree {
    /// The tree as bytes, for [`LightTree::from_baked`].
    ///
    /// About 100 bytes per light. Equal trees give equal bytes on every machine. The bytes hold the
    /// tree as [`LightTree::freeze`] leaves it: if lights have changed since the last refit, a copy
    /// of the tree is refitted first. If lights were added, removed or given other places by
    /// [`LightTree::set_lights`] since the last build, a copy of the tree is built first; lights keep
    /// their indices, and those of removed lights stay vacant.
    ///
    /// O(lights), but for that build.
    pub fn bake(&self) -> Vec<u8> {
        if self.is_dirty() {
            let mut refitted = self.clone();
            refitted.freeze();
            return refitted.bake();
        }
        let is_weighted = self.reference().map(|map| map.linear) == self.maps.weights.as_deref().map(|map| map.linear);
        if self.edited.is_changed() || !is_weighted {
            let mut built = self.clone();
            built.rebuild();
            return built.bake();
        }
        self.bytes()
    }

    /// The nodes as they are as bytes: of a tree that is up to date, whose nodes are depth first.
    fn bytes(&self) -> Vec<u8> {
        let Self { lights, leaves, nodes, light_counts, sides, .. } = self;
        let counts = Counts { lights: lights.len(), nodes: nodes.len(), sides: sides.len() };
        let header = Header {
            counts,
            built_cost: self.quality.built_cost,
            has_stale_sums: self.quality.is_stale,
            attributes: self.quality.attributes,
            root: self.root,
            reference: self.maps.weights.as_deref().map(|map| map.linear),
        };
        let mut bytes = Vec::with_capacity(counts.file_bytes() as usize);
        header.write(&mut bytes);
        sides.iter().for_each(|side| words::write(words::of_cluster(side), &mut bytes));
        lights.iter().for_each(|light| words::write(light_record::encode(light), &mut bytes));
        node_record::write(nodes, &mut bytes);
        for numbers in [leaves, light_counts] {
            words::write(numbers.iter().copied(), &mut bytes);
        }
        content::seal(&mut bytes);
        bytes
    }

    /// As [`LightTree::bake`] for a tree that is up to date, but nothing is built: the boxes and their
    /// children stay as they are. Edits may have scattered the nodes, which the bytes hold in order.
    pub(crate) fn bake_as_is(&self) -> Vec<u8> {
        if self.edited.is_changed() { self.ordered().bytes() } else { self.bytes() }
    }

    /// Loads a tree that [`LightTree::bake`] has written, on this machine or another one.
    ///
    /// The tree is the one that was baked after [`LightTree::freeze`], bit for bit: its lights,
    /// nodes, attributes and division into sides, and the map that later builds divide for. It is
    /// frozen, so its first edit allocates what refits need, and the refit after it visits all nodes.
    ///
    /// Nothing is built or refitted. O(bytes): 1.5 times as long as a copy into new memory for a
    /// million lights, on one thread (`docs/benchmarks.md`). The work is shared with rayon's threads; an engine that loads while
    /// it draws calls this inside a thread pool of its own. Memory: that of the frozen tree, about
    /// as much as the bytes.
    ///
    /// # Errors
    /// [`BakeError`] for bytes of another format, byte order or version, for a truncated or damaged
    /// file, and for one with a right checksum that is no sound tree. Whatever the bytes are, a
    /// tree that is returned can be sampled, refitted and rebuilt, with true probabilities. It
    /// takes memory in proportion to the bytes that were given, never to what they claim.
    ///
    /// That boxes and caps contain the lights below them follows from the checksum alone. Call
    /// [`LightTree::check`] too for files that someone may have forged.
    ///
    /// ```
    /// use girandole::{Light, LightTree, LightWorld, glam::Vec3};
    /// let lamps = (0..100).map(|i| Light::point(Vec3::X * i as f32, Vec3::ONE)).collect();
    /// let bytes = LightTree::new(lamps)?.bake();
    /// // Later, on any thread.
    /// let tree = LightTree::from_baked(&bytes)?;
    /// // On the thread of the world.
    /// let mut world = LightWorld::new();
    /// let key = world.add_tree(tree);
    /// assert_eq!(world.tree(key).map(|tree| tree.lights().len()), Some(100));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn from_baked(bytes: &[u8]) -> Result<Self, BakeError> {
        let (counts, sections) = Header::measure(bytes)?;
        let (effects, removed) = content::check(bytes, counts.place_of_lights())?;
        let Header { built_cost, has_stale_sums, attributes, root, reference, .. } = Header::read(bytes, counts)?;
        let reference = reference.map(|matrix| Box::new(Linear::new(matrix)));
        let numbers = |section| words::read(section).collect();
        let light = |bytes: &[u8]| light_record::decode_accepted(&light_record::read(bytes));
        let cluster = |bytes| words::to_cluster(words::read_array(bytes));
        let leaves: Vec<u32> = numbers(sections.leaves);
        let vacant = (0..).zip(&leaves).filter(|(_, place)| **place == NO_LEAF).map(|(index, _)| index).collect();
        let tree = Self {
            lights: records(sections.lights, LIGHT_BYTES, light),
            effects: if effects == EffectCounts::default() { Rare::default() } else { effects.into() },
            leaves,
            nodes: records(sections.nodes, NODE_BYTES, node_record::read),
            state: if counts.nodes > 0 { TreeState::Frozen } else { TreeState::default() },
            light_counts: numbers(sections.light_counts),
            quality: Quality { attributes, built_cost, cost: built_cost, is_stale: has_stale_sums },
            edited: Edited::of_build(vacant),
            builds: 0,
            root,
            sides: sections.sides.chunks_exact(words::CLUSTER_WORDS * words::WORD).map(cluster).collect(),
            maps: Maps::of_build(reference),
        };
        match tree.loading_fault(removed) {
            Some(fault) => Err(BakeError::Tree(fault)),
            None => Ok(tree),
        }
    }
}

/// Reads a section of records, in parallel.
fn records<T: Send>(section: &[u8], bytes: usize, read: impl Fn(&[u8]) -> T + Send + Sync) -> Vec<T> {
    #[cfg(feature = "parallel")]
    if section.len() > RECORDS_PER_TASK * bytes {
        use rayon::prelude::*;
        return section.par_chunks_exact(bytes).with_min_len(RECORDS_PER_TASK).map(read).collect();
    }
    section.chunks_exact(bytes).map(read).collect()
}
