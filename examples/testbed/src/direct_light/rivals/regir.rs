//! A grid in the world whose cells hold points on lights, each resampled from several for the cell. A
//! sample resamples points of the cell that it is in.
//!
//! Source: Boksansky, Jukarainen and Wyman, Rendering Many Lights with Grid-Based Reservoirs, Ray Tracing
//! Gems II (2021): 512 points in each cell, renewed in every frame, the target of a cell is the light at
//! its middle, the position is shifted by up to half a cell before its cell is looked up, and each sample
//! resamples by its BRDF. Only cells that a surface in view can look up are filled. Differs: a cell
//! rejects lights that certainly do not reach it; lights are drawn by flux. Reuse of the reservoirs of
//! the last frame is left out, as for all samplers here.

use super::candidates::{Candidate, FULL_HD, LightList, Random, Reservoir};
use crate::direct_light::draw::{Draw, Drawn, Frame, Sample};
use crate::direct_light::view::{Surface, View};
use crate::scene::Material;
use girandole::Light;
use girandole::glam::{IVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// Points of a cell.
const SLOTS: usize = 512;
/// Candidates for each of them.
const FILL_CANDIDATES: u32 = 16;
/// Points that a sample resamples.
const CANDIDATES: u32 = 16;
/// Cells that are filled, at most: half of those of the grid of 16 x 16 x 16 of the source, most of which
/// no surface in view looks up, and one for so many pixels.
const MOST_CELLS: usize = 2_048;
const PIXELS_PER_CELL: usize = 4;
/// The edge of the finest cells that are tried, in metres, and the factor between edges.
const FINEST: (f32, f32) = (0.5, std::f32::consts::SQRT_2);

/// Draws from the cells of a grid.
pub struct ReGir<'a> {
    lights: LightList<'a>,
    summaries: Vec<Summary>,
    /// The edge of a cell in metres.
    edge: f32,
    /// The share of the grid's cells that this view looks up.
    share: f64,
    /// The place of each cell that is filled.
    cells: HashMap<IVec3, u32>,
    /// The coordinates of the cells, by place.
    places: Vec<IVec3>,
    slots: Vec<Option<Candidate>>,
}

/// What a cell needs to know of a light.
struct Summary {
    center: Vec3,
    radius: f32,
    /// The axis and the sine and cosine of the half-angle of the directions of emission.
    axis: Vec3,
    half_angle: [f32; 2],
    range: f32,
    flux: f32,
}

impl<'a> ReGir<'a> {
    /// A grid as fine as the limit on cells allows for the picture `whole`, of which `view` is a part.
    pub fn new(lights: LightList<'a>, view: &View, whole: &View) -> Self {
        let most = MOST_CELLS.min(whole.pixels.len() / PIXELS_PER_CELL).max(8);
        let mut edge = FINEST.0;
        let all = loop {
            let all = places(whole, edge).len();
            if all <= most {
                break all;
            }
            edge *= FINEST.1;
        };
        let places = places(view, edge);
        let share = (places.len() as f64 / all.max(1) as f64).min(1.0);
        let cells = places.iter().copied().zip(0..).collect();
        let summaries = lights.lights.iter().map(Summary::new).collect();
        Self { lights, summaries, edge, share, cells, places, slots: Vec::new() }
    }
}

/// The cells that the surfaces of a view can look up.
fn places(view: &View, edge: f32) -> Vec<IVec3> {
    let corners = |surface: &Surface| {
        let base = surface.shading_point.position / edge;
        (0..8).map(move |i| {
            cell(base + Vec3::new((i & 1) as f32 - 0.5, (i >> 1 & 1) as f32 - 0.5, (i >> 2) as f32 - 0.5))
        })
    };
    let surfaces = view.pixels.iter().flat_map(|pixel| pixel.surfaces.iter().flatten());
    let mut places: Vec<IVec3> = surfaces.flat_map(corners).collect();
    places.sort_unstable_by_key(|place| place.to_array());
    places.dedup();
    places
}

/// The cell of a position, whose unit is the edge of a cell.
fn cell(position: Vec3) -> IVec3 {
    position.floor().as_ivec3()
}

impl Summary {
    fn new(light: &Light) -> Self {
        let (aabb, cone) = (light.aabb(), light.emission_cone());
        let half_angle = cone.half_angle.min(std::f32::consts::PI);
        Self {
            center: (aabb.min + aabb.max) * 0.5,
            radius: (aabb.max - aabb.min).length() * 0.5,
            axis: cone.axis,
            half_angle: [half_angle.sin(), half_angle.cos()],
            range: light.range,
            flux: light.flux(),
        }
    }

    /// The target of a cell with this middle, for positions up to `radius` away from it. Zero only
    /// where none of these receives light.
    fn target(&self, middle: Vec3, radius: f32, edge: f32) -> f32 {
        let toward = middle - self.center;
        let dist_sq = toward.length_squared();
        let dist = dist_sq.sqrt();
        let reach = radius + self.radius;
        if dist - reach >= self.range {
            return 0.0;
        }
        if dist > reach {
            let sin = reach / dist;
            let cos = (1.0 - sin * sin).sqrt();
            let [sin_half, cos_half] = self.half_angle;
            // Beyond a half turn together, nothing is outside.
            let can_miss = cos_half > -cos;
            if can_miss && self.axis.dot(toward) < dist * (cos_half * cos - sin_half * sin) - 1.0e-4 * dist {
                return 0.0;
            }
        }
        self.flux / dist_sq.max(edge * edge)
    }
}

impl Draw for ReGir<'_> {
    fn prepare(&mut self, frame: &Frame<'_>) {
        let Self { lights, summaries, edge, places, slots, .. } = self;
        // Shifted positions look up a cell from half an edge outside of it.
        let radius = *edge * 3.0_f32.sqrt();
        let slot = |index: usize| {
            let middle = (places[index / SLOTS].as_vec3() + 0.5) * *edge;
            let mut random = Random::new(&[frame.seed, frame.number, index as u32]);
            let mut reservoir = Reservoir::new();
            for _ in 0..FILL_CANDIDATES {
                let light = lights.by_flux.draw(random.pair());
                let weight = 1.0 / (lights.by_flux.probability(light) * FILL_CANDIDATES as f32);
                reservoir.offer(light, summaries[light].target(middle, radius, *edge), weight, random.pair()[0]);
            }
            let (light, weight) = reservoir.kept()?;
            Some(lights.candidate(light, random.pair(), weight))
        };
        (0..places.len() * SLOTS).into_par_iter().map(slot).collect_into_vec(slots);
    }

    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn> {
        let mut random = Random::of_sample(sample);
        let ([x, y], [z, _]) = (random.pair(), random.pair());
        let shifted = surface.shading_point.position / self.edge + Vec3::new(x, y, z) - 0.5;
        let slots = *self.cells.get(&cell(shifted))? as usize * SLOTS;
        let mut reservoir = Reservoir::new();
        for _ in 0..CANDIDATES {
            let Some(point) = &self.slots[slots + random.below(SLOTS)] else { continue };
            reservoir.offer(point, point.target(surface, material), point.weight, random.pair()[0]);
        }
        let (kept, weight) = reservoir.kept()?;
        self.lights.drawn(surface, kept, weight / CANDIDATES as f32)
    }

    /// The cells in view hardly grow with the picture.
    fn samples_per_preparation(&self, pixels: f64) -> f64 {
        pixels.max(FULL_HD) * self.share
    }

    fn prepared_bytes(&self) -> usize {
        self.places.len() * SLOTS * size_of::<Option<Candidate>>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::split_mix::Rng;
    use crate::measuring::irradiance::irradiance;
    use girandole::ShadingPoint;

    #[test]
    fn a_cell_rejects_no_light_that_reaches_it_and_many_that_do_not() {
        let mut rng = Rng(31);
        let (mut lit, mut rejected) = (0, 0);
        for _ in 0..2_000 {
            let (light, middle) = (rng.light(20.0), rng.position(20.0));
            let edge = rng.between(0.5, 3.0);
            let radius = edge * 3.0_f32.sqrt();
            let target = Summary::new(&light).target(middle, radius, edge);
            rejected += usize::from(target == 0.0);
            for _ in 0..10 {
                let position = middle + rng.direction() * (radius * rng.unit());
                let lux = irradiance(&light, &ShadingPoint::surface(position, rng.direction()));
                lit += usize::from(lux > 0.0);
                assert!(lux <= 0.0 || target > 0.0, "{light:?} sends {lux} lx to {position}");
            }
        }
        assert!(lit > 3_000 && rejected > 300, "{lit}, {rejected}");
    }

    #[test]
    fn the_target_of_a_cell_falls_with_the_square_of_the_distance() {
        let summary = Summary::new(&Light::point(Vec3::ZERO, Vec3::ONE));
        let flux = 4.0 * std::f32::consts::PI;
        for (distance, expected) in [(0.1, flux), (1.0, flux), (2.0, flux / 4.0), (10.0, flux / 100.0)] {
            let target = summary.target(Vec3::X * distance, 3.0_f32.sqrt(), 1.0);
            assert!((target / expected - 1.0).abs() < 1.0e-5, "{distance} m: {target}, not {expected}");
        }
    }
}
