//! The exact noise of the choice within one tree, as it is and as it would be after a rebuild.

use super::super::lights::contributions;
use super::super::sigma::Noise;
use girandole::glam::vec3;
use girandole::{LightId, LightTree, LightWorld, Placement, Policy, ShadingPoint, TreeKey};
use rayon::prelude::*;
use testbed::scene::SceneError;

/// The number of shading points around a tree.
const POINTS: usize = 16;
/// The golden angle, in radians: it spreads directions evenly.
const ANGLE_STEP: f32 = 2.399_963;
/// Distances of the points from the middle of the box, as shares of its diagonal. They take turns.
const DISTANCES: [f32; 2] = [0.5, 1.0];

/// Fixed points around a tree, which face its middle.
fn points_around(tree: &LightTree) -> Vec<ShadingPoint> {
    let bounds = tree.cluster().aabb;
    let (middle, diagonal) = (0.5 * (bounds.min + bounds.max), bounds.extent().length());
    let point = |index: usize| {
        let height = 1.0 - (2 * index + 1) as f32 / POINTS as f32;
        let (ring, turn) = ((1.0 - height * height).sqrt(), ANGLE_STEP * index as f32);
        let outward = vec3(ring * turn.cos(), height, ring * turn.sin());
        ShadingPoint::surface(middle + DISTANCES[index % 2] * diagonal * outward, -outward)
    };
    (0..POINTS).map(point).collect()
}

/// The mean of sigma over the shading points around one tree. Points without light are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TreeNoise {
    /// Of the tree as it is.
    pub now: f64,
    /// Of a new tree over the same lights.
    pub new: f64,
    /// Of a tree over the same lights that was only refitted.
    pub refitted: f64,
}

/// Smaller sigmas of new trees count as this much in ratios: they do not matter.
const MIN_SIGMA: f64 = 0.01;

impl TreeNoise {
    /// Sigma of the tree relative to that of a new tree.
    pub fn ratio(&self) -> f64 {
        self.now / self.new.max(MIN_SIGMA)
    }

    /// Sigma of the tree that was only refitted relative to that of a new tree.
    pub fn refitted_ratio(&self) -> f64 {
        self.refitted / self.new.max(MIN_SIGMA)
    }
}

/// Measures the noise of trees. `refitted` is a world with the same trees and keys, none of which
/// was ever rebuilt; without it they count as having no noise.
pub fn measure_trees(
    world: &LightWorld,
    refitted: Option<&LightWorld>,
    trees: &[TreeKey],
) -> Result<Vec<TreeNoise>, SceneError> {
    let of_tree = |key: &TreeKey| {
        let Some(now) = world.tree(*key) else { return Ok(TreeNoise::default()) };
        measure_tree(now, refitted.and_then(|world| world.tree(*key)))
    };
    trees.par_iter().map(of_tree).collect()
}

fn measure_tree(now: &LightTree, refitted: Option<&LightTree>) -> Result<TreeNoise, SceneError> {
    let new = LightTree::new(now.lights().to_vec())?;
    // A light of a tree emits the same in any world.
    let mut world = LightWorld::new();
    let key = world.add_tree(LightTree::new(now.lights().to_vec())?);
    let instance = world.add_instance(key, Placement::default(), Policy::Static)?;
    let lights: Vec<LightId> = (0..now.lights().len() as u32).map(|light| LightId::Local { instance, light }).collect();
    let sampler = world.sampler();
    let (mut sum, mut lit, mut pmfs) = (TreeNoise::default(), 0, Vec::new());
    for at in points_around(now) {
        let lux = contributions(&sampler, &lights, &at);
        if lux.iter().all(|lux| *lux <= 0.0) {
            continue;
        }
        let mut sigma = |tree: &LightTree| {
            tree.distribution(&at, 6, &mut pmfs);
            Noise::of(&lux, &pmfs).map_or(0.0, |noise| noise.sigma)
        };
        lit += 1;
        sum.now += sigma(now);
        sum.new += sigma(&new);
        sum.refitted += refitted.map_or(0.0, sigma);
    }
    let count = f64::from(lit.max(1));
    Ok(TreeNoise { now: sum.now / count, new: sum.new / count, refitted: sum.refitted / count })
}
