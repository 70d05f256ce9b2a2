//! The files that are damaged: the sample file, a larger one with most of what glTF has, and small
//! ones that have once caused harm or were made to do so.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// A document as text, and its binary chunk.
#[derive(Clone)]
pub struct Parts {
    pub json: Vec<u8>,
    pub bin: Vec<u8>,
    pub is_binary: bool,
}

impl Parts {
    /// The bytes of the file.
    pub fn to_bytes(&self) -> Vec<u8> {
        if !self.is_binary {
            return self.json.clone();
        }
        let padded = |bytes: &[u8], pad: u8| {
            let mut bytes = bytes.to_vec();
            bytes.resize(bytes.len().next_multiple_of(4), pad);
            bytes
        };
        let (json, bin) = (padded(&self.json, b' '), padded(&self.bin, 0));
        let mut file = Vec::new();
        let length = 12 + 8 + json.len() + 8 + bin.len();
        file.extend(b"glTF");
        [2, length as u32, json.len() as u32].iter().for_each(|number| file.extend(number.to_le_bytes()));
        file.extend(b"JSON");
        file.extend(json);
        file.extend((bin.len() as u32).to_le_bytes());
        file.extend(b"BIN\0");
        file.extend(bin);
        file
    }
}

/// The sample file with its buffer in a data URI.
pub fn small_text() -> Parts {
    let text = include_str!("../../../../tests/data/small.gltf");
    let uri = format!(
        "data:application/octet-stream;base64,{}",
        STANDARD.encode(include_bytes!("../../../../tests/data/small.bin"))
    );
    Parts { json: text.replace("small.bin\"", &format!("{uri}\"")).into_bytes(), bin: Vec::new(), is_binary: false }
}

/// The sample file as a .glb.
pub fn small_binary() -> Parts {
    let text = include_str!("../../../../tests/data/small.gltf").replace("\"uri\": \"small.bin\", ", "");
    Parts { json: text.into_bytes(), bin: include_bytes!("../../../../tests/data/small.bin").to_vec(), is_binary: true }
}

/// Buffer views and accessors over one binary chunk.
#[derive(Default)]
struct Buffers {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffers {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views.push(json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() }));
        self.bin.extend(bytes);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn floats(&mut self, kind: &str, width: usize, values: &[f32]) -> usize {
        let view = self.view(&values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>());
        let along = |axis: usize| values.iter().skip(axis).step_by(width).copied();
        let min: Vec<f32> = (0..width).map(|axis| along(axis).fold(f32::MAX, f32::min)).collect();
        let max: Vec<f32> = (0..width).map(|axis| along(axis).fold(f32::MIN, f32::max)).collect();
        let count = values.len() / width;
        self.accessor(json!({
            "bufferView": view, "componentType": 5126, "count": count, "type": kind, "min": min, "max": max
        }))
    }

    fn numbers(&mut self, component: u32, kind: &str, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.accessor(json!({ "bufferView": view, "componentType": component, "count": count, "type": kind }))
    }
}

/// A document with 20 meshes in all modes, with indices of all types, morph targets, skins, sparse
/// accessors, normalized positions, textures, images, cameras, lights and animations. All of it is
/// valid, and all of the gltf crate's validation runs.
pub fn large() -> Parts {
    let mut buffers = Buffers::default();
    let corner = |i: usize| [(i % 3) as f32 - 1.0, (i / 3) as f32 * 0.5, (i % 5) as f32 * 0.1];
    let corners: Vec<f32> = (0..9).flat_map(corner).collect();
    let positions = buffers.floats("VEC3", 3, &corners);
    let normals = buffers.floats("VEC3", 3, &[0.0, 0.0, 1.0].repeat(9));
    let texture_points = buffers.floats("VEC2", 2, &corners[..18]);
    let tangents = buffers.floats("VEC4", 4, &[1.0, 0.0, 0.0, 1.0].repeat(9));
    let weights = buffers.floats("VEC4", 4, &[0.25; 36]);
    let joints = buffers.numbers(5121, "VEC4", 9, &[0, 1, 0, 1].repeat(9));
    let colors = buffers.numbers(5121, "VEC4", 9, &[255, 128, 0, 255].repeat(9));
    buffers.accessors[colors]["normalized"] = json!(true);
    let faces = [0_u8, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4];
    let bytes = buffers.numbers(5121, "SCALAR", 12, &faces);
    let shorts = buffers.numbers(5123, "SCALAR", 12, &faces.map(|face| [face, 0]).concat());
    let words = buffers.numbers(5125, "SCALAR", 12, &faces.map(|face| [face, 0, 0, 0]).concat());
    let quantized: Vec<u8> = corners.iter().flat_map(|v| ((v * 16000.0) as i16).to_le_bytes()).collect();
    let quantized = buffers.numbers(5122, "VEC3", 9, &quantized);
    let bounds = [("normalized", json!(true)), ("min", json!([-1, 0, 0])), ("max", json!([1, 1, 1]))];
    bounds.into_iter().for_each(|(name, value)| buffers.accessors[quantized][name] = value);
    let sparse_indices = buffers.view(&[1, 0, 4, 0]);
    let sparse_values = buffers.view(&[0; 24]);
    let sparse = buffers.accessor(json!({
        "componentType": 5126, "count": 9, "type": "VEC3", "min": [0, 0, 0], "max": [0, 0, 0],
        "sparse": {
            "count": 2,
            "indices": { "bufferView": sparse_indices, "componentType": 5123, "byteOffset": 0 },
            "values": { "bufferView": sparse_values }
        }
    }));
    let bind = buffers.floats("MAT4", 16, &[1.0, 0.0, 0.0, 0.0, 0.0].repeat(6)[..16].repeat(2));
    let times = buffers.floats("SCALAR", 1, &[0.0, 0.5, 2.0]);
    let turns = buffers.floats("VEC4", 4, &[0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let moves = buffers.floats("VEC3", 3, &corners[..9]);
    let curves = buffers.floats("VEC3", 3, &corners);
    let image = buffers.view(b"\x89PNG not an image");

    let meshes: Vec<Value> = (0..20)
        .map(|i| {
            let indices = [json!(bytes), json!(shorts), json!(words)][i % 3].clone();
            let mut first = json!({
                "attributes": { "POSITION": if i % 5 == 4 { quantized } else { positions } },
                "indices": indices, "material": i % 6, "mode": if i % 7 < 4 { 4 } else { i % 7 }
            });
            if i % 4 == 1 {
                let more =
                    [("NORMAL", normals), ("TANGENT", tangents), ("TEXCOORD_0", texture_points), ("_USER", colors)];
                more.into_iter().for_each(|(name, accessor)| first["attributes"][name] = json!(accessor));
            }
            if i % 4 == 2 {
                let more = [("JOINTS_0", joints), ("WEIGHTS_0", weights), ("COLOR_0", colors)];
                more.into_iter().for_each(|(name, accessor)| first["attributes"][name] = json!(accessor));
                first["targets"] = json!([{ "POSITION": sparse, "NORMAL": normals }, { "TANGENT": normals }]);
            }
            // Sparse positions do not emit.
            let second = json!({ "attributes": { "POSITION": sparse }, "mode": i % 7, "material": 0 });
            let primitives = if i % 3 == 0 { vec![first, second] } else { vec![first] };
            json!({ "name": format!("mesh {i}"), "primitives": primitives, "weights": [0.5, 0.25] })
        })
        .collect();

    // Three levels of nodes: every fourth has the next three as its children, and every sixteenth
    // the roots of the three groups that follow.
    let nodes: Vec<Value> = (0..48_usize)
        .map(|i| {
            let step = i as f32;
            let mut node = json!({ "name": format!("node {i}") });
            match i % 3 {
                0 => node["translation"] = json!([step, 0.5, -step]),
                1 => {
                    node["rotation"] = json!([0.0, 0.6, 0.0, 0.8]);
                    node["scale"] = json!([1.0, 1.5, -0.5]);
                }
                _ => node["matrix"] = json!([0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, step, 1, 2, 1]),
            }
            if i % 4 == 0 {
                let mut children = vec![i + 1, i + 2, i + 3];
                if i % 16 == 0 {
                    children.extend([i + 4, i + 8, i + 12]);
                }
                node["children"] = json!(children);
            }
            match i % 5 {
                0 | 1 => node["mesh"] = json!(i % 20),
                2 => node["extensions"] = json!({ "KHR_lights_punctual": { "light": i % 6 } }),
                3 => node["camera"] = json!(i % 2),
                _ => {
                    node["mesh"] = json!(2);
                    node["skin"] = json!(i % 2);
                }
            }
            node
        })
        .collect();
    let lights: Vec<Value> = (0..6)
        .map(|i| match i % 3 {
            0 => json!({ "type": "point", "color": [1, 0.5, 0.25], "intensity": 10.0 * f64::from(i + 1), "range": 20 }),
            1 => json!({ "type": "spot", "intensity": 5, "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.7 } }),
            _ => json!({ "type": "directional", "name": "sun", "intensity": 2.5 }),
        })
        .collect();
    let materials: Vec<Value> = (0..6)
        .map(|i| {
            let texture = json!({ "index": i % 2, "texCoord": 0 });
            json!({
                "pbrMetallicRoughness": { "baseColorTexture": texture, "metallicRoughnessTexture": texture,
                    "baseColorFactor": [1, 1, 1, 0.5], "metallicFactor": 0.5, "roughnessFactor": 0.25 },
                "normalTexture": { "index": 0, "scale": 2 }, "occlusionTexture": { "index": 1, "strength": 0.5 },
                "emissiveTexture": texture, "emissiveFactor": if i == 0 { [0.0; 3] } else { [1.0, 0.5, 0.1] },
                "alphaMode": (["OPAQUE", "MASK", "BLEND"][i % 3]), "alphaCutoff": 0.5, "doubleSided": i % 2 == 1,
                "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 3 + i } },
                "extras": { "see_through": true, "list": [1, "two", null, { "three": [3.0] }] }
            })
        })
        .collect();
    let channel = |sampler: usize, node: usize, path: &str| json!({ "sampler": sampler, "target": { "node": node, "path": path } });
    let animations: Vec<Value> = (0..4_usize)
        .map(|i| {
            json!({
                "channels": [
                    channel(0, 3 * i + 1, "rotation"), channel(1, 3 * i, "translation"),
                    channel(2, 3 * i, "scale"), channel(1, 2, "weights")
                ],
                "samplers": [
                    { "input": times, "output": turns, "interpolation": "LINEAR" },
                    { "input": times, "output": moves, "interpolation": "STEP" },
                    { "input": times, "output": curves, "interpolation": "CUBICSPLINE" }
                ]
            })
        })
        .collect();
    let skins: Vec<Value> =
        (0..2).map(|i| json!({ "joints": [i, i + 1], "skeleton": i, "inverseBindMatrices": bind })).collect();
    let document = json!({
        "asset": { "version": "2.0", "generator": "girandole", "minVersion": "2.0" },
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_emissive_strength"],
        "extensionsRequired": ["KHR_lights_punctual"],
        "extensions": {
            "KHR_lights_punctual": { "lights": lights },
            "EXT_lights_image_based": { "lights": [{
                "intensity": 2.5, "rotation": [0, 0.6, 0, 0.8], "irradianceCoefficients": [],
                "specularImageSize": 1, "specularImages": [[0, 1, 0, 1, 0, 1]]
            }] }
        },
        "scene": 1, "scenes": [{ "nodes": [1] }, {
            "name": "all", "nodes": [0, 16, 32], "extensions": { "EXT_lights_image_based": { "light": 0 } }
        }],
        "nodes": nodes, "meshes": meshes, "materials": materials, "animations": animations, "skins": skins,
        "cameras": [
            { "type": "perspective", "perspective": { "aspectRatio": 1.5, "yfov": 0.9, "znear": 0.1, "zfar": 100 } },
            { "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 1, "znear": 0.1, "zfar": 10 } }
        ],
        "images": [{ "uri": "wood.png" }, { "bufferView": image, "mimeType": "image/png" }],
        "samplers": [{ "magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 33071 }],
        "textures": [{ "source": 0, "sampler": 0 }, { "source": 1 }],
        "accessors": buffers.accessors, "bufferViews": buffers.views,
        "buffers": [{ "byteLength": buffers.bin.len() }]
    });
    Parts { json: document.to_string().into_bytes(), bin: buffers.bin, is_binary: true }
}
