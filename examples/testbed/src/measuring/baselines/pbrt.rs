//! The importance of pbrt-v4's light BVH.
//!
//! Source: Pharr, Jakob and Humphreys, Physically Based Rendering (4th edition), 12.6.3, with the
//! light bounds of 12.2 to 12.4. As published, the squared distance is at least half of the box's
//! diagonal, although one is a square and the other a length, and the cosine at the shading point
//! has no sign, because surfaces may transmit light.
//!
//! Differs: bounds are not quantised; the power of a spot is its flux, not 4 pi times its peak
//! intensity (mean sigma on city S 4.4 instead of 11.2).

use super::bounds::LightBounds;
use super::tree::Formula;
use crate::measuring::emitter::{Emitter, Form, RealAabb, Receiver};
use crate::measuring::real::{Real, Vector};

/// The formula of pbrt-v4.
#[derive(Clone, Copy, Debug)]
pub struct Pbrt {
    /// An option that pbrt-v4 does not have: the cosine keeps its sign, so that no sample goes to
    /// lights behind an opaque surface.
    pub is_opaque: bool,
}

/// The bounds of a node.
#[derive(Clone, Copy)]
pub struct PbrtBounds<R: Real> {
    aabb: RealAabb<R>,
    axis: R::Vec3,
    power: R,
    cos_o: R,
    cos_e: R,
    is_two_sided: bool,
}

impl<R: Real> Formula<R> for Pbrt {
    type Bounds = PbrtBounds<R>;

    fn bounds(light: &Emitter<R>) -> LightBounds<R> {
        match light.form {
            Form::Point { .. } | Form::Profile { .. } | Form::Sphere { .. } => {
                LightBounds::all_round(light, light.flux())
            }
            Form::Spot { direction, inner_angle, outer_angle, .. } => {
                LightBounds::spot(light, direction, [inner_angle, outer_angle], light.flux())
            }
            Form::Rectangle { two_sided, .. } | Form::Triangle { two_sided, .. } => {
                LightBounds { is_two_sided: two_sided, ..LightBounds::flat(light, light.flux()) }
            }
        }
    }

    fn pack(bounds: &LightBounds<R>) -> PbrtBounds<R> {
        let LightBounds { aabb, axis, power, is_two_sided, .. } = *bounds;
        PbrtBounds { aabb, axis, power, cos_o: bounds.theta_o.cos(), cos_e: bounds.theta_e.cos(), is_two_sided }
    }

    fn first_probability(&self, children: [(&PbrtBounds<R>, Option<&Emitter<R>>); 2], at: &Receiver<R>) -> Option<R> {
        let [a, b] = children.map(|(bounds, _)| self.importance(bounds, at));
        (a + b > R::zero()).then(|| a / (a + b))
    }
}

impl Pbrt {
    fn importance<R: Real>(&self, bounds: &PbrtBounds<R>, at: &Receiver<R>) -> R {
        let from_center = at.position - bounds.aabb.center();
        let diagonal = bounds.aabb.extent().length();
        let dist_sq = from_center.length_squared().max(R::of(0.5) * diagonal).max(R::min_positive_value());
        let direction = from_center.normalize_or_zero();

        let mut cos_w = bounds.axis.dot(direction).clamp(-R::one(), R::one());
        if bounds.is_two_sided {
            cos_w = cos_w.abs();
        }
        let to_normals = Angle::from_cos(cos_w).minus(Angle::from_cos(bounds.cos_o));
        let box_angle = Angle::from_cos(cos_subtended(&bounds.aabb, from_center));
        let cos_emission = to_normals.minus(box_angle).cos;
        if cos_emission <= bounds.cos_e {
            return R::zero();
        }

        let mut cosine = R::one();
        if at.normal != R::Vec3::ZERO {
            let cos = -at.normal.dot(direction).clamp(-R::one(), R::one());
            let cos = if self.is_opaque { cos } else { cos.abs() };
            cosine = Angle::from_cos(cos).minus(box_angle).cos;
        }
        (bounds.power * cos_emission * cosine / dist_sq).max(R::zero())
    }
}

/// The cosine of the half-angle that the bounding sphere of a box covers; -1 from inside.
fn cos_subtended<R: Real>(aabb: &RealAabb<R>, from_center: R::Vec3) -> R {
    let radius_sq = R::of(0.25) * aabb.extent().length_squared();
    let dist_sq = from_center.length_squared();
    if dist_sq <= radius_sq { -R::one() } else { (R::one() - radius_sq / dist_sq).max(R::zero()).sqrt() }
}

/// An angle in [0, pi].
#[derive(Clone, Copy)]
struct Angle<R> {
    sin: R,
    cos: R,
}

impl<R: Real> Angle<R> {
    fn from_cos(cos: R) -> Self {
        Self { sin: sine(cos), cos }
    }

    /// The difference; 0 if `other` is larger.
    fn minus(self, other: Self) -> Self {
        if self.cos > other.cos {
            return Self { sin: R::zero(), cos: R::one() };
        }
        Self { sin: self.sin * other.cos - self.cos * other.sin, cos: self.cos * other.cos + self.sin * other.sin }
    }
}

/// The sine of an angle in [0, pi].
fn sine<R: Real>(cos: R) -> R {
    (R::one() - cos * cos).max(R::zero()).sqrt()
}
