//! The observations for fits: trees of every kind and motion some frames after their last rebuild,
//! with their attributes then and now, and the noise of a choice inside the refitted and inside a
//! fresh tree.

use super::figures::{Kind, Troupe};
use super::motion::Motion;
use super::sigma::Noise;
use super::stage::direction;
use girandole::glam::Vec3;
use girandole::light::luminance;
use girandole::tree::{Attribute, Attributes};
use girandole::{Light, LightId, LightTree, LightWorld, Placement, Policy, ShadingPoint, WorldError};
use rayon::prelude::*;
use testbed::scene::rng::Rng;

/// Trees of each kind and motion.
const SEEDS: u64 = 16;
/// Observations of each tree.
const TIMES: usize = 24;
/// The most frames since the last rebuild.
const OLDEST: usize = 100;
/// The last rebuild is in one of the first frames, up to this one.
const FRAMES: usize = 140;
/// Shading points around a tree.
const SHADING_POINTS: usize = 32;
/// The least and the greatest distance of shading points from the tree's middle, as a share of its
/// box's diagonal.
const DISTANCES: [f32; 2] = [0.2, 2.0];
/// The least distance of shading points from any light, in metres: a light that nearly touches a
/// surface would outweigh all other shading points.
const CLEARANCE: f32 = 1.0;
/// Tries per shading point.
const TRIES: usize = 50;

/// The motions in which every tree moves.
const MOTIONS: [Motion; 4] = [Motion::Smooth, Motion::Bursty, Motion::Teleporting, Motion::Scattering];

/// The shape of a tree in numbers.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    pub attributes: Attributes,
    /// The squared diagonal of the box around all lights, over the variance of their positions.
    pub box_per_spread: f64,
    /// The length of the mean direction of emission: 0 for lights in all directions, 1 for one
    /// beam.
    pub axis: f64,
}

impl Shape {
    fn of(tree: &LightTree) -> Self {
        let cluster = tree.cluster();
        let box_per_spread = f64::from(cluster.aabb.extent().length_squared() / cluster.variance.max(1.0e-12));
        Self { attributes: tree.attributes(), box_per_spread, axis: f64::from(cluster.axis.length()) }
    }

    /// The four attributes: distance, overlap, variance, splitting cost.
    pub fn values(&self) -> [f64; 4] {
        [Attribute::Distance, Attribute::Overlap, Attribute::Variance, Attribute::SplittingCost]
            .map(|attribute| f64::from(self.attributes.get(attribute)))
    }
}

/// One tree at one time after a rebuild.
#[derive(Clone, Copy, Debug)]
pub struct Observation {
    pub kind: Kind,
    /// The index of the tree among all.
    pub tree: usize,
    pub lights: usize,
    /// Right after the last rebuild.
    pub rebuilt: Shape,
    pub now: Shape,
    /// The value of [`LightTree::cost_rise`].
    pub cost_rise: f64,
    /// The relative variance of a choice in the refitted tree for each number of splits, in the
    /// mean over shading points.
    pub refitted: [f64; SPLITS.len()],
    /// The same in a fresh tree of the same lights.
    pub fresh: [f64; SPLITS.len()],
    pub fresh_shape: Shape,
}

/// The least relative variance in ratios and logarithms; lower values count as this.
pub const MIN_NOISE: f64 = 1.0e-4;

/// The numbers of splits that noise is measured with: none, and the default.
pub const SPLITS: [usize; 2] = [0, 6];

/// All observations, the same in every run.
pub fn all() -> Result<Vec<Observation>, WorldError> {
    let mut trees = Vec::new();
    for kind in Kind::ALL {
        for motion in MOTIONS {
            (0..SEEDS).for_each(|seed| trees.push((kind, motion, seed)));
        }
    }
    let observed: Result<Vec<Vec<Observation>>, WorldError> =
        trees.par_iter().enumerate().map(|(tree, (kind, motion, seed))| observe(tree, *kind, *motion, *seed)).collect();
    Ok(observed?.into_iter().flatten().collect())
}

fn observe(tree: usize, kind: Kind, motion: Motion, seed: u64) -> Result<Vec<Observation>, WorldError> {
    // Seeds differ from those of the stages, whose trees are to be predicted.
    let mut troupe = Troupe::new(kind, motion, 7 << 32 | (tree as u64) << 8 | seed);
    let mut rng = Rng::new(7, 0x0b5e_0000 + tree as u64);
    let mut observations = Vec::with_capacity(TIMES);
    for _ in 0..TIMES {
        let start = rng.below(FRAMES) as u32;
        troupe.advance(start);
        let mut refitted = LightTree::new(troupe.lights().to_vec())?;
        let rebuilt = Shape::of(&refitted);
        troupe.advance(start + 1 + rng.below(OLDEST) as u32);
        let changes: Vec<(u32, Light)> = (0..).zip(troupe.lights().iter().copied()).collect();
        refitted.set_lights(&changes)?;
        refitted.refit();
        let fresh = LightTree::new(troupe.lights().to_vec())?;
        let [before, after] = noise([&refitted, &fresh], &mut rng)?;
        observations.push(Observation {
            kind,
            tree,
            lights: troupe.lights().len(),
            rebuilt,
            now: Shape::of(&refitted),
            cost_rise: f64::from(refitted.cost_rise()),
            refitted: before,
            fresh: after,
            fresh_shape: Shape::of(&fresh),
        });
    }
    Ok(observations)
}

/// The weighted mean of the relative variance over shading points, of two trees over the same
/// lights.
fn noise(trees: [&LightTree; 2], rng: &mut Rng) -> Result<[[f64; SPLITS.len()]; 2], WorldError> {
    let mut world = LightWorld::new();
    let key = world.add_tree(LightTree::new(trees[1].lights().to_vec())?);
    let instance = world.add_instance(key, Placement::IDENTITY, Policy::Static)?;
    let sampler = world.sampler();
    let mut sums = [[0.0; SPLITS.len()]; 2];
    let (mut weights, mut pmfs) = (0.0, Vec::new());
    for _ in 0..SHADING_POINTS {
        let at = shading_point(trees[1], rng);
        let lux = |light: u32| {
            let incident = sampler.sample_light(&at, LightId::Local { instance, light }, [0.5, 0.5])?;
            Some(luminance(incident.radiance) * incident.direction.dot(at.normal).max(0.0) / incident.pdf)
        };
        let contributions: Vec<f32> =
            (0..trees[1].lights().len() as u32).map(|light| lux(light).unwrap_or(0.0)).collect();
        let weight = weight(trees[1], &at, contributions.iter().sum());
        if weight <= 0.0 {
            continue;
        }
        weights += weight;
        for (tree, sums) in trees.into_iter().zip(&mut sums) {
            for (splits, sum) in SPLITS.into_iter().zip(sums) {
                tree.distribution(&at, splits, &mut pmfs);
                *sum += weight * Noise::of(&contributions, &pmfs).map_or(0.0, |noise| noise.sigma * noise.sigma);
            }
        }
    }
    Ok(sums.map(|sums| sums.map(|sum| if weights > 0.0 { sum / weights } else { 0.0 })))
}

/// The weight of a shading point: the square of its illuminance over the illuminance by the same
/// flux from one point in the middle, at most 1. The noise of a tree counts in the same way among
/// other lights: where its beams miss a shading point, it does not matter.
fn weight(tree: &LightTree, at: &ShadingPoint, lux: f32) -> f64 {
    let cluster = tree.cluster();
    let dist_sq = at.position.distance_squared(cluster.mean);
    let share = f64::from(lux * dist_sq) * 4.0 * std::f64::consts::PI / f64::from(cluster.flux);
    (share * share).min(1.0)
}

/// A random surface point around a tree that faces part of it.
fn shading_point(tree: &LightTree, rng: &mut Rng) -> ShadingPoint {
    let cluster = tree.cluster();
    let [least, most] = DISTANCES;
    let middle = (cluster.aabb.min + cluster.aabb.max) * 0.5;
    let mut position = middle;
    for _ in 0..TRIES {
        let distance = least * (most / least).powf(rng.unit()) * cluster.aabb.extent().length();
        position = middle + direction(rng) * distance;
        let is_close = |light: &Light| light.cluster().mean.distance(position) < CLEARANCE;
        if !tree.lights().iter().any(is_close) {
            break;
        }
    }
    let toward = (cluster.mean - position).normalize_or(Vec3::Y);
    ShadingPoint::surface(position, (toward + 0.9 * direction(rng)).normalize_or(Vec3::Y))
}
