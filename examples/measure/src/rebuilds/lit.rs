//! The light that arrives at shading points in a frame. It is the same for all strategies, which
//! differ only in probabilities.

use super::lights::contributions;
use girandole::{LightId, LightWorld, ShadingPoint};
use rayon::prelude::*;

/// The dimmest lights of a shading point are left out as long as they bring less than this share of
/// its light together.
const DIM_SHARE: f64 = 1.0e-4;

/// The light at each shading point in one frame.
pub struct Lit(Vec<Illumination>);

/// The light at one shading point.
struct Illumination {
    /// The illuminance by all lights, in lux.
    total: f64,
    /// The index of each light in the order of [`girandole::LightSampler::all_lights`], and its
    /// lux; without the dimmest.
    lights: Vec<(u32, f32)>,
}

/// Noise and probabilities at one shading point.
pub struct PointNoise<'a> {
    /// The relative standard deviation of one sample; 0 where no light arrives.
    pub sigma: f64,
    /// The illuminance by all lights, in lux.
    pub total: f64,
    /// The index of each light, and its lux; without the dimmest.
    pub lights: &'a [(u32, f32)],
    /// The probabilities of all lights.
    pub pmfs: &'a [f32],
}

impl Lit {
    /// Sums up all lights: O(lights) per shading point, shading points in parallel.
    pub fn new(world: &LightWorld, shading_points: &[ShadingPoint]) -> Self {
        let sampler = world.sampler();
        let all: Vec<LightId> = sampler.all_lights().collect();
        let at = |shading_point: &ShadingPoint| {
            let lux = contributions(&sampler, &all, shading_point);
            let total: f64 = lux.iter().map(|lux| f64::from(*lux)).sum();
            let mut lights: Vec<(u32, f32)> = (0..).zip(lux).filter(|(_, lux)| *lux > 0.0).collect();
            lights.sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
            let mut left = total;
            let keep = lights.iter().take_while(|(_, lux)| {
                let is_kept = left > DIM_SHARE * total;
                left -= f64::from(*lux);
                is_kept
            });
            let kept = keep.count();
            lights.truncate(kept);
            lights.shrink_to_fit();
            lights.sort_unstable_by_key(|(light, _)| *light);
            Illumination { total, lights }
        };
        Self(shading_points.par_iter().map(at).collect())
    }

    /// Calls `read` with the index of each shading point and its noise in a world in the same
    /// frame.
    pub fn map<T: Send>(
        &self,
        world: &LightWorld,
        shading_points: &[ShadingPoint],
        read: impl Fn(usize, &PointNoise<'_>) -> T + Sync,
    ) -> Vec<T> {
        let sampler = world.sampler();
        let noise = |pmfs: &mut Vec<f32>, (index, (shading_point, light)): (usize, (&ShadingPoint, &Illumination))| {
            let Illumination { total, lights } = light;
            sampler.distribution(shading_point, pmfs);
            // The formula of `examples/testbed/src/measuring/sigma.rs`.
            let part = |(light, lux): &(u32, f32)| f64::from(*lux).powi(2) / f64::from(pmfs[*light as usize]);
            let second: f64 = lights.iter().map(part).sum();
            let sigma = if *total > 0.0 { (second / (total * total) - 1.0).max(0.0).sqrt() } else { 0.0 };
            read(index, &PointNoise { sigma, total: *total, lights, pmfs })
        };
        shading_points.par_iter().zip(&self.0).enumerate().map_init(Vec::new, noise).collect()
    }

    /// The mean over shading points of the relative standard deviation of one sample, in a world in
    /// the same frame.
    pub fn sigma(&self, world: &LightWorld, shading_points: &[ShadingPoint]) -> f64 {
        self.map(world, shading_points, |_, noise| noise.sigma).iter().sum::<f64>() / shading_points.len().max(1) as f64
    }
}
