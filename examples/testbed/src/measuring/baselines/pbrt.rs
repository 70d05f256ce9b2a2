//! The importance of pbrt-v4's light BVH.
//!
//! Source: Pharr, Jakob and Humphreys, Physically Based Rendering (4th edition), 12.6.3, with the
//! light bounds of 12.2 to 12.4. As published, the squared distance is at least half of the box's
//! diagonal, although one is a square and the other a length, and the cosine at the shading point
//! has no sign, because surfaces may transmit light.
//!
//! Differs: bounds are not quantised; the power of a spot is its flux, not 4 pi times its peak
//! intensity (mean sigma on city S 4.4 instead of 11.2).

use super::tree::{Formula, LightBounds};
use girandole::cluster::Aabb;
use girandole::glam::Vec3;
use girandole::{Light, ShadingPoint, Shape};

/// The formula of pbrt-v4.
#[derive(Clone, Copy, Debug)]
pub struct Pbrt {
    /// An option that pbrt-v4 does not have: the cosine keeps its sign, so that no sample goes to
    /// lights behind an opaque surface.
    pub is_opaque: bool,
}

/// The bounds of a node.
#[derive(Clone, Copy)]
pub struct PbrtBounds {
    aabb: Aabb,
    axis: Vec3,
    power: f32,
    cos_o: f32,
    cos_e: f32,
    is_two_sided: bool,
}

impl Formula for Pbrt {
    type Bounds = PbrtBounds;

    fn bounds(light: &Light) -> LightBounds {
        match light.shape {
            Shape::Spot { direction, inner_angle, outer_angle, .. } => {
                LightBounds::spot(light, direction, [inner_angle, outer_angle], light.flux())
            }
            Shape::Rectangle { two_sided, .. } | Shape::Triangle { two_sided, .. } => {
                LightBounds { is_two_sided: two_sided, ..LightBounds::flat(light, light.flux()) }
            }
            _ => LightBounds::all_round(light, light.flux()),
        }
    }

    fn pack(bounds: &LightBounds) -> PbrtBounds {
        let LightBounds { aabb, axis, power, is_two_sided, .. } = *bounds;
        PbrtBounds { aabb, axis, power, cos_o: bounds.theta_o.cos(), cos_e: bounds.theta_e.cos(), is_two_sided }
    }

    fn first_probability(&self, children: [(&PbrtBounds, Option<&Light>); 2], at: &ShadingPoint) -> Option<f32> {
        let [a, b] = children.map(|(bounds, _)| self.importance(bounds, at));
        (a + b > 0.0).then(|| a / (a + b))
    }
}

impl Pbrt {
    fn importance(&self, bounds: &PbrtBounds, at: &ShadingPoint) -> f32 {
        let from_center = at.position - bounds.aabb.center();
        let diagonal = bounds.aabb.extent().length();
        let dist_sq = from_center.length_squared().max(0.5 * diagonal).max(f32::MIN_POSITIVE);
        let direction = from_center.normalize_or_zero();

        let mut cos_w = bounds.axis.dot(direction).clamp(-1.0, 1.0);
        if bounds.is_two_sided {
            cos_w = cos_w.abs();
        }
        let to_normals = Angle::from_cos(cos_w).minus(Angle::from_cos(bounds.cos_o));
        let box_angle = Angle::from_cos(cos_subtended(&bounds.aabb, from_center));
        let cos_emission = to_normals.minus(box_angle).cos;
        if cos_emission <= bounds.cos_e {
            return 0.0;
        }

        let mut cosine = 1.0;
        if at.normal != Vec3::ZERO {
            let cos = -at.normal.dot(direction).clamp(-1.0, 1.0);
            let cos = if self.is_opaque { cos } else { cos.abs() };
            cosine = Angle::from_cos(cos).minus(box_angle).cos;
        }
        (bounds.power * cos_emission * cosine / dist_sq).max(0.0)
    }
}

/// The cosine of the half-angle that the bounding sphere of a box covers; -1 from inside.
fn cos_subtended(aabb: &Aabb, from_center: Vec3) -> f32 {
    let radius_sq = 0.25 * aabb.extent().length_squared();
    let dist_sq = from_center.length_squared();
    if dist_sq <= radius_sq { -1.0 } else { (1.0 - radius_sq / dist_sq).max(0.0).sqrt() }
}

/// An angle in [0, pi].
#[derive(Clone, Copy)]
struct Angle {
    sin: f32,
    cos: f32,
}

impl Angle {
    fn from_cos(cos: f32) -> Self {
        Self { sin: (1.0 - cos * cos).max(0.0).sqrt(), cos }
    }

    /// The difference; 0 if `other` is larger.
    fn minus(self, other: Self) -> Self {
        if self.cos > other.cos {
            return Self { sin: 0.0, cos: 1.0 };
        }
        Self { sin: self.sin * other.cos - self.cos * other.sin, cos: self.cos * other.cos + self.sin * other.sin }
    }
}
