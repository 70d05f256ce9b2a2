//! The sky as samplers see it: at the same distance from every shading point, and turned by its instance.

use glam::Vec3;

use crate::instance::placement::Placed;
use crate::keys::LightId;
use crate::math::dice::clamp_unit;
use crate::sampling::emit::{Incident, MIN_INVERSE_PDF, MIN_PDF};
use crate::sampling::sample::{LightSample, LightSampler};
use crate::shading::shading_point::ShadingPoint;
use crate::sky::SkyPoint;

impl LightSampler<'_> {
    /// Chooses a point of a patch.
    pub(crate) fn sample_sky(
        &self,
        placed: &Placed,
        shading_point: &ShadingPoint,
        patch: u32,
        u: [f32; 2],
    ) -> Option<Incident> {
        let point = self.world.sky()?.1.sample(patch, u.map(clamp_unit))?;
        arriving(placed, shading_point, point)
    }

    /// The density of a direction, if that is of a patch.
    pub(crate) fn sky_pdf(&self, placed: &Placed, shading_point: &ShadingPoint, patch: u32, toward: Vec3) -> f32 {
        let found = self.sky_point(placed, shading_point, toward);
        found.filter(|(found, _)| *found == patch).map_or(0.0, |(_, incident)| incident.pdf)
    }

    /// What a ray meets that hits nothing.
    pub(crate) fn hit_sky(&self, shading_point: &ShadingPoint, direction: Vec3) -> Option<LightSample> {
        let (key, _) = self.world.sky()?;
        let instance = self.world.instance(key)?;
        let placed = instance.shown().filter(|_| instance.appearance.mask & shading_point.mask != 0)?;
        let (patch, incident) = self.sky_point(placed, shading_point, direction)?;
        let incident = Incident { radiance: instance.appearance.arriving(incident.radiance)?, ..incident };
        let light = LightId::Local { instance: key, light: patch };
        let user_data = instance.appearance.user_data;
        Some(LightSample { light, pmf: self.pmf(shading_point, light), incident, user_data })
    }

    /// The patch in a direction, and what arrives from there.
    fn sky_point(&self, placed: &Placed, shading_point: &ShadingPoint, toward: Vec3) -> Option<(u32, Incident)> {
        let (patch, point) = self.world.sky()?.1.point((placed.to_local * toward).normalize_or_zero())?;
        Some((patch, arriving(placed, shading_point, point)?))
    }
}

/// What arrives from a point of the sky; `None` if it is below the horizon or black.
fn arriving(placed: &Placed, shading_point: &ShadingPoint, point: SkyPoint) -> Option<Incident> {
    let along = placed.linear.linear * point.direction;
    let stretch = along.length();
    let direction = along / stretch;
    let is_above = shading_point.normal == Vec3::ZERO || shading_point.normal.dot(direction) > 0.0;
    (is_above && point.radiance != Vec3::ZERO).then_some(())?;
    // A solid angle of the map becomes one of the world.
    let pdf = point.pdf * (stretch * stretch * stretch) / placed.determinant.abs();
    let pdf = pdf.clamp(MIN_PDF, 1.0 / MIN_INVERSE_PDF);
    Some(Incident { direction, dist: f32::INFINITY, radiance: point.radiance, pdf, is_delta: false, along: 0.0 })
}

#[cfg(test)]
mod portal_tests;
#[cfg(test)]
mod tests;
