//! Loads a glTF scene and bakes its trees.

use super::manifest::{FILE, Manifest};
use girandole::{LightWorld, TreeKey};
use girandole_assets::gltf::{GltfOptions, load_lights};
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};
use testbed::scene::SceneError;
use testbed::scene::gltf_scene::open;

/// The lights of a scene, and what it took to make and bake them.
pub struct Baked {
    pub world: LightWorld,
    /// Reading the lights and building all trees, without reading the file.
    pub building: Duration,
    /// Making the bytes of all trees, without writing them.
    pub baking: Duration,
    pub bytes: usize,
}

/// Bakes the trees of a scene into a folder, which is created.
pub fn write(scene: &Path, out: &Path) -> Result<Baked, SceneError> {
    let file = open(scene)?;
    let mut world = LightWorld::new();
    let start = Instant::now();
    let lights = load_lights(&mut world, &file, &[], &GltfOptions::default())
        .map_err(|error| SceneError(format!("{}: {error}", scene.display())))?;
    let building = start.elapsed();

    fs::create_dir_all(out).map_err(|error| refusal(out, &error))?;
    let mut manifest = Manifest::default();
    let (mut baking, mut bytes) = (Duration::ZERO, 0);
    let trees: Vec<TreeKey> = world.trees().collect();
    for (number, key) in trees.iter().enumerate() {
        let Some(tree) = world.tree(*key) else { continue };
        let start = Instant::now();
        let baked = tree.bake();
        baking += start.elapsed();
        bytes += baked.len();
        let name = format!("{number:04}.tree");
        let path = out.join(&name);
        fs::write(&path, baked).map_err(|error| refusal(&path, &error))?;
        manifest.trees.push(name);
    }
    for node in &lights.nodes {
        let tree = trees.iter().position(|key| *key == node.tree);
        manifest.instances.extend(tree.zip(world.instance(node.instance).map(|i| i.placement)));
    }
    manifest.directionals.extend(world.directionals().filter_map(|key| world.directional(key)));
    let path = out.join(FILE);
    fs::write(&path, manifest.to_text()).map_err(|error| refusal(&path, &error))?;
    Ok(Baked { world, building, baking, bytes })
}

/// An error of the file system in one line.
pub fn refusal(path: &Path, error: &dyn std::fmt::Display) -> SceneError {
    SceneError(format!("{}: {error}", path.display()))
}
