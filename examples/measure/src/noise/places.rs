//! The scenes that are measured, and the eyes from which their surfaces are seen.

use girandole::LightWorld;
use girandole::glam::{Vec3, vec3};
use testbed::direct_light::stage::prepare;
use testbed::render::geometry::Geometry;
use testbed::scene::procedural::{self, CityOptions, Size};
use testbed::scene::rooms;
use testbed::scene::{Scene, SceneError, Stage};

/// How long the scenes have moved, in seconds.
const TIME: f64 = 1.0;
/// Eyes in the avenue of the city and in the street that crosses it at z = 0: 1.7 m above the road
/// in its middle, or above the pavement.
const STREET_EYES: [Vec3; 8] = [
    vec3(0.0, 1.7, 85.0),
    vec3(0.0, 1.7, 45.0),
    vec3(9.5, 1.85, 65.0),
    vec3(-9.5, 1.85, 25.0),
    vec3(9.5, 1.85, -30.0),
    vec3(45.0, 1.7, 0.0),
    vec3(70.0, 1.85, 9.5),
    vec3(-40.0, 1.85, -9.5),
];

/// A scene to measure.
pub struct Place {
    pub name: String,
    pub scene: Scene,
    pub geometry: Geometry,
    /// All lights except those at infinity, which belong to no tree.
    pub world: LightWorld,
    /// Where the cameras are.
    pub eyes: Vec<Vec3>,
}

/// A street of city S, from the height of eyes.
pub fn street() -> Result<Place, SceneError> {
    let stage = procedural::stage(&CityOptions { size: Size::S, cars: None, seed: 1, lamp_profile: None })?;
    from_stage("street of city S".into(), stage, |_| STREET_EYES.to_vec())
}

/// Ten rooms and a corridor.
pub fn rooms() -> Result<Place, SceneError> {
    rooms_with_doors(true)
}

/// The same with all doors open or closed.
pub fn rooms_with_doors(are_open: bool) -> Result<Place, SceneError> {
    let (scene, world, eyes) = rooms::rooms(10, are_open)?;
    Ok(Place { name: "ten rooms".into(), geometry: Geometry::new(&scene)?, scene, world, eyes })
}

fn from_stage(name: String, stage: Stage, eyes: impl Fn(&Scene) -> Vec<Vec3>) -> Result<Place, SceneError> {
    let Stage { scene, world, .. } = prepare(stage, TIME)?;
    Ok(Place { name, geometry: Geometry::new(&scene)?, eyes: eyes(&scene), scene, world })
}
