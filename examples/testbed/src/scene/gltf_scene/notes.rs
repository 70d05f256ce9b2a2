//! What the user should know about a file: a line for each kind of thing, with how many there are.

use std::collections::BTreeMap;

use girandole_assets::gltf::gltf::camera::Projection;
use girandole_assets::gltf::gltf::mesh::Mode;
use girandole_assets::gltf::gltf::{Document, Semantic};
use serde_json::{Map, Value};

/// Extensions of materials, primitives and nodes that are used, or whose fallback is.
const USED: [&str; 6] = [
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_draco_mesh_compression",
    "EXT_mesh_gpu_instancing",
    "EXT_lights_ies",
    "KHR_node_visibility",
];
/// Characters of a file's text on a line.
const MAX_SHOWN: usize = 80;

/// Counts of what was found, by what it is and by what has it.
#[derive(Default)]
pub struct Notes(BTreeMap<(String, &'static str), usize>);

impl Notes {
    /// Counts one of `kind`, such as "materials".
    pub fn add(&mut self, what: &str, kind: &'static str) {
        *self.0.entry((what.to_owned(), kind)).or_default() += 1;
    }

    /// Counts what a file has and the scene does not show.
    pub fn add_unused(&mut self, document: &Document) {
        for material in document.materials() {
            self.add_if(material.normal_texture().is_some(), "normal textures are not used", "materials");
            self.add_if(material.occlusion_texture().is_some(), "occlusion textures are not used", "materials");
            let transmission = material.extension_value("KHR_materials_transmission");
            let is_textured = transmission.is_some_and(|value| value.get("transmissionTexture").is_some());
            self.add_if(is_textured, "transmission textures are not used", "materials");
            self.add_extensions(material.extensions(), "materials");
        }
        for mesh in document.meshes() {
            let is_morphed = mesh.primitives().any(|primitive| primitive.morph_targets().len() > 0);
            self.add_if(is_morphed, "morph targets are not used", "meshes");
            for primitive in mesh.primitives() {
                let is_solid = matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan);
                self.add_if(!is_solid, "points and lines are not shown", "primitives");
                let has_more_joints = primitive.get(&Semantic::Joints(1)).is_some();
                self.add_if(has_more_joints, "joints of vertices beyond the first four are not used", "primitives");
                self.add_extensions(primitive.extensions(), "primitives");
            }
        }
        for node in document.nodes() {
            self.add_extensions(node.extensions(), "nodes");
        }
        document.scenes().for_each(|scene| self.add_extensions(scene.extensions(), "scenes"));
        for camera in document.cameras() {
            let is_orthographic = matches!(camera.projection(), Projection::Orthographic(_));
            self.add_if(is_orthographic, "orthographic projections are not used", "cameras");
        }
    }

    /// Counts one of `kind` if it is there.
    pub fn add_if(&mut self, is_there: bool, what: &str, kind: &'static str) {
        if is_there {
            self.add(what, kind);
        }
    }

    fn add_extensions(&mut self, extensions: Option<&Map<String, Value>>, kind: &'static str) {
        for name in extensions.into_iter().flat_map(Map::keys).filter(|name| !USED.contains(&name.as_str())) {
            self.add(&format!("{} is not used", shown(name)), kind);
        }
    }

    /// The lines: one for each kind of thing.
    pub fn lines(&self) -> Vec<String> {
        self.0.iter().map(|((what, kind), count)| format!("{what} ({kind}: {count})")).collect()
    }
}

/// The beginning of a file's text, without control characters.
pub fn shown(text: &str) -> String {
    text.chars().take(MAX_SHOWN).map(|c| if c.is_control() { '?' } else { c }).collect()
}
