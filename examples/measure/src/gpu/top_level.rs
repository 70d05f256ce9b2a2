//! The top-level build over more and more instances, stage by stage.

use super::machine::Machine;
use super::spread::Spread;
use super::timer::{Timer, Times};
use girandole::glam::{DVec3, Vec3};
use girandole::gpu::measure::build_top_timed;
use girandole::gpu::{GpuError, GpuLights};
use girandole::{InstanceKey, Light, LightTree, LightWorld, Placement, Policy};
use serde_json::{Value, json};
use testbed::scene::SceneError;
use testbed::scene::rng::Rng;

/// Seeds places and lights.
const SEED: u64 = 29;
/// The mean distance between instances, in metres.
const DISTANCE: f32 = 10.0;
/// The numbers of lights of the trees, which the instances show in turn.
const TREES: [usize; 4] = [1, 2, 6, 16];

/// The build over one number of instances.
pub struct Row {
    pub instances: u32,
    /// The times, or the error with which the device refused this size.
    pub built: Result<Built, GpuError>,
}

/// The times of a build.
pub struct Built {
    pub dispatches: u32,
    /// In the order in which they first run.
    pub stages: Vec<Stage>,
    pub total: Spread,
}

/// All stages of one name together.
pub struct Stage {
    pub name: &'static str,
    pub dispatches: u32,
    /// `None` where passes cannot be timed.
    pub time: Option<Spread>,
}

impl Built {
    /// The ratio of the medians of the build and of its radix sort.
    pub fn per_sort(&self) -> Option<f64> {
        let sort = self.stages.iter().find(|stage| stage.name == "sort")?;
        Some(self.total.median / sort.time?.median)
    }
}

impl Row {
    pub fn to_json(&self) -> Value {
        match &self.built {
            Err(refusal) => json!({ "instances": self.instances, "refused": refusal.to_string() }),
            Ok(built) => json!({
                "instances": self.instances,
                "dispatches": built.dispatches,
                "stages": built.stages.iter().map(|stage| json!({
                    "name": stage.name,
                    "dispatches": stage.dispatches,
                    "time": stage.time.map(Spread::to_json),
                })).collect::<Vec<_>>(),
                "total": built.total.to_json(),
                "total_per_sort": built.per_sort(),
            }),
        }
    }
}

/// A world of instances of a few small trees in a square, the same in every run.
pub fn world(instances: u32) -> Result<(LightWorld, Vec<InstanceKey>), SceneError> {
    let mut rng = Rng::new(SEED, 0);
    let mut world = LightWorld::new();
    let mut trees = Vec::new();
    for lights in TREES {
        let lamp = |_| Light::point(vec3(&mut rng, 2.0) + 4.0 * Vec3::Y, Vec3::splat(rng.range(10.0, 1000.0)));
        trees.push(world.add_tree(LightTree::new((0..lights).map(lamp).collect())?));
    }
    let side = DISTANCE * (instances as f32).sqrt();
    let mut keys = Vec::new();
    for i in 0..instances as usize {
        keys.push(world.add_instance(trees[i % trees.len()], place(&mut rng, side), Policy::Static)?);
    }
    Ok((world, keys))
}

/// A random place in a square with this side, in metres.
pub fn place(rng: &mut Rng, side: f32) -> Placement {
    Placement::at(DVec3::new(rng.range(0.0, side).into(), 0.0, rng.range(0.0, side).into()))
}

fn vec3(rng: &mut Rng, size: f32) -> Vec3 {
    Vec3::new(rng.range(-size, size), rng.range(-size, size), rng.range(-size, size))
}

/// Times the top-level build for one number of instances.
pub fn measure(machine: &Machine, timer: &Timer, instances: u32) -> Result<Row, SceneError> {
    let refused = |refusal| Ok(Row { instances, built: Err(refusal) });
    let (world, _) = world(instances)?;
    let mut lights = match GpuLights::new(&machine.device, &machine.queue) {
        Ok(lights) => lights,
        Err(refusal) => return refused(refusal),
    };
    if let Err(refusal) = lights.upload(&world) {
        return refused(refusal);
    }
    let mut stages = Vec::new();
    let build = timer.time(|encoder, queries| {
        stages = build_top_timed(&mut lights, encoder, queries);
        stages.len()
    })?;
    let mut named: Vec<Stage> = Vec::new();
    for stage in &stages {
        match named.iter_mut().find(|other| other.name == stage.name) {
            Some(other) => other.dispatches += stage.dispatches,
            None => named.push(Stage { name: stage.name, dispatches: stage.dispatches, time: None }),
        }
    }
    for named in &mut named {
        let is_of = |(i, _): &(usize, &f64)| stages[*i].name == named.name;
        let sums = build.passes.iter().filter(|passes| !passes.is_empty());
        let sums = sums.map(|passes| passes.iter().enumerate().filter(is_of).map(|(_, seconds)| seconds).sum());
        named.time = Spread::of(sums);
    }
    let Times { total, .. } = build;
    let dispatches = stages.iter().map(|stage| stage.dispatches).sum();
    Ok(Row { instances, built: Ok(Built { dispatches, stages: named, total }) })
}
