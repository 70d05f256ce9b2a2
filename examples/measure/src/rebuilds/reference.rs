//! What is the same for all strategies: the trees that change in each frame, the light, and fresh
//! builds of the trees.

use super::lit::Lit;
use super::oracle::Gains;
use super::stage::{Stage, StageOptions};
use super::strategies::{ATTRIBUTES, Deviations};
use girandole::scheduler::VirtualClock;
use girandole::{FrameBudget, InstanceKey, Light, LightTree, LightWorld, Policy};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Duration;
use testbed::scene::SceneError;

/// The number of frames at which the deviations for [SS] are taken.
const POINTS: u32 = 8;

/// One scene in one motion, played once without rebuilds.
pub struct Reference {
    /// For each frame from the first on, whether each tree changed.
    pub changed: Vec<Vec<bool>>,
    /// The light in each frame in which noise is measured.
    pub lit: Vec<Lit>,
    /// The deviations of each tree.
    pub deviations: Vec<Deviations>,
    /// The number of lights of each tree.
    pub sizes: Vec<usize>,
    /// For the oracle.
    pub gains: Option<Gains>,
}

impl Reference {
    /// Plays `frames` frames. The gains of rebuilds, which take long, are computed only if
    /// `has_oracle`.
    pub fn new(options: &StageOptions, (frames, every): (u32, u32), has_oracle: bool) -> Result<Self, SceneError> {
        let clock = Arc::new(VirtualClock::new(|_| Duration::ZERO));
        let mut stage = Stage::new(options, clock)?;
        let instances = instances(&stage);
        set_policies(&mut stage.world, &instances, |_| Policy::RefitOnly)?;
        let lights = |stage: &Stage| -> Vec<Vec<Light>> {
            stage.trees.iter().map(|key| stage.world.tree(*key).map_or(Vec::new(), |t| t.lights().to_vec())).collect()
        };
        let mut before = lights(&stage);
        let sizes: Vec<usize> = before.iter().map(Vec::len).collect();
        let (mut changed, mut lit) = (Vec::new(), Vec::new());
        let mut attributes: Vec<Vec<[f32; 4]>> = vec![Vec::new(); stage.trees.len()];
        let mut gains = has_oracle.then(|| Gains::new(&stage, &instances));
        if let Some(gains) = &mut gains {
            gains.find_lit_points(&Lit::new(&stage.world, &stage.shading_points), &stage.world, &instances);
            before.iter().enumerate().for_each(|(tree, lights)| gains.record(0, tree, lights));
        }
        for frame in 1..=frames {
            stage.advance(frame)?;
            stage.world.update(FrameBudget::NONE);
            let now = lights(&stage);
            let moved: Vec<bool> = before.iter().zip(&now).map(|(before, now)| before != now).collect();
            before = now;
            if frame % (frames / POINTS).max(1) == 0 {
                let build = |lights: &Vec<Light>| LightTree::new(lights.clone()).map(|tree| tree.attributes());
                let fresh: Vec<_> = before.par_iter().map(build).collect::<Result<_, _>>()?;
                for (attributes, fresh) in attributes.iter_mut().zip(fresh) {
                    attributes.push(ATTRIBUTES.map(|attribute| fresh.get(attribute)));
                }
            }
            if frame % every == 0 {
                lit.push(Lit::new(&stage.world, &stage.shading_points));
            }
            if let Some(gains) = &mut gains {
                if let Some(lit) = lit.last().filter(|_| frame % every == 0) {
                    gains.find_lit_points(lit, &stage.world, &instances);
                }
                let moving = moved.iter().zip(&before).enumerate().filter(|(_, (moved, _))| **moved);
                moving.for_each(|(tree, (_, lights))| gains.record(frame, tree, lights));
            }
            changed.push(moved);
        }
        let deviations = attributes.iter().map(|samples| std::array::from_fn(|i| deviation(samples, i))).collect();
        Ok(Self { changed, lit, deviations, sizes, gains })
    }
}

/// The standard deviation of one attribute.
fn deviation(samples: &[[f32; 4]], attribute: usize) -> f32 {
    let count = samples.len().max(1) as f32;
    let mean = samples.iter().map(|sample| sample[attribute]).sum::<f32>() / count;
    (samples.iter().map(|sample| (sample[attribute] - mean).powi(2)).sum::<f32>() / count).sqrt()
}

/// The instances of each of a stage's deforming trees.
pub fn instances(stage: &Stage) -> Vec<Vec<InstanceKey>> {
    let indices: std::collections::HashMap<_, _> = stage.trees.iter().enumerate().map(|(i, key)| (*key, i)).collect();
    let mut instances = vec![Vec::new(); stage.trees.len()];
    for key in stage.world.instances() {
        if let Some(index) = stage.world.instance(key).map(|i| i.tree).and_then(|tree| indices.get(&tree)) {
            instances[*index].push(key);
        }
    }
    instances
}

/// Sets the policy of all instances of each tree.
pub fn set_policies(
    world: &mut LightWorld,
    instances: &[Vec<InstanceKey>],
    policy: impl Fn(usize) -> Policy,
) -> Result<(), SceneError> {
    for (tree, instances) in instances.iter().enumerate() {
        for key in instances {
            world.set_policy(*key, policy(tree))?;
        }
    }
    Ok(())
}
