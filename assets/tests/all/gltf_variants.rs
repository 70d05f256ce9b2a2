//! What glTF allows and few files have: channels without a node, accessors without a view, hidden nodes, and byte
//! order marks; and what is named when it is not read.

use girandole_assets::AssetError;
use girandole_assets::girandole::glam::Vec3;
use girandole_assets::girandole::{LightId, LightWorld, ShadingPoint, Shape};
use girandole_assets::gltf::gltf::Gltf;
use girandole_assets::gltf::{
    GltfFile, GltfLights, GltfOptions, LightSource, accessor_values, load_bytes, load_lights, parse, scene_nodes,
};

use testbed::testing::gltf_documents::{floats, square, square_primitive};

fn open(bytes: &[u8]) -> GltfFile {
    load_bytes(bytes, &GltfOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn load(text: &str) -> Result<(LightWorld, GltfLights), AssetError> {
    let (file, mut world) = (open(text.as_bytes()), LightWorld::new());
    let lights = load_lights(&mut world, &file, &[], &GltfOptions::default())?;
    Ok((world, lights))
}

/// A .glb file of a document.
fn binary(json: &[u8]) -> Vec<u8> {
    let mut json = json.to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |number: usize| (number as u32).to_le_bytes();
    [b"glTF", &word(2)[..], &word(20 + json.len()), &word(json.len()), b"JSON", &json].concat()
}

/// A node with a lamp, and an animation with these channels.
fn animated(channels: &str) -> String {
    square().text(&format!(
        "'extensionsUsed':['KHR_lights_punctual','KHR_animation_pointer'],\
         'extensions':{{'KHR_lights_punctual':{{'lights':[{{'type':'point','intensity':100}}]}}}},\
         'nodes':[{{'extensions':{{'KHR_lights_punctual':{{'light':0}}}}}}],\
         'animations':[{{'samplers':[{{'input':0,'output':0}}],'channels':[{channels}]}}]"
    ))
}

#[test]
fn channels_of_no_node_and_of_unknown_properties_are_left_out() {
    let pointer = "{'sampler':0,'target':{'path':'pointer','extensions':{'KHR_animation_pointer':\
                   {'pointer':'/extensions/KHR_lights_punctual/lights/0/intensity'}}}}";
    let of_node = "{'sampler':0,'target':{'node':0,'path':'scale'}}";
    let unknown = of_node.replace("scale", "pointer");
    for (channels, kept) in [
        (pointer.to_owned(), 0),
        (unknown.clone(), 0),
        (format!("{pointer},{of_node},{unknown},{pointer}"), 1),
        (of_node.into(), 1),
    ] {
        let text = animated(&channels);
        for bytes in [text.clone().into_bytes(), binary(text.as_bytes())] {
            let (file, mut world) = (GltfFile::new(open_lamp(&bytes).document, Vec::new()), LightWorld::new());
            load_lights(&mut world, &file, &[], &GltfOptions::default()).expect("a lamp");
            let found = file.document.animations().flat_map(|animation| animation.channels().collect::<Vec<_>>());
            assert_eq!((found.count(), world.light_count()), (kept, 1), "{channels}");
        }
    }
    for wrong in ["{'sampler':0}", "{'sampler':0,'target':{'node':1,'path':'scale'}}"] {
        let error = load_bytes(animated(wrong).as_bytes(), &GltfOptions::default()).expect_err(wrong);
        assert_eq!(error.code(), 700, "{error}");
    }
    // The second reading is within the limit of memory too.
    let text = animated(pointer);
    let bytes = |max_bytes| GltfOptions { max_bytes, ..GltfOptions::default() };
    let once = 1280 * text.matches('{').count() + 256 * (1 + text.matches([',', '[']).count()) + 2 * text.len();
    for (max_bytes, is_read) in [(2 * once, true), (2 * once - 1, false), (once, false)] {
        assert_eq!(parse(text.as_bytes(), &bytes(max_bytes as u64)).is_ok(), is_read, "{max_bytes}");
    }
}

/// The document of a file whose buffers do not matter.
fn open_lamp(bytes: &[u8]) -> Gltf {
    parse(bytes, &GltfOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn byte_order_marks_are_passed_over() {
    let text = format!("\u{feff}{}", animated("{'sampler':0,'target':{'node':0,'path':'scale'}}"));
    for bytes in [text.clone().into_bytes(), binary(text.as_bytes())] {
        assert_eq!(open_lamp(&bytes).document.nodes().count(), 1);
    }
    let error = parse("\u{feff}{\"asset\":{\"version\":\"1.0\"}}".as_bytes(), &GltfOptions::default());
    assert!(error.expect_err("the first version").to_string().contains("only 2.x is supported"));
}

/// An emissive square of the accessors of [`square`], with this in place of parts of the text.
fn emissive(replaced: &[(&str, &str)]) -> String {
    let mut document = square();
    let indices = document.view(&[1, 3]);
    let values = document.view(&floats(&[5.0, 6.0, 7.0, 8.0, 9.0, 10.0]));
    let mut text = document.text(&format!(
        "'nodes':[{{'mesh':0}}],'meshes':[{{'primitives':[{}]}}],'materials':[{{'emissiveFactor':[1,1,1]}}]",
        square_primitive(0)
    ));
    let sparse = format!(
        "'sparse':{{'count':2,'indices':{{'bufferView':{indices},'componentType':5121}},\
         'values':{{'bufferView':{values}}}}}"
    );
    for (from, to) in replaced {
        let [from, to] = [from, to].map(|text| text.replace("SPARSE", &sparse).replace('\'', "\""));
        assert!(text.contains(&from), "{from} in {text}");
        text = text.replacen(&from, &to, 1);
    }
    text
}

#[test]
fn compressed_primitives_without_other_data_are_named() {
    let draco = ("'attributes'", "'extensions':{'KHR_draco_mesh_compression':{'bufferView':0}},'attributes'");
    assert_eq!(load(&emissive(&[draco])).expect("data without compression").0.light_count(), 2);
    for without in [("'bufferView':0,'count':4", "'count':4"), ("'bufferView':2,'count':6", "'count':6")] {
        let error = load_bytes(emissive(&[draco, without]).as_bytes(), &GltfOptions::default()).expect_err("no data");
        let expected = "mesh 0: a primitive has no data but those of KHR_draco_mesh_compression";
        assert!(error.code() == 700 && error.to_string().ends_with(expected), "{error}");
    }
}

#[test]
fn sparse_accessors_replace_elements_or_zeros() {
    let (view, sparse) = ("'bufferView':0,'count':4", "'bufferView':0,'count':4,SPARSE");
    let vertices = |positions: &str| {
        let (world, _) = load(&emissive(&[(view, positions)])).expect("a valid document");
        let tree = world.tree(world.trees().next().expect("a tree")).expect("it lives");
        [0, 1].map(|light: usize| match tree.lights()[light].shape {
            Shape::Triangle { vertices, .. } => vertices,
            other => panic!("{other:?}"),
        })
    };
    let replaced = vertices(sparse);
    assert_eq!(replaced[0][1], Vec3::new(5.0, 6.0, 7.0));
    assert_eq!(replaced[1], [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, 0.0), Vec3::new(8.0, 9.0, 10.0)]);
    let zeros = vertices("'count':4,SPARSE");
    assert_eq!(zeros[1], [Vec3::ZERO, Vec3::ZERO, Vec3::new(8.0, 9.0, 10.0)]);
    let three =
        load(&emissive(&[(view, sparse), ("'sparse':{'count':2", "'sparse':{'count':3")])).expect_err("three of two");
    assert!(three.to_string().starts_with("accessor 0 reads up to byte "), "{three}");
    // A small file could state any number of zeros.
    for (count, is_read) in [(1 << 22, true), ((1 << 22) + 1, false), (10 << 22, false)] {
        let file = open(emissive(&[("'bufferView':0,'count':4", &format!("'count':{count},SPARSE"))]).as_bytes());
        let accessor = file.document.accessors().next().expect("positions");
        match accessor_values::<3>(&accessor, &file.buffers) {
            Ok(values) => {
                assert!(is_read && values.len() == count, "{count}");
                assert_eq!(values[..5], [[0.0; 3], [5.0, 6.0, 7.0], [0.0; 3], [8.0, 9.0, 10.0], [0.0; 3]]);
            }
            Err(error) => {
                assert!(!is_read, "{count}: {error}");
                assert!(error.to_string().contains("4,194,304"), "{error}");
            }
        }
    }
}

#[test]
fn lights_of_hidden_nodes_are_dark_until_they_are_enabled() {
    let text = |visible: &str| {
        let light = |index: usize| format!("'KHR_lights_punctual':{{'light':{index}}}");
        let hidden = |visible: &str| format!("'KHR_node_visibility':{{'visible':{visible}}}");
        square().text(&format!(
            "'extensionsRequired':['KHR_node_visibility'],'extensions':{{'KHR_lights_punctual':{{'lights':[\
             {{'type':'point','intensity':100}},{{'type':'directional'}}]}}}},\
             'nodes':[{{'children':[1,3,4],'extensions':{{{}}}}},\
             {{'children':[2],'extensions':{{{},{}}}}},{{'mesh':0,'extensions':{{{}}}}},\
             {{'extensions':{{{}}}}},{{'mesh':0}},{{'extensions':{{{}}}}}],\
             'meshes':[{{'primitives':[{}]}}],'materials':[{{'emissiveFactor':[1,1,1]}}]",
            hidden(visible),
            light(0),
            hidden("false"),
            hidden("true"),
            light(1),
            light(1),
            square_primitive(0)
        ))
    };
    let point = ShadingPoint::volume(Vec3::new(0.1, 0.2, 0.7));
    let local = |lights: &GltfLights| lights.nodes.iter().map(|added| (added.node, added.source)).collect::<Vec<_>>();
    let nodes = [(1, LightSource::Punctual), (2, LightSource::Surfaces), (4, LightSource::Surfaces)];
    // The root is hidden, and all below it, whatever they say.
    let (mut world, lights) = load(&text("false")).expect("a valid document");
    assert_eq!(local(&lights), nodes);
    assert_eq!(lights.directional.iter().map(|(node, _)| *node).collect::<Vec<_>>(), [5]);
    let is_lit = |world: &LightWorld, added: usize| {
        let sampler = world.sampler();
        sampler
            .all_lights()
            .filter(|light| sampler.pmf(&point, *light) > 0.0)
            .any(|light| matches!(light, LightId::Local { instance, .. } if instance == lights.nodes[added].instance))
    };
    assert!((0..3).all(|added| !is_lit(&world, added)));
    world.set_appearance(lights.nodes[2].instance, |a| a.is_enabled = true).expect("it lives");
    assert_eq!([0, 1, 2].map(|added| is_lit(&world, added)), [false, false, true]);
    // Only the second node is hidden, with its child.
    let (world, lights) = load(&text("true")).expect("a valid document");
    assert_eq!(local(&lights), nodes);
    assert_eq!(lights.directional.iter().map(|(node, _)| *node).collect::<Vec<_>>(), [3, 5]);
    let enabled = |added: usize| world.instance(lights.nodes[added].instance).map(|i| i.appearance.is_enabled);
    assert_eq!([0, 1, 2].map(enabled), [false, false, true].map(Some));
    let file = open(text("true").as_bytes());
    let nodes = scene_nodes(&file.document).expect("a tree");
    let visible: Vec<(usize, bool)> = nodes.iter().map(|node| (node.node, node.is_visible)).collect();
    assert_eq!(visible, [(0, true), (1, false), (2, false), (3, true), (4, true), (5, true)]);
    let error = load(&text("'no'")).expect_err("no truth value");
    assert_eq!(error.code(), 700, "{error}");
}
