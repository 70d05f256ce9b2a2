//! Stages from glTF files: meshes, materials, hierarchy, lights and animations.
//!
//! Read in this order:
//!
//! 1. this file: how the stage is put together;
//! 2. `notes`, `images`, `materials` and `attributes`: textured surfaces, and what is not used;
//! 3. `node_map`, `animation` and `sway`: the file's animations, or wind where there are none.

use std::path::Path;

use girandole::cluster::Aabb;
use girandole::glam::{Mat3, Vec3, Vec4};
use girandole::{DirectionalLight, LightWorld, Policy};
use girandole_assets::AssetError;
use girandole_assets::gltf::gltf::camera::Projection;
use girandole_assets::gltf::gltf::{Document, Node, Primitive, Semantic};
use girandole_assets::gltf::{
    self, GltfFile, GltfOptions, SceneNode, load_lights, node_instances, primitive_attribute, scene_nodes,
};

use super::{Alpha, Animation, Camera, Material, Mesh, Object, Scene, SceneError, Sky, Stage, Triangle, texture};

pub mod notes;
pub mod images;
pub mod materials;
pub mod attributes;

pub mod node_map;
pub mod animation;
pub mod sway;

use animation::Player;
use images::Images;
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
/// Reads a file and its buffers. An error is one line that begins with the path.
pub fn open(path: &Path) -> Result<GltfFile, SceneError> {
    gltf::load(path, &GltfOptions::default()).map_err(|error| match &error {
        AssetError::Read { .. } => SceneError(error.to_string()),
        _ => SceneError(format!("{}: {error}", path.display())),
    })
}

/// Loads a file for pictures of 16:9. See [`stage_in_frame`].
pub fn stage(path: &Path, camera: Option<Camera>) -> Result<Stage, SceneError> {
    stage_in_frame(path, camera, 16.0 / 9.0)
}

/// Loads a file. The camera is `camera`, else the first perspective camera of the file, else one that sees the whole
/// scene in a picture that is `aspect` times as wide as high.
pub fn stage_in_frame(path: &Path, camera: Option<Camera>, aspect: f32) -> Result<Stage, SceneError> {
    let file = open(path)?;
    load(&file, camera, aspect).map_err(|SceneError(what)| SceneError(format!("{}: {what}", path.display())))
}

/// Makes a stage of a file. Errors are without its path.
fn load(file: &GltfFile, camera: Option<Camera>, aspect: f32) -> Result<Stage, SceneError> {
    let mut notes = Notes::default();
    let images = images::load(file, &mut notes)?;
    let mut world = LightWorld::new();
    let options = GltfOptions { policy: Policy::Budgeted, ..GltfOptions::default() };
    let lights = load_lights(&mut world, file, &images.for_lights(), &options)?;
    let mut nodes = vec![None; file.document.nodes().len()];
    for node in scene_nodes(&file.document)? {
        nodes[node.node] = Some(node);
    }
    // Files have no sky.
    let [zenith, horizon, ambient] = [[0.004, 0.007, 0.018], [0.02, 0.018, 0.02], [0.012, 0.014, 0.02]].map(Vec3::from);
    let sky = Sky { zenith, horizon, ambient, ..Sky::default() };
    let mut scene = Scene { sky, is_metered: true, ..Scene::default() };
    let objects = place(file, &nodes, &images, &mut scene, &mut notes)?;
    scene.warnings = notes.lines();
    let visible = scene.objects.iter().filter(|object| object.visible);
    let bounds = Aabb::around(visible.flat_map(|object| scene.vertices(object)));
    scene.lamp_clearance = LAMP_CLEARANCE.min(LAMP_CLEARANCE_SHARE * bounds.extent().length());
    if world.light_count() == 0 && world.directionals().len() == 0 {
        scene.warnings.push("the file has no lights; a moon is added".into());
        world.add_directional(moon())?;
    }
    let own_camera = || file_camera(&file.document, &nodes);
    scene.camera = camera.or_else(own_camera).unwrap_or_else(|| Camera::around(&bounds, aspect));
    let node_map = NodeMap { objects, lights };
    let animation: Box<dyn Animation> = match Player::new(file, &node_map)? {
        Some(player) => Box::new(player),
        None => Box::new(Sway::new(&file.document, &scene, &nodes, node_map)),
    };
    Ok(Stage { scene, world, animation })
}

/// A light for files without lights, from above and from behind the usual camera. It is ten times as bright
/// as a full moon, so that surfaces are brighter than the sky.
fn moon() -> DirectionalLight {
    DirectionalLight { direction: Vec3::new(-0.5, -0.75, -0.43).normalize(), illuminance: Vec3::new(1.6, 2.1, 3.2) }
}

/// Adds the materials and meshes of a file to a scene, and places its nodes, of which `nodes` has those of the scene
/// by index.
fn place(
    file: &GltfFile,
    nodes: &[Option<SceneNode>],
    images: &Images,
    scene: &mut Scene,
    notes: &mut Notes,
) -> Result<Vec<NodeObject>, SceneError> {
    let document = &file.document;
    notes.add_unused(document);
    (scene.materials, scene.textures) = materials::convert_all(document, images, notes);
    let mut mesh_indices: Vec<Option<u32>> = vec![None; document.meshes().len()];
    for source in document.meshes() {
        let mut mesh = Mesh::default();
        for primitive in source.primitives() {
            add_primitive(&mut mesh, source.index(), &primitive, file, scene, notes)?;
        }
        if mesh.triangles.iter().flat_map(|triangle| triangle.vertices).any(|vertex| !vertex.is_finite()) {
            return Err(SceneError(format!("mesh {}: a position is not a finite number", source.index())));
        }
        if !mesh.triangles.is_empty() {
            mesh_indices[source.index()] = Some(scene.meshes.len() as u32);
            scene.meshes.push(mesh);
        }
    }
    let mut objects = Vec::new();
    for node in document.nodes() {
        let mesh = node.mesh().and_then(|mesh| mesh_indices[mesh.index()]);
        let (Some(mesh), Some(SceneNode { transform, is_visible: visible, .. })) = (mesh, nodes[node.index()]) else {
            continue;
        };
        for local in node_instances(file, &node)? {
            if objects.len() == MAX_OBJECTS {
                return Err(SceneError(format!("its nodes place more than {MAX_OBJECTS} meshes")));
            }
            objects.push(NodeObject { node: node.index(), object: objects.len(), local });
            let transform = to_single(transform * local);
            scene.objects.push(Object { mesh, transform, emission_scale: 1.0, visible });
        }
    }
    if objects.is_empty() {
        return Err(SceneError("its scene has no triangles".into()));
    }
    Ok(objects)
}

/// Adds the triangles of a primitive to a mesh, with its colours and normals, and with its texture coordinates if its
/// material has textures. A primitive without the coordinates of a texture gets the material without textures.
fn add_primitive(
    mesh: &mut Mesh,
    index: usize,
    primitive: &Primitive<'_>,
    file: &GltfFile,
    scene: &mut Scene,
    notes: &mut Notes,
) -> Result<(), AssetError> {
    let Some(corners) = primitive_attribute(index, primitive, &Semantic::Positions, &file.buffers)? else {
        return Ok(());
    };
    let mut material = primitive.material().index().unwrap_or(file.document.materials().len());
    let textures: Vec<u32> = scene.materials[material].textures().collect();
    let set = |texture: &u32| Semantic::TexCoords(scene.textures[*texture as usize].coordinates);
    if textures.iter().any(|texture| primitive.get(&set(texture)).is_none()) {
        let plain = Material {
            base_color_texture: None,
            emission_texture: None,
            roughness_texture: None,
            ..scene.materials[material]
        };
        material = scene.materials.len();
        scene.materials.push(plain);
    }
    let (first, material) = (mesh.triangles.len(), material as u32);
    mesh.triangles.extend(corners.into_iter().map(|corners| Triangle { vertices: corners.map(Vec3::from), material }));
    let count = mesh.triangles.len();
    for set in if textures.is_empty() { 0..0 } else { 0..2 } {
        let semantic = Semantic::TexCoords(set);
        let Some(coordinates) = primitive_attribute::<2>(index, primitive, &semantic, &file.buffers)? else { continue };
        if !coordinates.as_flattened().as_flattened().iter().all(|x| x.is_finite()) {
            let message = format!("mesh {index}: a texture coordinate is not a finite number");
            return Err(AssetError::Invalid { message });
        }
        mesh.tex_coords.resize(count, [Vec4::ZERO; 3]);
        for (corner, found) in mesh.tex_coords[first..].as_flattened_mut().iter_mut().zip(coordinates.as_flattened()) {
            [corner[2 * set as usize], corner[2 * set as usize + 1]] = *found;
        }
    }
    if let Some(colors) = attributes::colors((index, primitive, &file.buffers), notes)? {
        mesh.colors.resize(first, [Vec4::ONE; 3]);
        mesh.colors.extend(colors);
    }
    if let Some(normals) = attributes::normals((index, primitive, &file.buffers), notes)? {
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
    let perspective = |node: Node<'_>| match node.camera()?.projection() {
        Projection::Perspective(lens) => Some((nodes[node.index()]?, lens.yfov())),
        Projection::Orthographic(_) => None,
    };
    document.nodes().find_map(perspective).and_then(|(placed, vertical_fov)| {
        let transform = to_single(placed.transform);
        let eye = Vec3::from(transform.translation);
        let axes = Mat3::from(transform.matrix3);
        let forward = (axes * Vec3::NEG_Z).try_normalize()?;
        let vertical_fov = if (0.01..3.1).contains(&vertical_fov) { vertical_fov } else { Camera::FIELD_OF_VIEW };
        Some(Camera { eye, target: eye + forward, vertical_fov, up: (axes * Vec3::Y).normalize_or(Vec3::Y) })
    })
}
