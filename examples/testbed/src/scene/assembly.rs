//! Builds a scene and its light world together: one mesh and one light tree for each design, and
//! any number of placements.

use girandole::glam::{Affine3A, vec3};
use girandole::{DirectionalLight, InstanceKey, LightTree, LightWorld, Policy, TreeKey};

use super::part::Part;
use super::{Mesh, Object, Scene, SceneError, Sky};

/// Haze of the night, per metre: things of high contrast are visible up to 35 km.
const HAZE: f32 = 1.0 / 9_000.0;

/// A stage under construction.
pub struct Assembly {
    /// Geometry so far.
    pub scene: Scene,
    /// Lights so far.
    pub world: LightWorld,
}

/// A mesh and, if it emits, its light tree.
#[derive(Clone, Copy, Debug)]
pub struct Design {
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// `None` if it does not emit.
    pub tree: Option<TreeKey>,
}

/// A placement of a design.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// Index into [`Scene::objects`].
    pub object: usize,
    /// Its lights, if its design emits.
    pub instance: Option<InstanceKey>,
}

impl Assembly {
    /// An empty scene and an empty light world.
    pub fn new() -> Self {
        Self::with_world(LightWorld::new())
    }

    /// An empty scene and the given light world, which may have a clock of its own.
    pub fn with_world(world: LightWorld) -> Self {
        Self { scene: Scene::default(), world }
    }

    /// Adds a deep blue sky with a city's glow at the horizon, haze that hides the end of the land, and
    /// a dim moon.
    pub fn add_night(&mut self) -> Result<(), SceneError> {
        self.scene.sky = Sky {
            zenith: vec3(0.02, 0.042, 0.14),
            horizon: vec3(0.2, 0.14, 0.17),
            ambient: vec3(0.03, 0.035, 0.05),
            haze: HAZE,
            ..Sky::default()
        };
        let direction = vec3(0.42, -0.8, -0.43).normalize();
        self.world.add_directional(DirectionalLight { direction, illuminance: vec3(0.16, 0.21, 0.32) })?;
        Ok(())
    }

    /// Adds a mesh and returns its index.
    pub fn mesh(&mut self, mesh: Mesh) -> u32 {
        self.scene.meshes.push(mesh);
        (self.scene.meshes.len() - 1) as u32
    }

    /// Places a mesh and returns the index of the object.
    pub fn object(&mut self, mesh: u32, transform: Affine3A) -> usize {
        self.scene.objects.push(Object { mesh, transform, emission_scale: 1.0, visible: true });
        self.scene.objects.len() - 1
    }

    /// Adds a part: its mesh, and a light tree if it has lights.
    pub fn design(&mut self, part: Part) -> Result<Design, SceneError> {
        let tree = if part.lights.is_empty() { None } else { Some(self.world.add_tree(LightTree::new(part.lights)?)) };
        Ok(Design { mesh: self.mesh(part.mesh), tree })
    }

    /// Places a design.
    pub fn place(&mut self, design: Design, transform: Affine3A, policy: Policy) -> Result<Placed, SceneError> {
        let object = self.object(design.mesh, transform);
        let instance = match design.tree {
            Some(tree) => Some(self.world.add_instance(tree, transform, policy)?),
            None => None,
        };
        Ok(Placed { object, instance })
    }
}
