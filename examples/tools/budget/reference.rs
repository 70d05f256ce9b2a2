//! What is the same for all strategies: which trees change when, and what fresh builds of them are like.

use super::lit::Lit;
use super::motion::Motion;
use super::oracle::Gains;
use super::scene::SceneError;
use super::stage::{SceneKind, Stage};
use super::strategies::{ATTRIBUTES, Deviations};
use girandole::scheduler::VirtualClock;
use girandole::{FrameBudget, InstanceKey, Light, LightTree, LightWorld, Policy};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Duration;

/// Points of the animation at which SS's deviations are taken.
const POINTS: u32 = 8;

/// One scene in one motion, played once without any rebuild.
pub struct Reference {
    /// Of each frame from the first on, which trees changed.
    pub changed: Vec<Vec<bool>>,
    /// Of each frame in which noise is measured.
    pub lit: Vec<Lit>,
    /// Of each tree.
    pub deviations: Vec<Deviations>,
    /// Lights of each tree.
    pub sizes: Vec<usize>,
    /// For the oracle.
    pub gains: Option<Gains>,
}

impl Reference {
    /// Plays `frames` frames; what the oracle wants to know is found out only if `is_oracle_wanted`.
    pub fn new(
        kind: SceneKind,
        motion: Motion,
        (frames, every): (u32, u32),
        shading_points: usize,
        is_oracle_wanted: bool,
    ) -> Result<Self, SceneError> {
        let clock = Arc::new(VirtualClock::new(|_| Duration::ZERO));
        let mut stage = Stage::new(kind, motion, shading_points, clock)?;
        let instances = instances(&stage);
        set_policies(&mut stage.world, &instances, |_| Policy::RefitOnly)?;
        let lights = |stage: &Stage| -> Vec<Vec<Light>> {
            stage.trees.iter().map(|key| stage.world.tree(*key).map_or(Vec::new(), |t| t.lights().to_vec())).collect()
        };
        let mut before = lights(&stage);
        let sizes: Vec<usize> = before.iter().map(Vec::len).collect();
        let (mut changed, mut lit) = (Vec::new(), Vec::new());
        let mut attributes: Vec<Vec<[f32; 4]>> = vec![Vec::new(); stage.trees.len()];
        let mut gains = is_oracle_wanted.then(|| Gains::new(&stage, &instances));
        if let Some(gains) = &mut gains {
            gains.look(&Lit::new(&stage.world, &stage.shading_points), &stage.world, &instances);
            before.iter().enumerate().for_each(|(tree, lights)| gains.note(0, tree, lights));
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
                    gains.look(lit, &stage.world, &instances);
                }
                let moving = moved.iter().zip(&before).enumerate().filter(|(_, (moved, _))| **moved);
                moving.for_each(|(tree, (_, lights))| gains.note(frame, tree, lights));
            }
            changed.push(moved);
        }
        let deviations = attributes.iter().map(|samples| std::array::from_fn(|i| deviation(samples, i))).collect();
        Ok(Self { changed, lit, deviations, sizes, gains })
    }
}

fn deviation(samples: &[[f32; 4]], attribute: usize) -> f32 {
    let count = samples.len().max(1) as f32;
    let mean = samples.iter().map(|sample| sample[attribute]).sum::<f32>() / count;
    (samples.iter().map(|sample| (sample[attribute] - mean).powi(2)).sum::<f32>() / count).sqrt()
}

/// Of each of a stage's trees.
pub fn instances(stage: &Stage) -> Vec<Vec<InstanceKey>> {
    let places: std::collections::HashMap<_, _> = stage.trees.iter().enumerate().map(|(i, key)| (*key, i)).collect();
    let mut instances = vec![Vec::new(); stage.trees.len()];
    for key in stage.world.instances() {
        if let Some(place) = stage.world.instance_tree(key).and_then(|tree| places.get(&tree)) {
            instances[*place].push(key);
        }
    }
    instances
}

/// Gives all instances of each tree a policy.
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
