//! The measure of the benchmark: the exact relative standard deviation of one light sample, at each shading point.

use super::sigma::Noise;
use girandole::light::luminance;
use girandole::{LightId, LightSampler, LightWorld, ShadingPoint};
use rayon::prelude::*;

/// Sigma of one sample at each shading point, with as many splits as usual; 0 where nothing shines.
///
/// Only lights with a chance are looked at: all that contribute have one, which the library's tests prove.
/// O(lights) a shading point, shading points in parallel.
pub fn sigmas(world: &LightWorld, shading_points: &[ShadingPoint]) -> Vec<f64> {
    let sampler = world.sampler();
    let lights: Vec<LightId> = sampler.all_lights().collect();
    let buffers = || (Vec::new(), Vec::new());
    let of_shading_point = |(chances, contributions): &mut (Vec<f32>, Vec<f32>), at: &ShadingPoint| {
        sampler.distribution(at, chances);
        contributions.clear();
        contributions.extend(
            lights.iter().zip(&*chances).map(
                |(light, chance)| {
                    if *chance > 0.0 { contribution(&sampler, at, *light) } else { 0.0 }
                },
            ),
        );
        Noise::of(contributions, chances).map_or(0.0, |noise| noise.sigma)
    };
    shading_points.par_iter().map_init(buffers, of_shading_point).collect()
}

/// As `contributions` of the variance example.
fn contribution(sampler: &LightSampler<'_>, at: &ShadingPoint, light: LightId) -> f32 {
    let incident = sampler.sample_light(at, light, [0.5, 0.5]);
    incident.map_or(0.0, |incident| {
        luminance(incident.radiance) * incident.direction.dot(at.normal).max(0.0) / incident.pdf
    })
}
