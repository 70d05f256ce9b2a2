//! Builds the top level on the GPU, from instances and the roots of their trees. Nothing is read back.
//!
//! Twin of `src/top.rs` and of what `World` makes of an instance; the tests below compare both, and check the GPU's
//! bounds for themselves. Stages: leaves and their bounds, keys, sort, children of the lowest nodes, then one
//! dispatch a level. The
//! sources are `shaders/top_*.wgsl`. Nothing waits for another workgroup: bounds are maxima, which commute.

use std::fmt::Write;

use super::error::{GpuError, largest_storage_buffer};
use super::layout::{ClusterRecord, InstanceRecord, TreeRecord};
use super::pool::Pool;
use super::recorder::Recorder;
use super::sort::{RadixSort, SortBuffers};
use super::stages::{Access, PASS_STRIDE, Stages, pass_bytes};
use super::stored::Strides;
use super::text::variant;
use crate::bounds;
use crate::cluster;
use crate::cone;
use crate::curve;
use crate::effects::Effects;
use crate::top::level_starts;
use crate::tree::{Node, WIDTH};

/// Invocations in a workgroup. Half of what WebGPU allows: merging clusters takes many registers.
const LANES: u32 = 128;

/// No tree over 31-bit slots is higher.
const MOST_LEVELS: u32 = 31u32.div_ceil(WIDTH.ilog2());

/// Least and greatest coordinates.
const BOUNDS_BYTES: u64 = 24;

/// Twin of `TopPass` in `shaders/top_types.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct TopPass {
    slots: u32,
    first: u32,
    count: u32,
    first_above: u32,
    count_above: u32,
    strides: Strides,
    padding: [u32; 2],
}

/// The pipelines and buffers of the top level.
pub(crate) struct TopBuild {
    device: wgpu::Device,
    queue: wgpu::Queue,
    stages: Stages,
    leaves: wgpu::ComputePipeline,
    keys: wgpu::ComputePipeline,
    place: wgpu::ComputePipeline,
    level: wgpu::ComputePipeline,
    sort: RadixSort,
    passes: wgpu::Buffer,
    buffers: TopBuffers,
    /// The lowest first; none before the first build.
    levels: Vec<TopPass>,
    /// How nodes are to be stored and instances are.
    strides: Strides,
    generation: u64,
    /// With the generations of the instances and trees that it was made for.
    bound: Option<([u64; 2], wgpu::BindGroup)>,
}

/// What grows with the number of slots.
struct TopBuffers {
    capacity: u32,
    leaves: wgpu::Buffer,
    bounds: wgpu::Buffer,
    nodes: wgpu::Buffer,
    /// Of every node's children.
    clusters: wgpu::Buffer,
    sort: SortBuffers,
}

impl TopBuild {
    /// Pipelines, and room for a few slots.
    pub(crate) fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Self, GpuError> {
        // Instances, trees, leaves, bounds, keys, slots, nodes, clusters: as many as WebGPU grants a stage.
        let mut storage = [Access::Write; 8];
        storage[1] = Access::Read;
        let stages = Stages::new(device, "top level", size_of::<TopPass>() as u64, &storage);
        let pipeline = |stage: &Stage| stages.pipeline(device, stage.entry, stage.text());
        let sort = RadixSort::new(device);
        let passes = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("top level passes"),
            size: u64::from(MOST_LEVELS * PASS_STRIDE),
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let buffers = TopBuffers::new(device, &sort, 64)?;
        Ok(Self {
            device: device.clone(),
            queue: queue.clone(),
            leaves: pipeline(&LEAVES),
            keys: pipeline(&KEYS),
            place: pipeline(&PLACE),
            level: pipeline(&LEVEL),
            stages,
            sort,
            passes,
            buffers,
            levels: Vec::new(),
            strides: Strides::of(Effects::all()),
            generation: 0,
            bound: None,
        })
    }

    /// Makes room for so many instance slots.
    ///
    /// Fails with [`GpuError::Full`] and changes nothing where the device cannot bind as many.
    pub(crate) fn reserve(&mut self, slots: u32) -> Result<(), GpuError> {
        if slots > self.buffers.capacity {
            let roomy = slots.max(self.buffers.capacity.saturating_mul(2));
            self.buffers = TopBuffers::new(&self.device, &self.sort, roomy)
                .or_else(|_| TopBuffers::new(&self.device, &self.sort, slots))?;
            self.generation += 1;
            self.bound = None;
        }
        Ok(())
    }

    /// Names the records to build from, both by slot. The build writes the instances' `top_place`. To be called after
    /// [`TopBuild::reserve`] and whenever a pool grew.
    pub(crate) fn bind(&mut self, instances: &Pool<InstanceRecord>, trees: &Pool<TreeRecord>) {
        let generations = [instances.generation(), trees.generation()];
        if self.bound.as_ref().is_some_and(|(bound, _)| *bound == generations) {
            return;
        }
        let TopBuffers { leaves, bounds, nodes, clusters, sort, .. } = &self.buffers;
        let storage = [instances.buffer(), trees.buffer(), leaves, bounds, sort.keys(), sort.values(), nodes, clusters];
        self.bound = Some((generations, self.stages.bind(&self.device, &self.passes, &storage)));
    }

    /// Records the build over the first `slots` slots; nothing before the first [`TopBuild::bind`], when all nodes are
    /// zero, which is no light.
    ///
    /// 3 dispatches, 12 more for the sort, and one a level of eight. Sends a few hundred bytes if the number of slots
    /// is another than in the last build, else none.
    pub(crate) fn record(&mut self, recorder: &mut Recorder<'_>, slots: u32) {
        if self.bound.is_none() {
            return;
        }
        self.set_slots(slots);
        let Some((_, group)) = &self.bound else { return };
        recorder.clear(&self.buffers.bounds);
        let run = |recorder: &mut Recorder<'_>, pipeline, level: usize, invocations: u32| {
            recorder.set_bind_group(0, group, &[level as u32 * PASS_STRIDE]);
            recorder.set_pipeline(pipeline);
            recorder.dispatch(invocations.div_ceil(LANES));
        };
        recorder.stage("leaves");
        run(recorder, &self.leaves, 0, slots);
        recorder.stage("keys");
        run(recorder, &self.keys, 0, slots);
        recorder.stage("sort");
        self.sort.record(recorder, &self.buffers.sort);
        recorder.stage("place");
        run(recorder, &self.place, 0, self.levels[0].count * WIDTH as u32);
        recorder.stage("levels");
        for (index, level) in self.levels.iter().enumerate() {
            run(recorder, &self.level, index, (level.count_above * WIDTH as u32).max(level.count));
        }
    }

    fn set_slots(&mut self, slots: u32) {
        self.buffers.sort.set_count(&self.queue, slots);
        if self.levels.first().is_some_and(|level| (level.slots, level.strides) == (slots, self.strides)) {
            return;
        }
        let starts = level_starts(slots as usize);
        let level = |index: usize| (starts[index], starts[index + 1] - starts[index]);
        self.levels.clear();
        self.levels.extend((0..starts.len() - 1).rev().map(|index| {
            let (first, count) = level(index);
            let (first_above, count_above) = index.checked_sub(1).map_or((0, 0), level);
            TopPass { slots, first, count, first_above, count_above, strides: self.strides, padding: [0; 2] }
        }));
        self.queue.write_buffer(&self.passes, 0, &pass_bytes(&self.levels));
    }

    /// Reads instances and stores nodes in these strides from the next build on.
    pub(crate) fn set_strides(&mut self, strides: Strides) {
        self.strides = strides;
    }

    /// The top level's nodes, the root first; another object after each change of [`TopBuild::generation`].
    pub(crate) fn nodes(&self) -> &wgpu::Buffer {
        &self.buffers.nodes
    }

    /// Changes when the nodes' buffer is replaced, so that whoever bound the old one binds again.
    pub(crate) fn generation(&self) -> u64 {
        self.generation
    }
}

impl TopBuffers {
    fn new(device: &wgpu::Device, sort: &RadixSort, capacity: u32) -> Result<Self, GpuError> {
        let limit = largest_storage_buffer(device);
        let starts = level_starts(capacity as usize);
        let nodes = u64::from(starts[starts.len() - 1]) * size_of::<Node>() as u64;
        let clusters = u64::from(starts[starts.len() - 1]) * (WIDTH * size_of::<ClusterRecord>()) as u64;
        let leaves = u64::from(capacity.max(1)) * size_of::<ClusterRecord>() as u64;
        for (what, needed) in
            [("top-level clusters", clusters), ("top-level nodes", nodes), ("instances' clusters", leaves)]
        {
            if needed > limit {
                return Err(GpuError::Full { what, needed, limit });
            }
        }
        let buffer = |label, size| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        Ok(Self {
            capacity,
            sort: SortBuffers::new(device, sort, capacity)?,
            leaves: buffer("top level leaves", leaves),
            bounds: buffer("top level bounds", BOUNDS_BYTES),
            nodes: buffer("top level nodes", nodes),
            clusters: buffer("top level clusters", clusters),
        })
    }
}

/// A stage's name and its own file.
struct Stage {
    entry: &'static str,
    source: &'static str,
    stores_nodes: bool,
}

const LEAVES: Stage =
    Stage { entry: "top_leaves", source: include_str!("../../shaders/top_leaves.wgsl"), stores_nodes: false };
const KEYS: Stage =
    Stage { entry: "top_keys", source: include_str!("../../shaders/top_keys.wgsl"), stores_nodes: false };
const PLACE: Stage =
    Stage { entry: "top_place", source: include_str!("../../shaders/top_place.wgsl"), stores_nodes: true };
const LEVEL: Stage =
    Stage { entry: "top_level", source: include_str!("../../shaders/top_level.wgsl"), stores_nodes: true };

impl Stage {
    /// The whole text: Rust's constants, records, pure functions, the stage.
    fn text(&self) -> String {
        let mut text = super::text::constants();
        for (name, value) in [("LANES", LANES), ("KEY_BITS", curve::KEY_BITS), ("NO_KEY", curve::NO_KEY)] {
            let _ = writeln!(text, "const TOP_{name}: u32 = {value}u;");
        }
        for (name, value) in [
            ("CAP_PADDING", cone::CAP_PADDING),
            ("LEAST_AXIS", cluster::LEAST_AXIS),
            ("TRANSFORM_PADDING", bounds::TRANSFORM_PADDING),
        ] {
            let _ = writeln!(text, "const {name}: f32 = {value:e};");
        }
        for part in [
            include_str!("../../shaders/types.wgsl"),
            include_str!("../../shaders/instance.wgsl"),
            include_str!("../../shaders/node.wgsl"),
            include_str!("../../shaders/top_types.wgsl"),
            include_str!("../../shaders/cluster.wgsl"),
            self.source,
        ] {
            text += part;
        }
        if self.stores_nodes {
            text += include_str!("../../shaders/top_nodes.wgsl");
        }
        variant(&text, Effects::all(), false)
    }
}

#[cfg(test)]
mod tests;
