//! Worlds of lights.

use girandole::glam::Vec3;
use girandole::{DirectionalLight, FrameBudget, InstanceKey, LightTree, LightWorld, Policy, Sky, TreeKey};
use wasm_bindgen::prelude::wasm_bindgen;

use crate::failure::Failure;
use crate::light_list::LightList;
use crate::vectors::{placement, vector, vectors};

/// Trees of lights, any number of instances of each tree, directional lights and a sky. Keys are never used
/// again: a call with the key of something that was removed is refused.
#[wasm_bindgen(js_name = LightWorld)]
pub struct World(LightWorld);

/// What an update did.
#[wasm_bindgen]
pub struct UpdateReport {
    /// Instances that were added, moved, shown, hidden or removed.
    #[wasm_bindgen(readonly, js_name = movedInstances)]
    pub moved_instances: u32,
    /// Trees that were refitted because their lights changed.
    #[wasm_bindgen(readonly, js_name = refitTrees)]
    pub refit_trees: u32,
    /// Trees that were rebuilt.
    #[wasm_bindgen(readonly, js_name = rebuiltTrees)]
    pub rebuilt_trees: u32,
    /// Trees whose rebuilds wait for later updates.
    #[wasm_bindgen(readonly, js_name = waitingTrees)]
    pub waiting_trees: u32,
}

impl World {
    pub fn lights(&self) -> &LightWorld {
        &self.0
    }
}

fn directional(direction: &[f32], lux: &[f32]) -> Result<DirectionalLight, Failure> {
    Ok(DirectionalLight { direction: vector("direction", direction)?, illuminance: vector("lux", lux)? })
}

#[wasm_bindgen(js_class = LightWorld)]
impl World {
    /// Creates an empty world.
    #[wasm_bindgen(constructor)]
    pub fn new() -> Self {
        Self(LightWorld::new())
    }

    /// Builds a tree and returns its key. A tree without instances does not shine.
    #[wasm_bindgen(js_name = addTree)]
    pub fn add_tree(&mut self, lights: LightList) -> Result<u64, Failure> {
        let tree = LightTree::new(lights.into_lights())?;
        Ok(self.0.add_tree(tree).into())
    }

    /// Changes the lights of a tree from the index `first` on, at the next update. The tree is refitted, and
    /// rebuilt within the budget of updates once it has become noisy.
    #[wasm_bindgen(js_name = setLights)]
    pub fn set_lights(&mut self, tree: u64, first: u32, lights: LightList) -> Result<(), Failure> {
        Ok(self.0.set_light_range(TreeKey::from(tree), first, &lights.into_lights())?)
    }

    /// Replaces all lights of a tree by any number of others, and builds it at once.
    #[wasm_bindgen(js_name = replaceLights)]
    pub fn replace_lights(&mut self, tree: u64, lights: LightList) -> Result<(), Failure> {
        Ok(self.0.replace_lights(TreeKey::from(tree), lights.into_lights())?)
    }

    /// Removes a tree that has no instances.
    #[wasm_bindgen(js_name = removeTree)]
    pub fn remove_tree(&mut self, tree: u64) -> Result<(), Failure> {
        Ok(self.0.remove_tree(TreeKey::from(tree))?)
    }

    /// Places a tree in the world and returns the key of the instance. The matrix has 16 numbers, column by
    /// column. A matrix without inverse hides the instance.
    #[wasm_bindgen(js_name = addInstance)]
    pub fn add_instance(
        &mut self,
        tree: u64,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] matrix: &[f64],
    ) -> Result<u64, Failure> {
        Ok(self.0.add_instance(TreeKey::from(tree), placement(matrix)?, Policy::Budgeted)?.into())
    }

    /// Moves an instance.
    #[wasm_bindgen(js_name = moveInstance)]
    pub fn move_instance(
        &mut self,
        instance: u64,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] matrix: &[f64],
    ) -> Result<(), Failure> {
        Ok(self.0.move_instance(InstanceKey::from(instance), placement(matrix)?)?)
    }

    /// Sets the colour by which the lights of an instance are multiplied: each channel from 0 to 10,000. It is
    /// 1 at first.
    #[wasm_bindgen(js_name = setFactor)]
    pub fn set_factor(
        &mut self,
        instance: u64,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] factor: &[f32],
    ) -> Result<(), Failure> {
        let factor = vector("factor", factor)?;
        Ok(self.0.set_appearance(InstanceKey::from(instance), |appearance| appearance.factor = factor)?)
    }

    /// Switches an instance on or off.
    #[wasm_bindgen(js_name = setEnabled)]
    pub fn set_enabled(&mut self, instance: u64, enabled: bool) -> Result<(), Failure> {
        Ok(self.0.set_appearance(InstanceKey::from(instance), |appearance| appearance.is_enabled = enabled)?)
    }

    /// Removes an instance, or the sky.
    #[wasm_bindgen(js_name = removeInstance)]
    pub fn remove_instance(&mut self, instance: u64) -> Result<(), Failure> {
        Ok(self.0.remove_instance(InstanceKey::from(instance))?)
    }

    /// The number of an instance in shaders; `undefined` if it was removed.
    pub fn slot(&self, instance: u64) -> Option<u32> {
        self.0.slot(InstanceKey::from(instance))
    }

    /// Adds a light at infinity, which travels along the unit vector `direction`, and returns its key. A
    /// surface that faces it receives `lux`.
    #[wasm_bindgen(js_name = addDirectional)]
    pub fn add_directional(
        &mut self,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] direction: &[f32],
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] lux: &[f32],
    ) -> Result<u64, Failure> {
        Ok(self.0.add_directional(directional(direction, lux)?)?.into())
    }

    /// Changes a directional light.
    #[wasm_bindgen(js_name = setDirectional)]
    pub fn set_directional(
        &mut self,
        light: u64,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] direction: &[f32],
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] lux: &[f32],
    ) -> Result<(), Failure> {
        Ok(self.0.set_directional(light.into(), directional(direction, lux)?)?)
    }

    /// Removes a directional light.
    #[wasm_bindgen(js_name = removeDirectional)]
    pub fn remove_directional(&mut self, light: u64) -> Result<(), Failure> {
        Ok(self.0.remove_directional(light.into())?)
    }

    /// Makes an environment map the sky, and returns the key of its instance, whose matrix turns it. The map
    /// is equirectangular: rows of `width` pixels from the zenith down, three numbers of nits each.
    #[wasm_bindgen(js_name = setSky)]
    pub fn set_sky(
        &mut self,
        width: u32,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] nits: &[f32],
    ) -> Result<u64, Failure> {
        let pixels: Vec<Vec3> = vectors("nits", nits)?;
        Ok(self.0.set_sky(Sky::equirectangular(width as usize, &pixels)?).into())
    }

    /// Sets whether shaders choose lights by what glossy surfaces reflect: see `light_glossy_point`.
    #[wasm_bindgen(js_name = setGlossySampling)]
    pub fn set_glossy_sampling(&mut self, on: bool) {
        self.0.set_glossy_sampling(on);
    }

    /// Sets whether points on large and near surfaces are chosen by solid angle.
    #[wasm_bindgen(js_name = setSolidAngleSampling)]
    pub fn set_solid_angle_sampling(&mut self, on: bool) {
        self.0.set_solid_angle_sampling(on);
    }

    /// Refits trees whose lights changed, and rebuilds noisy trees within a budget of milliseconds.
    pub fn update(&mut self, milliseconds: f64) -> Result<UpdateReport, Failure> {
        let report = self.0.update(FrameBudget::from_millis(milliseconds)?);
        Ok(UpdateReport {
            moved_instances: report.moved_instances as u32,
            refit_trees: report.refit_trees as u32,
            rebuilt_trees: report.rebuilt_trees as u32,
            waiting_trees: report.waiting_trees as u32,
        })
    }

    /// The number of instances, hidden ones and the sky included.
    #[wasm_bindgen(getter, js_name = instanceCount)]
    pub fn instance_count(&self) -> u32 {
        self.0.instances().len() as u32
    }

    /// The number of trees, that of the sky included.
    #[wasm_bindgen(getter, js_name = treeCount)]
    pub fn tree_count(&self) -> u32 {
        self.0.trees().len() as u32
    }
}
