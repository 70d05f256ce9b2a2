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
use std::sync::Arc;

pub(crate) use buffers::MapQuads;
use buffers::{Capacity, TopBuffers, TopPass, most_nodes, most_parts};
use partition::{PlanesRecord, SentPartition};
pub(super) use stage::NODE_LANES;
use stage::{LANES, PACKING};

use super::buffers::BufferId;
use super::commands::Commands;
use super::draft::{Draft, Growth};
use super::error::PlanError;
use super::kernel::{Binding, Kernel, UNIFORM_ALIGNMENT};
use super::layout::ParamsRecord;
use super::sort::{HISTOGRAM, SortBuffers};
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

pub(super) const LEAVES: Kernel =
    Kernel::new("top_leaves", "leaves", LEAF_BINDINGS, |_| stage::text(&[shader!("top_leaves")]));
pub(super) const KEYS: Kernel =
    Kernel::new("top_keys", "keys", KEY_BINDINGS, |_| stage::text(&[HISTOGRAM, shader!("top_keys")]));
pub(super) const CELLS: Kernel = Kernel::new("top_cells", "cells", CELL_BINDINGS, |_| {
    stage::text(&[&PACKING[..], &[shader!("top_cells")]].concat())
});
pub(super) const BLOCKS: Kernel = Kernel::new("top_blocks", "blocks", BLOCK_BINDINGS, |_| {
    stage::text(&[&PACKING[..], &[shader!("top_blocks")]].concat())
});

/// The buffers of the top level, and what the next build makes of them.
#[derive(Clone, Debug)]
pub(crate) struct TopBuild {
    limit: u64,
    /// The most parts that fit beside some maps, once that was asked for.
    most_parts: Option<(MapQuads, u32)>,
    /// `None` before the first plan.
    buffers: Option<TopBuffers>,
    uniforms: Option<BufferId>,
    /// The passes as they were sent: of the first stages, then one for each stage of divided nodes.
    passes: Arc<[TopPass]>,
    partition: SentPartition,
    /// Something has changed since the last build.
    pub(super) is_due: bool,
}

impl TopBuild {
    /// No buffers yet. None will be larger than `limit` bytes.
    pub(crate) fn new(limit: u64) -> Self {
        Self {
            limit,
            most_parts: None,
            buffers: None,
            uniforms: None,
            passes: Arc::default(),
            partition: SentPartition::default(),
            is_due: true,
        }
    }

    /// The greatest number of parts that there can be room for, beside maps.
    pub(crate) fn most_parts(&mut self, maps: MapQuads) -> u32 {
        let maps = self.with_masks(maps);
        match self.most_parts {
            Some((of, most)) if of == maps => most,
            _ => self.most_parts.insert((maps, most_parts(maps, self.limit))).1,
        }
    }

    /// The partition as far as there can be room for its nodes beside `parts` parts and maps.
    pub(crate) fn fitting<'a>(&self, partition: &'a Partition, parts: u32, maps: MapQuads) -> Cow<'a, Partition> {
        let most = most_nodes(parts, self.with_masks(maps), self.limit) as usize;
        if partition.len() <= most { Cow::Borrowed(partition) } else { Cow::Owned(partition.coarse(most)) }
    }

    /// Room for masks is never given back.
    fn with_masks(&self, maps: MapQuads) -> MapQuads {
        MapQuads { has_masks: maps.has_masks || self.masks() != 0, ..maps }
    }

    /// Makes room for `parts` parts, a partition of `nodes` nodes and maps, in new buffers if need be. In these all
    /// nodes are zero, so that sampling finds no light before the first build.
    ///
    /// Fails with [`PlanError::Full`] if a buffer would be too large.
    pub(crate) fn reserve(
        &mut self,
        parts: u32,
        nodes: u32,
        maps: MapQuads,
        draft: &mut Draft,
    ) -> Result<(), PlanError> {
        let maps = self.with_masks(maps);
        self.uniforms
            .get_or_insert_with(|| draft.uniform("top level passes", u64::from(MAX_PASSES * UNIFORM_ALIGNMENT)));
        let (capacity, present) =
            self.buffers.as_ref().map_or_else(Default::default, |buffers| (buffers.capacity, buffers.map_quads));
        if self.buffers.is_some() && parts <= capacity.parts && nodes <= capacity.nodes && present.hold(maps) {
            return Ok(());
        }
        let grown = |needed: u32, present: u32, first: u32| match needed > present {
            true if draft.growth == Growth::Double => needed.max(present.saturating_mul(2)).max(first),
            true => needed,
            false => present,
        };
        let wanted = Capacity {
            parts: grown(parts, capacity.parts, FIRST_CAPACITY.parts),
            nodes: grown(nodes, capacity.nodes, FIRST_CAPACITY.nodes),
        };
        let least = Capacity { parts, nodes };
        let capacity = if TopBuffers::fit(wanted, maps, self.limit).is_ok() { wanted } else { least };
        TopBuffers::fit(capacity, maps, self.limit)?;
        let partition = self.buffers.as_ref().filter(|present| present.capacity.nodes == capacity.nodes);
        let new = TopBuffers::new(capacity, partition.map(|present| present.partition), maps, draft);
        draft.plan.upload.zero(new.nodes, 0..new.sizes.nodes);
        self.passes = Arc::default();
        let partition = new.partition;
        let former = self.buffers.replace(new);
        if former.as_ref().is_none_or(|former| former.partition != partition) {
            self.partition.lose();
        }
        draft.plan.freed.extend(former.iter().flat_map(TopBuffers::ids).filter(|id| *id != partition));
        Ok(())
    }

    /// The device may lack what was written, so the next [`TopBuild::prepare`] sends all of it.
    pub(crate) fn lose(&mut self) {
        self.passes = Arc::default();
        self.partition.lose();
        if let Some(buffers) = &mut self.buffers {
            buffers.sort.lose();
        }
    }

    /// Sets what the next builds read and store: `parts` parts, the nodes of a partition, and masks and home as the
    /// parameters of shaders say. Sends what changed: 80 bytes for each pass, 112 for each divided node, and the roots of blocks.
    pub(crate) fn prepare(
        &mut self,
        commands: &mut Commands,
        parts: u32,
        partition: &Partition,
        ParamsRecord { masks, home, .. }: ParamsRecord,
    ) {
        let (Some(buffers), Some(uniforms)) = (&mut self.buffers, self.uniforms) else { return };
        buffers.sort.set_count(commands, parts);
        self.partition.send(commands, buffers.partition, buffers.capacity.nodes, partition);
        let SentPartition { stages, nodes, is_divided, .. } = &self.partition;
        let first = TopPass {
            count: parts,
            capacity: buffers.capacity.parts,
            parts: (buffers.sizes.parts / 16) as u32,
            nodes: *nodes,
            runs: buffers.capacity.nodes,
            is_divided: u32::from(*is_divided),
            masks,
            sort_block: SortBuffers::block_keys(parts),
            home,
            ..TopPass::default()
        };
        let roots = buffers.capacity.nodes * (size_of::<PlanesRecord>() / 4) as u32;
        let passes: Arc<[TopPass]> = std::iter::once(first)
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
        self.buffers.as_ref().map_or(0, |buffers| (buffers.sizes.parts / 16) as u32)
    }

    /// Where masks can be stored in the same buffer, in units of 16 bytes; 0 if there is no room.
    pub(crate) fn masks(&self) -> u32 {
        let stored = self.buffers.as_ref().filter(|buffers| buffers.map_quads.has_masks);
        stored.map_or(0, |buffers| (buffers.sizes.masks / 16) as u32)
    }

    /// Where the map of the sky is stored in the same buffer, and the tables of profiles end, in units of 16 bytes.
    pub(crate) fn sky_map(&self) -> u32 {
        self.buffers.as_ref().map_or(0, |buffers| (buffers.sizes.sky_map / 16) as u32)
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
