//! The noise of samples of lights that kernels move.

use super::kernel::{Put, Writer, puts, refused};
use super::motion::{Fire, dancer, swirl};
use girandole::glam::{DVec3, Vec3};
use girandole::gpu::GpuLights;
use girandole::scheduler::{VirtualClock, Work};
use girandole::{FrameBudget, Light, LightTree, LightWorld, Placement, Policy, ShadingPoint, TreeKey, TreeSource};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Duration;
use testbed::measuring::lights::illuminances;
use testbed::measuring::sigma::{Noise, Summary};
use testbed::scene::SceneError;
use testbed::scene::rng::Rng;

/// The time of rebuilds in a frame.
const BUDGET: Duration = Duration::from_micros(300);
/// What work takes by the virtual clock, in nanoseconds a light.
const NANOS_PER_LIGHT: usize = 150;
/// The frames after which the CPU knows what the GPU has found out.
const LATENCY: u32 = 3;
/// Noise is measured every so many frames.
const EVERY: u32 = 30;
/// The distance between trees, in metres.
const DISTANCE: f32 = 4.0;

/// How much is measured.
#[derive(Clone, Copy)]
pub struct Effort {
    pub frames: u32,
    pub trees: u32,
    pub lights: usize,
    pub sparks: usize,
    /// The frames of the sparks, after two seconds in which they have spread.
    pub spark_frames: u32,
    pub shading_points: usize,
}

impl Effort {
    pub const FULL: Self =
        Self { frames: 300, trees: 16, lights: 720, sparks: 100_000, spark_frames: 90, shading_points: 64 };
    pub const QUICK: Self =
        Self { frames: 30, trees: 2, lights: 100, sparks: 500, spark_frames: 30, shading_points: 4 };
}

/// A row of the table.
pub struct Row {
    pub scene: &'static str,
    pub policy: &'static str,
    /// Rebuilds of one tree in a hundred frames.
    pub rebuilds: f64,
    /// The mean over frames of the mean over shading points.
    pub sigma: f64,
    /// The mean and the greatest over frames of sigma by that of fresh builds.
    pub over_fresh: f64,
    pub most_over_fresh: f64,
}

/// The lights of a tree of a scene in a frame.
type Motion = fn(u32, usize, u32) -> Vec<Light>;

/// Where a tree stands.
fn place(tree: u32) -> Vec3 {
    DISTANCE * Vec3::new((tree % 4) as f32, 0.0, (tree / 4) as f32)
}

/// Points on the floor, on a ceiling and on walls that face a tree, from 0.7 m to 8 m away from its middle.
fn shading_points(count: usize, trees: u32) -> Vec<ShadingPoint> {
    let mut rng = Rng::new(5, 0);
    let point = |i: usize| {
        let center = place(rng.below(trees as usize) as u32);
        let (angle, dist) = (rng.range(0.0, std::f32::consts::TAU), 0.7 * rng.range(0.0, (8.0_f32 / 0.7).ln()).exp());
        let way = Vec3::new(angle.cos(), 0.0, angle.sin());
        match i % 3 {
            0 => ShadingPoint::surface(center + dist * way + rng.range(0.2, 3.0) * Vec3::Y, -way),
            1 => ShadingPoint::surface(center + dist * way + 5.0 * Vec3::Y, Vec3::NEG_Y),
            _ => ShadingPoint::surface(center + dist * way, Vec3::Y),
        }
    };
    (0..count).map(point).collect()
}

/// The mean of sigma of a world at some points. `lights` are those of all instances, in the world's space.
fn sigma(world: &LightWorld, lights: &[Light], points: &[ShadingPoint]) -> f64 {
    let sampler = world.sampler();
    let one = |at: &ShadingPoint| {
        let mut pmfs = Vec::new();
        sampler.distribution(at, &mut pmfs);
        Noise::of(&illuminances(lights, at), &pmfs)
    };
    let noises: Vec<Noise> = points.par_iter().filter_map(one).collect();
    Summary::of(&noises).mean
}

/// A light that has been moved.
fn moved(light: &Light, by: Vec3) -> Light {
    use girandole::light::Shape;
    let shape = match light.shape {
        Shape::Point { position } => Shape::Point { position: position + by },
        Shape::Triangle { vertices, two_sided } => Shape::Triangle { vertices: vertices.map(|v| v + by), two_sided },
        other => other,
    };
    light.with_shape(shape)
}

/// A world of trees at their places.
fn world_of(trees: impl Iterator<Item = LightTree>, policy: Policy) -> Result<(LightWorld, Vec<TreeKey>), SceneError> {
    let clock = VirtualClock::new(|work: Work| Duration::from_nanos((NANOS_PER_LIGHT * work.lights) as u64));
    let mut world = LightWorld::with_clock(Arc::new(clock));
    let mut keys = Vec::new();
    for (index, tree) in (0..).zip(trees) {
        let key = world.add_tree(tree);
        world.add_instance(key, Placement::at(DVec3::from(place(index))), policy)?;
        keys.push(key);
    }
    // Builds in the background would end in other frames in each run.
    world.set_background_builds(false);
    world.update(FrameBudget::NONE);
    Ok((world, keys))
}

/// The device, and the lights of a world on it.
pub struct Engine<'a> {
    pub device: &'a wgpu::Device,
    pub queue: &'a wgpu::Queue,
}

impl Engine<'_> {
    /// Writes lights and builds the top level, and waits for the GPU.
    fn finish(&self, writer: &Writer, lights: &mut GpuLights, puts: &[Put]) -> Result<(), SceneError> {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        writer.record(&mut encoder, lights, puts);
        lights.build_top(&mut encoder);
        self.queue.submit([encoder.finish()]);
        testbed::common::gpu::wait(self.device).map_err(SceneError)
    }
}

/// Trees that kernels deform, with and without rebuilds.
pub fn deformed(engine: &Engine<'_>, effort: Effort) -> Result<Vec<Row>, SceneError> {
    let scenes: [(&'static str, Motion); 2] = [("dancers", dancer), ("swirls", swirl)];
    let policies = [("refits alone", Policy::RefitOnly), ("scheduled rebuilds", Policy::Budgeted)];
    let mut rows = Vec::new();
    for (scene, motion) in scenes {
        for policy in policies {
            rows.push(deform(engine, effort, (scene, motion), policy)?);
        }
    }
    Ok(rows)
}

fn deform(
    engine: &Engine<'_>,
    effort: Effort,
    (scene, motion): (&'static str, Motion),
    (name, policy): (&'static str, Policy),
) -> Result<Row, SceneError> {
    let lights_in = |tree: u32, frame: u32| motion(tree, effort.lights, frame);
    let trees: Vec<LightTree> =
        (0..effort.trees).map(|tree| LightTree::new(lights_in(tree, 0))).collect::<Result<_, _>>()?;
    let (mut world, keys) = world_of(trees.into_iter(), policy)?;
    keys.iter().try_for_each(|key| world.set_light_source(*key, TreeSource::GpuMesh))?;
    let mut gpu = GpuLights::new(engine.device, engine.queue).map_err(refused)?;
    let writer = Writer::new(engine.device, &gpu);
    let points = shading_points(effort.shading_points, effort.trees);
    let (mut rebuilds, mut sigmas, mut ratios) = (0, Vec::new(), Vec::new());
    for frame in 1..=effort.frames {
        if frame % LATENCY == 0 {
            gpu.follow_sources(&mut world);
        }
        world.update(FrameBudget::new(BUDGET));
        // Builds that take several frames end before the update that installs them.
        let is_new = |key: &&TreeKey| world.rebuild_state(**key).is_some_and(|state| state.age == 0);
        rebuilds += keys.iter().filter(is_new).count();
        gpu.upload(&world).map_err(refused)?;
        let present: Vec<Vec<Light>> = (0..effort.trees).map(|tree| lights_in(tree, frame)).collect();
        let all: Vec<Put> = keys.iter().zip(&present).flat_map(|(key, lights)| puts(&world, *key, lights)).collect();
        engine.finish(&writer, &mut gpu, &all)?;
        if frame % EVERY == 0 {
            let (now, fresh) = compare(&world, &keys, &present, &points)?;
            sigmas.push(now);
            ratios.push(now / fresh);
        }
    }
    let rebuilds = 100.0 * rebuilds as f64 / f64::from(effort.trees * effort.frames);
    Ok(Row::of((scene, name), rebuilds, &sigmas, &ratios))
}

/// Sigma of the trees as the GPU has them, and of trees that were built for these lights. The refit of the
/// GPU makes the nodes of the CPU's refit, of which the CPU's samplers read.
fn compare(
    world: &LightWorld,
    keys: &[TreeKey],
    present: &[Vec<Light>],
    points: &[ShadingPoint],
) -> Result<(f64, f64), SceneError> {
    let mut refitted = Vec::new();
    for (key, lights) in keys.iter().zip(present) {
        let mut tree = world.tree(*key).cloned().unwrap_or_default();
        tree.set_lights(&(0..).zip(lights.iter().copied()).collect::<Vec<_>>())?;
        tree.refit();
        refitted.push(tree);
    }
    let fresh = present.iter().map(|lights| LightTree::new(lights.clone())).collect::<Result<Vec<_>, _>>()?;
    let all: Vec<Light> = (0..)
        .zip(present)
        .flat_map(|(tree, lights)| lights.iter().map(move |light| moved(light, place(tree))))
        .collect();
    let of = |trees: Vec<LightTree>| {
        let (world, _) = world_of(trees.into_iter(), Policy::RefitOnly)?;
        Ok::<f64, SceneError>(sigma(&world, &all, points))
    };
    Ok((of(refitted)?, of(fresh)?))
}

/// Sparks that come and go, as leaves of the top level and as a tree that is refitted and rebuilt.
pub fn sparks(engine: &Engine<'_>, effort: Effort) -> Result<Vec<Row>, SceneError> {
    let kinds = [
        ("leaves of the top level", TreeSource::GpuParticles, Policy::RefitOnly),
        ("scheduled rebuilds", TreeSource::GpuMesh, Policy::Budgeted),
    ];
    kinds.into_iter().map(|(name, source, policy)| burn(engine, effort, (name, source, policy))).collect()
}

fn burn(
    engine: &Engine<'_>,
    effort: Effort,
    (name, source, policy): (&'static str, TreeSource, Policy),
) -> Result<Row, SceneError> {
    let mut fire = Fire::new(effort.sparks, 7);
    let lights_of = |fire: &Fire| fire.lights().map(|(light, _)| light).collect::<Vec<_>>();
    let one = |tree| world_of(std::iter::once(tree), policy);
    let (mut world, keys) = one(LightTree::new(lights_of(&fire))?)?;
    world.set_light_source(keys[0], source)?;
    let mut gpu = GpuLights::new(engine.device, engine.queue).map_err(refused)?;
    let writer = Writer::new(engine.device, &gpu);
    let points = shading_points(effort.shading_points, 1);
    let (mut rebuilds, mut sigmas, mut ratios) = (0, Vec::new(), Vec::new());
    for frame in 1..=effort.spark_frames {
        fire.advance();
        if frame % LATENCY == 0 {
            gpu.follow_sources(&mut world);
        }
        world.update(FrameBudget::new(BUDGET));
        rebuilds += usize::from(world.rebuild_state(keys[0]).is_some_and(|state| state.age == 0));
        gpu.upload(&world).map_err(refused)?;
        let born = fire.lights().map(|(_, is_born)| is_born);
        let lights = lights_of(&fire);
        let puts = puts(&world, keys[0], &lights);
        let all: Vec<Put> = puts.into_iter().zip(born).map(|(put, is_born)| put.born_if(is_born)).collect();
        engine.finish(&writer, &mut gpu, &all)?;
        if frame % EVERY != 0 {
            continue;
        }
        // The CPU's twins: the top level over all lights as if it knew them, or the tree as the GPU has refitted it.
        let mut tree = world.tree(keys[0]).cloned().unwrap_or_default();
        tree.set_lights(&(0..).zip(lights.iter().copied()).collect::<Vec<_>>())?;
        tree.refit();
        let (mut twin, twins) = one(tree)?;
        if source == TreeSource::GpuParticles {
            twin.set_light_source(twins[0], source)?;
            twin.update(FrameBudget::NONE);
        }
        let (fresh, _) = one(LightTree::new(lights.clone())?)?;
        let now = sigma(&twin, &lights, &points);
        sigmas.push(now);
        ratios.push(now / sigma(&fresh, &lights, &points));
    }
    Ok(Row::of(("sparks", name), 100.0 * rebuilds as f64 / f64::from(effort.spark_frames), &sigmas, &ratios))
}

impl Row {
    /// The row of a scene from the noise of some frames.
    fn of((scene, policy): (&'static str, &'static str), rebuilds: f64, sigmas: &[f64], ratios: &[f64]) -> Self {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let most_over_fresh = ratios.iter().copied().fold(0.0, f64::max);
        Self { scene, policy, rebuilds, sigma: mean(sigmas), over_fresh: mean(ratios), most_over_fresh }
    }
}
