//! Stages from glTF files: meshes, materials, hierarchy, lights and animations.
//!
//! Read in this order:
//!
//! 1. this file: how the stage is put together;
//! 2. `occupancy`, `viewpoint` and `exposure`: a camera and an exposure for scenes without a
//!    camera;
//! 3. `node_map`, `animation` and `sway`: the file's animations, or wind where there are none.

use std::path::Path;

use girandole::glam::{Mat3, Vec3};
use girandole::gltf::gltf::json::{Value, deserialize};
use girandole::gltf::gltf::{Document, Material as GltfMaterial, Node};
use girandole::gltf::{
    self, GltfError, GltfFile, GltfOptions, load_lights, material_emission, primitive_triangles, world_transforms,
};
use girandole::{LightWorld, Policy};

use super::{Animation, Camera, Material, Mesh, Object, Scene, SceneError, Sky, Stage, Triangle, rng};

pub mod occupancy;
pub mod viewpoint;
pub mod exposure;

pub mod node_map;
pub mod animation;
pub mod sway;

use animation::Player;
use node_map::{NodeMap, to_single};
use sway::Sway;

/// Point lights often lie inside the mesh of their lamp. Within this distance of a light, in
/// metres, nothing casts a shadow of it.
const LAMP_CLEARANCE: f32 = 0.35;

/// Reads a file and its buffers. An error is one line that begins with the path.
pub fn open(path: &Path) -> Result<GltfFile, SceneError> {
    gltf::load(path, &GltfOptions::default()).map_err(|error| match error {
        GltfError::Read { .. } => SceneError(error.to_string()),
        _ => SceneError(format!("{}: {error}", path.display())),
    })
}

/// Loads a file. The camera is `camera`, else the first perspective camera of the file, else it is
/// placed among the lights.
pub fn stage(path: &Path, camera: Option<Camera>) -> Result<Stage, SceneError> {
    let fail = |what: String| SceneError(format!("{}: {what}", path.display()));
    let file = open(path)?;
    let mut world = LightWorld::new();
    let options = GltfOptions { policy: Policy::Budgeted, ..GltfOptions::default() };
    let lights =
        load_lights(&mut world, &file.document, &file.buffers, &options).map_err(|error| fail(error.to_string()))?;
    let placed = place(&file).map_err(|error| fail(error.0))?;
    if placed.objects.is_empty() {
        return Err(fail("its scene has no triangles".into()));
    }
    let sky = Sky {
        zenith: Vec3::new(0.004, 0.007, 0.018),
        horizon: Vec3::new(0.02, 0.018, 0.02),
        ambient: Vec3::new(0.012, 0.014, 0.02),
        haze: 0.0,
    };
    let own_camera = file_camera(&file.document).map_err(|error| fail(error.to_string()))?;
    let mut scene = Scene {
        materials: placed.materials,
        meshes: placed.meshes,
        objects: placed.objects,
        camera: Camera { eye: Vec3::ZERO, target: Vec3::NEG_Z, vertical_fov: viewpoint::FIELD_OF_VIEW },
        sky,
        lamp_clearance: LAMP_CLEARANCE,
        exposure: 1.0,
        warnings: Vec::new(),
    };
    scene.camera = camera.or(own_camera).unwrap_or_else(|| viewpoint::among_lights(&scene, &world));
    scene.exposure = exposure::exposure(&scene, &world);
    let node_map = NodeMap::new(&file.document, &placed.node_objects, &lights);
    let animation: Box<dyn Animation> = match Player::new(&file, node_map.clone()).map_err(|error| fail(error.0))? {
        Some(player) => Box::new(player),
        None => Box::new(Sway::new(&file.document, &scene, node_map)),
    };
    Ok(Stage { scene, world, animation })
}

/// The geometry of a file.
struct PlacedMeshes {
    materials: Vec<Material>,
    meshes: Vec<Mesh>,
    objects: Vec<Object>,
    /// Pairs of a node and its object.
    node_objects: Vec<(usize, usize)>,
}

/// Converts the materials and meshes of a file and places its nodes.
fn place(file: &GltfFile) -> Result<PlacedMeshes, SceneError> {
    let document = &file.document;
    let error = |error: GltfError| SceneError(error.to_string());
    let mut materials: Vec<Material> = document.materials().map(|material| convert(&material)).collect();
    let default_material = materials.len() as u32;
    materials.push(Material { base_color: Vec3::ONE, roughness: 1.0, ..Material::default() });
    let transforms = world_transforms(document).map_err(error)?;
    let mut mesh_indices: Vec<Option<u32>> = vec![None; document.meshes().len()];
    let mut meshes: Vec<Mesh> = Vec::new();
    for mesh in document.meshes() {
        let mut triangles = Vec::new();
        for primitive in mesh.primitives() {
            let material = primitive.material().index().map_or(default_material, |index| index as u32);
            let corners = primitive_triangles(mesh.index(), &primitive, &file.buffers).map_err(error)?;
            if corners.iter().flatten().any(|vertex| !vertex.is_finite()) {
                return Err(SceneError(format!("mesh {}: a position is not a finite number", mesh.index())));
            }
            triangles.extend(corners.into_iter().map(|vertices| Triangle { vertices, material }));
        }
        if !triangles.is_empty() {
            mesh_indices[mesh.index()] = Some(meshes.len() as u32);
            meshes.push(Mesh { triangles });
        }
    }
    let mut objects = Vec::new();
    let mut node_objects = Vec::new();
    for node in document.nodes() {
        let mesh = node.mesh().and_then(|mesh| mesh_indices[mesh.index()]);
        let (Some(mesh), Some(transform)) = (mesh, transforms[node.index()]) else { continue };
        node_objects.push((node.index(), objects.len()));
        objects.push(Object { mesh, transform: to_single(transform), emission_scale: 1.0, visible: true });
    }
    Ok(PlacedMeshes { materials, meshes, objects, node_objects })
}

fn convert(material: &GltfMaterial<'_>) -> Material {
    let surface = material.pbr_metallic_roughness();
    let [red, green, blue, _] = surface.base_color_factor();
    Material {
        base_color: Vec3::new(red, green, blue).clamp(Vec3::ZERO, Vec3::ONE),
        roughness: surface.roughness_factor().clamp(0.0, 1.0),
        metallic: surface.metallic_factor().clamp(0.0, 1.0),
        emission: material_emission(material),
        two_sided_emission: material.double_sided(),
        see_through: see_through(material),
    }
}

/// Whether the material's extras contain `"see_through": true`.
fn see_through(material: &GltfMaterial<'_>) -> bool {
    let extras = material.extras().as_ref().and_then(|raw| deserialize::from_str::<Value>(raw.get()).ok());
    extras.and_then(|extras| extras.get("see_through")?.as_bool()).unwrap_or(false)
}

/// The first perspective camera of the scene.
fn file_camera(document: &Document) -> Result<Option<Camera>, GltfError> {
    use girandole::gltf::gltf::camera::Projection;
    let transforms = world_transforms(document)?;
    let perspective = |node: Node<'_>| match node.camera()?.projection() {
        Projection::Perspective(lens) => transforms[node.index()].map(|transform| (transform, lens.yfov())),
        Projection::Orthographic(_) => None,
    };
    Ok(document.nodes().find_map(perspective).and_then(|(transform, vertical_fov)| {
        let transform = to_single(transform);
        let eye = Vec3::from(transform.translation);
        let forward = (Mat3::from(transform.matrix3) * Vec3::NEG_Z).try_normalize()?;
        let is_usable = (0.01..3.1).contains(&vertical_fov);
        Some(Camera {
            eye,
            target: eye + forward,
            vertical_fov: if is_usable { vertical_fov } else { viewpoint::FIELD_OF_VIEW },
        })
    }))
}
