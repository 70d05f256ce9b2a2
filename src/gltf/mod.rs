//! Light trees and instances from glTF 2.0: emissive surfaces and KHR_lights_punctual.
//!
//! One tree a mesh with emissive primitives, one a punctual light; nodes that share a mesh or a light share its tree.
//! Emission is `emissiveFactor` times KHR_materials_emissive_strength, in nits; emissive textures, skins and morph
//! targets are not read. Many files depict a lamp twice, by a light and by a glowing surface: choose in [`GltfOptions`].
//!
//! ```no_run
//! use girandole::gltf::{self, GltfOptions, gltf::Gltf};
//! let file = Gltf::from_slice(&std::fs::read("scene.glb")?)?;
//! let buffers: Vec<Vec<u8>> = file.blob.iter().cloned().collect();
//! let mut world = girandole::LightWorld::new();
//! let lights = gltf::load_lights(&mut world, &file.document, &buffers, &GltfOptions::default())?;
//! println!("{} nodes shine", lights.nodes.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod nodes;
mod read;

use std::collections::BTreeMap;

use ::gltf::Document;
use ::gltf::khr_lights_punctual::Kind;
use glam::{DAffine3, DMat3, DVec3, Quat, Vec3};

pub use ::gltf;
pub use error::GltfError;
pub use nodes::{local_transform, scene_nodes, world_transforms};
pub use read::{accessor_values, primitive_triangles};

use crate::error::WorldError;
use crate::keys::{DirectionalKey, InstanceKey, TreeKey};
use crate::light::{DirectionalLight, Light};
use crate::placement::Placement;
use crate::policy::Policy;
use crate::world::LightWorld;

/// Which sides of emissive triangles shine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EmissiveSides {
    /// Both where the material is `doubleSided`, else the front: what a viewer shows.
    #[default]
    OfMaterial,
    /// The front, always: fewer lights to reach from behind, right for closed meshes whatever their material says.
    Front,
    /// Both, always: right for sheets whose facing is unsettled.
    Both,
}

/// What to take from a document.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GltfOptions {
    /// Takes emissive triangles.
    pub surfaces: bool,
    /// Multiplies the radiance of surfaces: 1 as the file says.
    pub surface_scale: f32,
    /// Which sides of them shine.
    pub sides: EmissiveSides,
    /// Takes KHR_lights_punctual.
    pub punctual: bool,
    /// Of all instances.
    pub policy: Policy,
}

impl Default for GltfOptions {
    fn default() -> Self {
        let sides = EmissiveSides::default();
        Self { surfaces: true, surface_scale: 1.0, sides, punctual: true, policy: Policy::default() }
    }
}

/// Where a node's instance gets its lights from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightSource {
    /// The emissive triangles of its mesh: one light each, in the order of the primitives.
    Surfaces,
    /// Its point or spot light.
    Punctual,
}

/// The instance that a node became. A node with both a mesh and a light becomes two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeLights {
    /// Its index in the file.
    pub node: usize,
    /// What shines.
    pub source: LightSource,
    /// Shared by the nodes that share its mesh or light.
    pub tree: TreeKey,
    /// The instance: move it by [`punctual_placement`] or the node's own transform when the node moves.
    pub instance: InstanceKey,
}

/// What a document added to a world.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GltfLights {
    /// In the order of the scene's hierarchy.
    pub nodes: Vec<NodeLights>,
    /// Directional lights and the nodes that carry them.
    pub directional: Vec<(usize, DirectionalKey)>,
}

/// The radiance of a material's front, nits.
pub fn material_emission(material: &gltf::Material<'_>) -> Vec3 {
    Vec3::from(material.emissive_factor()) * material.emissive_strength().unwrap_or(1.0)
}

/// Where a node's point or spot light stands: glTF ignores scale for them, all but the direction of -Z.
///
/// `None` if the transform is not finite or -Z has no direction left.
pub fn punctual_placement(transform: &DAffine3) -> Option<Placement> {
    let forward = (transform.matrix3 * DVec3::NEG_Z).try_normalize()?.as_vec3();
    let rotation = Quat::from_rotation_arc(Vec3::NEG_Z, forward.normalize());
    let linear = DMat3::from_quat(rotation.as_dquat());
    transform.translation.is_finite().then(|| DAffine3::from_mat3_translation(linear, transform.translation).into())
}

/// Everything that will be added, checked as far as it can be without the world.
#[derive(Default)]
struct Plan {
    trees: Vec<Vec<Light>>,
    instances: Vec<(usize, LightSource, usize, Placement)>,
    directional: Vec<(usize, DirectionalLight)>,
}

/// Adds the lights of a document's scene to a world.
///
/// The document must have been validated, as [`gltf::Gltf::from_slice`] does; `buffers` are the contents of its buffers by index.
///
/// # Errors
/// [`GltfError`], naming the culprit by its index in the file. The world is then as it was.
pub fn load_lights<B: AsRef<[u8]>>(
    world: &mut LightWorld,
    document: &Document,
    buffers: &[B],
    options: &GltfOptions,
) -> Result<GltfLights, GltfError> {
    let plan = Plan::new(document, buffers, options)?;
    let mut added = GltfLights::default();
    let mut trees = Vec::with_capacity(plan.trees.len());
    let result = plan.add(world, options.policy, &mut trees, &mut added);
    if result.is_err() {
        // What was added a moment ago can be removed again.
        added.nodes.iter().for_each(|lights| drop(world.remove_instance(lights.instance)));
        added.directional.iter().for_each(|(_, key)| drop(world.remove_directional(*key)));
        trees.into_iter().for_each(|tree| drop(world.remove_tree(tree)));
    }
    result.map(|()| added)
}

impl Plan {
    fn new<B: AsRef<[u8]>>(document: &Document, buffers: &[B], options: &GltfOptions) -> Result<Self, GltfError> {
        let mut plan = Self::default();
        // Trees by the mesh or light that they come from; `None` for meshes that do not shine.
        let mut meshes: BTreeMap<usize, Option<usize>> = BTreeMap::new();
        let mut punctual: BTreeMap<usize, usize> = BTreeMap::new();
        let nodes: Vec<gltf::Node<'_>> = document.nodes().collect();
        let transforms = world_transforms(document)?;
        for (index, _) in scene_nodes(document)? {
            let (node, Some(transform)) = (&nodes[index], transforms[index]) else { continue };
            if let Some(mesh) = node.mesh().filter(|_| options.surfaces) {
                let tree = match meshes.get(&mesh.index()) {
                    Some(&known) => known,
                    None => {
                        let lights = surfaces(&mesh, buffers, options)?;
                        let tree = (!lights.is_empty()).then(|| plan.tree(lights));
                        meshes.insert(mesh.index(), tree);
                        tree
                    }
                };
                if let Some(tree) = tree {
                    plan.instances.push((index, LightSource::Surfaces, tree, transform.into()));
                }
            }
            let Some(light) = node.light().filter(|_| options.punctual) else { continue };
            let placement = punctual_placement(&transform).ok_or(GltfError::Transform { node: index })?;
            let invalid = |source| GltfError::Light { what: "light", index: light.index(), source };
            let emission = Vec3::from(light.color()) * light.intensity();
            let local = match light.kind() {
                Kind::Point => Light::point(Vec3::ZERO, emission),
                Kind::Spot { inner_cone_angle: inner, outer_cone_angle: outer } => {
                    Light::spot(Vec3::ZERO, Vec3::NEG_Z, inner, outer, emission)
                }
                Kind::Directional => {
                    let direction = placement.linear * Vec3::NEG_Z;
                    plan.directional.push((index, DirectionalLight { direction, illuminance: emission }));
                    continue;
                }
            };
            let local = light.range().map_or(local, |range| local.with_range(range));
            local.validate().map_err(invalid)?;
            let tree = *punctual.entry(light.index()).or_insert_with(|| plan.tree(vec![local]));
            plan.instances.push((index, LightSource::Punctual, tree, placement));
        }
        Ok(plan)
    }

    fn tree(&mut self, lights: Vec<Light>) -> usize {
        self.trees.push(lights);
        self.trees.len() - 1
    }

    fn add(
        self,
        world: &mut LightWorld,
        policy: Policy,
        trees: &mut Vec<TreeKey>,
        added: &mut GltfLights,
    ) -> Result<(), GltfError> {
        let refused = |node: usize| move |source: WorldError| GltfError::LightWorld { node, source };
        for (index, lights) in self.trees.into_iter().enumerate() {
            let first = self.instances.iter().find(|instance| instance.2 == index).map_or(0, |instance| instance.0);
            trees.push(world.add_tree(lights).map_err(refused(first))?);
        }
        for (node, source, tree, placement) in self.instances {
            let tree = trees[tree];
            let instance = world.add_instance(tree, placement, policy).map_err(refused(node))?;
            added.nodes.push(NodeLights { node, source, tree, instance });
        }
        for (node, light) in self.directional {
            added.directional.push((node, world.add_directional(light).map_err(refused(node))?));
        }
        Ok(())
    }
}

/// A mesh's emissive triangles.
fn surfaces<B: AsRef<[u8]>>(
    mesh: &gltf::Mesh<'_>,
    buffers: &[B],
    options: &GltfOptions,
) -> Result<Vec<Light>, GltfError> {
    let mut lights = Vec::new();
    for primitive in mesh.primitives() {
        let material = primitive.material();
        let radiance = material_emission(&material) * options.surface_scale;
        // NaN is not zero: it goes on to be refused.
        if radiance == Vec3::ZERO {
            continue;
        }
        let both = match options.sides {
            EmissiveSides::OfMaterial => material.double_sided(),
            EmissiveSides::Front => false,
            EmissiveSides::Both => true,
        };
        for vertices in primitive_triangles(mesh.index(), &primitive, buffers)? {
            let light = Light::triangle(vertices, radiance);
            let light = if both { light.two_sided() } else { light };
            let invalid = |source| GltfError::Light { what: "mesh", index: mesh.index(), source };
            light.validate().map_err(invalid)?;
            lights.push(light);
        }
    }
    Ok(lights)
}
