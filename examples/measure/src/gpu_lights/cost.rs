//! What a refit on the GPU costs: dispatches, bytes and time, and what a frame costs the CPU.

use super::kernel::{Put, Writer, puts, refused};
use super::motion::dancer;
use girandole::glam::DVec3;
use girandole::gpu::GpuLights;
use girandole::gpu::measure::{MAX_TOP_STAGES, build_top_timed};
use girandole::plan::{Command, LightPlanner, PlanLimits};
use girandole::{FrameBudget, Light, LightTree, LightWorld, Placement, Policy, TreeSource};
use std::time::{Duration, Instant};
use testbed::common::gpu;
use testbed::scene::SceneError;

/// How much is measured.
#[derive(Clone, Copy)]
pub struct Effort {
    pub trees: u32,
    pub lights: usize,
    pub frames: usize,
}

impl Effort {
    pub const FULL: Self = Self { trees: 1_000, lights: 1_000, frames: 15 };
    pub const QUICK: Self = Self { trees: 8, lights: 60, frames: 3 };

    /// As many trees, of few lights: a refit takes little time, and the caches of the CPU keep what they had.
    pub fn with_small_trees(self) -> Self {
        Self { lights: 20, frames: 5 * self.frames, ..self }
    }
}

/// The row of the table.
pub struct Row {
    pub trees: u32,
    pub lights: usize,
    pub dispatches: usize,
    /// Bytes that the refit reads and writes, by those of a copy of the lights.
    pub bytes_per_copy: f64,
    pub refit_ms: f64,
    pub copy_ms: f64,
    /// What a frame takes on the CPU: the measures, an update and an upload. It does not depend on how many
    /// lights a tree has, but on caches.
    pub cpu_us: f64,
}

/// Bytes that a refit reads and writes for each light, node, piece and tree: the records in `shaders/`.
mod bytes {
    /// A light is read.
    pub const LIGHT: u64 = 64;
    /// Of a node, all is written but what the children are and what the parent is; the steps, the children and
    /// its entry in the list of the piece are read.
    pub const NODE: u64 = (224 - 32 - 12) + (4 + 32 + 8);
    /// The cluster of a piece is written, and read by the piece above; the record of its source is read.
    pub const PIECE: u64 = 96 + 96 + 96;
    /// The record of the tree and its measure are written.
    pub const TREE: u64 = 80 + 32;
}

fn world_of(effort: Effort) -> Result<(LightWorld, Vec<Vec<Light>>), SceneError> {
    let mut world = LightWorld::new();
    let mut all = Vec::new();
    for index in 0..effort.trees {
        let lights = dancer(index % 16, effort.lights, 7 * (index / 16));
        let tree = world.add_tree(LightTree::new(lights.clone())?);
        let at = DVec3::new(f64::from(index % 40), 0.0, f64::from(index / 40)) * 3.0;
        world.add_instance(tree, Placement::at(at), Policy::Budgeted)?;
        world.set_light_source(tree, TreeSource::GpuMesh)?;
        all.push(lights);
    }
    world.update(FrameBudget::NONE);
    Ok((world, all))
}

/// The dispatches of the refit, and the workgroups of those that refit pieces.
fn planned(world: &LightWorld) -> Result<(usize, u64), SceneError> {
    let mut planner = LightPlanner::new(PlanLimits::default());
    let plan = planner.reserve(world).map_err(|error| SceneError(error.to_string()))?.plan();
    let (mut dispatches, mut pieces) = (0, 0);
    for command in plan.top.iter() {
        if let Command::Dispatch { kernel, workgroups: [x, y, _], .. } = command
            && kernel.stage() == "refit"
        {
            dispatches += 1;
            pieces += if kernel.entry() == "refit" { u64::from(x) * u64::from(y) } else { 0 };
        }
    }
    Ok((dispatches, pieces))
}

/// The median of the seconds of some repetitions.
fn median(mut seconds: Vec<f64>) -> f64 {
    seconds.sort_by(f64::total_cmp);
    seconds[seconds.len() / 2]
}

/// Measures the cost of trees that kernels deform.
pub fn measure(device: &wgpu::Device, queue: &wgpu::Queue, effort: Effort) -> Result<Row, SceneError> {
    let (mut world, present) = world_of(effort)?;
    let (dispatches, pieces) = planned(&world)?;
    let count = present.iter().map(Vec::len).sum::<usize>();
    let nodes: usize = world.trees().filter_map(|key| world.tree(key)).map(|tree| tree.nodes().len()).sum();
    let read_and_written = bytes::LIGHT * count as u64
        + bytes::NODE * nodes as u64
        + bytes::PIECE * pieces
        + bytes::TREE * u64::from(effort.trees);
    let bytes_per_copy = read_and_written as f64 / (2 * bytes::LIGHT * count as u64) as f64;

    let mut lights = GpuLights::new(device, queue).map_err(refused)?;
    let writer = Writer::new(device, &lights);
    let keys: Vec<_> = world.trees().collect();
    let all: Vec<Put> = keys.iter().zip(&present).flat_map(|(key, lights)| puts(&world, *key, lights)).collect();
    let submit = |record: &mut dyn FnMut(&mut wgpu::CommandEncoder)| -> Result<f64, SceneError> {
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        record(&mut encoder);
        let start = Instant::now();
        queue.submit([encoder.finish()]);
        gpu::wait(device).map_err(SceneError)?;
        Ok(start.elapsed().as_secs_f64())
    };
    let stamps = Stamps::new(device);
    let (mut cpu, mut refits) = (Vec::new(), Vec::new());
    for frame in 0..effort.frames + 1 {
        // Lets the threads of a software GPU come to rest.
        std::thread::sleep(Duration::from_millis(5));
        let start = Instant::now();
        lights.follow_sources(&mut world);
        world.update(FrameBudget::new(Duration::from_micros(300)));
        lights.upload(&world).map_err(refused)?;
        let took = start.elapsed().as_secs_f64();
        if frame == 0 {
            submit(&mut |encoder| writer.record(encoder, &mut lights, &all))?;
        }
        submit(&mut |encoder| lights.build_top(encoder))?;
        // The same build again, stage by stage, of which the first is the refit.
        submit(&mut |encoder| {
            build_top_timed(&mut lights, encoder, Some(&stamps.set));
            stamps.resolve(encoder);
        })?;
        if frame > 0 {
            cpu.push(took);
            refits.push(stamps.seconds(device, queue)?);
        }
    }
    let from = lights_buffer(device, count, wgpu::BufferUsages::COPY_SRC);
    let to = lights_buffer(device, count, wgpu::BufferUsages::COPY_DST);
    let copy = |_| submit(&mut |encoder| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, from.size()));
    let copies: Vec<f64> = (0..effort.frames).map(copy).collect::<Result<_, _>>()?;
    Ok(Row {
        trees: effort.trees,
        lights: count,
        dispatches,
        bytes_per_copy,
        refit_ms: 1000.0 * median(refits),
        copy_ms: 1000.0 * median(copies),
        cpu_us: 1.0e6 * median(cpu),
    })
}

/// The timestamps of the stages of a build.
struct Stamps {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
}

impl Stamps {
    fn new(device: &wgpu::Device) -> Self {
        let set = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: None,
            ty: wgpu::QueryType::Timestamp,
            count: 2 * MAX_TOP_STAGES,
        });
        let resolved = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 2 * u64::from(wgpu::QUERY_SIZE),
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Self { set, resolved }
    }

    /// Records that the two of the first stage are stored.
    fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.set, 0..2, &self.resolved, 0);
    }

    /// The seconds of the first stage.
    fn seconds(&self, device: &wgpu::Device, queue: &wgpu::Queue) -> Result<f64, SceneError> {
        let ticks: Vec<u64> = gpu::read(device, queue, &self.resolved).map_err(SceneError)?;
        Ok(ticks[1].saturating_sub(ticks[0]) as f64 * 1.0e-9 * f64::from(queue.get_timestamp_period()))
    }
}

fn lights_buffer(device: &wgpu::Device, count: usize, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("a copy of lights"),
        size: bytes::LIGHT * count as u64,
        usage,
        mapped_at_creation: false,
    })
}
