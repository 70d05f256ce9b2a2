//! Plans the trees and instances of a document, and checks them, before the world is changed.
//!
//! The first pass walks the scene's nodes, finds out which of them share a tree, and counts lights.
//! Only when the count is within the limit does the second pass read the lights.

use std::collections::{BTreeMap, BTreeSet};

use ::gltf::khr_lights_punctual::{self, Kind};
use ::gltf::{Document, Material, Mesh, Node, Primitive, Semantic};
use glam::{DAffine3, Vec3};

use super::error::GltfError;
use super::nodes::{is_hidden, punctual_placement, scene_nodes, world_transforms};
use super::options::{EmissiveSides, GltfOptions};
use super::read::Triangles;
use crate::light::{DirectionalLight, Light};
use crate::placement::Placement;

/// Where the lights of an instance come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightSource {
    /// The emissive triangles of the node's mesh: one light each, in the order of the primitives. A
    /// primitive with the accessors and the emission of an earlier one of its mesh adds no lights,
    /// since it covers the same surface.
    Surfaces,
    /// The node's point or spot light.
    Punctual,
}

/// The radiance that a material emits, in nits: `emissiveFactor` times the strength of
/// KHR_materials_emissive_strength. Textures are ignored.
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
}

impl Plan {
    pub fn new<B: AsRef<[u8]>>(document: &Document, buffers: &[B], options: &GltfOptions) -> Result<Self, GltfError> {
        let value = options.surface_scale;
        if !(value.is_finite() && value >= 0.0) {
            return Err(GltfError::SurfaceScale { value });
        }
        let nodes: Vec<Node<'_>> = document.nodes().collect();
        let transforms = world_transforms(document)?;
        let mut outline = Outline::new(buffers, options);
        for (index, _) in scene_nodes(document)? {
            let (node, Some(transform)) = (&nodes[index], transforms[index]) else { continue };
            if let Some(mesh) = node.mesh().filter(|_| options.surfaces) {
                outline.add_mesh(index, &mesh, &transform)?;
            }
            if let Some(light) = node.light().filter(|_| options.punctual) {
                outline.add_light(index, &light, &transform)?;
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
}

/// The first pass: trees by what they are made from, instances, and the number of lights.
struct Outline<'a, B> {
    buffers: &'a [B],
    options: &'a GltfOptions,
    /// The tree of each mesh that was met; `None` for meshes that do not emit.
    meshes: BTreeMap<usize, Option<usize>>,
    /// The trees of meshes by the keys of their emissive primitives: meshes with equal lights share
    /// a tree.
    surfaces: BTreeMap<Vec<SurfaceKey>, usize>,
    /// The tree of each point or spot light that was met.
    punctual: BTreeMap<usize, usize>,
    trees: Vec<TreeOutline<'a>>,
    instances: Vec<PlannedInstance>,
    directional: Vec<(usize, DirectionalLight)>,
    /// Lights of all trees.
    light_count: u64,
}

impl<'a, B: AsRef<[u8]>> Outline<'a, B> {
    fn new(buffers: &'a [B], options: &'a GltfOptions) -> Self {
        Self {
            buffers,
            options,
            meshes: BTreeMap::new(),
            surfaces: BTreeMap::new(),
            punctual: BTreeMap::new(),
            trees: Vec::new(),
            instances: Vec::new(),
            directional: Vec::new(),
            light_count: 0,
        }
    }

    /// Adds an instance of a node's mesh if the mesh emits.
    fn add_mesh(&mut self, node: usize, mesh: &Mesh<'_>, transform: &DAffine3) -> Result<(), GltfError> {
        let tree = match self.meshes.get(&mesh.index()) {
            Some(&known) => known,
            None => {
                let tree = self.mesh_tree(node, mesh)?;
                self.meshes.insert(mesh.index(), tree);
                tree
            }
        };
        if let Some(tree) = tree {
            let (source, placement) = (LightSource::Surfaces, (*transform).into());
            self.instances.push(PlannedInstance { node, source, tree, placement });
        }
        Ok(())
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
        let key = SurfaceKey {
            mode: primitive.mode().as_gl_enum(),
            positions: primitive.get(&Semantic::Positions).map(|accessor| accessor.index()),
            indices: primitive.indices().map(|accessor| accessor.index()),
            radiance: radiance.to_array().map(f32::to_bits),
            two_sided,
        };
        Ok(Some((key, Surface { mesh, triangles, radiance, two_sided })))
    }

    /// Adds an instance of a node's point or spot light, or a directional light.
    fn add_light(
        &mut self,
        node: usize,
        light: &khr_lights_punctual::Light<'_>,
        transform: &DAffine3,
    ) -> Result<(), GltfError> {
        let emission = Vec3::from(light.color()) * light.intensity();
        let placement = match punctual_placement(transform) {
            Some(placement) => placement,
            // The light of a point has no direction to lose.
            None if matches!(light.kind(), Kind::Point) => Placement::at(transform.translation),
            None => return Err(GltfError::Transform { node }),
        };
        let local = match light.kind() {
            Kind::Point => Light::point(Vec3::ZERO, emission),
            Kind::Spot { inner_cone_angle: inner, outer_cone_angle: outer } => {
                Light::spot(Vec3::ZERO, Vec3::NEG_Z, inner, outer, emission)
            }
            Kind::Directional => {
                // A hidden node gives its light no direction.
                if !is_hidden(transform) {
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
        self.instances.push(PlannedInstance { node, source: LightSource::Punctual, tree, placement });
        Ok(())
    }

    fn add_tree(&mut self, node: usize, lights: LightsOutline<'a>, count: u64) -> usize {
        self.light_count = self.light_count.saturating_add(count);
        self.trees.push(TreeOutline { node, lights });
        self.trees.len() - 1
    }

    /// The second pass: reads and checks the lights of all trees.
    fn read(self) -> Result<Plan, GltfError> {
        let read = |tree: TreeOutline<'_>| {
            let lights = match tree.lights {
                LightsOutline::Surfaces(surfaces) => surface_lights(&surfaces)?,
                LightsOutline::Punctual(light) => vec![light],
            };
            Ok(PlannedTree { node: tree.node, lights })
        };
        let trees = self.trees.into_iter().map(read).collect::<Result<_, GltfError>>()?;
        Ok(Plan { trees, instances: self.instances, directional: self.directional })
    }
}

/// One light for each triangle.
fn surface_lights(surfaces: &[Surface<'_>]) -> Result<Vec<Light>, GltfError> {
    let mut lights = Vec::with_capacity(surfaces.iter().map(|surface| surface.triangles.count()).sum());
    for surface in surfaces {
        let invalid = |source| GltfError::Light { what: "mesh", index: surface.mesh, source };
        for vertices in surface.triangles.iter() {
            let light = Light::triangle(vertices?, surface.radiance);
            let light = if surface.two_sided { light.two_sided() } else { light };
            light.validate().map_err(invalid)?;
            lights.push(light);
        }
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
        let plan = Plan::new(&file.document, &buffers, &options).unwrap();
        let trees: Vec<(usize, usize)> = plan.trees.iter().map(|tree| (tree.node, tree.lights.len())).collect();
        assert_eq!(trees, [(1, 2), (3, 1), (4, 1)]);
        let instances: Vec<(usize, usize)> =
            plan.instances.iter().map(|planned| (planned.node, planned.tree)).collect();
        assert_eq!(instances, [(1, 0), (3, 1), (4, 2), (6, 0)]);
    }
}
