//! Small files that are malformed in one way each.

use super::files::{Parts, small_binary};

/// A file, and the number of lights that it loads or the code of the error that refuses it.
pub struct Hostile {
    pub name: &'static str,
    pub bytes: Vec<u8>,
    pub outcome: Result<usize, u32>,
}

/// Codes of [`AssetError`](girandole_assets::AssetError).
mod code {
    pub const INVALID: u32 = 700;
    pub const EXTENSIONS: u32 = 712;
}

/// An object of a JSON text, with ' for quotes.
fn object(fields: &str) -> String {
    format!("{{{}}}", fields.replace('\'', "\""))
}

/// The text of a document with these fields.
fn document(fields: &str) -> Vec<u8> {
    object(&format!("'asset':{{'version':'2.0'}},{fields}")).into_bytes()
}

/// A document with one emissive triangle: the fields of its accessor, its view and its buffer.
fn triangle(accessor: &str, view: &str, buffer: &str) -> Vec<u8> {
    document(&format!(
        "'nodes':[{{'mesh':0}}],'meshes':[{{'primitives':[{{'attributes':{{'POSITION':0}},'material':0}}]}}],\
         'materials':[{{'emissiveFactor':[1,1,1]}}],\
         'accessors':[{{'componentType':5126,'type':'VEC3','max':[1,1,1],{accessor}}}],\
         'bufferViews':[{{'buffer':0,{view}}}],'buffers':[{{{buffer}}}]"
    ))
}

/// A buffer of 36 bytes.
const BUFFER: &str = "'byteLength':36,'uri':'data:;base64,AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA'";
const VIEW: &str = "'byteLength':36";
const ACCESSOR: &str = "'bufferView':0,'count':3,'min':[0,0,0]";
/// The largest number of 64 bits.
const MAX: &str = "18446744073709551615";

/// A document whose buffer has a URI.
fn uri(uri: &str) -> Vec<u8> {
    document(&format!("'buffers':[{{'byteLength':1,'uri':'{uri}'}}]"))
}

/// Lists in lists.
fn lists(depth: usize) -> String {
    "[".repeat(depth) + &"]".repeat(depth)
}

/// What the gltf crate panics on, or takes long for.
fn known_panics() -> Vec<(&'static str, Vec<u8>, Result<usize, u32>)> {
    let refused = Err(code::INVALID);
    let bounds = vec!["0"; 500].join(",");
    let accessor = "'accessors':[{'count':1,'componentType':5126,'type':'VEC3','bufferView':0}],\
                    'bufferViews':[{'buffer':0,'byteLength':1}],'buffers':[{'uri':'data:;base64,AA'}]";
    let animation = |target: &str| {
        document(&format!(
            "{accessor},'animations':[{{'channels':[{{'sampler':0,'target':{{{target}}}}}],\
             'samplers':[{{'input':0,'output':0}}]}}]"
        ))
    };
    let lens = "'orthographic':{'xmag':1,'ymag':1,'zfar':1,'znear':0}";
    vec![
        ("no_positions", document("'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]"), refused),
        ("animation_of_no_node", animation("'node':9,'path':'scale'"), refused),
        ("animation_of_no_property", animation("'node':0,'path':'colour'"), Ok(0)),
        ("camera_of_the_other_type", document(&format!("'cameras':[{{'type':'perspective',{lens}}}]")), refused),
        ("image_without_a_source", document("'images':[{}],'textures':[{'source':0}]"), refused),
        ("image_without_a_type", document(&format!("{accessor},'images':[{{'bufferView':0}}]")), refused),
        ("long_bounds", triangle(&format!("'bufferView':0,'count':3,'min':[{bounds}]"), VIEW, BUFFER), refused),
    ]
}

fn deep() -> Vec<(&'static str, Vec<u8>, Result<usize, u32>)> {
    let refused = Err(code::INVALID);
    let chain = (1..1000).map(|i| format!("{{'children':[{i}]}},")).collect::<String>() + "{}";
    vec![
        ("deep_bounds", triangle(&format!("'min':{}", lists(2000)), VIEW, BUFFER), refused),
        ("deep_extras", document(&format!("'extras':{}", lists(3000))), Ok(0)),
        ("deep_unknown", document(&format!("'unknown':{}", lists(3000))), Ok(0)),
        ("deep_and_open", document(&format!("'extras':{}", "[{'a':".repeat(1000))), refused),
        ("deep_nodes", document(&format!("'nodes':[{chain}]")), Ok(0)),
    ]
}

fn hierarchies() -> Vec<(&'static str, Vec<u8>, Result<usize, u32>)> {
    let refused = Err(code::INVALID);
    let scene = "'scenes':[{'nodes':[0]}]";
    let huge = "'scale':[1e38,1e38,1e38]";
    vec![
        ("cycle", document(&format!("'nodes':[{{'children':[1]}},{{'children':[0]}}],{scene}")), refused),
        ("cycle_without_scenes", document("'nodes':[{'children':[1]},{'children':[0]}]"), refused),
        ("own_child", document(&format!("'nodes':[{{'children':[0]}}],{scene}")), refused),
        ("two_parents", document("'nodes':[{'children':[1,1]},{}]"), refused),
        ("scene_node_twice", document("'nodes':[{}],'scenes':[{'nodes':[0,0]}]"), refused),
        ("child_of_no_node", document("'nodes':[{'children':[1]}]"), Err(code::INVALID)),
        ("huge_scales", document(&format!("'nodes':[{{{huge},'children':[1]}},{{{huge}}}]")), Ok(0)),
        ("infinite_translation", document("'nodes':[{'translation':[1e39,0,0]}]"), Err(code::INVALID)),
        ("not_a_number", document("'nodes':[{'translation':[NaN,0,0]}]"), Err(code::INVALID)),
        ("index_beyond_32_bits", document("'scene':4294967296,'scenes':[{'nodes':[]}]"), Ok(0)),
    ]
}

fn accessors() -> Vec<(&'static str, Vec<u8>, Result<usize, u32>)> {
    let refused = Err(code::INVALID);
    let view = format!("'byteOffset':{MAX},'byteLength':{MAX}");
    let sparse = "'count':3,'min':[0,0,0],'sparse':{'count':9999999999,'indices':{'bufferView':0,'componentType':5125},\
                  'values':{'bufferView':0}}";
    vec![
        ("one_triangle", triangle(ACCESSOR, VIEW, BUFFER), Ok(1)),
        ("huge_count", triangle(&ACCESSOR.replace(":3", &format!(":{MAX}")), VIEW, BUFFER), refused),
        ("huge_offset", triangle(&format!("{ACCESSOR},'byteOffset':{MAX}"), VIEW, BUFFER), refused),
        ("huge_view", triangle(ACCESSOR, &view, BUFFER), refused),
        ("huge_buffer", triangle(ACCESSOR, VIEW, &BUFFER.replace("36", MAX)), Err(code::INVALID)),
        ("no_elements", triangle(&ACCESSOR.replace(":3", ":0"), "'byteLength':0", BUFFER), refused),
        ("sparse", triangle(sparse, VIEW, BUFFER), refused),
        ("no_chunk", document("'buffers':[{'byteLength':1}]"), Err(code::INVALID)),
    ]
}

fn texts() -> Vec<(&'static str, Vec<u8>, Result<usize, u32>)> {
    let refused = Err(code::INVALID);
    let required =
        "'extensionsRequired':['KHR_draco_mesh_compression','KHR_texture_basisu'],'textures':[{'source':'a'}]";
    vec![
        ("required_extensions", document(required), Err(code::EXTENSIONS)),
        ("parent_folder", uri("../a.bin"), refused),
        ("encoded_parent_folder", uri("%2e%2E%2fa.bin"), refused),
        ("absolute_path", uri("/etc/passwd"), refused),
        ("null_in_a_path", uri("a\\u0000.bin"), refused),
        ("lone_surrogate", uri("\\ud800.bin"), refused),
        ("cut_percent", uri("a%\\u00e9"), refused),
        ("no_base64", uri("data:;base64,\\u00e9"), refused),
        ("no_uri", uri(""), refused),
        (
            "no_image_based_light",
            document("'scenes':[{'nodes':[],'extensions':{'EXT_lights_image_based':{'light':9}}}]"),
            Err(code::INVALID),
        ),
        ("file_of_no_folder", uri("a.bin"), refused),
        ("not_utf_8", b"{\"asset\":{\"version\":\"2.0\",\"generator\":\"\xff\xfe\"}}".to_vec(), refused),
        ("not_utf_8_extras", b"{\"asset\":{\"version\":\"2.0\",\"extras\":[\"\xc3\"]}}".to_vec(), refused),
        ("byte_order_mark", b"\xef\xbb\xbf{\"asset\":{\"version\":\"2.0\"}}".to_vec(), Ok(0)),
        ("empty", Vec::new(), refused),
    ]
}

fn containers() -> Vec<(&'static str, Vec<u8>, Result<usize, u32>)> {
    let asset = b"{\"asset\":{\"version\":\"2.0\"}}".to_vec();
    let whole = Parts { json: asset, bin: vec![0; 8], is_binary: true }.to_bytes();
    let with = |at: usize, number: u32| {
        let mut bytes = whole.clone();
        bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
        bytes
    };
    let refused = Err(code::INVALID);
    let mut files = vec![
        ("no_lights", whole.clone(), Ok(0)),
        ("magic_only", b"glTF".to_vec(), refused),
        ("header_only", small_binary().to_bytes()[..20].to_vec(), refused),
    ];
    let lengths = [("length_0", 0), ("length_11", 11), ("length_12", 12), ("length_19", 19), ("length_max", u32::MAX)];
    files.extend(lengths.map(|(name, length)| (name, with(8, length), refused)));
    files.extend([("json_length_max", with(12, u32::MAX), refused), ("json_length_0", with(12, 0), refused)]);
    files.push(("bin_length_max", with(whole.len() - 16, u32::MAX), refused));
    files
}

/// All of them.
pub fn hostile() -> Vec<Hostile> {
    let files = [known_panics(), deep(), hierarchies(), accessors(), texts(), containers()].into_iter().flatten();
    files.map(|(name, bytes, outcome)| Hostile { name, bytes, outcome }).collect()
}
