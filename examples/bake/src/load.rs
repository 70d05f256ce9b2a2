//! Loads a folder of baked trees into a new world, as a game would.
//!
//! A worker thread reads the files and makes trees of them. The thread of the world takes each tree
//! as it is and adds its instances.

use super::manifest::{FILE, Manifest};
use super::write::refusal;
use girandole::{LightTree, LightWorld, Policy};
use std::fs;
use std::path::Path;
use std::sync::mpsc;
use std::time::{Duration, Instant};
use testbed::scene::SceneError;

/// A loaded world, and what it took.
pub struct Loaded {
    pub world: LightWorld,
    /// Copying the bytes of all files once, for comparison.
    pub copying: Duration,
    /// Making trees of the bytes on the worker thread.
    pub loading: Duration,
    /// What the thread of the world did: taking the trees and adding the instances.
    pub inserting: Duration,
}

/// A tree, the time of its load, and the time of a copy of its bytes.
type Loading = Result<(LightTree, Duration, Duration), SceneError>;

pub fn load(folder: &Path) -> Result<Loaded, SceneError> {
    let path = folder.join(FILE);
    let text = fs::read_to_string(&path).map_err(|error| refusal(&path, &error))?;
    let Manifest { trees, instances, directionals } =
        Manifest::from_text(&text).map_err(|error| refusal(&path, &error))?;
    let (sender, loaded) = mpsc::channel();
    let mut world = LightWorld::new();
    let [mut copying, mut loading, mut inserting] = [Duration::ZERO; 3];
    let mut keys = Vec::with_capacity(trees.len());
    std::thread::scope(|scope| {
        scope.spawn(move || {
            // It ends early if nobody takes the trees any more.
            trees.iter().all(|name| sender.send(load_tree(&folder.join(name))).is_ok())
        });
        for tree in loaded {
            let (tree, took, copy) = tree?;
            (loading, copying) = (loading + took, copying + copy);
            let start = Instant::now();
            keys.push(world.add_tree(tree));
            inserting += start.elapsed();
        }
        Ok::<(), SceneError>(())
    })?;
    let start = Instant::now();
    for (tree, placement) in instances {
        let refused = |error| refusal(&path, &error);
        world.add_instance(keys[tree], placement, Policy::default()).map_err(refused)?;
    }
    for light in directionals {
        world.add_directional(light).map_err(|error| refusal(&path, &error))?;
    }
    inserting += start.elapsed();
    Ok(Loaded { world, copying, loading, inserting })
}

fn load_tree(path: &Path) -> Loading {
    let bytes = fs::read(path).map_err(|error| refusal(path, &error))?;
    let start = Instant::now();
    let copy = std::hint::black_box(bytes.clone());
    let copying = start.elapsed();
    drop(copy);
    let start = Instant::now();
    let tree = LightTree::from_baked(&bytes).map_err(|error| refusal(path, &error))?;
    Ok((tree, start.elapsed(), copying))
}
