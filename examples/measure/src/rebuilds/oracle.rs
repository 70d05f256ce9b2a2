//! The gain of rebuilds, exact to first order, for the oracle.
//!
//! Let F be the illuminance by all lights at a shading point. The part of a tree in the second
//! moment of a sample is `S / P`. P is the probability of reaching the tree, which does not depend
//! on the tree's shape. `S = sum f^2 / p` runs over the tree's lights, where f is the illuminance
//! by a light and p the probability of the light inside the tree. A rebuild that lowers S by dS
//! lowers sigma by `dS / (2 sigma P F^2)`, since `sigma^2 = sum S / P / F^2 - 1`.
//!
//! The shape of a tree depends only on the frame in which it was built, so results found for one
//! budget hold for all.

use super::lights::contributions;
use super::lit::Lit;
use super::stage::Stage;
use girandole::glam::DVec3;
use girandole::{InstanceKey, Light, LightId, LightTree, LightWorld, Placement, Policy, ShadingPoint};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use testbed::scene::SceneError;

/// A shading point counts for a tree only if the tree brings at least this share of its light.
const MIN_SHARE: f64 = 1.0e-3;

/// The number of splits inside a tree, of all splits of a choice. With 0 or 4 the oracle recovered
/// less.
const SPLITS: usize = 2;

/// A shading point that an instance of a tree lights.
#[derive(Clone, Copy, Debug)]
struct LitPoint {
    instance: usize,
    shading_point: usize,
    /// The weight of S in the mean of sigma over shading points.
    weight: f64,
}

/// The lights of a tree in one frame.
struct Snapshot {
    lights: Arc<Vec<Light>>,
    /// The shading points that they light.
    points: Arc<Vec<LitPoint>>,
}

/// One tree over time.
struct History {
    placements: Vec<Placement>,
    /// The first frame and the frames in which the tree changed; empty for trees that light no
    /// shading point.
    snapshots: Vec<(u32, Snapshot)>,
    /// The tree's part of sigma, by the frame of the build and the frame of the lights, both as in
    /// `snapshots`.
    noises: Mutex<HashMap<(u32, u32), f64>>,
    /// The illuminance by each light at each lit point, by frame.
    lux: Mutex<HashMap<u32, Arc<Vec<Vec<f32>>>>>,
}

/// All trees and frames so far.
pub struct Gains {
    shading_points: Vec<ShadingPoint>,
    origin: DVec3,
    trees: Vec<History>,
    /// The shading points that each tree lights, as of the last [`Gains::find_lit_points`].
    points: Vec<Arc<Vec<LitPoint>>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Gains {
    /// Starts without any frame.
    pub fn new(stage: &Stage, instances: &[Vec<InstanceKey>]) -> Self {
        let history = |instances: &Vec<InstanceKey>| History {
            placements: instances.iter().filter_map(|key| stage.world.instance(*key).map(|i| i.placement)).collect(),
            snapshots: Vec::new(),
            noises: Mutex::default(),
            lux: Mutex::default(),
        };
        Self {
            shading_points: stage.shading_points.clone(),
            origin: stage.world.origin(),
            trees: instances.iter().map(history).collect(),
            points: vec![Arc::default(); instances.len()],
        }
    }

    /// Finds the shading points that each tree lights. They hold until the next call.
    pub fn find_lit_points(&mut self, lit: &Lit, world: &LightWorld, instances: &[Vec<InstanceKey>]) {
        // The range of the lights of each instance among all lights.
        let mut ranges: HashMap<InstanceKey, Range<usize>> = HashMap::new();
        let mut end = 0;
        for key in world.instances() {
            let tree = world.instance(key).and_then(|i| world.tree(i.tree));
            let start = end;
            end += tree.map_or(0, |tree| tree.lights().len());
            ranges.insert(key, start..end);
        }
        let count = self.shading_points.len() as f64;
        let found = lit.map(world, &self.shading_points, |shading_point, at| {
            let mut found = Vec::new();
            for (tree, instances) in instances.iter().enumerate() {
                for (instance, key) in instances.iter().enumerate() {
                    let Some(range) = ranges.get(key) else { continue };
                    let first = at.lights.partition_point(|(light, _)| (*light as usize) < range.start);
                    let own = at.lights[first..].iter().take_while(|(light, _)| (*light as usize) < range.end);
                    let light: f64 = own.map(|(_, lux)| f64::from(*lux)).sum();
                    if light <= MIN_SHARE * at.total || at.sigma <= 0.0 || !at.sigma.is_finite() {
                        continue;
                    }
                    let reach: f64 = at.pmfs[range.clone()].iter().map(|pmf| f64::from(*pmf)).sum();
                    let weight = 1.0 / (2.0 * at.sigma * reach * at.total * at.total * count);
                    found.push((tree, LitPoint { instance, shading_point, weight }));
                }
            }
            found
        });
        let mut points = vec![Vec::new(); instances.len()];
        for (tree, point) in found.into_iter().flatten() {
            points[tree].push(point);
        }
        self.points = points.into_iter().map(Arc::new).collect();
    }

    /// Records the lights of a tree that is new or has changed.
    pub fn record(&mut self, frame: u32, tree: usize, lights: &[Light]) {
        let points = Arc::clone(&self.points[tree]);
        if !points.is_empty() || !self.trees[tree].snapshots.is_empty() {
            self.trees[tree].snapshots.push((frame, Snapshot { lights: Arc::new(lights.to_vec()), points }));
        }
    }

    /// The difference in the mean of sigma in a frame between the tree as it was built in frame
    /// `built` and a tree that is built in this frame.
    pub fn loss(&self, tree: usize, built: u32, frame: u32) -> Result<f64, SceneError> {
        let history = &self.trees[tree];
        let (Some(built), Some(now)) = (history.at(built), history.at(frame)) else { return Ok(0.0) };
        if built == now || history.snapshots[now].1.points.is_empty() {
            return Ok(0.0);
        }
        Ok(self.noise(history, built, now)? - self.noise(history, now, now)?)
    }

    /// The part of the mean of sigma over shading points that depends on the tree's shape.
    fn noise(&self, history: &History, built: usize, now: usize) -> Result<f64, SceneError> {
        let ((built, then), (now, snapshot)) = (&history.snapshots[built], &history.snapshots[now]);
        if let Some(noise) = lock(&history.noises).get(&(*built, *now)) {
            return Ok(*noise);
        }
        let mut tree = LightTree::new(then.lights.to_vec())?;
        if built != now {
            tree.set_lights(&(0..).zip(snapshot.lights.iter().copied()).collect::<Vec<_>>())?;
            tree.refit_without_attributes();
        }
        let lux = self.lux(history, *now, snapshot)?;
        let mut pmfs = Vec::new();
        let mut noise = 0.0;
        for (point, lux) in snapshot.points.iter().zip(&*lux) {
            let placement = &history.placements[point.instance];
            let at = in_tree_space(&self.shading_points[point.shading_point], placement, self.origin);
            tree.distribution(&at, SPLITS, &mut pmfs);
            let part = |(lux, pmf): (&f32, &f32)| match *pmf > 0.0 {
                true => f64::from(*lux).powi(2) / f64::from(*pmf),
                false => 0.0,
            };
            noise += point.weight * lux.iter().zip(&pmfs).map(part).sum::<f64>();
        }
        lock(&history.noises).insert((*built, *now), noise);
        Ok(noise)
    }

    /// The illuminance by each light at each lit point.
    fn lux(&self, history: &History, frame: u32, snapshot: &Snapshot) -> Result<Arc<Vec<Vec<f32>>>, SceneError> {
        if let Some(lux) = lock(&history.lux).get(&frame) {
            return Ok(Arc::clone(lux));
        }
        let mut world = LightWorld::new();
        world.set_origin_near(self.origin)?;
        let tree = world.add_tree(LightTree::new(snapshot.lights.to_vec())?);
        let place = |placement: &Placement| world.add_instance(tree, *placement, Policy::Static);
        let instances: Vec<InstanceKey> = history.placements.iter().map(place).collect::<Result<_, _>>()?;
        let sampler = world.sampler();
        let at_point = |point: &LitPoint| {
            let instance = instances[point.instance];
            let ids: Vec<LightId> =
                (0..snapshot.lights.len() as u32).map(|light| LightId::Local { instance, light }).collect();
            contributions(&sampler, &ids, &self.shading_points[point.shading_point])
        };
        let lux = Arc::new(snapshot.points.iter().map(at_point).collect::<Vec<_>>());
        lock(&history.lux).insert(frame, Arc::clone(&lux));
        Ok(lux)
    }
}

impl History {
    /// The index of the last snapshot up to a frame.
    fn at(&self, frame: u32) -> Option<usize> {
        self.snapshots.partition_point(|(recorded, _)| *recorded <= frame).checked_sub(1)
    }
}

/// A shading point in the space of a tree, for instances without shear. Probabilities do not depend
/// on uniform scale.
fn in_tree_space(at: &ShadingPoint, placement: &Placement, origin: DVec3) -> ShadingPoint {
    let offset = origin + at.position.as_dvec3() - placement.translation;
    let position = placement.linear.inverse() * offset.as_vec3();
    ShadingPoint::surface(position, (placement.linear.transpose() * at.normal).normalize_or_zero())
}
