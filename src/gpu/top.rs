//! Builds the top level on the GPU, from instances and the roots of their trees. Nothing is read back.
//!
//! Twin of `src/top`, which explains the tree, and of what `LightWorld` makes of an instance; the tests below compare both,
//! and check the GPU's bounds for themselves. Stages: leaves and their bounds, keys, sort; then rounds of two, that
//! group units by pieces and make the groups nodes; then the upper part. How many units a round leaves is known on the
//! GPU alone, so there are as many rounds as the worst case takes, and the last may find nothing to do. The sources are
//! `shaders/top_*.wgsl`. Nothing waits for another workgroup: bounds are maxima, which commute.

use std::fmt::Write;

use super::error::{GpuError, largest_storage_buffer};
use super::layout::{ClusterRecord, InstanceRecord, TreeRecord};
use super::memory;
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
use crate::top;
use crate::tree;
use crate::tree::Node;

/// Invocations in a workgroup. Half of what WebGPU allows: merging clusters takes many registers.
const LANES: u32 = 128;

/// Invocations that split a piece.
const SPLIT_LANES: u32 = 256;

/// Units that a piece leaves at most.
const LEFT: u32 = top::most_units(top::PIECE) as u32;

/// Parts of the upper part of the tree: every split makes two of one.
const ROOT_PARTS: u32 = 2 * top::ROOT_UNITS as u32 - 1;

/// [`TopPass::units_before`] of the first round: instances in the curve's order.
const SORTED: u32 = u32::MAX;

/// Each round leaves hardly more than a quarter of 31-bit slots.
const MAX_ROUNDS: u32 = 16;

/// Least and greatest coordinates, the number of instances that shine, and one word more.
const BOUNDS_BYTES: u64 = 32;

/// Twin of `TopPass` in `shaders/top_types.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct TopPass {
    slots: u32,
    capacity: u32,
    units_before: u32,
    pieces_before: u32,
    units_after: u32,
    pieces: u32,
    first_node: u32,
    strides: Strides,
}

/// The rounds for so many slots, and the upper part as the last.
#[derive(Clone, Debug, PartialEq)]
struct Plan {
    passes: Vec<TopPass>,
    /// Nodes that there may be.
    nodes: u32,
    /// Words of unit lists.
    words: u32,
}

impl Plan {
    fn new(slots: u32, capacity: u32, strides: Strides) -> Self {
        let mut pass = TopPass { slots, capacity, units_before: SORTED, strides, ..TopPass::default() };
        let mut plan = Self { passes: Vec::new(), nodes: ROOT_PARTS + 1, words: 0 };
        let mut units = slots;
        while units > top::ROOT_UNITS as u32 {
            pass.pieces = units.div_ceil(top::SHARE as u32);
            pass.units_after = plan.words;
            pass.first_node = plan.nodes;
            plan.words += pass.pieces + (pass.pieces * LEFT).max(top::ROOT_UNITS as u32);
            plan.nodes += pass.pieces * LEFT;
            plan.passes.push(pass);
            // A quarter of every piece, rounded up.
            units = (units / 4 + pass.pieces).min(pass.pieces * LEFT);
            (pass.units_before, pass.pieces_before) = (pass.units_after, pass.pieces);
        }
        plan.passes.push(TopPass { units_after: plan.words, pieces: 0, first_node: 0, ..pass });
        plan.words += ROOT_PARTS;
        plan
    }
}

/// The pipelines and buffers of the top level.
pub(crate) struct TopBuild {
    device: wgpu::Device,
    queue: wgpu::Queue,
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
    /// Of the last build; none before the first.
    plan: Option<Plan>,
    /// How nodes are to be stored and instances are.
    strides: Strides,
    generation: u64,
    /// With the generations of the instances and trees that it was made for.
    bound: Option<([u64; 2], wgpu::BindGroup)>,
}

/// What grows with the number of slots.
struct TopBuffers {
    capacity: u32,
    bounds: wgpu::Buffer,
    nodes: wgpu::Buffer,
    /// Of all slots, then of all nodes.
    clusters: wgpu::Buffer,
    /// Lists of units that rounds leave.
    units: wgpu::Buffer,
    sort: SortBuffers,
}

impl TopBuild {
    /// Pipelines, and room for a few slots.
    pub(crate) fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Self, GpuError> {
        // Instances, trees, clusters, bounds, keys, slots, nodes, units: as many as WebGPU grants a stage.
        let mut storage = [Access::Write; 8];
        storage[1] = Access::Read;
        let stages = Stages::new(device, "top level", size_of::<TopPass>() as u64, &storage);
        let pipeline = |stage: &Stage| stages.pipeline(device, stage.entry, stage.text());
        let sort = RadixSort::new(device);
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let passes = memory::create_buffer(device, "top level passes", u64::from(MAX_ROUNDS * PASS_STRIDE), usage)?;
        let buffers = TopBuffers::new(device, &sort, 64)?;
        Ok(Self {
            device: device.clone(),
            queue: queue.clone(),
            leaves: pipeline(&LEAVES),
            keys: pipeline(&KEYS),
            group: pipeline(&GROUP),
            node: pipeline(&NODE),
            root_group: pipeline(&ROOT_GROUP),
            root: pipeline(&ROOT),
            stages,
            sort,
            passes,
            buffers,
            plan: None,
            strides: Strides::of(Effects::all()),
            generation: 0,
            bound: None,
        })
    }

    /// Makes room for so many instance slots.
    ///
    /// Fails and changes nothing: with [`GpuError::Full`] where the device cannot bind as many, with
    /// [`GpuError::OutOfMemory`] where it has no room for them.
    pub(crate) fn reserve(&mut self, slots: u32) -> Result<(), GpuError> {
        if slots > self.buffers.capacity {
            let roomy = slots.max(self.buffers.capacity.saturating_mul(2));
            self.buffers = TopBuffers::new(&self.device, &self.sort, roomy)
                .or_else(|_| TopBuffers::new(&self.device, &self.sort, slots))?;
            self.generation += 1;
            self.bound = None;
            self.plan = None;
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
        let TopBuffers { bounds, nodes, clusters, units, sort, .. } = &self.buffers;
        let storage = [instances.buffer(), trees.buffer(), clusters, bounds, sort.keys(), sort.values(), nodes, units];
        self.bound = Some((generations, self.stages.bind(&self.device, &self.passes, &storage)));
    }

    /// Records the build over the first `slots` slots; nothing before the first [`TopBuild::bind`], when all nodes are
    /// zero, which is no light.
    ///
    /// 4 dispatches, 12 more for the sort, and two a round: 26 for 100,000 slots. Sends a few hundred bytes if the
    /// number of slots is another than in the last build, else none.
    pub(crate) fn record(&mut self, recorder: &mut Recorder<'_>, slots: u32) {
        if self.bound.is_none() {
            return;
        }
        self.set_slots(slots);
        let (Some((_, group)), Some(plan)) = (&self.bound, &self.plan) else { return };
        recorder.clear(&self.buffers.bounds);
        let run = |recorder: &mut Recorder<'_>, pipeline, index: usize, workgroups: u32| {
            recorder.set_bind_group(0, group, &[index as u32 * PASS_STRIDE]);
            recorder.set_pipeline(pipeline);
            recorder.dispatch(workgroups);
        };
        recorder.stage("leaves");
        run(recorder, &self.leaves, 0, slots.div_ceil(LANES));
        recorder.stage("keys");
        run(recorder, &self.keys, 0, slots.div_ceil(LANES));
        recorder.stage("sort");
        self.sort.record(recorder, &self.buffers.sort);
        let root = plan.passes.len() - 1;
        for (index, round) in plan.passes[..root].iter().enumerate() {
            recorder.stage("groups");
            run(recorder, &self.group, index, round.pieces);
            recorder.stage("nodes");
            run(recorder, &self.node, index, (round.pieces * LEFT).div_ceil(LANES));
        }
        recorder.stage("root groups");
        run(recorder, &self.root_group, root, 1);
        recorder.stage("root nodes");
        run(recorder, &self.root, root, 1);
    }

    fn set_slots(&mut self, slots: u32) {
        self.buffers.sort.set_count(&self.queue, slots);
        // Another capacity has taken the plan away.
        if self
            .plan
            .as_ref()
            .is_some_and(|plan| (plan.passes[0].slots, plan.passes[0].strides) == (slots, self.strides))
        {
            return;
        }
        let plan = Plan::new(slots, self.buffers.capacity, self.strides);
        self.queue.write_buffer(&self.passes, 0, &pass_bytes(&plan.passes));
        self.plan = Some(plan);
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
        let plan = Plan::new(capacity, capacity, Strides::of(Effects::all()));
        let nodes = u64::from(plan.nodes) * size_of::<Node>() as u64;
        let clusters = u64::from(capacity + plan.nodes) * size_of::<ClusterRecord>() as u64;
        let units = u64::from(plan.words) * 4;
        for (what, needed) in [("top-level clusters", clusters), ("top-level nodes", nodes)] {
            if needed > limit {
                return Err(GpuError::Full { what, needed, limit });
            }
        }
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let buffer = |what, bytes| memory::create_buffer(device, what, bytes, usage);
        Ok(Self {
            capacity,
            sort: SortBuffers::new(device, sort, capacity)?,
            bounds: buffer("top level bounds", BOUNDS_BYTES)?,
            nodes: buffer("top level nodes", nodes)?,
            clusters: buffer("top level clusters", clusters)?,
            units: buffer("top level units", units)?,
        })
    }
}

/// A stage's name, the most units that its workgroups split, and its own files.
struct Stage {
    entry: &'static str,
    piece: usize,
    sources: &'static [&'static str],
}

macro_rules! shader {
    ($name:literal) => {
        include_str!(concat!("../../shaders/", $name, ".wgsl"))
    };
}

const LEAVES: Stage = Stage { entry: "top_leaves", piece: 0, sources: &[shader!("top_leaves")] };
const KEYS: Stage = Stage { entry: "top_keys", piece: 0, sources: &[shader!("top_curve"), shader!("top_keys")] };
const GROUP: Stage = Stage {
    entry: "top_group",
    piece: top::PIECE,
    sources: &[
        shader!("top_curve"),
        shader!("top_split"),
        shader!("top_gather"),
        shader!("top_nodes"),
        shader!("top_group"),
    ],
};
const NODE: Stage =
    Stage { entry: "top_node", piece: 0, sources: &[shader!("top_nodes"), shader!("top_make"), shader!("top_node")] };
const ROOT_GROUP: Stage = Stage {
    entry: "top_root_group",
    piece: top::ROOT_UNITS,
    sources: &[shader!("top_split"), shader!("top_gather"), shader!("top_nodes"), shader!("top_root_group")],
};
const ROOT: Stage =
    Stage { entry: "top_root", piece: 0, sources: &[shader!("top_nodes"), shader!("top_make"), shader!("top_root")] };

impl Stage {
    /// The whole text: Rust's constants, records, pure functions, the stage.
    fn text(&self) -> String {
        let mut text = super::text::constants();
        for (name, value) in [
            ("LANES", LANES),
            ("KEY_BITS", curve::KEY_BITS),
            ("NO_KEY", curve::NO_KEY),
            ("SPLIT_LANES", SPLIT_LANES),
            ("PIECE", self.piece as u32),
            ("LEFT", LEFT),
            ("SHARE", top::SHARE as u32),
            ("WINDOW", top::WINDOW as u32),
            ("SORTED", SORTED),
            ("ROOT_UNITS", top::ROOT_UNITS as u32),
            ("ROOT_PARTS", ROOT_PARTS),
            ("CUTS", top::CUTS as u32),
            ("CUT_BITS", top::CUT_BITS),
            ("COST_SLACK", top::COST_SLACK),
            ("ROUNDS", top::ROUNDS as u32),
            ("LAST_CELL", top::LAST_CELL),
            ("SPARSE_COUNTS", tree::SPARSE_COUNTS),
            ("FULL", tree::FULL as u32),
        ] {
            let _ = writeln!(text, "const TOP_{name}: u32 = {value}u;");
        }
        for (name, value) in [
            ("TOP_AXIS_STEPS", top::AXIS_STEPS),
            ("TOP_MIN_ORIENTATION", tree::MIN_ORIENTATION),
            ("TOP_DIAGONAL_WEIGHT", tree::DIAGONAL_WEIGHT),
            ("CAP_PADDING", cone::CAP_PADDING),
            ("MIN_AXIS", cluster::MIN_AXIS),
            ("TRANSFORM_PADDING", bounds::TRANSFORM_PADDING),
        ] {
            let _ = writeln!(text, "const {name}: f32 = {value:e};");
        }
        for part in [shader!("types"), shader!("instance"), shader!("node"), shader!("top_types"), shader!("cluster")] {
            text += part;
        }
        text += &self.sources.concat();
        variant(&text, Effects::all(), false)
    }
}

#[cfg(test)]
mod tests;
