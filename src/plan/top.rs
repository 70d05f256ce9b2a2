//! Plans the build of the top level on the GPU from the instances and the parts of their trees. Nothing is read
//! back.
//!
//! Twin of `src/top`, which explains the tree, and of `LightWorld::parts`, which makes the
//! clusters of the parts; the tests compare both and also check the bounds on the GPU by
//! themselves.
//!
//! The build has these stages; `shaders/top_*.wgsl` are their sources.
//!
//! 1. The leaves: the cluster of each part, the bounds of their means, and a sample of them.
//! 2. The planes that divide space, as medians of a sample of the means.
//! 3. The keys: the place of each part in the order that the planes make, counted for the sort.
//! 4. The sort.
//! 5. Passes of two stages each. The first divides the units into pieces of neighbours, splits each
//!    piece and chooses the children of its nodes. The second packs these nodes. The last pass, once
//!    few units are left, makes the root.
//!
//! Only the GPU knows how many units a pass leaves, so the build records as many passes as the worst
//! case needs, and some may only hand their units on. No workgroup waits for another: the bounds are
//! maxima, which do not depend on the order of the operations.

mod buffers;
mod passes;
mod stage;

pub(crate) use buffers::MapQuads;
use buffers::{BOUNDS_BYTES, TopBuffers, most_parts};
use passes::{MAX_PASSES, Passes, Places, TopPass};
pub(super) use stage::NODE_LANES;
use stage::{LANES, Stage};

use super::buffers::{BufferId, Ids, NewBuffer};
use super::commands::{CommandSizes, Commands};
use super::error::PlanError;
use super::kernel::{Binding, Kernel, UNIFORM_ALIGNMENT, pass_bytes};
use super::layout::Strides;
use super::pool::Growth;

/// The largest number of stages of a build: four, and two for each pass.
#[cfg(feature = "gpu")]
pub(crate) const MAX_STAGES: u32 = 4 + 2 * MAX_PASSES;

/// Parts that the first buffers have room for.
const FIRST_CAPACITY: u32 = 64;

const UNIFORM: Binding = Binding::Uniform { bytes: size_of::<TopPass>() as u32 };

/// Clusters, bounds and nodes; parts, instances and trees.
const LEAF_BINDINGS: &[Binding] =
    &[UNIFORM, Binding::ReadWrite, Binding::ReadWrite, Binding::ReadWrite, Binding::Read, Binding::Read, Binding::Read];

/// Clusters and bounds.
const PLANE_BINDINGS: &[Binding] = &[UNIFORM, Binding::ReadWrite, Binding::ReadWrite];

/// Clusters and bounds; keys, order and the histogram of the sort.
const KEY_BINDINGS: &[Binding] =
    &[UNIFORM, Binding::ReadWrite, Binding::ReadWrite, Binding::ReadWrite, Binding::ReadWrite, Binding::ReadWrite];

/// Clusters, bounds and nodes; keys, order and units.
const BINDINGS: &[Binding] = &[
    UNIFORM,
    Binding::ReadWrite,
    Binding::ReadWrite,
    Binding::ReadWrite,
    Binding::ReadWrite,
    Binding::ReadWrite,
    Binding::ReadWrite,
];

const fn kernel(stage: &'static Stage, name: &'static str, text: fn() -> String) -> Kernel {
    Kernel::new(stage.entry, name, BINDINGS, text)
}

pub(super) const LEAVES: Kernel = Kernel::new(stage::LEAVES.entry, "leaves", LEAF_BINDINGS, || stage::LEAVES.text());
pub(super) const PLANES: Kernel = Kernel::new(stage::PLANES.entry, "planes", PLANE_BINDINGS, || stage::PLANES.text());
pub(super) const KEYS: Kernel = Kernel::new(stage::KEYS.entry, "keys", KEY_BINDINGS, || stage::KEYS.text());
pub(super) const GROUP: Kernel = kernel(&stage::GROUP, "groups", || stage::GROUP.text());
pub(super) const NODE: Kernel = kernel(&stage::NODE, "nodes", || stage::NODE.text());

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
    /// The passes of the last build; `None` before the first build and after the buffers were
    /// replaced.
    passes: Option<Passes>,
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
            passes: None,
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

    /// Makes room for `parts` parts, for masks if `has_masks` or if there is room for them
    /// already, and for profiles and the sky's map. Adds new buffers to `new`.
    ///
    /// Fails with [`PlanError::Full`] and changes nothing if a buffer would be too large.
    pub(crate) fn reserve(
        &mut self,
        parts: u32,
        (has_masks, map_quads): (bool, MapQuads),
        growth: Growth,
        (ids, new): (&mut Ids, &mut Vec<NewBuffer>),
    ) -> Result<(), PlanError> {
        let (capacity, had_masks, had_quads) =
            self.buffers.as_ref().map_or_else(Default::default, |b| (b.capacity, b.places.masks != 0, b.map_quads));
        if self.buffers.is_none() || parts > capacity || has_masks && !had_masks || !had_quads.hold(map_quads) {
            let wanted = match parts > capacity {
                true if growth == Growth::Double => parts.max(capacity.saturating_mul(2)).max(FIRST_CAPACITY),
                true => parts,
                false => capacity,
            };
            let has_masks = has_masks || had_masks;
            let mut make = |capacity| {
                let mut buffers = Vec::new();
                let made = TopBuffers::new(ids, &mut buffers, capacity, (has_masks, map_quads), self.limit)?;
                Ok((made, buffers))
            };
            let (made, buffers) = make(wanted).or_else(|_| make(parts))?;
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
        self.passes = None;
        if let Some(old) = self.buffers.replace(new) {
            freed.extend(old.ids());
        }
    }

    /// Drops what was reserved.
    pub(crate) fn undo(&mut self) {
        self.replacement = None;
        self.new_uniforms = None;
    }

    /// The device may lack what was written, so the next [`TopBuild::prepare`] sends all of it.
    pub(crate) fn lose(&mut self) {
        self.passes = None;
        if let Some(buffers) = &mut self.buffers {
            buffers.sort.lose();
        }
    }

    /// Sets what the next builds read and store: `parts` parts, records with these strides, masks at
    /// this place of the nodes, 0 for none, and places relative to the centre of the sector `home`.
    /// Sends 80 bytes if only `home` changes, and a few hundred if others of them change.
    pub(crate) fn prepare(
        &mut self,
        commands: &mut Commands,
        parts: u32,
        strides: Strides,
        (masks, home): (u32, [i32; 3]),
    ) {
        let (Some(buffers), Some(uniforms)) = (&mut self.buffers, self.uniforms) else { return };
        buffers.sort.set_count(commands, parts);
        let is_same = |pass: &TopPass| (pass.count, pass.strides, pass.masks) == (parts, strides, masks);
        if let Some(Passes { passes, .. }) = self.passes.as_mut().filter(|all| is_same(&all.passes[0])) {
            // Only the leaves are placed, by the first pass.
            if passes[0].home != home {
                passes[0].home = home;
                commands.write(uniforms, 0, bytemuck::bytes_of(&passes[0]));
            }
            return;
        }
        let places = Places { masks, ..buffers.places };
        let mut all = Passes::new(parts, buffers.capacity, places, strides);
        all.passes[0].home = home;
        commands.write(uniforms, 0, &pass_bytes(&all.passes, UNIFORM_ALIGNMENT));
        self.passes = Some(all);
    }

    /// Adds the build from these buffers of parts, instances and trees. Adds nothing before the
    /// first [`TopBuild::prepare`].
    ///
    /// Takes 3 dispatches, 4 more for the sort, and 2 for each pass: 13 for a million parts.
    pub(crate) fn build(&self, commands: &mut Commands, [parts, instances, trees]: [BufferId; 3]) {
        let (Some(buffers), Some(uniforms), Some(all)) = (&self.buffers, self.uniforms, &self.passes) else { return };
        let TopBuffers { bounds, nodes, clusters, units, sort, .. } = buffers;
        commands.zero(*bounds, 0..BOUNDS_BYTES);
        sort.clear(commands);
        let leaves = [uniforms, *clusters, *bounds, *nodes, parts, instances, trees];
        let work = [uniforms, *clusters, *bounds, *nodes, sort.keys, sort.values, *units];
        let groups = all.passes[0].count.div_ceil(LANES);
        commands.dispatch(LEAVES, &leaves, 0, groups);
        commands.dispatch(PLANES, &[uniforms, *clusters, *bounds], 0, 1);
        let keys = [uniforms, *clusters, *bounds, sort.keys, sort.values, sort.histogram];
        commands.dispatch(KEYS, &keys, 0, groups);
        sort.sort_counted(commands);
        for (pass, index) in all.passes.iter().zip(0..) {
            for kernel in [GROUP, NODE] {
                commands.dispatch(kernel, &work, index * UNIFORM_ALIGNMENT, pass.pieces.max(1));
            }
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

    /// The size of that buffer without the map of the sky.
    pub(crate) fn bytes_before_sky(&self) -> u64 {
        16 * u64::from(self.sky_map())
    }

    /// The clusters of all parts, then of all nodes.
    #[cfg(test)]
    pub(crate) fn clusters(&self) -> BufferId {
        self.buffers.as_ref().expect("the first plan has made the buffers").clusters
    }

    /// The number of parts that there is room for.
    #[cfg(test)]
    pub(crate) fn capacity(&self) -> u32 {
        self.buffers.as_ref().map_or(0, |buffers| buffers.capacity)
    }
}

#[cfg(test)]
mod tests;
