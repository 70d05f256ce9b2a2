//! Reservoirs: lights that are kept from point to point and from frame to frame, and their merges.
//!
//! Twin of `shaders/resample.wgsl`. Sources: Bitterli et al., Spatiotemporal Reservoir Resampling (2020); Lin et al.,
//! Generalized Resampled Importance Sampling (2022), whose MIS weights by targets `merge` has. Differs: a reservoir
//! keeps the numbers that choose the point on its light, so that a light that moves takes its point along, and no
//! Jacobian is needed.

use crate::keys::LightId;
use crate::math::dice::clamp_unit;
use crate::sampling::sample::{LightPick, LightSample, LightSampler};
use crate::shading::shading_point::ShadingPoint;

/// The largest target of a merge, and the largest part that a reservoir brings to the sum. Products of both and of
/// weights stay inside f32.
pub(crate) const MAX_TARGET: f32 = 1.0e30;

/// The largest weight of a reservoir: its inverse is no subnormal number.
pub(crate) const MAX_RESERVOIR_WEIGHT: f32 = 1.0e37;

/// A light that was kept of several, and a point on it: what a renderer stores from frame to frame.
///
/// [`LightSampler::resample`] makes one, [`LightSampler::reservoir_sample`] returns its light at any shading point,
/// and [`Reservoir::merge`] keeps one of two. In shaders it is `LightReservoir`, of 28 bytes. The default has no light
/// and stands for no draw.
///
/// ```
/// use girandole::glam::Vec3;
/// use girandole::light::luminance;
/// use girandole::{Light, LightSample, LightTree, LightWorld, Placement, Policy, Reservoir, ShadingPoint};
///
/// let mut world = LightWorld::new();
/// let lamps = (0..9).map(|i| Light::point(Vec3::new(i as f32, 3.0, 0.0), Vec3::splat(100.0)));
/// let tree = world.add_tree(LightTree::new(lamps.collect())?);
/// world.add_instance(tree, Placement::IDENTITY, Policy::Static)?;
/// let sampler = world.sampler();
///
/// let [here, beside] = [0.0, 0.5].map(|x| ShadingPoint::surface(Vec3::X * x, Vec3::Y));
/// let draw = |at, u| sampler.resample(at, u, 1);
/// let [mut own, mut other] = [draw(&here, [0.1, 0.2, 0.3, 0.4, 0.5]), draw(&beside, [0.6, 0.7, 0.8, 0.9, 0.5])];
///
/// // A renderer multiplies by its BRDF, and by the result of a shadow ray.
/// let lux = |at: &ShadingPoint, s: LightSample| s.incident.radiance * s.incident.direction.dot(at.normal);
/// let reflected = |at: &ShadingPoint, kept: &Reservoir| {
///     sampler.reservoir_sample(at, kept).map_or(0.0, |s| luminance(lux(at, s)) / s.incident.pdf)
/// };
/// own.reflected = reflected(&here, &own);
/// other.reflected = reflected(&beside, &other);
/// let merged = own.merge(reflected(&beside, &own), &other, reflected(&here, &other), 0.5);
///
/// let light = sampler.reservoir_sample(&here, &merged).expect("a lamp above the ground");
/// let estimate = lux(&here, light) / (light.pmf * light.incident.pdf);
/// assert!(estimate.x > 0.0 && merged.count == 2.0);
/// # Ok::<(), girandole::WorldError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reservoir {
    /// The light; `None` if nothing arrives.
    pub light: Option<LightId>,
    /// The light's [generation](crate::LightWorld::generation) when it was drawn. Of a light with another one,
    /// nothing arrives.
    pub generation: u32,
    /// The numbers in [0, 1) that choose the point on the light, in steps of 2⁻¹⁶.
    pub numbers: [f32; 2],
    /// Takes the place of 1 / `pmf`, without unit: the W of ReSTIR. 0 if nothing arrives.
    pub weight: f32,
    /// How many draws it stands for, which is its share in a merge: 1 for one of [`LightSampler::resample`]. Limit it
    /// before a merge: a small number forgets former frames sooner.
    pub count: f32,
    /// What the light reflects at the point of the reservoir, which the caller sets: the luminance of
    /// `brdf * cosine * radiance / pdf` of [`LightSampler::reservoir_sample`], times the result of a shadow ray where
    /// there is one. It is the target function of ReSTIR, in nits. 0 in one of [`LightSampler::resample`].
    pub reflected: f32,
}

impl Reservoir {
    /// Merges `other` into this one: keeps one of their lights, at the point of this one.
    ///
    /// `own_there` is what the light of this one reflects at the point of the other, and `other_here` what that of
    /// the other reflects at the point of this one, each as [`Reservoir::reflected`]. Of what a light reflects here,
    /// each reservoir gets a share, in proportion to what the light reflects at its point times its count.
    /// So the estimate by the result is unbiased if those by both are.
    ///
    /// `choice` in [0, 1) chooses. Negative numbers and NaN count as nothing reflected, and what is above 1e30 as 1e30.
    /// For two candidates at one point, pass `self.reflected` and `other.reflected`.
    #[must_use]
    pub fn merge(&self, own_there: f32, other: &Self, other_here: f32, choice: f32) -> Self {
        // As a GPU that flushes subnormal numbers; 0 for NaN.
        let limited = |target: f32| if target >= f32::MIN_POSITIVE { target.min(MAX_TARGET) } else { 0.0 };
        let [own_here, own_there] = [self.reflected, own_there].map(limited);
        let [other_here, other_there] = [other_here, other.reflected].map(limited);
        let part = |own: f32, others: f32, here: f32, weight: f32| {
            (own / (own + others).max(f32::MIN_POSITIVE) * here * weight).min(MAX_TARGET)
        };
        let own_part = part(self.count * own_here, other.count * own_there, own_here, self.weight);
        let other_part = part(other.count * other_there, self.count * other_here, other_here, other.weight);
        let total = own_part + other_part;
        let (kept, reflected) =
            if clamp_unit(choice) * total < other_part { (other, other_here) } else { (self, own_here) };
        let weight = if total > 0.0 { (total / reflected).min(MAX_RESERVOIR_WEIGHT) } else { 0.0 };
        Self { weight, count: self.count + other.count, reflected, ..*kept }
    }
}

impl LightSampler<'_> {
    /// Returns a reservoir with a given light. `u` chooses the point on it, as in [`LightSampler::sample_light`]. The
    /// weight is 1, and 0 for a light that does not exist.
    pub fn reservoir_of(&self, light: LightId, u: [f32; 2]) -> Reservoir {
        let drawn = LightPick { light, pmf: 1.0 };
        self.reservoir_of_pick(Some((drawn, u.map(stored))), 1.0)
    }

    /// The reservoir that keeps a pick, with the numbers of its point as they are [`stored`].
    pub(crate) fn reservoir_of_pick(&self, kept: Option<(LightPick, [f32; 2])>, weight: f32) -> Reservoir {
        let none = Reservoir { count: 1.0, ..Reservoir::default() };
        let Some((LightPick { light, .. }, numbers)) = kept else { return none };
        let Some(generation) = self.world.generation(light) else { return none };
        Reservoir { light: Some(light), generation, numbers, weight, count: 1.0, reflected: 0.0 }
    }

    /// Returns the light of a reservoir at any shading point, as it is in this sampler's world: `1 / weight` is its
    /// `pmf`, so that `brdf * cosine * radiance / (pmf * pdf)` estimates the light by all lights.
    ///
    /// `None` if nothing arrives, if the light is gone, or if another one has its name. The cost is that of
    /// [`LightSampler::sample_light`].
    pub fn reservoir_sample(&self, shading_point: &ShadingPoint, reservoir: &Reservoir) -> Option<LightSample> {
        let light = reservoir.light.filter(|_| reservoir.weight > 0.0)?;
        if self.world.generation(light) != Some(reservoir.generation) {
            return None;
        }
        self.sample_picked(shading_point, LightPick { light, pmf: 1.0 / reservoir.weight }, reservoir.numbers)
    }
}

/// The number that a reservoir stores for one in [0, 1).
pub(crate) fn stored(u: f32) -> f32 {
    ((clamp_unit(u) * 65_536.0).floor() + 0.5) / 65_536.0
}
