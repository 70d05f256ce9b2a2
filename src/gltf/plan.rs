//! Plans the trees and instances of a document, and checks them, before the world is changed.
//!
//! The first pass walks the scene's nodes, finds out which of them share a tree, and counts lights.
//! Only when the count is within the limit does the second pass read the lights.

use std::collections::{BTreeMap, BTreeSet};

use ::gltf::khr_lights_punctual::{self, Kind};
use ::gltf::{Document, Material, Mesh, Node, Primitive, Semantic};
use glam::{DAffine3, Quat, Vec3};

use super::emissive::{EmissiveTexture, TextureKey, Textures, coverage};
use super::error::GltfError;
use super::instancing::Instances;
use super::nodes::{is_hidden, node_visibility, punctual_placement, scene_nodes, surface_placement, world_transforms};
use super::options::{EmissiveSides, GltfOptions};
use super::profiles::{Lamp, profile_placement, read_profile};
use super::read::Triangles;
use super::texture::TextureImage;
use crate::instance::placement::Placement;
use crate::light::{DirectionalLight, Light};
use crate::profile::Profile;
use crate::texture::TexturedSurface;

/// Where the lights of an instance come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LightSource {
    /// The emissive triangles of the node's mesh, in the order of the primitives: one light each, or more of a
    /// primitive whose texture varies. A primitive with the accessors and the emission of an earlier one of its mesh adds no lights,
    /// since it covers the same surface. Triangles whose emissive texture is black add none.
    Surfaces,
    /// The node's point or spot light.
    Punctual,
    /// The node's lamp with a photometric profile, of EXT_lights_ies.
    Profile,
}

/// The radiance that a material emits, in nits: `emissiveFactor` times the strength of
/// KHR_materials_emissive_strength. Textures are not regarded.
pub fn material_emission(material: &Material<'_>) -> Vec3 {
    Vec3::from(material.emissive_factor()) * material.emissive_strength().unwrap_or(1.0)
}

/// The trees, instances and directional lights of a document.
pub(super) struct Plan {
    pub trees: Vec<PlannedTree>,
    pub instances: Vec<PlannedInstance>,
    /// Nodes and their directional lights.
    pub directional: Vec<(usize, DirectionalLight)>,
}

/// A tree to be added.
pub(super) struct PlannedTree {
    /// The first node that uses it, which errors name.
    pub node: usize,
    pub lights: Vec<Light>,
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
    /// Whether the node is not hidden by KHR_node_visibility.
    pub is_shown: bool,
}

impl Plan {
    pub fn new<B: AsRef<[u8]>>(
        document: &Document,
        buffers: &[B],
        images: &[Option<TextureImage<'_>>],
        options: &GltfOptions,
    ) -> Result<Self, GltfError> {
        let value = options.surface_scale;
        if !(value.is_finite() && value >= 0.0) {
            return Err(GltfError::SurfaceScale { value });
        }
        let nodes: Vec<Node<'_>> = document.nodes().collect();
        let transforms = world_transforms(document)?;
        let shown = node_visibility(document)?;
        let mut outline = Outline::new(document, buffers, images, options);
        for (index, _) in scene_nodes(document)? {
            let (node, Some(transform)) = (&nodes[index], transforms[index]) else { continue };
            outline.is_shown = shown[index];
            if let Some(mesh) = node.mesh().filter(|_| options.surfaces) {
                outline.add_mesh(node, &mesh, &transform)?;
            }
            if options.punctual {
                if let Some(light) = node.light() {
                    outline.add_light(index, &light, &transform)?;
                }
                if let Some(lamp) = Lamp::of(node)? {
                    outline.add_lamp(index, &lamp, &transform)?;
                }
            }
        }
        let limit = options.max_lights;
        let found = outline.light_count.saturating_add(outline.directional.len() as u64);
        if found > limit as u64 {
            return Err(GltfError::TooManyLights { found, limit });
        }
        outline.read()
    }
}

/// The lights of a tree, not read yet.
struct TreeOutline<'a> {
    node: usize,
    lights: LightsOutline<'a>,
}

enum LightsOutline<'a> {
    Surfaces(Vec<Surface<'a>>),
    Punctual(Light),
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
    positions: Option<usize>,
    indices: Option<usize>,
    /// Bits of the radiance.
    radiance: [u32; 3],
    two_sided: bool,
    texture: Option<TextureKey>,
}

/// The first pass: trees by what they are made from, instances, and the number of lights.
struct Outline<'a, B> {
    document: &'a Document,
    buffers: &'a [B],
    images: &'a [Option<TextureImage<'a>>],
    options: &'a GltfOptions,
    /// The tree of each mesh that was met; `None` for meshes that do not emit.
    meshes: BTreeMap<usize, Option<usize>>,
    /// The trees of meshes by the keys of their emissive primitives: meshes with equal lights share
    /// a tree.
    surfaces: BTreeMap<Vec<SurfaceKey>, usize>,
    /// The tree of each point or spot light that was met.
    punctual: BTreeMap<usize, usize>,
    /// The profiles that were read.
    profiles: BTreeMap<usize, Profile>,
    /// The tree of each profile and bits of its factor that were met.
    lamps: BTreeMap<(usize, [u32; 3]), usize>,
    trees: Vec<TreeOutline<'a>>,
    instances: Vec<PlannedInstance>,
    directional: Vec<(usize, DirectionalLight)>,
    /// Lights of all trees.
    light_count: u64,
    /// Whether the present node is not hidden by KHR_node_visibility.
    is_shown: bool,
}

impl<'a, B: AsRef<[u8]>> Outline<'a, B> {
    fn new(
        document: &'a Document,
        buffers: &'a [B],
        images: &'a [Option<TextureImage<'a>>],
        options: &'a GltfOptions,
    ) -> Self {
        Self {
            document,
            buffers,
            images,
            options,
            meshes: BTreeMap::new(),
            surfaces: BTreeMap::new(),
            punctual: BTreeMap::new(),
            profiles: BTreeMap::new(),
            lamps: BTreeMap::new(),
            trees: Vec::new(),
            instances: Vec::new(),
            directional: Vec::new(),
            light_count: 0,
            is_shown: true,
        }
    }

    /// Adds the instances of a node's mesh if the mesh emits.
    fn add_mesh(&mut self, node: &Node<'_>, mesh: &Mesh<'_>, transform: &DAffine3) -> Result<(), GltfError> {
        let tree = match self.meshes.get(&mesh.index()) {
            Some(&known) => known,
            None => {
                let tree = self.mesh_tree(node.index(), mesh)?;
                self.meshes.insert(mesh.index(), tree);
                tree
            }
        };
        let Some(tree) = tree else { return Ok(()) };
        let instances = Instances::new(self.document, node, self.buffers)?;
        self.check_instances(instances.count())?;
        for local in instances.iter() {
            let local = local?;
            let (node, source) = (node.index(), LightSource::Surfaces);
            let world = *transform * local;
            if !world.is_finite() {
                return Err(GltfError::Transform { node });
            }
            let (placement, is_shown) = (surface_placement(&world), self.is_shown);
            self.instances.push(PlannedInstance { node, source, tree, placement, local, is_shown });
        }
        Ok(())
    }

    /// Refuses more instances than the limit.
    fn check_instances(&self, added: usize) -> Result<(), GltfError> {
        let (found, limit) = (self.instances.len() as u64 + added as u64, self.options.max_instances);
        if found <= limit as u64 { Ok(()) } else { Err(GltfError::TooManyInstances { found, limit }) }
    }

    /// The tree of a mesh's emissive triangles, which may be the tree of another mesh; `None` if
    /// there are none.
    fn mesh_tree(&mut self, node: usize, mesh: &Mesh<'_>) -> Result<Option<usize>, GltfError> {
        let (mut keys, mut surfaces) = (Vec::new(), Vec::new());
        let mut known = BTreeSet::new();
        let mut count = 0;
        for primitive in mesh.primitives() {
            let Some((key, surface)) = self.surface(mesh.index(), &primitive)? else { continue };
            if known.insert(key) {
                count += surface.triangles.count() as u64;
                keys.push(key);
                surfaces.push(surface);
            }
        }
        if count == 0 {
            return Ok(None);
        }
        if let Some(&tree) = self.surfaces.get(&keys) {
            return Ok(Some(tree));
        }
        let tree = self.add_tree(node, LightsOutline::Surfaces(surfaces), count);
        self.surfaces.insert(keys, tree);
        Ok(Some(tree))
    }

    /// An emissive primitive of triangles; `None` for other primitives.
    fn surface(&self, mesh: usize, primitive: &Primitive<'_>) -> Result<Option<(SurfaceKey, Surface<'a>)>, GltfError> {
        let material = primitive.material();
        let radiance = material_emission(&material) * self.options.surface_scale;
        if radiance == Vec3::ZERO {
            return Ok(None);
        }
        let Some(triangles) = Triangles::new(mesh, primitive, self.buffers)? else { return Ok(None) };
        let two_sided = match self.options.sides {
            EmissiveSides::OfMaterial => material.double_sided(),
            EmissiveSides::Front => false,
            EmissiveSides::Both => true,
        };
        let texture = EmissiveTexture::of(&material, primitive, self.images, self.buffers)?;
        let is_masked = texture.as_ref().is_some_and(EmissiveTexture::is_masked);
        let radiance = if is_masked { radiance } else { radiance * coverage(&material) };
        if radiance == Vec3::ZERO {
            return Ok(None);
        }
        let key = SurfaceKey {
            mode: primitive.mode().as_gl_enum(),
            positions: primitive.get(&Semantic::Positions).map(|accessor| accessor.index()),
            indices: primitive.indices().map(|accessor| accessor.index()),
            radiance: radiance.to_array().map(f32::to_bits),
            two_sided,
            texture: texture.as_ref().map(|texture| texture.key),
        };
        Ok(Some((key, Surface { mesh, triangles, radiance, two_sided, texture })))
    }

    /// Adds an instance of a node's point or spot light, or a directional light.
    fn add_light(
        &mut self,
        node: usize,
        light: &khr_lights_punctual::Light<'_>,
        transform: &DAffine3,
    ) -> Result<(), GltfError> {
        let emission = Vec3::from(light.color()) * light.intensity();
        let placement = punctual_placement(transform).ok_or(GltfError::Transform { node })?;
        let local = match light.kind() {
            Kind::Point => Light::point(Vec3::ZERO, emission),
            Kind::Spot { inner_cone_angle: inner, outer_cone_angle: outer } => {
                Light::spot(Vec3::ZERO, Vec3::NEG_Z, inner, outer, emission)
            }
            Kind::Directional => {
                // A node that is hidden by its scale may give its light no direction.
                if self.is_shown && !is_hidden(transform) {
                    let direction = placement.linear * Vec3::NEG_Z;
                    self.directional.push((node, DirectionalLight { direction, illuminance: emission }));
                }
                return Ok(());
            }
        };
        let tree = match self.punctual.get(&light.index()) {
            Some(&known) => known,
            None => {
                let local = light.range().map_or(local, |range| local.with_range(range));
                let invalid = |source| GltfError::Light { what: "light", index: light.index(), source };
                local.validate().map_err(invalid)?;
                let tree = self.add_tree(node, LightsOutline::Punctual(local), 1);
                self.punctual.insert(light.index(), tree);
                tree
            }
        };
        self.check_instances(1)?;
        let (source, local) = (LightSource::Punctual, DAffine3::IDENTITY);
        self.instances.push(PlannedInstance { node, source, tree, placement, local, is_shown: self.is_shown });
        Ok(())
    }

    /// Adds an instance of a node's lamp with a profile.
    fn add_lamp(&mut self, node: usize, lamp: &Lamp, transform: &DAffine3) -> Result<(), GltfError> {
        let placement = profile_placement(transform).ok_or(GltfError::Transform { node })?;
        let key = (lamp.profile, lamp.factor.to_array().map(f32::to_bits));
        let tree = match self.lamps.get(&key) {
            Some(&known) => known,
            None => {
                let profile = match self.profiles.get(&lamp.profile) {
                    Some(&known) => known,
                    None => read_profile(self.document, self.buffers, lamp.profile)?,
                };
                self.profiles.insert(lamp.profile, profile);
                let light = Light::profile(Vec3::ZERO, Quat::IDENTITY, profile, lamp.factor);
                let invalid = |source| GltfError::Light { what: "profile", index: lamp.profile, source };
                light.validate().map_err(invalid)?;
                let tree = self.add_tree(node, LightsOutline::Punctual(light), 1);
                self.lamps.insert(key, tree);
                tree
            }
        };
        self.check_instances(1)?;
        let (source, local) = (LightSource::Profile, DAffine3::IDENTITY);
        self.instances.push(PlannedInstance { node, source, tree, placement, local, is_shown: self.is_shown });
        Ok(())
    }

    fn add_tree(&mut self, node: usize, lights: LightsOutline<'a>, count: u64) -> usize {
        self.light_count = self.light_count.saturating_add(count);
        self.trees.push(TreeOutline { node, lights });
        self.trees.len() - 1
    }

    /// The second pass: reads and checks the lights of all trees. Leaves out trees without lights.
    fn read(self) -> Result<Plan, GltfError> {
        let mut textures = Textures::default();
        let found = self.light_count as usize + self.directional.len();
        let mut room = self.options.max_lights.saturating_sub(found).min(self.options.texture_parts);
        let (mut trees, mut kept) = (Vec::new(), Vec::with_capacity(self.trees.len()));
        for tree in self.trees {
            let lights = match tree.lights {
                LightsOutline::Surfaces(surfaces) => surface_lights(&surfaces, &mut textures, self.options, &mut room)?,
                LightsOutline::Punctual(light) => vec![light],
            };
            kept.push((!lights.is_empty()).then_some(trees.len()));
            if !lights.is_empty() {
                trees.push(PlannedTree { node: tree.node, lights });
            }
        }
        let renumbered = |planned: PlannedInstance| Some(PlannedInstance { tree: kept[planned.tree]?, ..planned });
        let instances = self.instances.into_iter().filter_map(renumbered).collect();
        Ok(Plan { trees, instances, directional: self.directional })
    }
}

/// The most lights that a primitive gets beyond its triangles.
const MAX_PARTS: usize = 1 << 10;

/// The lights of primitives: one for each triangle, or more of those whose texture is cut into parts, without those over
/// which the texture is black. `room` is the number of lights that may be added to those of triangles.
fn surface_lights<'a>(
    surfaces: &[Surface<'a>],
    textures: &mut Textures<'a>,
    options: &GltfOptions,
    room: &mut usize,
) -> Result<Vec<Light>, GltfError> {
    let mut lights = Vec::with_capacity(surfaces.iter().map(|surface| surface.triangles.count()).sum());
    for surface in surfaces {
        let invalid = |source| GltfError::Light { what: "mesh", index: surface.mesh, source };
        let mut add = |light: Light| {
            let light = if surface.two_sided { light.two_sided() } else { light };
            light.validate().map_err(invalid)?;
            if light.emission != Vec3::ZERO {
                lights.push(light);
            }
            Ok(())
        };
        let Some(texture) = &surface.texture else {
            for vertices in surface.triangles.iter() {
                add(Light::triangle(vertices?, surface.radiance))?;
            }
            continue;
        };
        let textured = surface.triangles.iter().enumerate().map(|(triangle, vertices)| {
            let corners = texture.on_image(surface.triangles.tex_coords(triangle, &texture.coordinates)?);
            Ok(TexturedSurface::white_triangle(vertices?, surface.radiance).with_exact_tex_coords(corners))
        });
        let textured = textured.collect::<Result<Vec<_>, GltfError>>()?;
        let shown = textures.get(texture)?;
        let most = textured.len() + MAX_PARTS.min(*room);
        let parts = shown.split(&textured, options.texture_noise, most);
        *room -= parts.len() - textured.len();
        parts.iter().try_for_each(|part| add(shown.light(part)))?;
    }
    Ok(lights)
}

#[cfg(test)]
mod tests {
    use super::super::parse::parse;
    use super::*;

    #[test]
    fn a_planned_tree_holds_the_first_node_that_uses_it() {
        let options = GltfOptions::default();
        let file = parse(include_bytes!("../../tests/data/small.gltf"), &options).unwrap();
        let buffers = [include_bytes!("../../tests/data/small.bin")];
        let plan = Plan::new(&file.document, &buffers, &[], &options).unwrap();
        let trees: Vec<(usize, usize)> = plan.trees.iter().map(|tree| (tree.node, tree.lights.len())).collect();
        assert_eq!(trees, [(1, 2), (3, 1), (4, 1)]);
        let instances: Vec<(usize, usize)> =
            plan.instances.iter().map(|planned| (planned.node, planned.tree)).collect();
        assert_eq!(instances, [(1, 0), (3, 1), (4, 2), (6, 0)]);
    }
}
