//! What the example draws and how it moves: meshes, materials, objects, a camera, and the light world beside them.
//!
//! Loaders (`procedural`, `gltf_scene`, `real_city`) each return a [`Stage`]; renderers read it and know nothing of
//! where it came from. Metres, right-handed, Y up. Radiance and emission in nits, per linear Rec. 709 channel.

pub mod assembly;
pub mod buildings;
pub mod facade;
pub mod fcd;
pub mod furniture;
pub mod gltf_animation;
pub mod gltf_file;
pub mod gltf_scene;
pub mod gltf_sway;
pub mod ground;
pub mod lamps_csv;
pub mod layout;
pub mod meshes;
pub mod occupancy;
pub mod palette;
pub mod procedural;
pub mod real_city;
pub mod real_ground;
pub mod roads;
pub mod signs;
pub mod strings;
pub mod swarm;
pub mod traffic_sim;
pub mod vehicles;
pub mod viewpoint;

pub use crate::common::pcg as rng;

use girandole::LightWorld;
use girandole::glam::{Affine3A, Vec3};

/// How a surface scatters and emits. GGX with a diffuse base, as glTF's metallic-roughness model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Linear base colour, each channel in [0, 1].
    pub base_color: Vec3,
    /// Perceptual roughness in [0, 1]; GGX alpha is its square.
    pub roughness: f32,
    /// 0 dielectric, 1 metal.
    pub metallic: f32,
    /// Emitted radiance in nits, seen from the front (counter-clockwise) side.
    pub emission: Vec3,
    /// Emits from its back side too.
    pub two_sided_emission: bool,
    /// Shadow rays pass.
    pub see_through: bool,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            base_color: Vec3::splat(0.5),
            roughness: 0.8,
            metallic: 0.0,
            emission: Vec3::ZERO,
            two_sided_emission: false,
            see_through: false,
        }
    }
}

/// A triangle in its mesh's space.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    /// Counter-clockwise seen from the front.
    pub vertices: [Vec3; 3],
    /// Index into [`Scene::materials`].
    pub material: u32,
}

/// Triangles that objects share.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Never empty in a scene that a loader returns.
    pub triangles: Vec<Triangle>,
}

/// One placed mesh.
#[derive(Clone, Copy, Debug)]
pub struct Object {
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Mesh space to world space.
    pub transform: Affine3A,
    /// Multiplies its materials' emission: a lamp that is switched off has 0.
    pub emission_scale: f32,
    /// Hidden objects are neither seen nor cast shadows.
    pub visible: bool,
}

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it stands.
    pub eye: Vec3,
    /// A point at the picture's centre.
    pub target: Vec3,
    /// Radians.
    pub vertical_fov: f32,
}

/// What rays that leave the scene see, and the faint unshadowed light it casts. Nits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Straight up.
    pub zenith: Vec3,
    /// At the horizon, where a city's glow is.
    pub horizon: Vec3,
    /// Added to every surface as albedo * ambient: the glow of the sky, not sampled.
    pub ambient: Vec3,
}

/// Everything a renderer needs besides the lights.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Surface kinds.
    pub materials: Vec<Material>,
    /// Shared triangles.
    pub meshes: Vec<Mesh>,
    /// Placed meshes. Their number and meshes do not change after loading: what comes and goes is hidden and shown.
    pub objects: Vec<Object>,
    /// The view.
    pub camera: Camera,
    /// Beyond everything.
    pub sky: Sky,
    /// Shadow rays towards point and spot lights end this many metres early, for lights that sit inside their lamps.
    pub lamp_clearance: f32,
    /// Multiplies radiance before tone mapping, so that the picture is neither black nor white.
    pub exposure: f32,
}

/// Moves a stage on. `time` is seconds from the start and never goes back.
pub trait Animation {
    /// Brings objects and lights to `time`. Touches only what moves.
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError>;

    /// Nothing moves after the first call, however late: there is no need for another.
    fn is_still(&self) -> bool {
        false
    }
}

/// A scene, its lights and what moves them.
pub struct Stage {
    /// Geometry.
    pub scene: Scene,
    /// Lights.
    pub world: LightWorld,
    /// Motion.
    pub animation: Box<dyn Animation>,
}

/// Why a stage could not be made or moved: one line for the user.
#[derive(Debug)]
pub struct SceneError(pub String);

impl std::fmt::Display for SceneError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for SceneError {}

impl From<girandole::WorldError> for SceneError {
    fn from(error: girandole::WorldError) -> Self {
        Self(error.to_string())
    }
}
