//! Stages from glTF files: meshes, materials, hierarchy, lights and animations.
//!
//! Read in this order:
//!
//! 1. this file: how the stage is put together;
//! 2. `notes`, `images`, `materials`, `attributes` and `skins`: textured surfaces, and what is not used;
//! 3. `extent`, `occupancy` and `viewpoint`: a camera for scenes without one;
//! 4. `node_map`, `animation` and `sway`: the file's animations, or wind where there are none.

use std::path::Path;

use girandole::glam::{Affine3A, Mat3, Vec3, Vec4};
use girandole::{DirectionalLight, LightWorld, Policy};
use girandole_assets::AssetError;
use girandole_assets::gltf::gltf::{Document, Node, Primitive, Semantic};
use girandole_assets::gltf::{
    self, GltfFile, GltfOptions, SceneNode, load_lights, node_instances, primitive_attribute, scene_nodes,
};

use super::texture::{self, Texture};
use super::{Alpha, Animation, Camera, Material, Mesh, Object, Scene, SceneError, Sky, Stage, Triangle};

pub mod notes;
pub mod images;
pub mod materials;
pub mod attributes;
pub mod skins;

pub mod extent;
pub mod occupancy;
pub mod viewpoint;

pub mod node_map;
pub mod animation;
pub mod sway;

use animation::Player;
use images::Images;
use materials::Materials;
use node_map::{NodeMap, NodeObject, to_single};
use notes::Notes;
use sway::Sway;

/// Point lights often lie inside the mesh of their lamp. Within this distance of a light, in
/// metres, nothing casts a shadow of it.
const LAMP_CLEARANCE: f32 = 0.35;
/// The same for small scenes, as a share of their size.
const LAMP_CLEARANCE_SHARE: f32 = 0.02;
/// Most placed meshes: nodes can share the accessors of their instances, so that a small file could
/// describe more than fit into memory.
const MAX_OBJECTS: usize = 1 << 24;
/// Most triangles of meshes that are posed by skins, for the same reason.
const MAX_POSED: usize = 1 << 24;
/// The sky above files, which have none.
const SKY: Sky = Sky {
    zenith: Vec3::new(0.004, 0.007, 0.018),
    horizon: Vec3::new(0.02, 0.018, 0.02),
    ambient: Vec3::new(0.012, 0.014, 0.02),
    haze: 0.0,
    glow: Vec3::ZERO,
    sun: Vec3::ZERO,
};

/// Required extensions that are not read, and the commands of glTF Transform that convert such files.
const CONVERTERS: [(&str, &str); 5] = [
    ("KHR_draco_mesh_compression", "copy"),
    ("EXT_meshopt_compression", "copy"),
    ("KHR_meshopt_compression", "copy"),
    ("KHR_texture_basisu", "ktxdecompress"),
    ("EXT_texture_avif", "png --formats '*'"),
];

/// Reads a file and its buffers. An error is one line that begins with the path.
pub fn open(path: &Path) -> Result<GltfFile, SceneError> {
    gltf::load(path, &GltfOptions::default()).map_err(|error| match &error {
        AssetError::Read { .. } => SceneError(error.to_string()),
        AssetError::Extensions { names } => {
            let command = |name: &String| Some(CONVERTERS.iter().find(|(known, _)| known == name)?.1);
            let mut commands: Vec<&str> = names.iter().filter_map(command).collect();
            commands.sort_unstable();
            commands.dedup();
            let advice = commands.iter().map(|command| format!("; \"gltf-transform {command} IN OUT\" converts it"));
            SceneError(format!("{}: {error}{}", path.display(), advice.collect::<String>()))
        }
        _ => SceneError(format!("{}: {error}", path.display())),
    })
}

/// Loads a file for pictures of 16:9. See [`stage_in_frame`].
pub fn stage(path: &Path, camera: Option<Camera>) -> Result<Stage, SceneError> {
    stage_in_frame(path, camera, 16.0 / 9.0)
}

/// Loads a file. The camera is `camera`, else the first perspective camera of the file, else it is
/// placed where it shows the scene in a picture that is `aspect` times as wide as high.
pub fn stage_in_frame(path: &Path, camera: Option<Camera>, aspect: f32) -> Result<Stage, SceneError> {
    let fail = |what: String| SceneError(format!("{}: {what}", path.display()));
    let file = open(path)?;
    let images = images::load(&file).map_err(|error| fail(error.0))?;
    let mut world = LightWorld::new();
    let options = GltfOptions { policy: Policy::Budgeted, ..GltfOptions::default() };
    let lights =
        load_lights(&mut world, &file, &images.for_lights(), &options).map_err(|error| fail(error.to_string()))?;
    let mut nodes = vec![None; file.document.nodes().len()];
    for node in scene_nodes(&file.document).map_err(|error| fail(error.to_string()))? {
        nodes[node.node] = Some(node);
    }
    let placed = place(&file, &nodes, &images).map_err(|error| fail(error.0))?;
    if placed.objects.is_empty() {
        return Err(fail("its scene has no triangles".into()));
    }
    let own_camera = file_camera(&file.document, &nodes);
    let mut scene = Scene {
        materials: placed.materials,
        textures: placed.textures,
        meshes: placed.meshes,
        objects: placed.objects,
        festival: None,
        camera: Camera { eye: Vec3::ZERO, target: Vec3::NEG_Z, vertical_fov: viewpoint::FIELD_OF_VIEW, up: Vec3::Y },
        sky: SKY,
        lamp_clearance: LAMP_CLEARANCE,
        exposure: 1.0,
        is_metered: true,
        warnings: images.warnings,
    };
    scene.warnings.extend(placed.warnings);
    let extent = extent::Extent::of(&scene);
    scene.lamp_clearance = LAMP_CLEARANCE.min(extent.size() * LAMP_CLEARANCE_SHARE);
    if world.light_count() == 0 && world.directionals().len() == 0 {
        scene.warnings.push("the file has no lights; a moon is added".into());
        world.add_directional(moon())?;
    }
    scene.camera = camera.or(own_camera).unwrap_or_else(|| viewpoint::camera(&scene, &world, &extent, aspect));
    let node_map = NodeMap::new(&file.document, &placed.node_objects, &lights);
    let animation: Box<dyn Animation> = match Player::new(&file, node_map.clone()).map_err(|error| fail(error.0))? {
        Some(player) => Box::new(player),
        None => Box::new(Sway::new(&file.document, &scene, node_map)),
    };
    Ok(Stage { scene, world, animation })
}

/// A light for files without lights, from above and from behind the usual camera. It is ten times as bright
/// as a full moon, so that surfaces are brighter than the sky.
fn moon() -> DirectionalLight {
    DirectionalLight { direction: Vec3::new(-0.5, -0.75, -0.43).normalize(), illuminance: Vec3::new(1.6, 2.1, 3.2) }
}

/// The geometry of a file.
struct PlacedMeshes {
    materials: Vec<Material>,
    textures: Vec<Texture>,
    meshes: Vec<Mesh>,
    objects: Vec<Object>,
    node_objects: Vec<NodeObject>,
    warnings: Vec<String>,
}

/// Converts the materials and meshes of a file and places its nodes, of which `nodes` has those of the scene by index.
fn place(file: &GltfFile, nodes: &[Option<SceneNode>], images: &Images) -> Result<PlacedMeshes, SceneError> {
    let document = &file.document;
    let error = |error: AssetError| SceneError(error.to_string());
    let mut notes = Notes::default();
    notes.add_unused(document);
    let mut materials = Materials::new(images);
    materials.add_all(document);
    let mut mesh_indices: Vec<Option<u32>> = vec![None; document.meshes().len()];
    let mut meshes: Vec<Mesh> = Vec::new();
    for source in document.meshes() {
        let mut mesh = Mesh::default();
        for primitive in source.primitives() {
            add_primitive(&mut mesh, source.index(), &primitive, &file.buffers, &mut materials, &mut notes)
                .map_err(error)?;
        }
        if mesh.triangles.iter().flat_map(|triangle| triangle.vertices).any(|vertex| !vertex.is_finite()) {
            return Err(SceneError(format!("mesh {}: a position is not a finite number", source.index())));
        }
        if !mesh.triangles.is_empty() {
            mesh_indices[source.index()] = Some(meshes.len() as u32);
            meshes.push(mesh);
        }
    }
    let mut objects = Vec::new();
    let mut node_objects = Vec::new();
    let mut posed_count = 0;
    for node in document.nodes() {
        let mesh = node.mesh().and_then(|mesh| mesh_indices[mesh.index()]);
        let (Some(mesh), Some(SceneNode { transform, is_visible: visible, .. })) = (mesh, nodes[node.index()]) else {
            continue;
        };
        if node.skin().is_some() {
            posed_count += meshes[mesh as usize].triangles.len();
            if posed_count > MAX_POSED {
                return Err(SceneError(format!("its skins pose more than {MAX_POSED} triangles")));
            }
            if let Some(posed) = skins::posed(&node, &meshes[mesh as usize], file, nodes).map_err(error)? {
                let emits =
                    |triangle: &Triangle| materials.materials[triangle.material as usize].emission != Vec3::ZERO;
                let is_lamp = posed.triangles.iter().any(emits);
                notes.add_if(is_lamp, "lights of surfaces with skins stay where they are without", "nodes");
                notes.add_if(document.animations().len() > 0, "skins are shown at rest, without animation", "nodes");
                let transform = Affine3A::IDENTITY;
                objects.push(Object { mesh: meshes.len() as u32, transform, emission_scale: 1.0, visible });
                meshes.push(posed);
                continue;
            }
            notes.add("skins that leave out joints or vertices are not used", "nodes");
        }
        for local in node_instances(file, &node).map_err(error)? {
            if objects.len() == MAX_OBJECTS {
                return Err(SceneError(format!("its nodes place more than {MAX_OBJECTS} meshes")));
            }
            node_objects.push(NodeObject { node: node.index(), object: objects.len(), local });
            let transform = to_single(transform * local);
            objects.push(Object { mesh, transform, emission_scale: 1.0, visible });
        }
    }
    let Materials { materials, textures, mut warnings, .. } = materials;
    warnings.extend(notes.lines());
    Ok(PlacedMeshes { materials, textures, meshes, objects, node_objects, warnings })
}

/// Adds the triangles of a primitive to a mesh, with its colours and normals, and the texture coordinates that its
/// material uses.
fn add_primitive(
    mesh: &mut Mesh,
    index: usize,
    primitive: &Primitive<'_>,
    buffers: &[Vec<u8>],
    materials: &mut Materials<'_>,
    notes: &mut Notes,
) -> Result<(), AssetError> {
    let Some(corners) = primitive_attribute(index, primitive, &Semantic::Positions, buffers)? else { return Ok(()) };
    let (material, sets) = materials.of(primitive);
    let first = mesh.triangles.len();
    mesh.triangles.extend(corners.into_iter().map(|corners| Triangle { vertices: corners.map(Vec3::from), material }));
    let count = mesh.triangles.len();
    for (slot, set) in sets.into_iter().enumerate() {
        let Some(set) = set else { continue };
        let coordinates = primitive_attribute::<2>(index, primitive, &Semantic::TexCoords(set), buffers)?;
        let Some(coordinates) = coordinates else { continue };
        if !coordinates.as_flattened().as_flattened().iter().all(|x| x.is_finite()) {
            let message = format!("mesh {index}: a texture coordinate is not a finite number");
            return Err(AssetError::Invalid { message });
        }
        mesh.tex_coords.resize(count, [Vec4::ZERO; 3]);
        for (corner, found) in mesh.tex_coords[first..].as_flattened_mut().iter_mut().zip(coordinates.as_flattened()) {
            [corner[2 * slot], corner[2 * slot + 1]] = *found;
        }
    }
    if let Some(colors) = attributes::colors((index, primitive, buffers), notes)? {
        mesh.colors.resize(first, [Vec4::ONE; 3]);
        mesh.colors.extend(colors);
    }
    if let Some(normals) = attributes::normals((index, primitive, buffers), notes)? {
        mesh.normals.resize(first, [Vec4::ZERO; 3]);
        mesh.normals.extend(normals);
    }
    // Of the triangles of other primitives, and of those that follow.
    let fill = |list: &mut Vec<[Vec4; 3]>, value: Vec4| {
        if !list.is_empty() {
            list.resize(count, [value; 3])
        }
    };
    fill(&mut mesh.tex_coords, Vec4::ZERO);
    fill(&mut mesh.colors, Vec4::ONE);
    fill(&mut mesh.normals, Vec4::ZERO);
    Ok(())
}

/// The first perspective camera of the scene.
fn file_camera(document: &Document, nodes: &[Option<SceneNode>]) -> Option<Camera> {
    use girandole_assets::gltf::gltf::camera::Projection;
    let perspective = |node: Node<'_>| match node.camera()?.projection() {
        Projection::Perspective(lens) => Some((nodes[node.index()]?, lens.yfov())),
        Projection::Orthographic(_) => None,
    };
    document.nodes().find_map(perspective).and_then(|(placed, vertical_fov)| {
        let transform = to_single(placed.transform);
        let eye = Vec3::from(transform.translation);
        let axes = Mat3::from(transform.matrix3);
        let forward = (axes * Vec3::NEG_Z).try_normalize()?;
        let is_usable = (0.01..3.1).contains(&vertical_fov);
        Some(Camera {
            eye,
            target: eye + forward,
            vertical_fov: if is_usable { vertical_fov } else { viewpoint::FIELD_OF_VIEW },
            up: (axes * Vec3::Y).normalize_or(Vec3::Y),
        })
    })
}
