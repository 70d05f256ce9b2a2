//! Pictures by all lights, which no sampler is part of.

use super::draw::reflected;
use super::renderer::Renderer;
use super::view::{SUBPIXELS, Surface};
use crate::common::lattice::{Dimension, random};
use girandole::glam::Vec3;
use girandole::light::luminance;
use girandole::{LightId, LightSampler};
use rayon::prelude::*;

/// The shadow rays of a surface.
const SHADOW_RAYS: u32 = 256;

/// Renders a picture with one sample at each subpixel. `ids` are all lights.
///
/// A sample computes the light that every light reflects without shadows, from one point on each.
/// Shadow rays go to points that are chosen in proportion to this light, so their number is the
/// only source of noise for lights without extent. O(lights) per sample, about 70 ns each.
pub fn picture(renderer: &Renderer<'_>, lights: &LightSampler<'_>, ids: &[LightId], seed: u32) -> Vec<Vec3> {
    let pixel = |weights: &mut Vec<(u32, f64)>, index: usize| {
        let pixel = &renderer.view.pixels[index];
        let mut sum = Vec3::ZERO;
        for (subpixel, surface) in pixel.surfaces.iter().enumerate() {
            if let Some(surface) = surface {
                let u = random(index as u32, subpixel as u32, seed, Dimension::Light);
                sum += light(renderer, (lights, ids), surface, u, weights);
            }
        }
        pixel.background + sum / SUBPIXELS as f32
    };
    (0..renderer.view.pixels.len()).into_par_iter().map_init(Vec::new, pixel).collect()
}

/// The light that a surface reflects towards the camera. `weights` is memory.
fn light(
    renderer: &Renderer<'_>,
    (lights, ids): (&LightSampler<'_>, &[LightId]),
    surface: &Surface,
    [offset, _, x, y]: [f32; 4],
    weights: &mut Vec<(u32, f64)>,
) -> Vec3 {
    let material = renderer.material(surface);
    let point = |light: LightId| {
        let incident = lights.sample_light(&surface.shading_point, light, [x, y])?;
        Some((incident, reflected(surface, material, &incident) / incident.pdf))
    };
    let mut total = 0.0;
    weights.clear();
    for (index, light) in (0..).zip(ids) {
        let weight = point(*light).map_or(0.0, |(_, light)| f64::from(luminance(light)));
        if weight > 0.0 {
            total += weight;
            weights.push((index, total));
        }
    }
    // Equally spaced points of the running sums: systematic sampling.
    let step = total / f64::from(SHADOW_RAYS);
    let (mut sum, mut place) = (Vec3::ZERO, 0);
    for ray in 0..SHADOW_RAYS {
        let target = (f64::from(ray) + f64::from(offset)) * step;
        while place + 1 < weights.len() && weights[place].1 <= target {
            place += 1;
        }
        let Some((index, _)) = weights.get(place) else { break };
        let Some((incident, light)) = point(ids[*index as usize]) else { continue };
        if !renderer.is_shadowed(surface, &incident) {
            sum += light * (step / f64::from(luminance(light))) as f32;
        }
    }
    sum
}
