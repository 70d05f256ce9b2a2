//! What one light sends to a surface, without and with shadows.

use crate::measuring::lights::contribution;
use crate::render::geometry::Geometry;
use crate::scene::Scene;
use girandole::{Incident, LightId, LightSampler, ShadingPoint};

/// Shadow rays towards area lights end just before the surface of the light, which would shadow
/// itself.
const STOP_BEFORE_LIGHT: f32 = 1.0 - 1.0e-3;

/// What casts shadows.
#[derive(Clone, Copy)]
pub struct Shadows<'a> {
    geometry: &'a Geometry,
    lamp_clearance: f32,
}

impl<'a> Shadows<'a> {
    /// The shadows of a scene, whose hierarchies are in `geometry`.
    pub fn new(scene: &Scene, geometry: &'a Geometry) -> Self {
        Self { geometry, lamp_clearance: scene.lamp_clearance }
    }

    /// Whether something opaque lies between a shading point and a point on a light.
    pub fn is_shadowed(&self, shading_point: &ShadingPoint, incident: &Incident) -> bool {
        let limit = match incident.is_delta {
            true => incident.dist - self.lamp_clearance,
            false => incident.dist * STOP_BEFORE_LIGHT,
        };
        let (origin, direction) = (shading_point.position, incident.direction);
        self.geometry.occluders.may_block(origin, direction, limit) && self.geometry.occluded(origin, direction, limit)
    }

    /// The illuminance by one light in lux, without and with shadows.
    ///
    /// Lights with a surface are reduced to the point of [`contribution`]: one shadow ray towards
    /// it decides whether the whole light is visible.
    pub fn illuminance(&self, lights: &LightSampler<'_>, shading_point: &ShadingPoint, light: LightId) -> (f32, f32) {
        let Some((incident, lux)) = contribution(lights, light, shading_point) else { return (0.0, 0.0) };
        let is_visible = lux > 0.0 && !self.is_shadowed(shading_point, &incident);
        (lux, if is_visible { lux } else { 0.0 })
    }
}
