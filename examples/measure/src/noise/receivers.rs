//! Surfaces that cameras see, and the light that reaches them.

use super::places::Place;
use girandole::glam::{Vec3, vec3};
use girandole::{LightId, LightSampler, ShadingPoint};
use rayon::prelude::*;
use std::f32::consts::TAU;
use testbed::direct_light::shadows::Shadows;
use testbed::direct_light::view::first_surface;
use testbed::scene::SceneError;
use testbed::scene::rng::Rng;

/// Seeds the directions of camera rays.
const SEED: u64 = 2_026;
/// The sine of the greatest elevation of camera rays, above and below the horizon: 30 degrees.
const MAX_SLOPE: f32 = 0.5;
/// Camera rays for each shading point that is wanted, after which the scene counts as dark.
const TRIES: usize = 20;

/// The illuminance by each light in lux, in the order of [`LightSampler::all_lights`].
#[derive(Clone, Debug, PartialEq)]
pub struct Illuminance {
    /// Without shadows.
    pub all: Vec<f32>,
    /// With shadows.
    pub visible: Vec<f32>,
}

/// A surface that some light reaches.
pub struct Receiver {
    /// The eye that sees it.
    pub eye: Vec3,
    pub shading_point: ShadingPoint,
    pub illuminance: Illuminance,
}

impl Illuminance {
    /// Traces a shadow ray to each light that contributes without shadows.
    pub fn new(
        shadows: &Shadows<'_>,
        lights: &LightSampler<'_>,
        ids: &[LightId],
        shading_point: &ShadingPoint,
    ) -> Self {
        let (all, visible) = ids.iter().map(|light| shadows.illuminance(lights, shading_point, *light)).unzip();
        Self { all, visible }
    }
}

/// Finds `count` surfaces that some light reaches. Each is what a camera ray from one of the eyes
/// meets first; the eyes take turns, and the rays are uniform over the directions within 30 degrees
/// of the horizon.
pub fn receivers(
    place: &Place,
    lights: &LightSampler<'_>,
    ids: &[LightId],
    count: usize,
) -> Result<Vec<Receiver>, SceneError> {
    let shadows = Shadows::new(&place.scene, &place.geometry);
    let at = |index: usize| {
        let mut rng = Rng::new(SEED, index as u64);
        let eye = place.eyes[index % place.eyes.len()];
        let slope = rng.range(-MAX_SLOPE, MAX_SLOPE);
        let (sin, cos) = (rng.unit() * TAU).sin_cos();
        let level = (1.0 - slope * slope).sqrt();
        let surface = first_surface(&place.geometry, eye, vec3(cos * level, slope, sin * level))?;
        let illuminance = Illuminance::new(&shadows, lights, ids, &surface.shading_point);
        let is_lit = illuminance.visible.iter().any(|lux| *lux > 0.0);
        is_lit.then_some(Receiver { eye, shading_point: surface.shading_point, illuminance })
    };
    let mut found: Vec<Receiver> = Vec::with_capacity(count);
    for round in 0..TRIES {
        let round: Vec<Receiver> = (round * count..(round + 1) * count).into_par_iter().filter_map(at).collect();
        found.extend(round);
        if found.len() >= count {
            found.truncate(count);
            return Ok(found);
        }
    }
    Err(SceneError(format!("{}: too few surfaces in sight are lit", place.name)))
}
