//! Light trees from glTF: the sample file, malformed and malicious files, and the city example's
//! glTF scenes.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use girandole_assets::AssetError;
use girandole_assets::girandole::glam::{DAffine3, DVec3, Mat3, Vec3, vec3};
use girandole_assets::girandole::{FrameBudget, LightWorld, Shape, WorldError};
use girandole_assets::gltf::gltf::{Glb, binary as container};
use girandole_assets::gltf::{EmissiveSides, GltfFile, GltfLights, GltfOptions, LightSource, load_lights, parse};

use testbed::render::geometry::Geometry;
use testbed::scene::gltf_scene;
use testbed::scene::{Camera, SceneError};
use testbed::testing::support::Rng;

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data").join(name)
}

fn text() -> String {
    std::fs::read_to_string(sample("small.gltf")).unwrap()
}

fn binary() -> Vec<u8> {
    std::fs::read(sample("small.bin")).unwrap()
}

/// The bytes of small.bin: the positions of three meshes, the keys of one animation, the indices.
fn small_bin() -> Vec<u8> {
    let ground = [-6.0, 0.0, 6.0, 6.0, 0.0, 6.0, 6.0, 0.0, -6.0, -6.0, 0.0, -6.0];
    let sign = [-1.0, -0.5, 0.0, 1.0, -0.5, 0.0, 1.0, 0.5, 0.0, -1.0, 0.5, 0.0];
    let corner = |i: u32| [(i & 1) as f32 - 0.5, (i >> 1 & 1) as f32, (i >> 2) as f32 - 0.5];
    let block = (0..8).flat_map(corner);
    let times = [0.0, 2.0, 4.0];
    let turns = [0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0];
    let places = [0.0, 1.5, -2.0, 0.0, 2.5, -2.0, 0.0, 1.5, -2.0];
    let floats = ground.into_iter().chain(sign).chain(block).chain(times).chain(turns).chain(places);
    let quad = [0u16, 1, 2, 0, 2, 3];
    let faces = [
        [0u16, 2, 3, 0, 3, 1],
        [4, 5, 7, 4, 7, 6],
        [0, 1, 5, 0, 5, 4],
        [2, 6, 7, 2, 7, 3],
        [0, 4, 6, 0, 6, 2],
        [1, 3, 7, 1, 7, 5],
    ];
    let indices = quad.into_iter().chain(faces.into_iter().flatten());
    floats.flat_map(f32::to_le_bytes).chain(indices.flat_map(u16::to_le_bytes)).collect()
}

fn load_into(
    world: &mut LightWorld,
    text: &str,
    bytes: Vec<u8>,
    options: &GltfOptions,
) -> Result<GltfLights, AssetError> {
    let file = parse(text.as_bytes(), &GltfOptions::default()).expect("a valid document");
    load_lights(world, &GltfFile::new(file.document, vec![bytes]), &[], options)
}

/// The sample file with one passage replaced.
fn replaced(from: &str, to: &str) -> String {
    let text = text();
    assert!(text.contains(from), "the sample file does not contain {from}");
    text.replacen(from, to, 1)
}

#[test]
fn small_bin_holds_the_bytes_that_small_gltf_describes() {
    assert_eq!(binary(), small_bin());
}

#[test]
fn nodes_with_the_same_mesh_share_a_tree() {
    let mut world = LightWorld::new();
    let lights = load_into(&mut world, &text(), binary(), &GltfOptions::default()).unwrap();
    let nodes: Vec<(usize, LightSource)> = lights.nodes.iter().map(|lights| (lights.node, lights.source)).collect();
    let (surfaces, punctual) = (LightSource::Surfaces, LightSource::Punctual);
    assert_eq!(nodes, [(1, surfaces), (3, punctual), (4, punctual), (6, surfaces)]);
    assert_eq!(lights.nodes[0].tree, lights.nodes[3].tree);
    assert_eq!((world.trees().len(), world.instances().len(), world.light_count()), (3, 4, 6));
    let sign = world.tree(lights.nodes[0].tree).unwrap().lights()[0];
    assert!(matches!(sign.shape, Shape::Triangle { two_sided: true, .. }));
    assert!(sign.emission.abs_diff_eq(vec3(20.0, 2.0, 8.0), 1e-4));
    let bulb = world.tree(lights.nodes[1].tree).unwrap().lights()[0];
    assert_eq!((bulb.range, bulb.emission), (25.0, vec3(1.0, 0.8, 0.5) * 40.0));
    // The spot is turned 60 degrees down from -Z.
    let down = world.instance(lights.nodes[2].instance).unwrap().placement.linear * Vec3::NEG_Z;
    assert!(down.abs_diff_eq(vec3(0.0, -0.866_025_4, -0.5), 1e-5), "{down}");
}

#[test]
fn options_select_what_is_loaded() {
    let load = |options: GltfOptions| {
        let mut world = LightWorld::new();
        load_into(&mut world, &text(), binary(), &options).unwrap();
        let key = world.trees().next().unwrap();
        (world.light_count(), world.tree(key).unwrap().lights()[0])
    };
    let (count, light) = load(GltfOptions { punctual: false, sides: EmissiveSides::Front, ..Default::default() });
    assert_eq!((count, light.emission.x), (4, 20.0));
    assert!(matches!(light.shape, Shape::Triangle { two_sided: false, .. }));
    assert_eq!(load(GltfOptions { surfaces: false, ..Default::default() }).0, 2);
}

#[test]
fn malformed_files_are_refused_and_leave_the_world_unchanged() {
    let swap = |from: &str, to: &str| (replaced(from, to), binary());
    let patch = |at: usize, bytes: &[u8]| {
        let mut binary = binary();
        binary[at..at + bytes.len()].copy_from_slice(bytes);
        (text(), binary)
    };
    let cases: Vec<(&str, (String, Vec<u8>))> = vec![
        (
            "view beyond its buffer",
            swap("\"byteOffset\": 288, \"byteLength\": 12", "\"byteOffset\": 370, \"byteLength\": 12"),
        ),
        ("accessor beyond its view", swap("\"count\": 6, \"type\"", "\"count\": 7, \"type\"")),
        ("largest count of an accessor", swap("\"count\": 6, \"type\"", "\"count\": 9223372036854775807, \"type\"")),
        ("largest offset of a view", swap("\"byteOffset\": 48,", "\"byteOffset\": 18446744073709551000,")),
        ("short buffer", (text(), binary()[..290].to_vec())),
        ("empty buffer", (text(), Vec::new())),
        ("index of no vertex", patch(288, &9u16.to_le_bytes())),
        ("float indices", swap("\"componentType\": 5123, \"count\": 6", "\"componentType\": 5126, \"count\": 3")),
        ("vertex that is NaN", patch(48, &f32::NAN.to_le_bytes())),
        ("vertex that is infinite", patch(48, &f32::INFINITY.to_le_bytes())),
        ("emission that overflows", swap("\"emissiveStrength\": 20.0", "\"emissiveStrength\": 1e39")),
        ("negative emission", swap("\"emissiveFactor\": [1.0, 0.1", "\"emissiveFactor\": [-1.0, 0.1")),
        ("negative intensity", swap("\"intensity\": 40.0", "\"intensity\": -40.0")),
        ("range of zero", swap("\"range\": 25.0", "\"range\": 0.0")),
        ("spot wider than a sphere", swap("\"outerConeAngle\": 0.6", "\"outerConeAngle\": 9.0")),
        ("transform that overflows", swap("[0.0, 1.5, -2.0]", "[0.0, 1e39, -2.0]")),
        ("node too far from the origin", swap("[0.0, 1.5, -2.0]", "[0.0, 1e12, -2.0]")),
        ("rotation without length", swap("[0.0, 0.3826834, 0.0, 0.9238795]", "[0.0, 0.0, 0.0, 0.0]")),
        (
            "node that is its own child",
            swap("\"name\": \"Ground\", \"mesh\": 0 }", "\"name\": \"Ground\", \"mesh\": 0, \"children\": [0] }"),
        ),
        (
            "node with two parents",
            swap("\"name\": \"Ground\", \"mesh\": 0 }", "\"name\": \"Ground\", \"mesh\": 0, \"children\": [1] }"),
        ),
    ];
    for (name, (text, bytes)) in cases {
        // The gltf crate refuses some of these files itself.
        let Ok(file) = parse(text.as_bytes(), &GltfOptions::default()) else { continue };
        let mut world = LightWorld::new();
        let result = load_lights(&mut world, &GltfFile::new(file.document, vec![bytes]), &[], &GltfOptions::default());
        let error = result.expect_err(name);
        assert!(!error.to_string().contains('\n'), "{name}: {error}");
        assert_eq!((world.trees().len(), world.instances().len(), world.light_count()), (0, 0, 0), "{name}: {error}");
    }
}

#[test]
fn errors_name_the_element_by_its_index() {
    let mut world = LightWorld::new();
    let text = text();
    let file = parse(text.as_bytes(), &GltfOptions::default()).unwrap();
    let says = |result: Result<GltfLights, AssetError>, message: &str| {
        assert_eq!(result, Err(AssetError::Invalid { message: message.into() }));
    };
    let missing = load_lights(&mut world, &GltfFile::new(file.document, Vec::new()), &[], &GltfOptions::default());
    says(missing, "buffer 0 is missing: 0 buffers were given");
    let short = load_into(&mut world, &text, binary()[..295].to_vec(), &GltfOptions::default());
    says(short, "accessor 6 reads up to byte 300, but its buffer has 295 bytes");
    let far = text.replace("[-3.0, 1.0, 0.0]", "[-3e12, 1.0, 0.0]");
    let far = load_into(&mut world, &far, binary(), &GltfOptions::default());
    assert!(matches!(far, Err(AssetError::World { node: 6, source: WorldError::Value(_) })), "{far:?}");
}

#[test]
fn a_cycle_in_a_document_without_scenes_is_refused() {
    let text = text().replace("\"scene\": 0,", "").replace("\"scenes\": [{ \"nodes\": [0, 1, 2, 3, 4, 5, 6] }],", "");
    assert_eq!(load_into(&mut LightWorld::new(), &text, binary(), &GltfOptions::default()).unwrap().nodes.len(), 4);
    let from = "\"name\": \"Sign\", \"mesh\": 1,";
    assert!(text.contains(from));
    let cycle = text.replacen(from, "\"name\": \"Sign\", \"mesh\": 1, \"children\": [1],", 1);
    let result = load_into(&mut LightWorld::new(), &cycle, binary(), &GltfOptions::default());
    assert_eq!(result.unwrap_err().to_string(), "node 1 has two parents or is its own ancestor");
}

#[test]
fn nodes_scaled_to_zero_are_loaded_and_hidden() {
    for scale in ["[0, 0, 0]", "[0, 1, 1]", "[1, 1, 0]", "[0, 2, 0]"] {
        let text = replaced("[0.5, 0.5, 0.5] }", &format!("{scale} }}"))
            .replace("[2.5, 4.0, 2.0],", &format!("[2.5, 4.0, 2.0], \"scale\": {scale},"))
            .replace("[-2.0, 3.0, 1.0],", &format!("[-2.0, 3.0, 1.0], \"scale\": {scale},"));
        let mut world = LightWorld::new();
        let lights = load_into(&mut world, &text, binary(), &GltfOptions::default()).unwrap();
        let linear = |node: usize| {
            let node = lights.nodes.iter().find(|lights| lights.node == node).unwrap();
            world.instance(node.instance).unwrap().placement.linear
        };
        // The scaled copy of the sign, the point light and the spot light.
        assert_eq!([6, 3, 4].map(linear), [Mat3::ZERO; 3], "{scale}");
        assert_eq!(linear(1), Mat3::IDENTITY);
        // A hidden instance appears when it is moved to a placement that is not hidden.
        let copy = lights.nodes.iter().find(|lights| lights.node == 6).unwrap();
        let shown = LightSource::Surfaces.placement(&DAffine3::from_scale(DVec3::splat(0.5))).unwrap();
        world.move_instance(copy.instance, shown).unwrap();
        assert_eq!(world.instance(copy.instance).map(|i| i.placement), Some(shown));
    }
}

#[test]
fn a_hidden_ancestor_hides_its_turned_descendants() {
    // The rotation of the child is rounded, so that its determinant is not exactly zero.
    let flat = "\"name\": \"Ground\", \"scale\": [1, 0, 1], \"rotation\": [0.1, 0.7, 0.3, 0.6], \"children\": [6] }";
    let text = replaced("\"name\": \"Ground\", \"mesh\": 0 }", flat)
        .replace("[0, 1, 2, 3, 4, 5, 6] }]", "[0, 1, 2, 3, 4, 5] }]")
        .replace("[0.0, 0.3826834, 0.0, 0.9238795]", "[0.3, 0.1, 0.7, 0.5]");
    let mut world = LightWorld::new();
    let lights = load_into(&mut world, &text, binary(), &GltfOptions::default()).unwrap();
    let copy = lights.nodes.iter().find(|lights| lights.node == 6).unwrap();
    assert_eq!(world.instance(copy.instance).unwrap().placement.linear, Mat3::ZERO);
}

/// The sample file with one triangle of the sign for each of `primitives` primitives. All share the
/// accessors; primitive i has material `material(i)`, whose strength is i + 1.
fn shared_accessors(primitives: usize, materials: usize) -> String {
    let mut list = String::new();
    for i in 0..primitives {
        let material = 3 + i % materials;
        write!(list, "{{ \"attributes\": {{ \"POSITION\": 1 }}, \"indices\": 6, \"material\": {material} }},").unwrap();
    }
    let mut emitters = String::new();
    for i in 0..materials {
        let strength = i + 1;
        write!(
            emitters,
            ", {{ \"emissiveFactor\": [1, 1, 1], \"extensions\": {{ \"KHR_materials_emissive_strength\": \
             {{ \"emissiveStrength\": {strength} }} }} }}"
        )
        .unwrap();
    }
    let sign = "{ \"attributes\": { \"POSITION\": 1 }, \"indices\": 6, \"material\": 1 }";
    let last = "\"metallicFactor\": 0.0, \"roughnessFactor\": 0.3 } }";
    replaced(sign, list.trim_end_matches(',')).replacen(last, &format!("{last}{emitters}"), 1)
}

#[test]
fn primitives_with_equal_accessors_and_emission_add_their_lights_once() {
    let mut world = LightWorld::new();
    let lights = load_into(&mut world, &shared_accessors(300, 1), binary(), &GltfOptions::default()).unwrap();
    assert_eq!(world.tree(lights.nodes[0].tree).unwrap().lights().len(), 2);
    let mut world = LightWorld::new();
    let lights = load_into(&mut world, &shared_accessors(300, 3), binary(), &GltfOptions::default()).unwrap();
    assert_eq!(world.tree(lights.nodes[0].tree).unwrap().lights().len(), 6);
}

#[test]
fn meshes_with_equal_accessors_and_emission_share_a_tree() {
    let copy = "\"name\": \"SignCopy\", \"mesh\": 1,";
    let mesh = "{ \"name\": \"Box\",";
    let twin = "{ \"primitives\": [{ \"attributes\": { \"POSITION\": 1 }, \"indices\": 6, \"material\": 1 }] }";
    let load = |twin: &str| {
        // The twin becomes mesh 2, which the copy of the sign uses.
        let text = replaced(copy, "\"name\": \"SignCopy\", \"mesh\": 2,").replacen(mesh, &format!("{twin}, {mesh}"), 1);
        let lights = load_into(&mut LightWorld::new(), &text, binary(), &GltfOptions::default()).unwrap();
        let tree = |node: usize| lights.nodes.iter().find(|lights| lights.node == node).unwrap().tree;
        (tree(1), tree(6))
    };
    let (first, second) = load(twin);
    assert_eq!(first, second);
    let (first, second) = load(&twin.replace("\"indices\": 6, ", ""));
    assert_ne!(first, second, "the twin without indices has one triangle");
}

#[test]
fn the_number_of_lights_is_limited() {
    let load = |max_lights: usize| {
        let mut world = LightWorld::new();
        let options = GltfOptions { max_lights, ..Default::default() };
        let result = load_into(&mut world, &text(), binary(), &options);
        (result.map(|lights| lights.nodes.len()), world.trees().len())
    };
    // Two triangles of the sign, which two nodes share, and two punctual lights.
    assert_eq!(load(4), (Ok(4), 3));
    assert_eq!(load(3), (Err(AssetError::Limit { option: "max_lights", needed: 4, limit: 3 }), 0));
    let sun = replaced("\"type\": \"point\",", "\"type\": \"directional\",").replacen(", \"range\": 25.0", "", 1);
    let load = |max_lights: usize| {
        let options = GltfOptions { max_lights, ..Default::default() };
        load_into(&mut LightWorld::new(), &sun, binary(), &options).map(|lights| lights.directional.len())
    };
    assert_eq!(load(4), Ok(1));
    assert_eq!(load(3), Err(AssetError::Limit { option: "max_lights", needed: 4, limit: 3 }));
}

#[test]
fn a_small_file_that_describes_millions_of_lights_is_refused() {
    // 300 materials that share one accessor of 90,000 indices: 9 million lights from 220 kB.
    let indices = "\"bufferView\": 6, \"componentType\": 5123, \"count\": 6,";
    let view = "\"byteOffset\": 288, \"byteLength\": 12,";
    let text = shared_accessors(300, 300);
    assert!(text.contains(indices) && text.contains(view));
    let text = text
        .replacen(indices, "\"bufferView\": 6, \"componentType\": 5123, \"count\": 90000,", 1)
        .replacen(view, "\"byteOffset\": 372, \"byteLength\": 180000,", 1)
        .replacen("\"byteLength\": 372", "\"byteLength\": 180372", 1);
    let mut bytes = binary();
    bytes.resize(180_372, 0);
    let mut world = LightWorld::new();
    let result = load_into(&mut world, &text, bytes, &GltfOptions::default());
    assert_eq!(result, Err(AssetError::Limit { option: "max_lights", needed: 9_000_002, limit: 1 << 22 }));
    assert_eq!(world.trees().len(), 0);
}

/// A number of `text` replaced by one that a file should not hold at that place.
fn spoiled(text: &str, rng: &mut Rng) -> String {
    const VALUES: [&str; 12] =
        ["0", "-1", "1", "2", "7", "255", "65535", "4294967295", "18446744073709551615", "1e39", "-1e39", "1e-40"];
    let is_number = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
    let starts: Vec<usize> = text
        .char_indices()
        .filter(|&(i, c)| is_number(c) && !text[..i].ends_with(|before: char| is_number(before) || before == '_'))
        .map(|(i, _)| i)
        .collect();
    let start = starts[rng.bits() as usize % starts.len()];
    let end = text[start..].find(|c| !is_number(c)).map_or(text.len(), |length| start + length);
    let value = VALUES[rng.bits() as usize % VALUES.len()];
    format!("{}{value}{}", &text[..start], &text[end..])
}

#[test]
fn spoiled_numbers_never_panic() {
    let mut rng = Rng(0x61_7f);
    let folder = std::env::temp_dir().join(format!("girandole_spoiled_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let (path, bin) = (folder.join("spoiled.gltf"), folder.join("small.bin"));
    let (mut loaded, mut refused) = (0, 0);
    for _ in 0..500 {
        let mut text = text();
        for _ in 0..1 + rng.bits() % 3 {
            text = spoiled(&text, &mut rng);
        }
        let mut bytes = binary();
        for _ in 0..rng.bits() % 3 {
            let at = rng.bits() as usize % bytes.len();
            bytes[at] = rng.bits() as u8;
        }
        if let Ok(file) = parse(text.as_bytes(), &GltfOptions::default()) {
            let mut world = LightWorld::new();
            let buffers = vec![bytes.clone()];
            let result = load_lights(&mut world, &GltfFile::new(file.document, buffers), &[], &GltfOptions::default());
            if result.is_err() {
                refused += 1;
                assert_eq!((world.trees().len(), world.instances().len()), (0, 0), "{result:?}");
            } else {
                loaded += 1;
            }
        }
        // The example's loader, player and geometry.
        std::fs::write(&path, &text).unwrap();
        std::fs::write(&bin, &bytes).unwrap();
        let Ok(mut stage) = gltf_scene::stage(&path, None) else { continue };
        let Ok(mut geometry) = Geometry::new(&stage.scene) else { continue };
        for time in [0.0, 1.0, 2.5] {
            let moved = stage.animation.advance(time, &mut stage.scene, &mut stage.world);
            if moved.is_err() || geometry.update(&stage.scene).is_err() {
                break;
            }
        }
    }
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(loaded > 100 && refused > 20, "{loaded} loaded, {refused} refused");
}

#[test]
fn every_truncation_of_a_binary_file_is_an_error() {
    let text = text().replace("\"uri\": \"small.bin\", ", "");
    let glb = Glb {
        header: container::Header { magic: *b"glTF", version: 2, length: 0 },
        json: text.into_bytes().into(),
        bin: Some(binary().into()),
    };
    let bytes = glb.to_vec().unwrap();
    let path = std::env::temp_dir().join(format!("girandole_truncated_{}.glb", std::process::id()));
    std::fs::write(&path, &bytes).unwrap();
    assert!(gltf_scene::stage(&path, None).is_ok());
    let lengths = (0..40).chain((40..bytes.len()).step_by(97)).chain(bytes.len() - 8..bytes.len());
    for length in lengths {
        // With the stated length unchanged, and with the length of the truncated file.
        let cut = bytes[..length].to_vec();
        let mut consistent = cut.clone();
        if length >= 12 {
            consistent[8..12].copy_from_slice(&(length as u32).to_le_bytes());
        }
        for file in [cut, consistent] {
            std::fs::write(&path, file).unwrap();
            let SceneError(message) = gltf_scene::open(&path).expect_err("a truncated file");
            assert!(!message.contains('\n') && message.contains("girandole_truncated"), "{message}");
        }
    }
    std::fs::remove_file(&path).unwrap();
}

#[test]
fn animations_move_objects_and_lights_and_loop() {
    let mut stage = gltf_scene::stage(&sample("small.gltf"), None).unwrap();
    assert_eq!(stage.scene.camera.eye, vec3(0.0, 2.2, 7.0));
    let rest = stage.scene.objects[1].transform;
    stage.animation.advance(0.0, &mut stage.scene, &mut stage.world).unwrap();
    stage.world.update(FrameBudget::UNLIMITED);
    stage.animation.advance(1.0, &mut stage.scene, &mut stage.world).unwrap();
    let moved = stage.scene.objects[1].transform;
    assert!((moved.translation.y - 2.0).abs() < 1e-5 && !moved.abs_diff_eq(rest, 0.5));
    // One of the two signs turned together with its lights; the other did not move.
    assert_eq!(stage.world.update(FrameBudget::UNLIMITED).moved_instances, 1);
    let instances: Vec<_> = stage.world.instances().collect();
    let is_at_sign = |instance| {
        stage
            .world
            .instance(instance)
            .unwrap()
            .placement
            .translation
            .as_vec3()
            .abs_diff_eq(moved.translation.into(), 1e-5)
    };
    assert_eq!(instances.into_iter().filter(|&instance| is_at_sign(instance)).count(), 1);
    stage.animation.advance(4.0, &mut stage.scene, &mut stage.world).unwrap();
    assert!(stage.scene.objects[1].transform.abs_diff_eq(rest, 1e-5));
}

#[test]
fn a_node_whose_animated_scale_is_zero_is_hidden() {
    // The positions of the sign's animation become scales, of which the first is zero.
    let folder = std::env::temp_dir().join(format!("girandole_scale_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("scale.gltf");
    std::fs::write(&path, replaced("\"path\": \"translation\"", "\"path\": \"scale\"")).unwrap();
    let mut bytes = binary();
    bytes[252..264].fill(0);
    // A scale of zero along one axis hides the node too, so the second key gets one.
    bytes[264..268].copy_from_slice(&1f32.to_le_bytes());
    std::fs::write(folder.join("small.bin"), bytes).unwrap();
    let mut stage = gltf_scene::stage(&path, None).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    let mut geometry = Geometry::new(&stage.scene).unwrap();
    for (time, is_hidden) in [(0.0, true), (1.0, false), (4.0, true)] {
        stage.animation.advance(time, &mut stage.scene, &mut stage.world).unwrap();
        geometry.update(&stage.scene).unwrap();
        let hidden = |instance| stage.world.instance(instance).unwrap().placement.linear == Mat3::ZERO;
        assert_eq!(stage.world.instances().filter(|&instance| hidden(instance)).count(), usize::from(is_hidden));
        assert_eq!(geometry.objects[1].visible, !is_hidden);
    }
}

#[test]
fn a_camera_that_is_given_replaces_that_of_the_file() {
    let camera = Camera { eye: Vec3::ONE, target: Vec3::ZERO, vertical_fov: 1.0, up: Vec3::Y };
    assert_eq!(gltf_scene::stage(&sample("small.gltf"), Some(camera)).unwrap().scene.camera, camera);
}

#[test]
fn errors_name_a_file_that_does_not_exist() {
    let SceneError(message) = gltf_scene::stage(Path::new("/nowhere/scene.glb"), None).err().unwrap();
    assert!(message.starts_with("/nowhere/scene.glb: "), "{message}");
}
