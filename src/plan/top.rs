//! Plans the build of the top level on the GPU from the instances and the parts of their trees. Nothing is read
//! back.
//!
//! Twin of `src/top`, which explains the tree, and of `LightWorld::parts`, which makes the
//! clusters of the parts; the tests compare both and also check the bounds on the GPU by
//! themselves.
//!
//! The build has these stages; `shaders/top_*.wgsl` are their sources.
//!
//! 1. The leaves: the cluster of each part.
//! 2. The keys: the cell of the partition in which each part lies, counted for the sort.
//! 3. The sort.
//! 4. The cells: the nodes of all cells, and runs for cells of too many parts.
//! 5. The divided nodes of the partition, by stages (`top/stages.rs`).
//!
//! No workgroup waits for another.

mod buffers;
mod partition;
mod stage;

use std::borrow::Cow;

pub(crate) use buffers::MapQuads;
use buffers::{Capacity, TopBuffers, TopPass, most_nodes, most_parts};
use partition::{PlanesRecord, SentPartition};
use stage::LANES;
pub(super) use stage::NODE_LANES;

use super::buffers::{BufferId, Ids, NewBuffer};
use super::commands::{CommandSizes, Commands};
use super::error::PlanError;
use super::kernel::{Binding, Kernel, UNIFORM_ALIGNMENT};
use super::pool::Growth;
use super::sort::SortBuffers;
use crate::top::partition::Partition;
use crate::tree::WIDTH;

/// Passes that there are uniforms for: one for the first stages, and one for each stage of divided nodes. Each stage
/// has at least twice as many nodes below it as the one before, so there are never more.
const MAX_PASSES: u32 = 32;

/// The largest number of stages of a build: three, the sort, and those of divided nodes.
#[cfg(feature = "gpu")]
pub(crate) const MAX_STAGES: u32 = 3 + 4 + MAX_PASSES - 1;

/// Parts, and nodes of the partition, that the first buffers have room for.
const FIRST_CAPACITY: Capacity = Capacity { parts: 64, nodes: 16 };

use Binding::{Read, ReadWrite};

const UNIFORM: Binding = Binding::Uniform { bytes: size_of::<TopPass>() as u32 };

/// Clusters and nodes; parts, instances and trees.
const LEAF_BINDINGS: &[Binding] = &[UNIFORM, ReadWrite, ReadWrite, Read, Read, Read];

/// Clusters, parts and partition; keys, order and the histogram of the sort.
const KEY_BINDINGS: &[Binding] = &[UNIFORM, Read, Read, Read, ReadWrite, ReadWrite, ReadWrite];

/// Clusters and nodes; keys, order and parts; units.
const CELL_BINDINGS: &[Binding] = &[UNIFORM, ReadWrite, ReadWrite, Read, Read, Read, ReadWrite];

/// Clusters, nodes, partition and units.
const BLOCK_BINDINGS: &[Binding] = &[UNIFORM, ReadWrite, ReadWrite, Read, ReadWrite];

pub(super) const LEAVES: Kernel = Kernel::new(stage::LEAVES.entry, "leaves", LEAF_BINDINGS, || stage::LEAVES.text());
pub(super) const KEYS: Kernel = Kernel::new(stage::KEYS.entry, "keys", KEY_BINDINGS, || stage::KEYS.text());
pub(super) const CELLS: Kernel = Kernel::new(stage::CELLS.entry, "cells", CELL_BINDINGS, || stage::CELLS.text());
pub(super) const BLOCKS: Kernel = Kernel::new(stage::BLOCKS.entry, "blocks", BLOCK_BINDINGS, || stage::BLOCKS.text());

/// The buffers of the top level, and what the next build makes of them.
///
/// As with a pool, a frame reserves, and then adopts or undoes what it reserved.
#[derive(Debug)]
pub(crate) struct TopBuild {
    limit: u64,
    /// The most parts that fit beside some masks and maps, once that was asked for.
    most_parts: Option<((bool, MapQuads), u32)>,
    /// `None` before the first plan.
    buffers: Option<TopBuffers>,
    uniforms: Option<BufferId>,
    /// The buffers after this frame, if they are others.
    replacement: Option<TopBuffers>,
    new_uniforms: Option<BufferId>,
    /// The passes as they were sent: of the first stages, then one for each stage of divided nodes.
    passes: Vec<TopPass>,
    partition: SentPartition,
    /// Something has changed since the last build.
    pub(super) is_due: bool,
    /// What the last build took.
    pub(super) sizes: CommandSizes,
}

impl TopBuild {
    /// No buffers yet. None will be larger than `limit` bytes.
    pub(crate) fn new(limit: u64) -> Self {
        Self {
            limit,
            most_parts: None,
            buffers: None,
            uniforms: None,
            replacement: None,
            new_uniforms: None,
            passes: Vec::new(),
            partition: SentPartition::default(),
            is_due: true,
            sizes: CommandSizes::default(),
        }
    }

    /// The greatest number of parts that there can be room for, beside masks and maps.
    pub(crate) fn most_parts(&mut self, (has_masks, map_quads): (bool, MapQuads)) -> u32 {
        let maps = (has_masks || self.masks() != 0, map_quads);
        match self.most_parts {
            Some((of, most)) if of == maps => most,
            _ => self.most_parts.insert((maps, most_parts(maps, self.limit))).1,
        }
    }

    /// The partition as far as there can be room for its nodes beside `parts` parts, masks and maps.
    pub(crate) fn fitting<'a>(
        &self,
        partition: &'a Partition,
        parts: u32,
        (has_masks, map_quads): (bool, MapQuads),
    ) -> Cow<'a, Partition> {
        let most = most_nodes(parts, (has_masks || self.masks() != 0, map_quads), self.limit) as usize;
        if partition.len() <= most { Cow::Borrowed(partition) } else { Cow::Owned(partition.coarse(most)) }
    }

    /// Makes room for `parts` parts and a partition of `nodes` nodes, for masks if `has_masks` or if there is room for them
    /// already, and for profiles and the sky's map. Adds new buffers to `new`.
    ///
    /// Fails with [`PlanError::Full`] and changes nothing if a buffer would be too large.
    pub(crate) fn reserve(
        &mut self,
        [parts, nodes]: [u32; 2],
        (has_masks, map_quads): (bool, MapQuads),
        growth: Growth,
        (ids, new): (&mut Ids, &mut Vec<NewBuffer>),
    ) -> Result<(), PlanError> {
        let (capacity, had_masks, had_quads) =
            self.buffers.as_ref().map_or_else(Default::default, |b| (b.capacity, b.places.masks != 0, b.map_quads));
        let is_full = parts > capacity.parts || nodes > capacity.nodes;
        if self.buffers.is_none() || is_full || has_masks && !had_masks || !had_quads.hold(map_quads) {
            let grown = |needed: u32, present: u32, first: u32| match needed > present {
                true if growth == Growth::Double => needed.max(present.saturating_mul(2)).max(first),
                true => needed,
                false => present,
            };
            let wanted = Capacity {
                parts: grown(parts, capacity.parts, FIRST_CAPACITY.parts),
                nodes: grown(nodes, capacity.nodes, FIRST_CAPACITY.nodes),
            };
            let has_masks = has_masks || had_masks;
            let mut make = |capacity: Capacity| {
                let mut buffers = Vec::new();
                let present = self.buffers.as_ref().filter(|present| present.capacity.nodes == capacity.nodes);
                let partition = present.map(|present| present.partition);
                let made =
                    TopBuffers::new(ids, &mut buffers, (capacity, partition), (has_masks, map_quads), self.limit)?;
                Ok((made, buffers))
            };
            let (made, buffers) = make(wanted).or_else(|_| make(Capacity { parts, nodes }))?;
            self.replacement = Some(made);
            new.extend(buffers);
        }
        if self.uniforms.is_none() {
            let uniforms = ids.uniform("top level passes", u64::from(MAX_PASSES * UNIFORM_ALIGNMENT));
            self.new_uniforms = Some(uniforms.id);
            new.push(uniforms);
        }
        Ok(())
    }

    /// Whether the frame brings another buffer of nodes.
    pub(crate) fn is_replaced(&self) -> bool {
        self.replacement.is_some()
    }

    /// Takes new buffers into use. Adds former ones, which no later command uses, to `freed`. In
    /// new buffers all nodes are zero, so that sampling finds no light before the first build.
    pub(crate) fn adopt(&mut self, commands: &mut Commands, freed: &mut Vec<BufferId>) {
        self.uniforms = self.new_uniforms.take().or(self.uniforms);
        let Some(new) = self.replacement.take() else { return };
        commands.zero(new.nodes, 0..new.nodes_bytes);
        self.passes.clear();
        let partition = new.partition;
        let old = self.buffers.replace(new);
        if old.as_ref().is_none_or(|old| old.partition != partition) {
            self.partition.lose();
        }
        freed.extend(old.iter().flat_map(TopBuffers::ids).filter(|id| *id != partition));
    }

    /// Drops what was reserved.
    pub(crate) fn undo(&mut self) {
        self.replacement = None;
        self.new_uniforms = None;
    }

    /// The device may lack what was written, so the next [`TopBuild::prepare`] sends all of it.
    pub(crate) fn lose(&mut self) {
        self.passes.clear();
        self.partition.lose();
        if let Some(buffers) = &mut self.buffers {
            buffers.sort.lose();
        }
    }

    /// Sets what the next builds read and store: `parts` parts, masks at
    /// this place of the nodes, 0 for none, places relative to the centre of the sector `home`, and the nodes of a
    /// partition. Sends what changed: 80 bytes for each pass, 112 for each divided node, and the roots of blocks.
    pub(crate) fn prepare(
        &mut self,
        commands: &mut Commands,
        (parts, partition): (u32, &Partition),
        (masks, home): (u32, [i32; 3]),
    ) {
        let (Some(buffers), Some(uniforms)) = (&mut self.buffers, self.uniforms) else { return };
        buffers.sort.set_count(commands, parts);
        self.partition.send(commands, (buffers.partition, buffers.capacity.nodes), partition);
        let SentPartition { stages, nodes, is_divided, .. } = &self.partition;
        let first = TopPass {
            count: parts,
            capacity: buffers.capacity.parts,
            parts: buffers.places.parts,
            nodes: *nodes,
            runs: buffers.capacity.nodes,
            is_divided: u32::from(*is_divided),
            masks,
            sort_block: SortBuffers::block_keys(parts),
            home,
            ..TopPass::default()
        };
        let roots = buffers.capacity.nodes * (size_of::<PlanesRecord>() / 4) as u32;
        let passes: Vec<TopPass> = std::iter::once(first)
            .chain(stages.iter().map(|stage| TopPass {
                blocks: roots + stage.first,
                block_count: stage.count,
                home: [0; 3],
                ..first
            }))
            .collect();
        for (pass, index) in passes.iter().zip(0..) {
            if self.passes.get(index as usize) != Some(pass) {
                commands.write(uniforms, u64::from(index * UNIFORM_ALIGNMENT), bytemuck::bytes_of(pass));
            }
        }
        self.passes = passes;
    }

    /// Adds the build from these buffers of parts, instances and trees. Adds nothing before the
    /// first [`TopBuild::prepare`].
    ///
    /// Takes 3 dispatches, 4 more for the sort, and one for each stage of divided nodes: 10 for a million parts.
    pub(crate) fn build(&self, commands: &mut Commands, [parts, instances, trees]: [BufferId; 3]) {
        let (Some(buffers), Some(uniforms), [first, stages @ ..]) = (&self.buffers, self.uniforms, &self.passes[..])
        else {
            return;
        };
        let TopBuffers { nodes, clusters, partition, units, sort, .. } = buffers;
        sort.clear(commands);
        let groups = first.count.div_ceil(LANES);
        commands.dispatch(LEAVES, &[uniforms, *clusters, *nodes, parts, instances, trees], 0, groups);
        let keys = [uniforms, *clusters, parts, *partition, sort.keys, sort.values, sort.histogram];
        commands.dispatch(KEYS, &keys, 0, groups);
        sort.sort_counted(commands);
        let cells = [uniforms, *clusters, *nodes, sort.keys, sort.values, parts, *units];
        commands.dispatch(CELLS, &cells, 0, first.nodes.div_ceil(NODE_LANES / WIDTH as u32));
        for (stage, index) in stages.iter().zip(1..) {
            let blocks = [uniforms, *clusters, *nodes, *partition, *units];
            commands.dispatch(BLOCKS, &blocks, index * UNIFORM_ALIGNMENT, stage.block_count);
        }
    }

    /// Where the parts begin in the buffer of the nodes, in units of 16 bytes.
    pub(crate) fn parts(&self) -> u32 {
        self.buffers.as_ref().map_or(0, |buffers| buffers.places.parts)
    }

    /// Where masks can be stored in the same buffer, in units of 16 bytes; 0 if there is no room.
    pub(crate) fn masks(&self) -> u32 {
        self.buffers.as_ref().map_or(0, |buffers| buffers.places.masks)
    }

    /// Where the map of the sky is stored in the same buffer, and the tables of profiles end, in units of 16 bytes.
    pub(crate) fn sky_map(&self) -> u32 {
        self.buffers.as_ref().map_or(0, |buffers| buffers.places.sky_map)
    }

    /// How many quads of profiles and of the sky's map there is room for.
    pub(crate) fn map_quads(&self) -> MapQuads {
        self.buffers.as_ref().map_or_else(MapQuads::default, |buffers| buffers.map_quads)
    }

    /// The nodes of the top level, the root first, then its parts, then room for masks, for profiles and for the sky.
    /// Panics before the first plan.
    pub(crate) fn nodes(&self) -> BufferId {
        self.buffers.as_ref().expect("the first plan has made the buffers").nodes
    }

    /// The clusters of all parts, then of all nodes.
    #[cfg(test)]
    pub(crate) fn clusters(&self) -> BufferId {
        self.buffers.as_ref().expect("the first plan has made the buffers").clusters
    }

    /// The number of nodes of a partition that there is room for, after which come runs.
    #[cfg(test)]
    pub(crate) fn first_run(&self) -> u32 {
        self.buffers.as_ref().map_or(0, |buffers| buffers.capacity.nodes)
    }

    /// The number of parts that there is room for.
    #[cfg(test)]
    pub(crate) fn capacity(&self) -> u32 {
        self.buffers.as_ref().map_or(0, |buffers| buffers.capacity.parts)
    }
}

#[cfg(test)]
mod tests;
