//! The noise of one sample at surfaces of the view, without and with shadows, and the share of
//! draws that end without a light.
//!
//! It is computed from the probabilities of all lights, with area lights reduced to their middle.
//! For samplers that choose among candidates it is estimated from many draws.

use super::options::Plan;
use super::samplers::Samplers;
use super::scene_view::SceneView;
use super::settings::Sampler;
use girandole::light::luminance;
use rayon::prelude::*;
use testbed::direct_light::numbers::numbers;
use testbed::direct_light::shadows::Shadows;
use testbed::direct_light::view::Surface;
use testbed::measuring::sigma::Noise;

/// The numbers of light contributions that a run keeps, at most: they bound the memory.
const MOST_CONTRIBUTIONS: usize = 40_000_000;
/// The fewest points.
const LEAST_POINTS: usize = 10;
/// Seeds the draws of estimates.
const SEED: u32 = 77;

/// The noise of a sampler, as means over points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplerNoise {
    /// The relative standard deviation of the illuminance that one sample estimates, without
    /// shadows.
    pub sigma: f64,
    /// The same for the illuminance with shadows, at the points that some light reaches.
    pub sigma_visible: f64,
    /// The share of draws that end without a light.
    pub dead: f64,
}

/// A surface and the illuminance by each light, in lux.
struct Point {
    surface: Surface,
    lux: Vec<f32>,
    /// With shadows, by one shadow ray to each light.
    visible: Vec<f32>,
}

/// Surfaces of the view that lights reach.
pub struct Points(Vec<Point>);

impl Points {
    /// Sums up all lights at surfaces that are spread evenly over the view.
    pub fn new(view: &SceneView, samplers: &Samplers<'_>, plan: &Plan) -> Self {
        let (lights, ids) = (samplers.lights(), samplers.ids());
        let shadows = Shadows::new(&view.scene, &view.geometry);
        let count = (MOST_CONTRIBUTIONS / ids.len().max(1)).clamp(LEAST_POINTS, plan.noise_points);
        let all: Vec<&Surface> = view.view.pixels.iter().filter_map(|pixel| pixel.surfaces[0].as_ref()).collect();
        let spread = all.len().div_ceil(count).max(1);
        let at = |surface: &&Surface| {
            let (lux, visible): (Vec<f32>, Vec<f32>) =
                ids.iter().map(|light| shadows.illuminance(&lights, &surface.shading_point, *light)).unzip();
            let is_lit = lux.iter().any(|lux| *lux > 0.0);
            is_lit.then_some(Point { surface: **surface, lux, visible })
        };
        Self(all.into_par_iter().step_by(spread).filter_map(|surface| at(&surface)).collect())
    }

    /// The number of points.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The noise of a sampler; `None` where no light reaches any point, and for the sum over all
    /// lights.
    pub fn noise(
        &self,
        view: &SceneView,
        samplers: &Samplers<'_>,
        sampler: Sampler,
        draws: u32,
    ) -> Option<SamplerNoise> {
        let draw = samplers.draw(sampler)?;
        let at = |(index, point): (usize, &Point)| match samplers.pmfs(sampler, &point.surface.shading_point) {
            Some(pmfs) => exact(point, &pmfs),
            None => {
                let renderer = view.renderer();
                let material = &view.scene.materials[point.surface.material as usize];
                let values = (0..draws).map(|i| {
                    let drawn = draw.draw(&point.surface, material, numbers(index as u32, i, SEED))?;
                    let cosine = point.surface.shading_point.normal.dot(drawn.incident.direction).max(0.0);
                    let lux = luminance(drawn.incident.radiance) * cosine * drawn.weight;
                    Some([f64::from(lux), f64::from(u8::from(!renderer.is_shadowed(&point.surface, &drawn.incident)))])
                });
                estimated(point, values)
            }
        };
        let noises: Vec<PointNoise> = self.0.par_iter().enumerate().map(at).collect();
        let mean = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
            (count > 0).then(|| sum / f64::from(count))
        };
        Some(SamplerNoise {
            sigma: mean(&mut noises.iter().map(|noise| noise.sigma))?,
            sigma_visible: mean(&mut noises.iter().filter_map(|noise| noise.sigma_visible))?,
            dead: mean(&mut noises.iter().map(|noise| noise.dead))?,
        })
    }
}

/// The noise at one point.
struct PointNoise {
    sigma: f64,
    /// `None` in full shadow.
    sigma_visible: Option<f64>,
    dead: f64,
}

fn exact(point: &Point, pmfs: &[f32]) -> PointNoise {
    let sum: f64 = pmfs.iter().map(|pmf| f64::from(*pmf)).sum();
    let sigma = |lux: &[f32]| Noise::of(lux, pmfs).map(|noise| noise.sigma);
    PointNoise {
        sigma: sigma(&point.lux).unwrap_or(0.0),
        sigma_visible: sigma(&point.visible),
        dead: (1.0 - sum).max(0.0),
    }
}

/// The noise of draws, which are `None` or an illuminance without shadows and its visibility.
fn estimated(point: &Point, draws: impl Iterator<Item = Option<[f64; 2]>>) -> PointNoise {
    let (mut count, mut dead, mut squares, mut visible_squares) = (0.0_f64, 0.0, 0.0, 0.0);
    for draw in draws {
        count += 1.0;
        match draw {
            Some([lux, visibility]) => {
                squares += lux * lux;
                visible_squares += lux * lux * visibility;
            }
            None => dead += 1.0,
        }
    }
    let sigma = |lux: &[f32], squares: f64| {
        let mean: f64 = lux.iter().map(|lux| f64::from(*lux)).sum();
        (mean > 0.0).then(|| (squares / count / (mean * mean) - 1.0).max(0.0).sqrt())
    };
    PointNoise {
        sigma: sigma(&point.lux, squares).unwrap_or(0.0),
        sigma_visible: sigma(&point.visible, visible_squares),
        dead: dead / count.max(1.0),
    }
}
