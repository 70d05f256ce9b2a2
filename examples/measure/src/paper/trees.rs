//! One tree over all lights of a scene, of either kind, behind one interface.

use super::strategies::TreeKind;
use girandole::{Attributes, Light, LightId, LightSampler, LightTree, ShadingPoint};
use testbed::direct_light::draw::{Draw, Drawn, Sample};
use testbed::direct_light::view::Surface;
use testbed::measuring::baselines::Pbrt;
use testbed::measuring::baselines::moving::MovingTree;
use testbed::measuring::samplers::wide;
use testbed::scene::{Material, SceneError};

/// A tree over all lights of a scene.
pub trait OneTree: Sync + Send {
    /// Replaces lights and updates the nodes and the attributes. The shape of the tree stays.
    fn refit(&mut self, changes: &[(u32, Light)]) -> Result<(), SceneError>;

    /// The attributes as of the last build or refit.
    fn attributes(&self) -> Attributes;

    /// Chooses a light, and returns its index and its probability. `u` in [0, 1)^2.
    fn pick(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<(u32, f32)>;
}

impl OneTree for LightTree {
    fn refit(&mut self, changes: &[(u32, Light)]) -> Result<(), SceneError> {
        self.set_lights(changes)?;
        Self::refit(self);
        Ok(())
    }

    fn attributes(&self) -> Attributes {
        Self::attributes(self)
    }

    fn pick(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<(u32, f32)> {
        Self::pick(self, shading_point, u, 6)
    }
}

impl OneTree for MovingTree<Pbrt> {
    fn refit(&mut self, changes: &[(u32, Light)]) -> Result<(), SceneError> {
        Self::refit(self, changes);
        Ok(())
    }

    fn attributes(&self) -> Attributes {
        Self::attributes(self)
    }

    fn pick(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<(u32, f32)> {
        Self::pick(self, shading_point, wide(u))
    }
}

/// Builds a tree over lights in world space. A world of two levels has no such tree, and its kind
/// gives a tree of the library.
pub fn build(kind: TreeKind, lights: Vec<Light>) -> Result<Box<dyn OneTree>, SceneError> {
    match kind {
        TreeKind::Binary => Ok(Box::new(MovingTree::new(Pbrt { is_opaque: true }, lights))),
        TreeKind::Library | TreeKind::TwoLevels => Ok(Box::new(LightTree::new(lights)?)),
    }
}

/// Draws a light from one tree, then a point on it.
pub struct FromTree<'a> {
    pub tree: &'a dyn OneTree,
    /// The names of the tree's lights.
    pub ids: &'a [LightId],
    /// Draws the points.
    pub lights: LightSampler<'a>,
}

impl Draw for FromTree<'_> {
    fn draw(&self, surface: &Surface, _: &Material, sample: &Sample) -> Option<Drawn> {
        let [a, b, x, y, _] = sample.u;
        let (light, pmf) = self.tree.pick(&surface.shading_point, [a, b])?;
        let light = self.ids[light as usize];
        let incident = self.lights.sample_light(&surface.shading_point, light, [x, y])?;
        Some(Drawn { incident, weight: 1.0 / (incident.pdf * pmf), light: 0, id: light, numbers: [x, y] })
    }
}
