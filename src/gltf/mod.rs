//! Loads light trees and instances from glTF 2.0: emissive surfaces, KHR_lights_punctual, EXT_lights_ies and
//! EXT_lights_image_based.
//!
//! [`load`] reads a file and its buffers. No file makes it panic, unlike the gltf crate's own
//! functions. [`load_lights`] makes one tree for each mesh with emissive primitives and one for
//! each punctual light. It makes one instance for each node that has them, or several if
//! EXT_mesh_gpu_instancing places the node's mesh several times. Nodes with the same mesh or light
//! share a tree. So do meshes whose emissive primitives have the same accessors and the same
//! emission.
//!
//! Emission is `emissiveFactor` times the strength of KHR_materials_emissive_strength, in nits.
//! [`load_lights_with_textures`] also multiplies it by the average of the emissive texture over each
//! triangle, if the caller passes the decoded images. Alpha, skins and morph targets are ignored.
//! Many files describe one lamp twice, by a light and by an emissive surface; [`GltfOptions`] selects
//! either.
//!
//! A node whose scale is zero along one or more axes is hidden, as [`is_hidden`] tells: it becomes an
//! instance that contributes nothing until it is moved to a placement that is not hidden. A node that
//! KHR_node_visibility hides, as [`node_visibility`] tells, becomes an instance that is not enabled.
//!
//! Quantized meshes (KHR_mesh_quantization), instances of meshes (EXT_mesh_gpu_instancing), texture
//! transforms (KHR_texture_transform) and sparse accessors are read.
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

mod emissive;
mod error;
mod options;
mod budget;
mod check;
mod parse;
mod uri;
mod files;
mod load;
mod nodes;
mod read;
mod image;
mod instancing;
mod profiles;
mod texture;
mod image_based;
mod plan;

use ::gltf::Document;
use glam::DAffine3;

pub use ::gltf;
pub use error::GltfError;
pub use image::read_image;
pub use instancing::node_instances;
pub use load::{GltfFile, GltfSource, load};
pub use nodes::{
    is_hidden, local_transform, node_visibility, punctual_placement, scene_nodes, surface_placement, world_transforms,
};
pub use options::{EmissiveSides, GltfOptions};
pub use parse::parse;
pub use plan::{LightSource, material_emission};
pub use profiles::profile_placement;
pub use read::{accessor_values, primitive_attribute, primitive_tex_coords, primitive_triangles};
pub use texture::{TextureImage, TextureUse};

pub use crate::texture::TextureWrap;

use crate::error::WorldError;
use crate::instance::placement::Placement;
use crate::keys::{DirectionalKey, InstanceKey, TreeKey};
use crate::policy::Policy;
use crate::sky::Sky;
use crate::tree::LightTree;
use crate::world::LightWorld;
use image_based::ImageBasedLight;
use plan::{Plan, PlannedInstance};

/// An instance that a node became. A node becomes one instance for each instance of its emissive mesh,
/// and one for its light.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct NodeLights {
    /// Index of the node in the document.
    pub node: usize,
    /// Where the lights come from.
    pub source: LightSource,
    /// The tree, which other nodes may share.
    pub tree: TreeKey,
    /// The instance. It is not [enabled](LightWorld::set_enabled) if [`node_visibility`] hides the node. When the node moves to a transform `node`, move the instance to the
    /// [`surface_placement`] of `node * local` if its lights are surfaces, to the [`profile_placement`] of
    /// `node` if it is a lamp with a profile, and to the [`punctual_placement`] of `node` otherwise.
    pub instance: InstanceKey,
    /// The transform of the instance to the space of the node: that of [`node_instances`].
    pub local: DAffine3,
}

/// What a document added to a world.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct GltfLights {
    /// Instances, in the order of [`scene_nodes`].
    pub nodes: Vec<NodeLights>,
    /// Nodes and their directional lights. Hidden nodes are left out: a directional light is never disabled, and
    /// those that a scale of zero hides may have no direction.
    pub directional: Vec<(usize, DirectionalKey)>,
    /// The sky, if the scene has a light of EXT_lights_image_based that became it.
    pub sky: Option<InstanceKey>,
}

/// Adds the lights of a document's scene to a world.
///
/// The document must be one that [`load`] or [`parse`] accepted. `buffers` holds the contents of its
/// buffers, by buffer index.
///
/// # Errors
/// [`GltfError`], which names the mesh, light, accessor or node by its index in the document. The
/// world is then as it was before the call. A malformed light of EXT_lights_image_based is an error too,
/// although nothing becomes of it without its images.
///
/// # Cost
/// Linear in the nodes and instances of the document and in the lights of its trees, plus the builds
/// of these trees.
pub fn load_lights<B: AsRef<[u8]>>(
    world: &mut LightWorld,
    document: &Document,
    buffers: &[B],
    options: &GltfOptions,
) -> Result<GltfLights, GltfError> {
    load_lights_with_textures(world, document, buffers, &[], options)
}

/// As [`load_lights`], with emissive textures: triangles over which a texture varies are cut into parts
/// ([`Texture::split`](crate::Texture::split), with [`GltfOptions::texture_noise`] and [`GltfOptions::texture_parts`]),
/// and the emission of each part is multiplied by the average of its texels.
///
/// `images` holds decoded images by their index in the document; [`read_image`] reads the bytes to
/// decode. Images that are `None` or beyond the end of the list count as white, and so do textures
/// whose coordinates the primitive lacks. The wrap modes, KHR_texture_transform and the set of
/// coordinates are respected; [`TextureUse`] holds them. Colours are converted from sRGB to linear.
/// Texels count as squares of one colour, whatever the filter. What the alpha of the base colour's texture cuts
/// out (`alphaMode` MASK) does not emit, and where it blends (BLEND) the emission is multiplied by it; but if that
/// texture lies on the surface in another way than the emissive one, it is not regarded.
///
/// The scene's light of EXT_lights_image_based becomes the world's [sky](LightWorld::set_sky), if all six faces of the
/// first level of its `specularImages` are decoded and the world has no sky yet. Otherwise the sky stays as it is.
/// Colours are divided by alpha, in which writers store brightness (RGBD); an alpha of 0 counts as 1 of 255. The
/// intensity multiplies the radiance, in nits, and the rotation turns the instance. The map has four columns for each
/// one of a face, and is resampled as that of [`Sky::octahedral`](crate::Sky::octahedral) is.
///
/// A triangle over which the texture is black becomes no light. A mesh with only such triangles
/// gets neither a tree nor instances.
///
/// # Errors
/// Those of [`load_lights`], and [`GltfError::Image`] if an image that an emissive material uses
/// or the sky has the wrong number of bytes, or if the transform of a texture is not finite;
/// [`GltfError::ImageBasedLight`] if the images are no cube, or too large or too bright for a sky.
///
/// # Cost
/// That of [`load_lights`], plus that of [`Texture::light`](crate::Texture::light) for each part, and for each that is
/// cut. A sky takes 512 points for each pixel of a face of its cube.
pub fn load_lights_with_textures<B: AsRef<[u8]>>(
    world: &mut LightWorld,
    document: &Document,
    buffers: &[B],
    images: &[Option<TextureImage<'_>>],
    options: &GltfOptions,
) -> Result<GltfLights, GltfError> {
    let plan = Plan::new(document, buffers, images, options)?;
    let sky = match ImageBasedLight::of(document)? {
        Some(light) if world.sky().is_none() => light.sky(images)?.map(|sky| (sky, light.placement)),
        _ => None,
    };
    let mut lights = GltfLights::default();
    let mut trees = Vec::with_capacity(plan.trees.len());
    let result = add(plan, world, options.policy, &mut trees, &mut lights);
    if result.is_err() {
        // Everything here was added above, so none of these calls fails.
        lights.nodes.iter().for_each(|added| drop(world.remove_instance(added.instance)));
        lights.directional.iter().for_each(|(_, key)| drop(world.remove_directional(*key)));
        trees.into_iter().for_each(|tree| drop(world.remove_tree(tree)));
    }
    result.map(|()| {
        lights.sky = sky.and_then(|sky| set_sky(world, sky));
        lights
    })
}

/// Makes a map the sky, turned by a rotation, which no world refuses.
fn set_sky(world: &mut LightWorld, (sky, placement): (Sky, Placement)) -> Option<InstanceKey> {
    let key = world.set_sky(sky);
    world.move_instance(key, placement).ok().map(|()| key)
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
        trees.push(world.add_tree(LightTree::new(tree.lights).map_err(refused(tree.node))?));
    }
    for planned in plan.instances {
        let tree = trees[planned.tree];
        let instance = world.add_instance(tree, planned.placement, policy).map_err(refused(planned.node))?;
        let PlannedInstance { node, source, local, is_shown, .. } = planned;
        lights.nodes.push(NodeLights { node, source, tree, instance, local });
        if !is_shown {
            world.set_enabled(instance, false).map_err(refused(node))?;
        }
    }
    for (node, light) in plan.directional {
        lights.directional.push((node, world.add_directional(light).map_err(refused(node))?));
    }
    Ok(())
}
