//! Points on lights as presampled lists store them: what an estimate of their light needs.

use girandole::glam::{Quat, Vec3};
use girandole::light::luminance;
use girandole::{Light, Profile, ShadingPoint, Shape};
use std::f32::consts::PI;

/// The least width of a spot's falloff, see [`Shape::Spot`].
const MIN_SPOT_FALLOFF: f32 = 1.0e-3;

/// A point on a light.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    position: Vec3,
    /// The normal of a flat light times its area, the unit axis of a spot, or zero.
    axis: Vec3,
    /// The luminance of the emission, in candela or nits.
    emission: f32,
    range: f32,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Point,
    Spot { scale: f32, offset: f32 },
    Profile { rotation: Quat, profile: Profile },
    Flat { two_sided: bool },
    Sphere { radius: f32 },
}

impl LightPoint {
    /// The point of a light that [`girandole::LightSampler::sample_light`] maps `u` to. A sphere, of which
    /// each receiver samples the side that it sees, is represented by its centre.
    pub fn new(light: &Light, u: [f32; 2]) -> Self {
        let (position, axis, kind) = match light.shape {
            Shape::Point { position } => (position, Vec3::ZERO, Kind::Point),
            Shape::Spot { position, direction, inner_angle, outer_angle } => {
                let scale = 1.0 / (inner_angle.cos() - outer_angle.cos()).max(MIN_SPOT_FALLOFF);
                let kind = Kind::Spot { scale, offset: -outer_angle.cos() * scale };
                (position, direction.normalize_or_zero(), kind)
            }
            Shape::Profile { position, rotation, profile } => {
                (position, Vec3::ZERO, Kind::Profile { rotation: Quat::from_array(rotation), profile })
            }
            Shape::Rectangle { center, half_u, half_v, two_sided } => {
                let position = center + half_u * (2.0 * u[0] - 1.0) + half_v * (2.0 * u[1] - 1.0);
                (position, half_u.cross(half_v) * 4.0, Kind::Flat { two_sided })
            }
            Shape::Triangle { vertices: [a, b, c], two_sided } => {
                let root = u[0].sqrt();
                let position = a + (b - a) * (root * (1.0 - u[1])) + (c - a) * (root * u[1]);
                (position, (b - a).cross(c - a) * 0.5, Kind::Flat { two_sided })
            }
            Shape::Sphere { center, radius } => (center, Vec3::ZERO, Kind::Sphere { radius }),
            _ => unreachable!("this version has no others"),
        };
        Self { position, axis, emission: luminance(light.emission), range: light.range, kind }
    }

    /// The direction of the point as seen from a shading point with a normal, and the illuminance from
    /// there in lux, divided by the density of the point on its light. That of a sphere is an estimate,
    /// which is positive wherever light arrives. `None` where nothing arrives.
    pub fn illuminance(&self, at: &ShadingPoint) -> Option<(Vec3, f32)> {
        let toward = self.position - at.position;
        let dist_sq = toward.length_squared();
        let direction = toward / dist_sq.sqrt();
        let cosine = at.normal.dot(direction);
        let (cosine, size) = match self.kind {
            Kind::Point => (cosine, 1.0 / dist_sq),
            Kind::Spot { scale, offset } => {
                let falloff = (-self.axis.dot(direction) * scale + offset).clamp(0.0, 1.0);
                (cosine, falloff * falloff / dist_sq)
            }
            Kind::Profile { rotation, profile } => (cosine, profile.candela(rotation.inverse() * -direction) / dist_sq),
            Kind::Flat { two_sided } => {
                let facing = -self.axis.dot(direction);
                (cosine, if two_sided { facing.abs() } else { facing } / dist_sq)
            }
            Kind::Sphere { radius } => {
                let sin_sq = radius * radius / dist_sq;
                let one_minus_cos = sin_sq / (1.0 + (1.0 - sin_sq).max(0.0).sqrt());
                // A sphere is visible until all of it is below the horizon.
                (cosine.max(0.5 * (cosine + sin_sq.sqrt())), 2.0 * PI * one_minus_cos)
            }
        };
        let lux = self.emission * self.window(dist_sq) * size * cosine;
        (cosine > 0.0 && size > 0.0 && lux > 0.0 && lux < f32::INFINITY).then_some((direction, lux))
    }

    /// The range window of KHR_lights_punctual. A sphere ends where its near side does.
    fn window(&self, dist_sq: f32) -> f32 {
        if self.range == f32::INFINITY {
            return 1.0;
        }
        let range = if let Kind::Sphere { radius } = self.kind { self.range + radius } else { self.range };
        let ratio_sq = dist_sq / (range * range);
        (1.0 - ratio_sq * ratio_sq).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::split_mix::Rng;
    use girandole::{LightTree, LightWorld, Placement, Policy};

    #[test]
    fn the_illuminance_is_that_of_the_librarys_sample_of_the_same_point() {
        let mut rng = Rng(8);
        let mut lit = 0;
        for _ in 0..400 {
            let light = rng.light(10.0);
            let mut world = LightWorld::new();
            let tree = world.add_tree(LightTree::new(vec![light]).expect("a valid light"));
            world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("a valid placement");
            let sampler = world.sampler();
            let id = sampler.all_lights().next().expect("one light");
            for _ in 0..20 {
                let at = ShadingPoint::surface(rng.position(20.0), rng.direction());
                let u = [rng.unit(), rng.unit()];
                let exact = sampler.sample_light(&at, id, u);
                let exact = exact.map(|i| luminance(i.radiance) * i.direction.dot(at.normal) / i.pdf);
                let own = LightPoint::new(&light, u).illuminance(&at).map(|(_, lux)| lux);
                if let Some(lux) = exact {
                    lit += 1;
                    let own = own.expect("a light that contributes has an estimate");
                    let is_sphere = matches!(light.shape, Shape::Sphere { .. });
                    assert!(is_sphere || (own / lux - 1.0).abs() < 1.0e-3, "{light:?} at {at:?}: {own}, not {lux}");
                }
            }
        }
        assert!(lit > 500, "{lit}");
    }
}
