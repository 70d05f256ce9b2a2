//! The top level over more and more instances, stage by stage, beside a sort of as many keys.

use super::machine::Machine;
use super::scene::SceneError;
use super::scene::rng::Rng;
use super::spread::Spread;
use super::timer::{Timer, Times};
use girandole::glam::{DVec3, Vec3};
use girandole::gpu::measure::KeySort;
use girandole::gpu::{GpuError, GpuLights};
use girandole::{InstanceKey, Light, LightWorld, Placement, Policy};
use serde_json::{Value, json};

/// Of places and lights.
const SEED: u64 = 29;
/// Metres between instances, in the mean.
const DISTANCE: f32 = 10.0;
/// Lights of the trees that the instances show in turn.
const TREES: [usize; 4] = [1, 2, 6, 16];

/// One size.
pub struct Row {
    pub instances: u32,
    /// What the device refused, or what it took.
    pub built: Result<Built, GpuError>,
}

/// What a build took.
pub struct Built {
    pub dispatches: u32,
    /// In order of their first turn; no time where passes cannot be timed.
    pub stages: Vec<Stage>,
    pub total: Spread,
    pub sort: Spread,
}

/// All stages of one name.
pub struct Stage {
    pub name: &'static str,
    pub dispatches: u32,
    pub time: Option<Spread>,
}

impl Built {
    /// Of medians.
    pub fn per_sort(&self) -> f64 {
        self.total.median / self.sort.median
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
                "sort_alone": built.sort.to_json(),
                "total_per_sort_alone": built.per_sort(),
            }),
        }
    }
}

/// Instances of a few small trees, spread over a square; always the same.
pub fn world(instances: u32) -> Result<(LightWorld, Vec<InstanceKey>), SceneError> {
    let mut rng = Rng::new(SEED, 0);
    let mut world = LightWorld::new();
    let mut trees = Vec::new();
    for lights in TREES {
        let lamp = |_| Light::point(vec3(&mut rng, 2.0) + 4.0 * Vec3::Y, Vec3::splat(rng.range(10.0, 1000.0)));
        trees.push(world.add_tree((0..lights).map(lamp).collect())?);
    }
    let side = DISTANCE * (instances as f32).sqrt();
    let mut keys = Vec::new();
    for i in 0..instances as usize {
        keys.push(world.add_instance(trees[i % trees.len()], place(&mut rng, side), Policy::Static)?);
    }
    Ok((world, keys))
}

/// Somewhere in the square of the world of so many instances.
pub fn place(rng: &mut Rng, side: f32) -> Placement {
    Placement::at(DVec3::new(rng.range(0.0, side).into(), 0.0, rng.range(0.0, side).into()))
}

fn vec3(rng: &mut Rng, size: f32) -> Vec3 {
    Vec3::new(rng.range(-size, size), rng.range(-size, size), rng.range(-size, size))
}

/// Builds the top level over so many instances again and again.
pub fn measure(machine: &Machine, timer: &Timer, instances: u32) -> Result<Row, SceneError> {
    let refused = |refusal| Ok(Row { instances, built: Err(refusal) });
    let (mut world, _) = world(instances)?;
    let mut lights = match GpuLights::new(&machine.device, &machine.queue) {
        Ok(lights) => lights,
        Err(refusal) => return refused(refusal),
    };
    let delta = world.take_delta();
    if let Err(refusal) = lights.upload(&world, &delta) {
        return refused(refusal);
    }
    let mut stages = Vec::new();
    let build = timer.time(|encoder, queries| {
        stages = lights.build_top_timed(encoder, queries);
        stages.len()
    })?;
    let keys = match KeySort::new(&machine.device, &machine.queue, instances) {
        Ok(keys) => keys,
        Err(refusal) => return refused(refusal),
    };
    let sort = timer.time(|encoder, queries| {
        keys.record(encoder, queries);
        1
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
    Ok(Row { instances, built: Ok(Built { dispatches, stages: named, total, sort: sort.total }) })
}
