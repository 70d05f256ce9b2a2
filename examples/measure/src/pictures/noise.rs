//! The noise of one sample at surfaces of the view, without and with shadows, and the share of
//! draws that end without a light.
//!
//! It is computed from the probabilities of all lights, with area lights reduced to their middle.
//! For samplers that choose among candidates it is estimated from many draws.

use super::options::Plan;
use super::samplers::Samplers;
use super::scene_view::SceneView;
use super::settings::Sampler;
use girandole::glam::Vec3;
use girandole::light::luminance;
use rayon::prelude::*;
use testbed::direct_light::draw::{Draw, Sample};
use testbed::direct_light::frames::Frames;
use testbed::direct_light::numbers::numbers;
use testbed::direct_light::shadows::Shadows;
use testbed::direct_light::view::Surface;
use testbed::measuring::sigma::Noise;

/// The numbers of light contributions that a run keeps, at most: they bound the memory.
const MOST_CONTRIBUTIONS: usize = 40_000_000;
/// The fewest points.
const LEAST_POINTS: usize = 10;
/// The frames over which the draws of estimates are spread.
const FRAMES: u32 = 16;
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
    /// Its pixel, and what the first subpixel shows.
    pixel: u32,
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
        let shown =
            (0..).zip(&view.view.pixels).filter_map(|(index, pixel)| Some((index, pixel.surfaces[0].as_ref()?)));
        let all: Vec<(u32, &Surface)> = shown.collect();
        let spread = all.len().div_ceil(count).max(1);
        let at = |(pixel, surface): (u32, &Surface)| {
            let (lux, visible): (Vec<f32>, Vec<f32>) =
                ids.iter().map(|light| shadows.illuminance(&lights, &surface.shading_point, *light)).unzip();
            let is_lit = lux.iter().any(|lux| *lux > 0.0);
            is_lit.then_some(Point { pixel, surface: *surface, lux, visible })
        };
        Self(all.into_par_iter().step_by(spread).filter_map(at).collect())
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
        let mut draw = samplers.draw(sampler)?;
        let at = |point: &Point| Some(exact(point, &samplers.pmfs(sampler, &point.surface.shading_point)?));
        let exact: Option<Vec<PointNoise>> = self.0.par_iter().map(at).collect();
        let noises = exact.unwrap_or_else(|| self.estimated(view, draw.as_mut(), draws));
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

    /// The noise of so many draws at each point, in several frames that are prepared one by one.
    fn estimated(&self, view: &SceneView, draw: &mut dyn Draw, draws: u32) -> Vec<PointNoise> {
        let (renderer, learns) = (view.renderer(), draw.warm_up() > 0);
        let mut frames = Frames::new(&renderer, draw, SEED);
        let mut pictures = vec![Vec3::ZERO; view.view.pixels.len()];
        let mut sums = vec![Sums::default(); self.0.len()];
        for round in 0..FRAMES {
            frames.prepare();
            let (draw, frame) = frames.prepared();
            sums.par_iter_mut().zip(&self.0).enumerate().for_each(|(index, (sums, point))| {
                let Point { pixel, surface, .. } = point;
                let material = renderer.material(surface);
                for i in round * draws / FRAMES..(round + 1) * draws / FRAMES {
                    let sample = Sample { pixel: *pixel, frame, u: numbers(index as u32, i, SEED) };
                    let drawn = draw.draw(surface, material, &sample);
                    sums.add(drawn.map(|drawn| {
                        let cosine = surface.shading_point.normal.dot(drawn.incident.direction).max(0.0);
                        let lux = luminance(drawn.incident.radiance) * cosine * drawn.weight;
                        (f64::from(lux), !renderer.is_shadowed(surface, &drawn.incident))
                    }));
                }
            });
            frames.draw(&mut pictures, |_| learns);
        }
        sums.iter().zip(&self.0).map(|(sums, point)| sums.noise(point)).collect()
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

/// Sums over the draws at a point.
#[derive(Clone, Copy, Default)]
struct Sums {
    count: f64,
    dead: f64,
    squares: f64,
    visible_squares: f64,
}

impl Sums {
    /// Adds a draw: an illuminance without shadows, and whether it arrives with them.
    fn add(&mut self, draw: Option<(f64, bool)>) {
        self.count += 1.0;
        match draw {
            Some((lux, is_visible)) => {
                self.squares += lux * lux;
                self.visible_squares += if is_visible { lux * lux } else { 0.0 };
            }
            None => self.dead += 1.0,
        }
    }

    fn noise(&self, point: &Point) -> PointNoise {
        let sigma = |lux: &[f32], squares: f64| {
            let mean: f64 = lux.iter().map(|lux| f64::from(*lux)).sum();
            (mean > 0.0).then(|| (squares / self.count / (mean * mean) - 1.0).max(0.0).sqrt())
        };
        PointNoise {
            sigma: sigma(&point.lux, self.squares).unwrap_or(0.0),
            sigma_visible: sigma(&point.visible, self.visible_squares),
            dead: self.dead / self.count.max(1.0),
        }
    }
}
