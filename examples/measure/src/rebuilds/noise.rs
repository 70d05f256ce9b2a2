//! The measure of this tool: the exact relative standard deviation of one light sample at each
//! shading point.

use super::sigma::Noise;
use girandole::light::luminance;
use girandole::{LightId, LightSampler, LightWorld, ShadingPoint};
use rayon::prelude::*;

/// Sigma of one sample at each shading point, with the default number of splits; 0 where no light
/// arrives.
///
/// Only lights whose probability is above 0 are evaluated: the library's tests prove that all
/// contributing lights have one. The cost is O(lights) per shading point, shading points in
/// parallel.
pub fn sigmas(world: &LightWorld, shading_points: &[ShadingPoint]) -> Vec<f64> {
    let sampler = world.sampler();
    let lights: Vec<LightId> = sampler.all_lights().collect();
    let buffers = || (Vec::new(), Vec::new());
    let sigma = |(pmfs, contributions): &mut (Vec<f32>, Vec<f32>), at: &ShadingPoint| {
        sampler.distribution(at, pmfs);
        contributions.clear();
        contributions.extend(
            lights
                .iter()
                .zip(&*pmfs)
                .map(|(light, pmf)| if *pmf > 0.0 { contribution(&sampler, at, *light) } else { 0.0 }),
        );
        Noise::of(contributions, pmfs).map_or(0.0, |noise| noise.sigma)
    };
    shading_points.par_iter().map_init(buffers, sigma).collect()
}

/// One value of `contributions` of the variance tool.
fn contribution(sampler: &LightSampler<'_>, at: &ShadingPoint, light: LightId) -> f32 {
    let incident = sampler.sample_light(at, light, [0.5, 0.5]);
    incident.map_or(0.0, |incident| {
        luminance(incident.radiance) * incident.direction.dot(at.normal).max(0.0) / incident.pdf
    })
}
