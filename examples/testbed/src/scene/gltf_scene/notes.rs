//! What the user should know about a file: a line for each kind of thing, with how many there are.

use std::collections::BTreeMap;

use girandole_assets::gltf::gltf::Document;
use girandole_assets::gltf::gltf::mesh::Mode;

/// Extensions that are used, or whose fallback is.
const USED: [&str; 12] = [
    "EXT_lights_ies",
    "EXT_lights_image_based",
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
];
/// Characters of a file's text on a line.
const MAX_SHOWN: usize = 80;

/// Counts of what was found, by what it is.
#[derive(Default)]
pub struct Notes(BTreeMap<String, usize>);

impl Notes {
    /// Counts one if it is there.
    pub fn add(&mut self, is_there: bool, what: &str) {
        if is_there {
            *self.0.entry(what.to_owned()).or_default() += 1;
        }
    }

    /// Counts what a file has and the scene does not show.
    pub fn add_unused(&mut self, document: &Document) {
        for name in document.extensions_used() {
            self.add(!USED.contains(&name), &format!("{} is not used", shown(name)));
        }
        for material in document.materials() {
            self.add(material.normal_texture().is_some(), "normal textures are not used");
        }
        for primitive in document.meshes().flat_map(|mesh| mesh.primitives()) {
            self.add(primitive.morph_targets().len() > 0, "morph targets are not used");
            let is_solid = matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan);
            self.add(!is_solid, "points and lines are not shown");
        }
        document.nodes().for_each(|node| self.add(node.skin().is_some(), "skins are not used"));
    }

    /// The lines: one for each kind of thing.
    pub fn lines(&self) -> Vec<String> {
        self.0.iter().map(|(what, count)| format!("{what} ({count})")).collect()
    }
}

/// The beginning of a file's text, without control characters.
pub fn shown(text: &str) -> String {
    text.chars().take(MAX_SHOWN).map(|c| if c.is_control() { '?' } else { c }).collect()
}
