//! Plans the trees and instances of a document, and checks them, before the world is changed.
//!
//! The first pass walks the scene's nodes, finds out which of them share a tree, and counts lights.
//! Only when the count is within the limit does the second pass read the lights.

use std::collections::{BTreeMap, BTreeSet};

use ::gltf::khr_lights_punctual::{self, Kind};
use ::gltf::{Material, Mesh, Node, Primitive};
use girandole::{DirectionalLight, Light, Placement, Profile, ValueError};
use glam::{DAffine3, Quat, Vec3};

use super::emissive::{EmissiveTexture, TextureKey, Textures, coverage};
use super::files::Files;
use super::load::GltfFile;
use super::nodes::{LightSource, SceneNode, instances, is_hidden, scene_nodes, transform_error};
use super::options::{EmissiveSides, GltfOptions};
use super::profiles::{Lamp, read_profile};
use super::read::Triangles;
use super::texture::TextureImage;
use crate::error::{AssetError, invalid};
use crate::texture::TexturedSurface;

/// The most lights that a primitive gets beyond its triangles.
const MAX_PARTS: usize = 1 << 10;

/// The radiance that a material emits, in nits: `emissiveFactor` times the strength of
/// KHR_materials_emissive_strength. Textures are not regarded.
pub fn material_emission(material: &Material<'_>) -> Vec3 {
    Vec3::from(material.emissive_factor()) * material.emissive_strength().unwrap_or(1.0)
}

/// A tree to be added.
pub(super) struct PlannedTree<'a> {
    /// The first node that uses it, which errors name.
    pub node: usize,
    /// Its lights, beside those of its surfaces that are not read yet. Without any, it is not added.
    pub lights: Vec<Light>,
    surfaces: Vec<Surface<'a>>,
}

/// An instance to be added.
pub(super) struct PlannedInstance {
    pub node: usize,
    pub source: LightSource,
    /// Index into [`Plan::trees`].
    pub tree: usize,
    pub placement: Placement,
    /// The transform to the space of the node.
    pub local: DAffine3,
    pub is_visible: bool,
}

/// The triangles of an emissive primitive.
struct Surface<'a> {
    mesh: usize,
    triangles: Triangles<'a>,
    radiance: Vec3,
    two_sided: bool,
    texture: Option<EmissiveTexture<'a>>,
}

/// What the lights of a primitive depend on: primitives with equal keys have equal lights.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct SurfaceKey {
    mode: u32,
    positions: usize,
    indices: Option<usize>,
    /// Bits of the radiance.
    radiance: [u32; 3],
    two_sided: bool,
    texture: Option<TextureKey>,
}

/// What a tree is made from: it is made once.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Origin {
    Mesh(usize),
    /// Meshes with equal lights share a tree.
    Surfaces(Vec<SurfaceKey>),
    Light(usize),
    /// A profile and the bits of its factor.
    Lamp(usize, [u32; 3]),
}

/// The trees, instances and directional lights of a document.
pub(super) struct Plan<'a> {
    file: &'a GltfFile,
    images: &'a [Option<TextureImage<'a>>],
    options: &'a GltfOptions,
    files: Files<'a>,
    pub trees: Vec<PlannedTree<'a>>,
    pub instances: Vec<PlannedInstance>,
    /// Nodes and their directional lights.
    pub directional: Vec<(usize, DirectionalLight)>,
    /// The trees that were met; `None` for meshes that do not emit.
    known: BTreeMap<Origin, Option<usize>>,
    /// The profiles that were read.
    profiles: BTreeMap<usize, Profile>,
    /// Lights of all trees, and directional ones.
    light_count: u64,
}

impl<'a> Plan<'a> {
    pub fn new(
        file: &'a GltfFile,
        images: &'a [Option<TextureImage<'a>>],
        options: &'a GltfOptions,
    ) -> Result<Self, AssetError> {
        let mut plan = Self {
            file,
            images,
            options,
            files: Files::new(file.folder.as_deref(), options),
            trees: Vec::new(),
            instances: Vec::new(),
            directional: Vec::new(),
            known: BTreeMap::new(),
            profiles: BTreeMap::new(),
            light_count: 0,
        };
        let nodes: Vec<Node<'_>> = file.document.nodes().collect();
        for placed in scene_nodes(&file.document)? {
            let node = &nodes[placed.node];
            if let Some(mesh) = node.mesh().filter(|_| options.surfaces) {
                plan.add_mesh(&placed, node, &mesh)?;
            }
            if !options.punctual {
                continue;
            }
            if let Some(light) = node.light() {
                plan.add_light(&placed, &light)?;
            }
            if let Some(lamp) = Lamp::of(node)? {
                plan.add_lamp(&placed, &lamp)?;
            }
        }
        if plan.light_count > options.max_lights as u64 {
            let (needed, limit) = (plan.light_count, options.max_lights as u64);
            return Err(AssetError::Limit { option: "max_lights", needed, limit });
        }
        plan.read_surfaces()?;
        Ok(plan)
    }

    /// Adds the instances of a node's mesh if the mesh emits.
    fn add_mesh(&mut self, placed: &SceneNode, node: &Node<'_>, mesh: &Mesh<'_>) -> Result<(), AssetError> {
        let tree = match self.known.get(&Origin::Mesh(mesh.index())) {
            Some(&known) => known,
            None => {
                let tree = self.mesh_tree(placed.node, mesh)?;
                self.known.insert(Origin::Mesh(mesh.index()), tree);
                tree
            }
        };
        let Some(tree) = tree else { return Ok(()) };
        let mut instances = instances(self.file, node)?;
        instances.try_for_each(|local| self.add_instance(placed, LightSource::Surfaces, tree, local?))
    }

    /// The tree of a mesh's emissive triangles, which may be the tree of another mesh; `None` if
    /// there are none.
    fn mesh_tree(&mut self, node: usize, mesh: &Mesh<'_>) -> Result<Option<usize>, AssetError> {
        let (mut keys, mut surfaces) = (Vec::new(), Vec::new());
        let mut known = BTreeSet::new();
        for primitive in mesh.primitives() {
            let Some((key, surface)) = self.surface(mesh.index(), &primitive)? else { continue };
            if known.insert(key) {
                keys.push(key);
                surfaces.push(surface);
            }
        }
        let count = surfaces.iter().map(|surface: &Surface<'_>| surface.triangles.count() as u64).sum();
        if count == 0 {
            return Ok(None);
        }
        let origin = Origin::Surfaces(keys);
        if let Some(&tree) = self.known.get(&origin) {
            return Ok(tree);
        }
        Ok(Some(self.add_tree(origin, PlannedTree { node, lights: Vec::new(), surfaces }, count)))
    }

    /// An emissive primitive of triangles; `None` for other primitives.
    fn surface(&self, mesh: usize, primitive: &Primitive<'_>) -> Result<Option<(SurfaceKey, Surface<'a>)>, AssetError> {
        let (material, buffers) = (primitive.material(), &self.file.buffers);
        let radiance = material_emission(&material);
        if radiance == Vec3::ZERO {
            return Ok(None);
        }
        let Some(triangles) = Triangles::new(mesh, primitive, buffers)? else { return Ok(None) };
        let two_sided = match self.options.sides {
            EmissiveSides::OfMaterial => material.double_sided(),
            EmissiveSides::Front => false,
            EmissiveSides::Both => true,
        };
        let texture = EmissiveTexture::of(primitive, self.images, buffers)?;
        let is_masked = texture.as_ref().is_some_and(EmissiveTexture::is_masked);
        let radiance = if is_masked { radiance } else { radiance * coverage(&material) };
        if radiance == Vec3::ZERO {
            return Ok(None);
        }
        let key = SurfaceKey {
            mode: primitive.mode().as_gl_enum(),
            positions: triangles.positions.accessor,
            indices: primitive.indices().map(|accessor| accessor.index()),
            radiance: radiance.to_array().map(f32::to_bits),
            two_sided,
            texture: texture.as_ref().map(EmissiveTexture::key),
        };
        Ok(Some((key, Surface { mesh, triangles, radiance, two_sided, texture })))
    }

    /// Adds an instance of a node's point or spot light, or a directional light.
    fn add_light(&mut self, placed: &SceneNode, light: &khr_lights_punctual::Light<'_>) -> Result<(), AssetError> {
        let emission = Vec3::from(light.color()) * light.intensity();
        let local = match light.kind() {
            Kind::Point => Light::point(Vec3::ZERO, emission),
            Kind::Spot { inner_cone_angle: inner, outer_cone_angle: outer } => {
                Light::spot(Vec3::ZERO, Vec3::NEG_Z, inner, outer, emission)
            }
            Kind::Directional => return self.add_directional(placed, emission),
        };
        let local = light.range().map_or(local, |range| local.with_range(range));
        let owner = format!("light {}", light.index());
        self.add_lamp_light(placed, LightSource::Punctual, Origin::Light(light.index()), local, &owner)
    }

    /// Adds a directional light. A node that is hidden by its scale may give its light no direction.
    fn add_directional(&mut self, placed: &SceneNode, illuminance: Vec3) -> Result<(), AssetError> {
        let placement = LightSource::Punctual.placement(&placed.transform);
        let direction = placement.ok_or_else(|| transform_error(placed.node))?.linear * Vec3::NEG_Z;
        if placed.is_visible && !is_hidden(&placed.transform) {
            self.directional.push((placed.node, DirectionalLight { direction, illuminance }));
            self.light_count += 1;
        }
        Ok(())
    }

    /// Adds an instance of a node's lamp with a profile.
    fn add_lamp(&mut self, placed: &SceneNode, lamp: &Lamp) -> Result<(), AssetError> {
        let profile = match self.profiles.get(&lamp.profile) {
            Some(&known) => known,
            None => read_profile(self.file, lamp.profile, &mut self.files)?,
        };
        self.profiles.insert(lamp.profile, profile);
        let light = Light::profile(Vec3::ZERO, Quat::IDENTITY, profile, lamp.factor);
        let origin = Origin::Lamp(lamp.profile, lamp.factor.to_array().map(f32::to_bits));
        self.add_lamp_light(placed, LightSource::Profile, origin, light, &format!("profile {}", lamp.profile))
    }

    /// Adds an instance of a tree of one light.
    fn add_lamp_light(
        &mut self,
        placed: &SceneNode,
        source: LightSource,
        origin: Origin,
        light: Light,
        owner: &str,
    ) -> Result<(), AssetError> {
        let tree = match self.known.get(&origin) {
            Some(&Some(known)) => known,
            _ => {
                light.validate().map_err(|error| light_error(owner, error))?;
                self.add_tree(origin, PlannedTree { node: placed.node, lights: vec![light], surfaces: Vec::new() }, 1)
            }
        };
        self.add_instance(placed, source, tree, DAffine3::IDENTITY)
    }

    fn add_tree(&mut self, origin: Origin, tree: PlannedTree<'a>, count: u64) -> usize {
        self.light_count = self.light_count.saturating_add(count);
        self.trees.push(tree);
        self.known.insert(origin, Some(self.trees.len() - 1));
        self.trees.len() - 1
    }

    fn add_instance(
        &mut self,
        placed: &SceneNode,
        source: LightSource,
        tree: usize,
        local: DAffine3,
    ) -> Result<(), AssetError> {
        let (needed, limit) = (self.instances.len() as u64 + 1, self.options.max_instances as u64);
        if needed > limit {
            return Err(AssetError::Limit { option: "max_instances", needed, limit });
        }
        let &SceneNode { node, is_visible, .. } = placed;
        let placement = source.placement(&(placed.transform * local)).ok_or_else(|| transform_error(node))?;
        self.instances.push(PlannedInstance { node, source, tree, placement, local, is_visible });
        Ok(())
    }

    /// The second pass: reads and checks the lights of surfaces.
    fn read_surfaces(&mut self) -> Result<(), AssetError> {
        let mut textures = Textures::new(self.images);
        // The number of lights that may be added to those of triangles.
        let mut room = self.options.max_lights - self.light_count as usize;
        room = room.min(self.options.texture_parts);
        for tree in &mut self.trees {
            for surface in &tree.surfaces {
                tree.lights.reserve_exact(surface.triangles.count());
                surface.read(&mut textures, self.options, &mut room, &mut tree.lights)?;
            }
        }
        Ok(())
    }
}

impl<'a> Surface<'a> {
    /// Adds its lights: one for each triangle, or more of those whose texture is cut into parts, without those over which
    /// the texture is black.
    fn read(
        &self,
        textures: &mut Textures<'_>,
        options: &GltfOptions,
        room: &mut usize,
        lights: &mut Vec<Light>,
    ) -> Result<(), AssetError> {
        let mut add = |light: Light| {
            let light = if self.two_sided { light.two_sided() } else { light };
            light.validate().map_err(|error| light_error(&format!("mesh {}", self.mesh), error))?;
            if light.emission != Vec3::ZERO {
                lights.push(light);
            }
            Ok(())
        };
        let mut triangles =
            self.triangles.corners(&self.triangles.positions).map(|corners| Ok(corners?.map(Vec3::from)));
        let Some(texture) = &self.texture else {
            return triangles.try_for_each(|vertices| add(Light::triangle(vertices?, self.radiance)));
        };
        let textured = triangles
            .zip(texture.on_image(&self.triangles))
            .map(|(vertices, corners)| Ok(TexturedSurface::exact_triangle(vertices?, corners?, self.radiance)))
            .collect::<Result<Vec<_>, AssetError>>()?;
        let shown = textures.get(texture)?;
        let parts = shown.split(&textured, options.texture_noise, textured.len() + MAX_PARTS.min(*room));
        *room -= parts.len() - textured.len();
        parts.iter().try_for_each(|part| add(shown.light(part)))
    }
}

/// A light of a document has an invalid value.
fn light_error(owner: &str, error: ValueError) -> AssetError {
    invalid(format!("{owner}: {error}"))
}
