//! The baked format: a finished tree as bytes, which are loaded without a build.
//!
//! A file holds what a frozen tree holds, so its loading computes nothing. It is a file of
//! `src/file.rs` with this content:
//!
//! | bytes | content |
//! |---:|---|
//! | 144 | a [`Header`] |
//! | 72 per side | the clusters of the sides |
//! | 56 per light | the lights; zeros for a light that was removed |
//! | 208 per node | the nodes |
//! | 4 per light | the places of the lights; all bits for a light that was removed |
//! | 4 per node | numbers of lights |

mod light_record;
#[cfg(test)]
mod tests;

use std::io::{self, Write};

use bytemuck::{Pod, Zeroable};
use glam::Mat3;

use super::attributes::{Attributes, Quality};
use super::edited::Edited;
use super::node::{MAX_LIGHTS, NO_LEAF, WIDTH};
use super::state::TreeState;
use super::{LightTree, Maps};
use crate::cluster::{Cluster, Linear, MAX_SCALE};
use crate::effects::EffectCounts;
use crate::error::LoadError;
use crate::file::{self, FileReader, FileWriter, Mark};
use crate::rare::Rare;
use light_record::Record;

const MARK: Mark = *b"\x89GTREE\r\n";

/// The largest number of nodes: the place of a child, `node * WIDTH + slot`, has 32 bits.
const MAX_NODES: u32 = u32::MAX / WIDTH as u32;

/// Records of lights that are written at once: a checksum of many bytes is faster than those of a few.
const RECORDS_AT_ONCE: usize = 1024;

/// The values of a tree as a whole.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Header {
    lights: u32,
    nodes: u32,
    sides: u32,
    /// Whether some sums of attributes are older than the nodes: 0 or 1.
    has_stale_sums: u32,
    /// The cost of the tree as it was built.
    built_cost: f32,
    attributes: Attributes,
    root: Cluster,
    /// The matrix of the reference, or zeros.
    reference: Mat3,
}

impl Header {
    /// What is wrong with the values besides the root, if anything is.
    fn fault(&self) -> Option<&'static str> {
        let Attributes { distance, overlap, variance, splitting_cost } = self.attributes;
        let costs = [self.built_cost, distance, overlap, variance, splitting_cost];
        if self.lights > MAX_LIGHTS as u32 || self.nodes > MAX_NODES || self.sides > WIDTH as u32 {
            return Some("more lights, nodes or sides than a tree can have");
        }
        if self.has_stale_sums > 1 {
            return Some("a flag is neither 0 nor 1");
        }
        // NaN is not at least 0.
        if !costs.into_iter().all(|cost| cost >= 0.0) {
            return Some("a cost or an attribute is below 0 or not a number");
        }
        let is_usable = self.reference().is_none_or(|map| {
            let is_within = |entry: f32| entry.abs() <= MAX_SCALE;
            map.linear.to_cols_array().into_iter().all(is_within) && map.least_scale >= 1.0 / MAX_SCALE
        });
        (!is_usable).then_some("the reference is the linear part of no instance")
    }

    fn reference(&self) -> Option<Box<Linear>> {
        let is_zero = bytemuck::bytes_of(&self.reference).iter().all(|byte| *byte == 0);
        (!is_zero).then(|| Box::new(Linear::new(self.reference)))
    }
}

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
        let about = size_of_val(&self.lights[..]) + size_of_val(&self.nodes[..]);
        let bytes = FileWriter::new(&MARK, Vec::with_capacity(about)).and_then(|mut file| {
            self.write(&mut file)?;
            file.finish()
        });
        bytes.expect("a list of bytes takes all")
    }

    /// Writes the nodes as they are: of a tree that is up to date, whose nodes are depth first.
    fn write<W: Write>(&self, file: &mut FileWriter<W>) -> io::Result<()> {
        let Self { lights, leaves, nodes, light_counts, sides, .. } = self;
        file.value(&Header {
            lights: lights.len() as u32,
            nodes: nodes.len() as u32,
            sides: sides.len() as u32,
            has_stale_sums: self.quality.is_stale.into(),
            built_cost: self.quality.built_cost,
            attributes: self.quality.attributes,
            root: self.root,
            reference: self.maps.weights.as_deref().map_or(Mat3::ZERO, |map| map.linear),
        })?;
        file.list(sides)?;
        for lights in lights.chunks(RECORDS_AT_ONCE) {
            let records: Vec<Record> = lights.iter().map(light_record::encode).collect();
            file.list(&records)?;
        }
        file.list(nodes)?;
        file.list(leaves)?;
        file.list(light_counts)
    }

    /// Writes a tree that is up to date without a build: the boxes and their children stay as they
    /// are. Edits may have scattered the nodes, which the file holds in order.
    pub(crate) fn write_as_is<W: Write>(&self, file: &mut FileWriter<W>) -> io::Result<()> {
        if self.edited.is_changed() { self.ordered().write(file) } else { self.write(file) }
    }

    /// Loads a tree that [`LightTree::bake`] has written, on this machine or another one.
    ///
    /// The tree is the one that was baked after [`LightTree::freeze`], bit for bit: its lights,
    /// nodes, attributes and division into sides, and the map that later builds divide for. It is
    /// frozen, so its first edit allocates what refits need, and the refit after it visits all nodes.
    ///
    /// Nothing is built or refitted. O(bytes), about as long as a copy of large trees
    /// (`docs/benchmarks.md`). The work is shared with rayon's threads; an engine that loads while
    /// it draws calls this inside a thread pool of its own. Memory: that of the frozen tree, about
    /// as much as the bytes.
    ///
    /// # Errors
    /// [`LoadError`] for bytes of another format or version, for a truncated or damaged file, and for
    /// one with a right checksum that is no sound tree. Whatever the bytes are, a
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
    pub fn from_baked(bytes: &[u8]) -> Result<Self, LoadError> {
        let mut file = FileReader::open("a baked tree", &MARK, bytes)?;
        let tree = Self::read(&mut file)?;
        file.finish()?;
        Ok(tree)
    }

    /// Reads what [`LightTree::write`] has written. The lights are checked before the nodes.
    pub(crate) fn read(file: &mut FileReader<'_>) -> Result<Self, LoadError> {
        let header: Header = file.value()?;
        if let Some(fault) = header.fault() {
            return Err(LoadError::content("the header", fault));
        }
        let [count, nodes, sides] = [header.lights, header.nodes, header.sides].map(|count| count as usize);
        let sides: Vec<Cluster> = file.list(sides)?;
        let records = file.section::<Record>(count)?;
        let lights = file::map(records, light_record::decode);
        let (effects, removed) = light_record::check(records, &lights)?;
        let (tree_nodes, leaves) = (file.list(nodes)?, file.list::<u32>(count)?);
        let vacant = (0..).zip(&leaves).filter(|(_, place)| **place == NO_LEAF).map(|(index, _)| index).collect();
        let Header { built_cost, attributes, root, .. } = header;
        let tree = Self {
            lights,
            effects: if effects == EffectCounts::default() { Rare::default() } else { effects.into() },
            leaves,
            nodes: tree_nodes,
            state: if nodes > 0 { TreeState::Frozen } else { TreeState::default() },
            light_counts: file.list(nodes)?,
            quality: Quality { attributes, built_cost, cost: built_cost, is_stale: header.has_stale_sums == 1 },
            edited: Edited::of_build(vacant),
            builds: 0,
            root,
            sides: sides.into(),
            maps: Maps::of_build(header.reference()),
        };
        tree.check_structure(removed).map_err(|fault| LoadError::content("the tree", fault))?;
        Ok(tree)
    }
}
