//! What a loader returns: geometry, materials, camera, lights and motion.

use girandole::LightWorld;
use girandole::cluster::Aabb;
use girandole::glam::{Affine3A, Vec3, Vec4};

use super::festival::Festival;
use super::texture::Texture;

/// Whether light passes through a surface, as glTF states it. A surface that covers a share of what
/// lies behind it stops that share of the light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Alpha {
    /// It covers all.
    #[default]
    Opaque,
    /// It covers all where its opacity is at least this, and nothing elsewhere.
    Mask(f32),
    /// It covers a share that equals its opacity.
    Blend,
}

/// How a surface scatters and emits light: GGX over a diffuse base, the metallic-roughness model of
/// glTF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Linear base colour; each channel is in [0, 1].
    pub base_color: Vec3,
    /// Perceptual roughness in [0, 1]; GGX alpha is its square.
    pub roughness: f32,
    /// 0 for dielectrics, 1 for metals.
    pub metallic: f32,
    /// Emitted radiance in nits, from the front (counter-clockwise) side.
    pub emission: Vec3,
    /// Whether the back side emits too.
    pub two_sided_emission: bool,
    /// Whether the surface reflects nothing: it shows its base colour to the camera at the scene's
    /// exposure, and lights nothing.
    pub is_unlit: bool,
    /// Whether shadow rays pass through.
    pub see_through: bool,
    /// Whether light passes through for camera and shadow rays alike.
    pub alpha: Alpha,
    /// The opacity, from 0 to 1, that `alpha` refers to.
    pub opacity: f32,
    /// A texture by whose colour the base colour is multiplied, and by whose alpha the opacity: an
    /// index into [`Scene::textures`].
    pub base_color_texture: Option<u32>,
    /// A texture by whose colour the emission is multiplied.
    pub emission_texture: Option<u32>,
    /// A texture by whose green channel the roughness is multiplied, and by whose blue one the
    /// metallic factor.
    pub roughness_texture: Option<u32>,
}

impl Material {
    /// The textures that it uses.
    pub fn textures(&self) -> impl Iterator<Item = u32> {
        [self.base_color_texture, self.emission_texture, self.roughness_texture].into_iter().flatten()
    }
}

impl Default for Material {
    fn default() -> Self {
        Self {
            base_color: Vec3::splat(0.5),
            roughness: 0.8,
            metallic: 0.0,
            emission: Vec3::ZERO,
            two_sided_emission: false,
            is_unlit: false,
            see_through: false,
            alpha: Alpha::Opaque,
            opacity: 1.0,
            base_color_texture: None,
            emission_texture: None,
            roughness_texture: None,
        }
    }
}

/// A triangle in the space of its mesh.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    /// Counter-clockwise from the front.
    pub vertices: [Vec3; 3],
    /// Index into [`Scene::materials`].
    pub material: u32,
}

/// Triangles that any number of objects share.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Not empty in a scene that a loader returns.
    pub triangles: Vec<Triangle>,
    /// Two texture coordinates, xy and zw, for each corner of each triangle, or nothing if no material of
    /// the mesh has a texture.
    pub tex_coords: Vec<[Vec4; 3]>,
    /// For each corner of each triangle, the linear colour by which the base colour is multiplied, and an
    /// alpha by which the opacity is; or nothing if all are 1.
    pub colors: Vec<[Vec4; 3]>,
    /// For each corner of each triangle, the unit normal (w is 0) of the smooth surface that the mesh
    /// stands for, or nothing if all triangles are flat. Zero for a triangle that is flat.
    pub normals: Vec<[Vec4; 3]>,
}

/// A placed mesh.
#[derive(Clone, Copy, Debug)]
pub struct Object {
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Mesh space to world space.
    pub transform: Affine3A,
    /// Factor on the emission of its materials: 0 for a lamp that is switched off.
    pub emission_scale: f32,
    /// Objects that are not visible cast no shadows either.
    pub visible: bool,
}

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position.
    pub eye: Vec3,
    /// A point that appears in the middle of the picture.
    pub target: Vec3,
    /// Radians.
    pub vertical_fov: f32,
    /// The direction that is upward in the picture.
    pub up: Vec3,
}

impl Camera {
    /// The vertical field of view where nothing states another, radians.
    pub const FIELD_OF_VIEW: f32 = 1.0;

    /// A camera outside of a box that sees all of it, in a picture that is `aspect` times as wide as high.
    pub fn around(bounds: &Aabb, aspect: f32) -> Self {
        /// How much farther the camera is than it has to be.
        const MARGIN: f32 = 1.05;
        let bounds = if bounds.is_empty() { Aabb::point(Vec3::ZERO) } else { *bounds };
        let (target, half) = (bounds.center(), (0.5 * bounds.extent()).max(Vec3::splat(1e-3)));
        let back = Vec3::new(0.5, 0.45, 0.74).normalize();
        let right = Vec3::Y.cross(back).normalize();
        let slope = (0.5 * Self::FIELD_OF_VIEW).tan();
        let needed = |i: i32| {
            let corner = half * Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { -1.0 } else { 1.0 }));
            let [x, y] = [corner.dot(right) / (slope * aspect), corner.dot(back.cross(right)) / slope];
            x.abs().max(y.abs()) + corner.dot(back)
        };
        let distance = MARGIN * (0..8).map(needed).fold(0.0, f32::max);
        Self { eye: target + back * distance, target, vertical_fov: Self::FIELD_OF_VIEW, up: Vec3::Y }
    }
}

/// The radiance of the sky, and the faint light without shadows that it adds to surfaces. Nits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sky {
    /// Radiance straight up.
    pub zenith: Vec3,
    /// Radiance at the horizon and below, where a city's glow is.
    pub horizon: Vec3,
    /// Added to every surface as albedo times ambient. It is not sampled.
    pub ambient: Vec3,
    /// The share of the light of surfaces that haze replaces by the radiance at the horizon on each
    /// metre to the camera; 0 for clear air.
    pub haze: f32,
    /// Added around the sun, which is just below the horizon: see [`sky_radiance`](crate::render::shading::sky_radiance).
    pub glow: Vec3,
    /// The unit direction of the sun; zero if there is no glow.
    pub sun: Vec3,
}

/// Everything that a renderer needs, except for the lights.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Materials, by index.
    pub materials: Vec<Material>,
    /// Textures, by index. They do not change after loading.
    pub textures: Vec<Texture>,
    /// Meshes, by index.
    pub meshes: Vec<Mesh>,
    /// Placed meshes. Their number and their meshes do not change after loading: objects that
    /// appear and disappear change their visibility.
    pub objects: Vec<Object>,
    /// Lights that kernels on a GPU move, if there are any.
    pub festival: Option<Festival>,
    /// The camera.
    pub camera: Camera,
    /// The sky.
    pub sky: Sky,
    /// Shadow rays towards point and spot lights end this many metres before the light, because
    /// such lights often lie inside the mesh of their lamp.
    pub lamp_clearance: f32,
    /// Factor on radiance before tone mapping.
    pub exposure: f32,
    /// Whether the exposure is relative to what the camera sees in the first frame (`render::metering`).
    pub is_metered: bool,
    /// What the user should know about the files: one line each.
    pub warnings: Vec<String>,
}

impl Scene {
    /// The corners of the triangles of an object, in world space.
    pub fn vertices(&self, object: &Object) -> impl Iterator<Item = Vec3> {
        let transform = object.transform;
        let corners = self.meshes[object.mesh as usize].triangles.iter().flat_map(|triangle| triangle.vertices);
        corners.map(move |corner| transform.transform_point3(corner))
    }
}

impl Default for Scene {
    /// An empty scene.
    fn default() -> Self {
        Self {
            materials: Vec::new(),
            textures: Vec::new(),
            meshes: Vec::new(),
            objects: Vec::new(),
            festival: None,
            camera: Camera { eye: Vec3::Y, target: Vec3::Z, vertical_fov: Camera::FIELD_OF_VIEW, up: Vec3::Y },
            sky: Sky::default(),
            lamp_clearance: 0.1,
            exposure: 1.0,
            is_metered: false,
            warnings: Vec::new(),
        }
    }
}

/// What moves a stage. `time` is in seconds from the start and never decreases.
pub trait Animation {
    /// Moves objects and lights to where they are at `time`. Changes nothing else.
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError>;

    /// Whether nothing moves after the first call of [`Animation::advance`], so that it needs no
    /// other.
    fn is_still(&self) -> bool {
        false
    }
}

/// The animation of a stage in which nothing moves.
pub struct Still;

impl Animation for Still {
    fn advance(&mut self, _: f64, _: &mut Scene, _: &mut LightWorld) -> Result<(), SceneError> {
        Ok(())
    }

    fn is_still(&self) -> bool {
        true
    }
}

/// A scene, its lights, and what moves both.
pub struct Stage {
    /// Geometry, materials and camera.
    pub scene: Scene,
    /// Lights.
    pub world: LightWorld,
    /// Motion.
    pub animation: Box<dyn Animation>,
}

impl Stage {
    /// Removes the lights at infinity, which belong to no tree.
    #[allow(dead_code, reason = "only measuring programs compare samplers that lack such lights")]
    pub fn remove_directionals(&mut self) -> Result<(), SceneError> {
        let keys: Vec<_> = self.world.directionals().collect();
        keys.into_iter().try_for_each(|key| Ok(self.world.remove_directional(key)?))
    }
}

/// Why a stage could not be loaded, moved or rendered: one line for the user.
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

impl From<girandole_assets::AssetError> for SceneError {
    fn from(error: girandole_assets::AssetError) -> Self {
        Self(error.to_string())
    }
}
