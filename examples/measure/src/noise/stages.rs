//! The scenes that are measured, after one second of motion, and shading points on their surfaces.

use super::shading_points::shading_points;
use girandole::cluster::Aabb;
use girandole::glam::{Vec3, vec3};
use girandole::{FrameBudget, LightWorld, ShadingPoint};
use std::path::Path;
use testbed::scene::assembly::Assembly;
use testbed::scene::palette::Palette;
use testbed::scene::procedural::swarm::{self, Swarm};
use testbed::scene::procedural::{self, CityOptions, Size};
use testbed::scene::{SceneError, Stage, gltf_scene};

/// A scene to measure.
pub struct Lit {
    pub name: String,
    /// All lights except those at infinity, which belong to no tree.
    pub world: LightWorld,
    pub shading_points: Vec<ShadingPoint>,
}

/// How long the scenes have moved, in seconds.
const TIME: f64 = 1.0;

/// Shading points lie within 300 m of the city's middle and up to 30 m high, in metres.
pub const CITY_BOUNDS: Aabb = Aabb { min: vec3(-300.0, -1.0, -300.0), max: vec3(300.0, 30.0, 300.0) };

/// The procedural city, and its swarm of drones alone with the same shading points.
pub fn city(size: Size, count: usize) -> Result<[Lit; 2], SceneError> {
    let stage = moved(procedural::stage(&CityOptions { size, cars: None, seed: 1, lamp_profile: None })?)?;
    let shading_points = shading_points(&stage.scene, &CITY_BOUNDS, count)?;
    let swarm = Lit { name: "swarm".into(), world: swarm(size)?, shading_points: shading_points.clone() };
    Ok([Lit { name: format!("city {size:?}"), world: stage.world, shading_points }, swarm])
}

/// A glTF scene, named after its file.
pub fn gltf(path: &Path, count: usize) -> Result<Lit, SceneError> {
    let stage = moved(gltf_scene::stage(path, None)?)?;
    let everywhere = Aabb { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };
    let shading_points = shading_points(&stage.scene, &everywhere, count)?;
    let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    Ok(Lit { name, world: stage.world, shading_points })
}

/// A stage after [`TIME`], without directional lights.
pub fn moved(mut stage: Stage) -> Result<Stage, SceneError> {
    stage.animation.advance(TIME, &mut stage.scene, &mut stage.world)?;
    stage.world.update(FrameBudget::UNLIMITED);
    stage.remove_directionals()?;
    Ok(stage)
}

/// The swarm of the city of this size: as many drones at the same place.
fn swarm(size: Size) -> Result<LightWorld, SceneError> {
    let drones = match size {
        Size::S => 560,
        Size::M => 3_000,
        Size::L => 10_000,
    };
    swarm_at(drones, TIME)
}

/// A swarm of drones without a city, after `time` seconds.
pub fn swarm_at(drones: usize, time: f64) -> Result<LightWorld, SceneError> {
    let mut assembly = Assembly::new();
    let glows = swarm::glows(&mut Palette::default());
    let mut swarm = Swarm::new(&mut assembly, &glows, vec3(2.0, 78.0, -60.0), 30.0, drones)?;
    swarm.fly(time, &mut assembly.scene, &mut assembly.world)?;
    assembly.world.update(FrameBudget::UNLIMITED);
    Ok(assembly.world)
}
