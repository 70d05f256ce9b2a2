//! Light trees from glTF: the sample file, files that lie about their own layout, and the scenes of the example.

use std::path::{Path, PathBuf};

use girandole::glam::{Vec3, vec3};
use girandole::gltf::gltf::{Glb, Gltf, binary as container};
use girandole::gltf::{EmissiveSides, GltfError, GltfLights, GltfOptions, LightSource, load_lights};
use girandole::{FrameBudget, LightWorld, Shape, WorldError};

use super::city::scene::{Camera, SceneError, gltf_file, gltf_scene};

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

fn text() -> String {
    std::fs::read_to_string(sample("small.gltf")).unwrap()
}

fn binary() -> Vec<u8> {
    std::fs::read(sample("small.bin")).unwrap()
}

/// How small.bin came to be: three meshes, the keys of one animation, the indices.
fn recipe() -> Vec<u8> {
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
) -> Result<GltfLights, GltfError> {
    let file = Gltf::from_slice(text.as_bytes()).expect("the gltf crate takes it");
    load_lights(world, &file.document, &[bytes], options)
}

#[test]
fn the_sample_is_made_by_its_recipe() {
    assert_eq!(binary(), recipe());
}

#[test]
fn nodes_become_instances_that_share_trees() {
    let mut world = LightWorld::new();
    let lights = load_into(&mut world, &text(), binary(), &GltfOptions::default()).unwrap();
    let nodes: Vec<(usize, LightSource)> = lights.nodes.iter().map(|lights| (lights.node, lights.source)).collect();
    let (surfaces, punctual) = (LightSource::Surfaces, LightSource::Punctual);
    assert_eq!(nodes, [(1, surfaces), (3, punctual), (4, punctual), (6, surfaces)]);
    assert_eq!(lights.nodes[0].tree, lights.nodes[3].tree);
    assert_eq!((world.tree_count(), world.instance_count(), world.light_count()), (3, 4, 6));
    let sign = world.tree(lights.nodes[0].tree).unwrap().lights()[0];
    assert!(matches!(sign.shape, Shape::Triangle { two_sided: true, .. }));
    assert!(sign.emission.abs_diff_eq(vec3(20.0, 2.0, 8.0), 1e-4));
    let bulb = world.tree(lights.nodes[1].tree).unwrap().lights()[0];
    assert_eq!((bulb.range, bulb.emission), (25.0, vec3(1.0, 0.8, 0.5) * 40.0));
    // The spot is turned 60 degrees down from -Z.
    let down = world.placement(lights.nodes[2].instance).unwrap().linear * Vec3::NEG_Z;
    assert!(down.abs_diff_eq(vec3(0.0, -0.866_025_4, -0.5), 1e-5), "{down}");
}

#[test]
fn options_choose_what_is_taken() {
    let load = |options: GltfOptions| {
        let mut world = LightWorld::new();
        load_into(&mut world, &text(), binary(), &options).unwrap();
        let key = world.trees().next().unwrap();
        (world.light_count(), world.tree(key).unwrap().lights()[0])
    };
    let surfaces =
        GltfOptions { punctual: false, sides: EmissiveSides::Front, surface_scale: 2.0, ..Default::default() };
    let (count, light) = load(surfaces);
    assert_eq!((count, light.emission.x), (4, 40.0));
    assert!(matches!(light.shape, Shape::Triangle { two_sided: false, .. }));
    assert_eq!(load(GltfOptions { surfaces: false, ..Default::default() }).0, 2);
}

#[test]
fn files_that_lie_are_refused_and_the_world_stays_as_it_was() {
    let swap = |from: &str, to: &str| {
        let text = text();
        assert!(text.contains(from), "{from}");
        (text.replacen(from, to, 1), binary())
    };
    let patch = |at: usize, bytes: &[u8]| {
        let mut binary = binary();
        binary[at..at + bytes.len()].copy_from_slice(bytes);
        (text(), binary)
    };
    let cases: Vec<(&str, (String, Vec<u8>))> = vec![
        (
            "view past its buffer",
            swap("\"byteOffset\": 288, \"byteLength\": 12", "\"byteOffset\": 370, \"byteLength\": 12"),
        ),
        ("accessor past its view", swap("\"count\": 6, \"type\"", "\"count\": 7, \"type\"")),
        ("accessor as large as numbers go", swap("\"count\": 6, \"type\"", "\"count\": 9223372036854775807, \"type\"")),
        ("offset as large as numbers go", swap("\"byteOffset\": 48,", "\"byteOffset\": 18446744073709551000,")),
        ("short buffer", (text(), binary()[..290].to_vec())),
        ("no bytes", (text(), Vec::new())),
        ("index past the vertices", patch(288, &9u16.to_le_bytes())),
        ("float indices", swap("\"componentType\": 5123, \"count\": 6", "\"componentType\": 5126, \"count\": 3")),
        ("vertex that is NaN", patch(48, &f32::NAN.to_le_bytes())),
        ("vertex that is infinite", patch(48, &f32::INFINITY.to_le_bytes())),
        ("emission that overflows", swap("\"emissiveStrength\": 20.0", "\"emissiveStrength\": 1e39")),
        ("negative emission", swap("\"emissiveFactor\": [1.0, 0.1", "\"emissiveFactor\": [-1.0, 0.1")),
        ("negative intensity", swap("\"intensity\": 40.0", "\"intensity\": -40.0")),
        ("range of zero", swap("\"range\": 25.0", "\"range\": 0.0")),
        ("spot wider than its falloff", swap("\"outerConeAngle\": 0.6", "\"outerConeAngle\": 9.0")),
        ("transform that overflows", swap("[0.0, 1.5, -2.0]", "[0.0, 1e39, -2.0]")),
        ("far beyond the world", swap("[0.0, 1.5, -2.0]", "[0.0, 1e12, -2.0]")),
        ("rotation without length", swap("[0.0, 0.3826834, 0.0, 0.9238795]", "[0.0, 0.0, 0.0, 0.0]")),
        ("scale of zero", swap("[0.5, 0.5, 0.5] }", "[0.5, 0.0, 0.5] }")),
        (
            "own child",
            swap("\"name\": \"Ground\", \"mesh\": 0 }", "\"name\": \"Ground\", \"mesh\": 0, \"children\": [0] }"),
        ),
        (
            "two parents",
            swap("\"name\": \"Ground\", \"mesh\": 0 }", "\"name\": \"Ground\", \"mesh\": 0, \"children\": [1] }"),
        ),
    ];
    for (name, (text, bytes)) in cases {
        // What the crate itself refuses needs no check of ours.
        let Ok(file) = Gltf::from_slice(text.as_bytes()) else { continue };
        let mut world = LightWorld::new();
        let result = load_lights(&mut world, &file.document, &[bytes], &GltfOptions::default());
        let error = result.expect_err(name);
        assert!(!error.to_string().contains('\n'), "{name}: {error}");
        assert_eq!((world.tree_count(), world.instance_count(), world.light_count()), (0, 0, 0), "{name}: {error}");
    }
}

#[test]
fn errors_name_the_culprit() {
    let mut world = LightWorld::new();
    let text = text();
    let file = Gltf::from_slice(text.as_bytes()).unwrap();
    let none: [Vec<u8>; 0] = [];
    let missing = load_lights(&mut world, &file.document, &none, &GltfOptions::default());
    assert_eq!(missing, Err(GltfError::MissingBuffer { buffer: 0, given: 0 }));
    let short = load_into(&mut world, &text, binary()[..295].to_vec(), &GltfOptions::default());
    assert_eq!(short, Err(GltfError::OutOfBounds { accessor: 6, what: "buffer", end: 300, length: 295 }));
    let flat = text.replace("[0.5, 0.5, 0.5] }", "[0.5, 0.0, 0.5] }");
    let flat = load_into(&mut world, &flat, binary(), &GltfOptions::default());
    assert!(matches!(flat, Err(GltfError::LightWorld { node: 6, source: WorldError::Placement(_) })), "{flat:?}");
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
        // Both as cut, and with a header that agrees with the cut.
        let cut = bytes[..length].to_vec();
        let mut agreed = cut.clone();
        if length >= 12 {
            agreed[8..12].copy_from_slice(&(length as u32).to_le_bytes());
        }
        for file in [cut, agreed] {
            std::fs::write(&path, file).unwrap();
            let SceneError(message) = gltf_file::open(&path).expect_err("a truncated file");
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
    stage.world.take_delta();
    stage.animation.advance(1.0, &mut stage.scene, &mut stage.world).unwrap();
    let moved = stage.scene.objects[1].transform;
    assert!((moved.translation.y - 2.0).abs() < 1e-5 && !moved.abs_diff_eq(rest, 0.5));
    // One of the two signs turned; it took its lights along, the other stayed.
    assert_eq!(stage.world.update(FrameBudget::UNLIMITED).moved_instances, 1);
    let instances: Vec<_> = stage.world.instances().collect();
    let follows = |instance| {
        stage.world.placement(instance).unwrap().translation.as_vec3().abs_diff_eq(moved.translation.into(), 1e-5)
    };
    assert_eq!(instances.into_iter().filter(|&instance| follows(instance)).count(), 1);
    stage.animation.advance(4.0, &mut stage.scene, &mut stage.world).unwrap();
    assert!(stage.scene.objects[1].transform.abs_diff_eq(rest, 1e-5));
}

#[test]
fn a_given_camera_wins() {
    let camera = Camera { eye: Vec3::ONE, target: Vec3::ZERO, vertical_fov: 1.0 };
    assert_eq!(gltf_scene::stage(&sample("small.gltf"), Some(camera)).unwrap().scene.camera, camera);
}

#[test]
fn missing_files_are_named() {
    let SceneError(message) = gltf_scene::stage(Path::new("/nowhere/scene.glb"), None).err().unwrap();
    assert!(message.starts_with("/nowhere/scene.glb: "), "{message}");
}
