//! Loads light trees and instances from glTF 2.0: emissive surfaces and KHR_lights_punctual.
//!
//! [`load`] reads a file and its buffers. No file makes it panic, as the gltf crate's own functions
//! do. [`load_lights`] makes one tree for each mesh with emissive primitives and one for each punctual
//! light, and one instance for each node that has them. Nodes with the same mesh or light share a
//! tree. So do meshes whose emissive primitives have the same accessors and the same emission.
//!
//! Emission is `emissiveFactor` times the strength of KHR_materials_emissive_strength, in nits.
//! Emissive textures, skins and morph targets are ignored. A node whose scale is zero along all
//! axes is hidden: it becomes an instance that contributes nothing until it is moved. Many files
//! describe one lamp twice, by a light and by an emissive surface; [`GltfOptions`] selects either.
//!
//! ```no_run
//! use girandole::gltf::{self, GltfOptions};
//! let options = GltfOptions::default();
//! let file = gltf::load("scene.glb", &options)?;
//! let mut world = girandole::LightWorld::new();
//! let lights = gltf::load_lights(&mut world, &file.document, &file.buffers, &options)?;
//! println!("{} instances of lights", lights.nodes.len());
//! # Ok::<(), girandole::gltf::GltfError>(())
//! ```

mod error;
mod options;
mod budget;
mod check;
mod parse;
mod uri;
mod load;
mod nodes;
mod read;
mod plan;

use ::gltf::Document;

pub use ::gltf;
pub use error::GltfError;
pub use load::{GltfFile, GltfSource, load};
pub use nodes::{local_transform, punctual_placement, scene_nodes, world_transforms};
pub use options::{EmissiveSides, GltfOptions};
pub use parse::parse;
pub use plan::{LightSource, material_emission};
pub use read::{accessor_values, primitive_triangles};

use crate::error::WorldError;
use crate::keys::{DirectionalKey, InstanceKey, TreeKey};
use crate::policy::Policy;
use crate::world::LightWorld;
use plan::Plan;

/// An instance that a node became. A node with both an emissive mesh and a light becomes two
/// instances.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct NodeLights {
    /// Index of the node in the document.
    pub node: usize,
    /// Where the lights come from.
    pub source: LightSource,
    /// The tree, which other nodes may share.
    pub tree: TreeKey,
    /// The instance. When the node moves, move the instance to the node's transform if its lights
    /// are surfaces, and to the transform's [`punctual_placement`] otherwise.
    pub instance: InstanceKey,
}

/// What a document added to a world.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct GltfLights {
    /// Instances, in the order of [`scene_nodes`].
    pub nodes: Vec<NodeLights>,
    /// Nodes and their directional lights. Hidden nodes are left out: they have no direction.
    pub directional: Vec<(usize, DirectionalKey)>,
}

/// Adds the lights of a document's scene to a world.
///
/// The document must be one that [`load`] or [`parse`] accepted. `buffers` holds the contents of its
/// buffers, by buffer index.
///
/// # Errors
/// [`GltfError`], which names the mesh, light, accessor or node by its index in the document. The
/// world is then as it was before the call.
///
/// # Cost
/// Linear in the nodes of the document and in the lights of its trees, plus the builds of these
/// trees.
pub fn load_lights<B: AsRef<[u8]>>(
    world: &mut LightWorld,
    document: &Document,
    buffers: &[B],
    options: &GltfOptions,
) -> Result<GltfLights, GltfError> {
    let plan = Plan::new(document, buffers, options)?;
    let mut lights = GltfLights::default();
    let mut trees = Vec::with_capacity(plan.trees.len());
    let result = add(plan, world, options.policy, &mut trees, &mut lights);
    if result.is_err() {
        // Everything here was added above, so none of these calls fails.
        lights.nodes.iter().for_each(|added| drop(world.remove_instance(added.instance)));
        lights.directional.iter().for_each(|(_, key)| drop(world.remove_directional(*key)));
        trees.into_iter().for_each(|tree| drop(world.remove_tree(tree)));
    }
    result.map(|()| lights)
}

/// Adds a plan to the world. After an error, `trees` and `lights` hold what was added before it.
fn add(
    plan: Plan,
    world: &mut LightWorld,
    policy: Policy,
    trees: &mut Vec<TreeKey>,
    lights: &mut GltfLights,
) -> Result<(), GltfError> {
    let refused = |node: usize| move |source: WorldError| GltfError::World { node, source };
    for tree in plan.trees {
        trees.push(world.add_tree(tree.lights).map_err(refused(tree.node))?);
    }
    for planned in plan.instances {
        let tree = trees[planned.tree];
        let instance = world.add_instance(tree, planned.placement, policy).map_err(refused(planned.node))?;
        lights.nodes.push(NodeLights { node: planned.node, source: planned.source, tree, instance });
    }
    for (node, light) in plan.directional {
        lights.directional.push((node, world.add_directional(light).map_err(refused(node))?));
    }
    Ok(())
}
