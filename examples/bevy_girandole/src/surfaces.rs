//! Notices changes of what surfaces look like: of materials, of the images that they show, and of meshes.

use std::collections::HashSet;

use bevy::prelude::*;

use crate::gather::changed;
use crate::gathered::Changes;

/// The images that a material shows.
fn images(material: &StandardMaterial) -> impl Iterator<Item = AssetId<Image>> {
    let textures = [
        &material.base_color_texture,
        &material.emissive_texture,
        &material.metallic_roughness_texture,
        &material.normal_map_texture,
        &material.occlusion_texture,
    ];
    textures.into_iter().flatten().map(|image| image.id())
}

/// Tells the render world if any of them changed. It looks through all materials after an event of an image.
pub fn gather(
    mut changes: ResMut<Changes>,
    mut meshes: MessageReader<AssetEvent<Mesh>>,
    mut materials: MessageReader<AssetEvent<StandardMaterial>>,
    mut changed_images: MessageReader<AssetEvent<Image>>,
    all: Res<Assets<StandardMaterial>>,
) {
    let changes = changes.bypass_change_detection();
    let changed_images: HashSet<AssetId<Image>> = changed_images.read().filter_map(changed).collect();
    let is_shown = |image: AssetId<Image>| changed_images.contains(&image);
    changes.edits.has_new_surfaces |= meshes.read().filter_map(changed).count() > 0;
    changes.edits.has_new_surfaces |= materials.read().filter_map(changed).count() > 0;
    changes.edits.has_new_surfaces |=
        !changed_images.is_empty() && all.iter().any(|(_, material)| images(material).any(is_shown));
}
