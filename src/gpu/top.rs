//! Builds the top level on the GPU from the instances and the parts of their trees. Nothing is read
//! back.
//!
//! Twin of `src/top`, which explains the tree, and of `LightWorld::parts`, which makes the
//! clusters of the parts; the tests compare both and also check the bounds on the GPU by
//! themselves.
//!
//! The build has these stages; `shaders/top_*.wgsl` are their sources.
//!
//! 1. The leaves: the cluster of each part, and the bounds of their means.
//! 2. The keys: the place of each part on a curve through space.
//! 3. The sort along the curve.
//! 4. Rounds of two stages each. The first divides the units into pieces of neighbours and forms
//!    groups within each piece. The second makes a node of each group.
//! 5. The upper part of the tree, again in two stages, once few units are left.
//!
//! Only the GPU knows how many units a round leaves, so the build records as many rounds as the
//! worst case needs, and the last rounds may find nothing to do. No workgroup waits for another:
//! the bounds are maxima, which do not depend on the order of the operations.

mod buffers;
mod plan;
mod stage;

use buffers::TopBuffers;
use plan::{MAX_GROUPS, MAX_PASSES, Places, Plan, TopPass};
use stage::{GROUP, KEYS, LANES, LEAVES, NODE, ROOT, ROOT_GROUP, Stage};

use super::error::GpuError;
use super::layout::{InstanceRecord, PartRecord, Strides, TreeRecord};
use super::memory;
use super::pool::Pool;
use super::recorder::Recorder;
use super::sort::RadixSort;
use super::stages::{Access, PASS_STRIDE, Stages, pass_bytes};
use crate::effects::Effects;

/// The largest number of stages that a build records: five, and two for each round.
pub(super) const MAX_STAGES: u32 = 5 + 2 * (MAX_PASSES - 1);

/// The pipelines and buffers of the top level.
#[derive(Debug)]
pub(crate) struct TopBuild {
    device: wgpu::Device,
    queue: wgpu::Queue,
    /// The layout of the first stage, which reads the records of the world.
    leaf_stages: Stages,
    /// The layout of all other stages.
    stages: Stages,
    leaves: wgpu::ComputePipeline,
    keys: wgpu::ComputePipeline,
    group: wgpu::ComputePipeline,
    node: wgpu::ComputePipeline,
    root_group: wgpu::ComputePipeline,
    root: wgpu::ComputePipeline,
    sort: RadixSort,
    passes: wgpu::Buffer,
    buffers: TopBuffers,
    /// The plan of the last build; `None` before the first build and after the buffers were
    /// replaced.
    plan: Option<Plan>,
    /// The strides with which the build reads instances and stores nodes.
    strides: Strides,
    /// Where it stores masks, in units of 16 bytes; 0 if it stores none.
    masks: u32,
    generation: u64,
    bound: Option<Bound>,
}

/// The bind groups of a build.
#[derive(Debug)]
struct Bound {
    /// The generations of the pools of parts, instances and trees.
    generations: [u64; 3],
    leaves: wgpu::BindGroup,
    others: wgpu::BindGroup,
}

impl TopBuild {
    /// Compiles the pipelines and makes room for 64 parts.
    pub(crate) fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Self, GpuError> {
        // Clusters, bounds and nodes; then parts, instances and trees for the leaves, and keys,
        // order and units for the other stages.
        let bytes = size_of::<TopPass>() as u64;
        let mut storage = [Access::Write; 6];
        let stages = Stages::new(device, "top level", bytes, &storage);
        storage[3..].fill(Access::Read);
        let leaf_stages = Stages::new(device, "top level leaves", bytes, &storage);
        let pipeline = |stage: &Stage| stages.pipeline(device, stage.entry, stage.text());
        let sort = RadixSort::new(device);
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let passes = memory::create_buffer(device, "top level passes", u64::from(MAX_PASSES * PASS_STRIDE), usage)?;
        let buffers = TopBuffers::new(device, &sort, 64, false)?;
        Ok(Self {
            device: device.clone(),
            queue: queue.clone(),
            leaves: leaf_stages.pipeline(device, LEAVES.entry, LEAVES.text()),
            keys: pipeline(&KEYS),
            group: pipeline(&GROUP),
            node: pipeline(&NODE),
            root_group: pipeline(&ROOT_GROUP),
            root: pipeline(&ROOT),
            leaf_stages,
            stages,
            sort,
            passes,
            buffers,
            plan: None,
            strides: Strides::of(Effects::all()),
            masks: 0,
            generation: 0,
            bound: None,
        })
    }

    /// Makes room for `parts` parts, or for twice as many as before if that is more, and for masks if
    /// `has_masks` or if there is room for them already.
    ///
    /// Fails and changes nothing: with [`GpuError::Full`] if the device cannot bind buffers for
    /// that many parts, with [`GpuError::OutOfMemory`] if it has no memory for them.
    pub(crate) fn reserve(&mut self, parts: u32, has_masks: bool) -> Result<(), GpuError> {
        let (capacity, had_masks) = (self.buffers.capacity, self.masks() != 0);
        if parts > capacity || has_masks && !had_masks {
            let new = |capacity| TopBuffers::new(&self.device, &self.sort, capacity, has_masks || had_masks);
            let more = if parts > capacity { parts.max(capacity.saturating_mul(2)) } else { capacity };
            self.buffers = new(more).or_else(|_| new(parts))?;
            self.generation += 1;
            self.bound = None;
            self.plan = None;
        }
        Ok(())
    }

    /// Sets the records to build from, which the build does not change. To be called after
    /// [`TopBuild::reserve`] and after a pool has replaced its buffer.
    pub(crate) fn bind(
        &mut self,
        parts: &Pool<PartRecord>,
        instances: &Pool<InstanceRecord>,
        trees: &Pool<TreeRecord>,
    ) {
        let generations = [parts.generation(), instances.generation(), trees.generation()];
        if self.bound.as_ref().is_some_and(|bound| bound.generations == generations) {
            return;
        }
        let TopBuffers { bounds, nodes, clusters, units, sort, .. } = &self.buffers;
        let records = [clusters, bounds, nodes, parts.buffer(), instances.buffer(), trees.buffer()];
        let work = [clusters, bounds, nodes, sort.keys(), sort.values(), units];
        self.bound = Some(Bound {
            generations,
            leaves: self.leaf_stages.bind(&self.device, &self.passes, &records),
            others: self.stages.bind(&self.device, &self.passes, &work),
        });
    }

    /// Records the build over the first `parts` parts. Records nothing before the first call of
    /// [`TopBuild::bind`]; until then all nodes are zero, so that sampling finds no light.
    ///
    /// Takes 4 dispatches, 12 more for the sort, and 2 for each round: 26 for 100,000 parts. Sends
    /// a few hundred bytes if the number of parts has changed since the last build, and none
    /// otherwise.
    pub(crate) fn record(&mut self, recorder: &mut Recorder<'_>, parts: u32) {
        if self.bound.is_none() {
            return;
        }
        self.set_count(parts);
        let (Some(bound), Some(plan)) = (&self.bound, &self.plan) else { return };
        recorder.clear(&self.buffers.bounds);
        let run = |recorder: &mut Recorder<'_>, group, pipeline, index: usize, workgroups: u32| {
            recorder.set_bind_group(0, group, &[index as u32 * PASS_STRIDE]);
            recorder.set_pipeline(pipeline);
            recorder.dispatch(workgroups);
        };
        recorder.stage("leaves");
        run(recorder, &bound.leaves, &self.leaves, 0, parts.div_ceil(LANES));
        let run = |recorder: &mut Recorder<'_>, pipeline, index, workgroups| {
            run(recorder, &bound.others, pipeline, index, workgroups);
        };
        recorder.stage("keys");
        run(recorder, &self.keys, 0, parts.div_ceil(LANES));
        recorder.stage("sort");
        self.sort.record(recorder, &self.buffers.sort);
        let root = plan.passes.len() - 1;
        for (index, round) in plan.passes[..root].iter().enumerate() {
            recorder.stage("groups");
            run(recorder, &self.group, index, round.pieces);
            recorder.stage("nodes");
            run(recorder, &self.node, index, (round.pieces * MAX_GROUPS).div_ceil(LANES));
        }
        recorder.stage("root groups");
        run(recorder, &self.root_group, root, 1);
        recorder.stage("root nodes");
        run(recorder, &self.root, root, 1);
    }

    /// Sends the plan if it changes.
    fn set_count(&mut self, count: u32) {
        self.buffers.sort.set_count(&self.queue, count);
        let is_same = |pass: &TopPass| (pass.count, pass.strides, pass.masks) == (count, self.strides, self.masks);
        if self.plan.as_ref().is_some_and(|plan| is_same(&plan.passes[0])) {
            return;
        }
        let places = Places { masks: self.masks, ..self.buffers.places };
        let plan = Plan::new(count, self.buffers.capacity, places, self.strides);
        self.queue.write_buffer(&self.passes, 0, &pass_bytes(&plan.passes));
        self.plan = Some(plan);
    }

    /// Sets the strides with which the next builds read instances and store nodes, and where they
    /// store masks: 0 or [`TopBuild::masks`].
    pub(crate) fn set_layout(&mut self, strides: Strides, masks: u32) {
        self.strides = strides;
        self.masks = masks;
    }

    /// Where the parts begin in the buffer of the nodes, in units of 16 bytes.
    pub(crate) fn parts(&self) -> u32 {
        self.buffers.places.parts
    }

    /// Where masks can be stored in the same buffer, in units of 16 bytes; 0 if there is no room.
    pub(crate) fn masks(&self) -> u32 {
        self.buffers.places.masks
    }

    /// The nodes of the top level, the root first, then its parts, then room for masks. The buffer is replaced when
    /// [`TopBuild::generation`] changes.
    pub(crate) fn nodes(&self) -> &wgpu::Buffer {
        &self.buffers.nodes
    }

    /// Changes whenever the buffer of the nodes is replaced and has to be bound again.
    pub(crate) fn generation(&self) -> u64 {
        self.generation
    }
}

#[cfg(test)]
mod tests;
