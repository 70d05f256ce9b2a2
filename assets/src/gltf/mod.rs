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
//! Emission is `emissiveFactor` times the strength of KHR_materials_emissive_strength, in nits, times
//! the average of the emissive texture over each triangle, if the caller passes the decoded images.
//! Alpha counts where the alpha mode is MASK or BLEND. Skins and morph targets are ignored.
//! Many files describe one lamp twice, by a light and by an emissive surface; [`GltfOptions`] selects
//! either.
//!
//! A node whose scale is zero along one or more axes is hidden, as [`is_hidden`] tells: it becomes an
//! instance that contributes nothing until it is moved to a placement that is not hidden. A node that
//! KHR_node_visibility hides, as [`SceneNode::is_visible`] tells, becomes an instance that is not enabled.
//!
//! Quantized meshes (KHR_mesh_quantization), instances of meshes (EXT_mesh_gpu_instancing), texture
//! transforms (KHR_texture_transform) and sparse accessors are read.
//!
//! ```no_run
//! use girandole_assets::gltf::{self, GltfOptions};
//! let options = GltfOptions::default();
//! let file = gltf::load("scene.glb", &options)?;
//! let mut world = girandole_assets::girandole::LightWorld::new();
//! let lights = gltf::load_lights(&mut world, &file, &[], &options)?;
//! println!("{} instances of lights", lights.nodes.len());
//! # Ok::<(), girandole_assets::AssetError>(())
//! ```

mod options;
mod files;
mod check;
mod parse;
mod load;
mod read;
mod nodes;
mod texture;
mod emissive;
mod image_based;
mod profiles;
mod plan;

use girandole::{DirectionalKey, InstanceKey, LightTree, LightWorld, TreeKey, WorldError};
use glam::DAffine3;

pub use ::gltf;
pub use load::{GltfFile, load, load_bytes, read_image};
pub use nodes::{LightSource, SceneNode, is_hidden, local_transform, node_instances, scene_nodes};
pub use options::{EmissiveSides, GltfOptions};
pub use parse::parse;
pub use plan::material_emission;
pub use read::{accessor_values, primitive_attribute};
pub use texture::{TextureImage, TextureUse};

use crate::error::AssetError;
use image_based::ImageBasedLight;
use plan::Plan;

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
    /// The instance. It is not [enabled](girandole::Appearance::is_enabled) if the node is not [visible](SceneNode::is_visible).
    /// When the node moves to a transform `node`, move the instance to the [placement](LightSource::placement) of
    /// `node * local`.
    pub instance: InstanceKey,
    /// The transform of the instance to the space of the node: that of [`node_instances`] for surfaces, else the identity.
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
/// `images` holds decoded images by their index in the document; [`read_image`] reads the bytes to
/// decode. Images that are `None` or beyond the end of the list count as white, and so do textures
/// whose coordinates the primitive lacks: without images, pass `&[]`.
///
/// Triangles over which an emissive texture varies are cut into parts ([`Texture::split`](crate::texture::Texture::split),
/// with [`GltfOptions::texture_noise`] and [`GltfOptions::texture_parts`]), and the emission of each part is multiplied by
/// the average of its texels. The wrap modes, KHR_texture_transform and the set of
/// coordinates are respected; [`TextureUse`] holds them. Colours are converted from sRGB to linear.
/// Texels count as squares of one colour, whatever the filter. What the alpha of the base colour's texture cuts
/// out (`alphaMode` MASK) does not emit, and where it blends (BLEND) the emission is multiplied by it; but if that
/// texture lies on the surface in another way than the emissive one, it is not regarded.
/// A triangle over which the texture is black becomes no light. A mesh with only such triangles
/// gets neither a tree nor instances.
///
/// The scene's light of EXT_lights_image_based becomes the world's [sky](LightWorld::set_sky), if all six faces of the
/// first level of its `specularImages` are decoded and the world has no sky yet. Otherwise the sky stays as it is.
/// Colours are divided by alpha, in which writers store brightness (RGBD); an alpha of 0 counts as 1 of 255. The
/// intensity multiplies the radiance, in nits, and the rotation turns the instance. The map has four columns for each
/// one of a face, and is resampled as that of [`Sky::averaged`](girandole::Sky::averaged) is.
///
/// # Errors
/// [`AssetError::Invalid`], which names the mesh, light, accessor, image or node by its index in the document, for what is
/// not valid in a document, its images or its profiles; [`AssetError::World`]; [`AssetError::Limit`];
/// [`AssetError::Read`] for profiles that are files. The world is then as it was before the call. A malformed light of
/// EXT_lights_image_based is an error too, although nothing becomes of it without its images.
///
/// # Cost
/// Linear in the nodes and instances of the document and in the lights of its trees, plus the builds
/// of these trees, plus that of [`Texture::light`](crate::texture::Texture::light) for each part, and for each that is
/// cut. A sky takes 512 points for each pixel of a face of its cube.
pub fn load_lights(
    world: &mut LightWorld,
    file: &GltfFile,
    images: &[Option<TextureImage<'_>>],
    options: &GltfOptions,
) -> Result<GltfLights, AssetError> {
    let plan = Plan::new(file, images, options)?;
    let sky = match ImageBasedLight::of(&file.document)? {
        Some(light) if world.sky().is_none() => light.sky(images)?.map(|sky| (sky, light.placement)),
        _ => None,
    };
    let mut lights = GltfLights::default();
    let mut trees = Vec::with_capacity(plan.trees.len());
    if let Err(error) = add(plan, world, options, &mut trees, &mut lights) {
        // Everything here was added above, so none of these calls fails.
        lights.nodes.iter().for_each(|added| drop(world.remove_instance(added.instance)));
        lights.directional.iter().for_each(|(_, key)| drop(world.remove_directional(*key)));
        trees.into_iter().flatten().for_each(|tree| drop(world.remove_tree(tree)));
        return Err(error);
    }
    // A rotation, which no world refuses.
    lights.sky = sky.and_then(|(sky, placement)| {
        let key = world.set_sky(sky);
        world.move_instance(key, placement).ok().map(|()| key)
    });
    Ok(lights)
}

/// Adds a plan to the world. After an error, `trees` and `lights` hold what was added before it.
fn add(
    plan: Plan<'_>,
    world: &mut LightWorld,
    options: &GltfOptions,
    trees: &mut Vec<Option<TreeKey>>,
    lights: &mut GltfLights,
) -> Result<(), AssetError> {
    let refused = |node: usize| move |source: WorldError| AssetError::World { node, source };
    for planned in plan.trees {
        let tree = |lights| LightTree::new(lights).map_err(refused(planned.node));
        let is_lit = !planned.lights.is_empty();
        trees.push(if is_lit { Some(world.add_tree(tree(planned.lights)?)) } else { None });
    }
    for planned in plan.instances {
        let Some(tree) = trees[planned.tree] else { continue };
        let (node, source, local) = (planned.node, planned.source, planned.local);
        let instance = world.add_instance(tree, planned.placement, options.policy).map_err(refused(node))?;
        lights.nodes.push(NodeLights { node, source, tree, instance, local });
        if !planned.is_visible {
            world.set_appearance(instance, |a| a.is_enabled = false).map_err(refused(node))?;
        }
    }
    for (node, light) in plan.directional {
        lights.directional.push((node, world.add_directional(light).map_err(refused(node))?));
    }
    Ok(())
}
