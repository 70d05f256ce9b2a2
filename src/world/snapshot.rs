//! A world without trees, for those who keep the lights of one moment.

use super::LightWorld;
use super::scene::{Instance, Scene, TreeEntry};
use crate::tree::LightTree;

impl LightWorld {
    /// A world of the same lights, instances, sky and origin, from which no sample can be drawn.
    pub(crate) fn without_nodes(&self) -> Self {
        let Scene { trees, instances, directionals, sky, origin, .. } = &self.scene;
        let lights = |entry: &TreeEntry| {
            let tree = TreeEntry::new(LightTree::of_lights(entry.tree.lights()));
            TreeEntry { births: entry.births.clone(), ..tree }
        };
        let scene = Scene {
            trees: trees.map(lights),
            instances: instances.map(Instance::clone),
            directionals: directionals.clone(),
            sky: sky.clone(),
            origin: *origin,
            ..Scene::default()
        };
        Self { scene, effects: self.effects.clone(), ..Self::default() }
    }
}
