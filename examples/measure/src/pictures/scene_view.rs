//! The last frame of a played scene: what the camera sees.

use testbed::direct_light::numbers::numbers;
use testbed::direct_light::renderer::Renderer;
use testbed::direct_light::view::{Pixel, View};
use testbed::render::geometry::Geometry;
use testbed::scene::{Material, Scene, SceneError};

/// A scene and its surfaces in view.
pub struct SceneView {
    pub scene: Scene,
    pub geometry: Geometry,
    pub view: View,
}

impl SceneView {
    /// Traces the camera rays. All materials become diffuse if `is_matte` is set.
    pub fn new(scene: &Scene, is_matte: bool, size: (u32, u32)) -> Result<Self, SceneError> {
        let scene = if is_matte { matte(scene.clone()) } else { scene.clone() };
        let geometry = Geometry::new(&scene)?;
        let view = View::new(&scene, &geometry, size);
        let is_seen = view.pixels.iter().any(|pixel| pixel.surfaces.iter().any(Option::is_some));
        if !is_seen {
            return Err(SceneError("the camera sees no surface".into()));
        }
        Ok(Self { scene, geometry, view })
    }

    /// A renderer of this view.
    pub fn renderer(&self) -> Renderer<'_> {
        Renderer { scene: &self.scene, geometry: &self.geometry, view: &self.view, numbers }
    }

    /// A geometry that casts no shadows.
    pub fn without_shadows(&self) -> Result<Geometry, SceneError> {
        let mut scene = self.scene.clone();
        scene.materials.iter_mut().for_each(|material| material.see_through = true);
        Geometry::new(&scene)
    }

    /// The mean number of pixels that a sample per pixel shades: those that show no sky.
    pub fn shaded_pixels(&self) -> f64 {
        let shown = |pixel: &Pixel| {
            let count = pixel.surfaces.iter().filter(|surface| surface.is_some()).count();
            count as f64 / pixel.surfaces.len() as f64
        };
        self.view.pixels.iter().map(shown).sum()
    }
}

/// A scene with materials that reflect diffusely only.
pub fn matte(mut scene: Scene) -> Scene {
    for material in &mut scene.materials {
        *material = Material { roughness: 1.0, metallic: 0.0, ..*material };
    }
    scene
}
