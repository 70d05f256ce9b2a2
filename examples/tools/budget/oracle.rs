//! What rebuilds gain, exact to first order, for strategies that know it.
//!
//! At a shading point where all lights together bring F, a tree's part of the second moment of a sample is `S / P`: `P` is the
//! chance of reaching the tree, which its shape does not change, and `S = sum f^2 / p` over its lights, each of which
//! brings f and is chosen with chance p inside of the tree. `sigma^2 = sum S / P / F^2 - 1`, so that a rebuild that
//! lowers `S` by dS lowers sigma by `dS / (2 sigma P F^2)`. A tree's shape follows from the frame in which it was built
//! alone, so that what is found out for one budget holds for all.

use super::lights::contributions;
use super::lit::Lit;
use super::scene::SceneError;
use super::stage::Stage;
use girandole::glam::DVec3;
use girandole::{InstanceKey, Light, LightId, LightTree, LightWorld, Placement, Policy, ShadingPoint, SplitCount};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Shading points where a tree brings a smaller share of the light do not count for it.
const MIN_SHARE: f64 = 1.0e-3;

/// Clusters opened inside a tree, of those that are opened in all: with 0 or 4 the oracle recovered less.
const SPLITS: SplitCount = SplitCount::of::<2>();

/// A shading point that an instance of a tree matters to.
#[derive(Clone, Copy, Debug)]
struct Seen {
    instance: usize,
    shading_point: usize,
    /// Of `S`, in the mean of sigma over shading points.
    weight: f64,
}

/// A tree's lights in one frame.
struct Moment {
    lights: Arc<Vec<Light>>,
    /// Who sees them.
    views: Arc<Vec<Seen>>,
}

/// One tree.
struct History {
    placements: Vec<Placement>,
    /// Those in which it changed, and the first; only of trees that are seen.
    moments: Vec<(u32, Moment)>,
    /// By the frame of the build and the frame that is looked at, both as in `moments`.
    noises: Mutex<HashMap<(u32, u32), f64>>,
    /// What each light brings to each view, by frame.
    lux: Mutex<HashMap<u32, Arc<Vec<Vec<f32>>>>>,
}

/// What is known of all trees and frames.
pub struct Gains {
    shading_points: Vec<ShadingPoint>,
    origin: DVec3,
    trees: Vec<History>,
    /// Of each tree, as looked at last.
    views: Vec<Arc<Vec<Seen>>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Gains {
    /// Knows nothing yet.
    pub fn new(stage: &Stage, instances: &[Vec<InstanceKey>]) -> Self {
        let history = |instances: &Vec<InstanceKey>| History {
            placements: instances.iter().filter_map(|key| stage.world.placement(*key)).collect(),
            moments: Vec::new(),
            noises: Mutex::default(),
            lux: Mutex::default(),
        };
        Self {
            shading_points: stage.shading_points.clone(),
            origin: stage.world.origin(),
            trees: instances.iter().map(history).collect(),
            views: vec![Arc::default(); instances.len()],
        }
    }

    /// Looks at who sees what, until the next time.
    pub fn look(&mut self, lit: &Lit, world: &LightWorld, instances: &[Vec<InstanceKey>]) {
        // Where the lights of each instance begin among all.
        let mut ranges: HashMap<InstanceKey, Range<usize>> = HashMap::new();
        let mut end = 0;
        for key in world.instances() {
            let tree = world.instance_tree(key).and_then(|tree| world.tree(tree));
            let start = end;
            end += tree.map_or(0, |tree| tree.lights().len());
            ranges.insert(key, start..end);
        }
        let count = self.shading_points.len() as f64;
        let found = lit.look(world, &self.shading_points, |shading_point, at| {
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
                    let chance: f64 = at.chances[range.clone()].iter().map(|chance| f64::from(*chance)).sum();
                    let weight = 1.0 / (2.0 * at.sigma * chance * at.total * at.total * count);
                    found.push((tree, Seen { instance, shading_point, weight }));
                }
            }
            found
        });
        let mut views = vec![Vec::new(); instances.len()];
        for (tree, seen) in found.into_iter().flatten() {
            views[tree].push(seen);
        }
        self.views = views.into_iter().map(Arc::new).collect();
    }

    /// Takes note of a tree that has changed, or is new.
    pub fn note(&mut self, frame: u32, tree: usize, lights: &[Light]) {
        let views = Arc::clone(&self.views[tree]);
        if !views.is_empty() || !self.trees[tree].moments.is_empty() {
            self.trees[tree].moments.push((frame, Moment { lights: Arc::new(lights.to_vec()), views }));
        }
    }

    /// How much a tree that was built in one frame adds to the mean of sigma in another, beside one built there.
    ///
    /// # Errors
    /// None for lights that a world has taken.
    pub fn loss(&self, tree: usize, built: u32, frame: u32) -> Result<f64, SceneError> {
        let history = &self.trees[tree];
        let (Some(built), Some(now)) = (history.at(built), history.at(frame)) else { return Ok(0.0) };
        if built == now || history.moments[now].1.views.is_empty() {
            return Ok(0.0);
        }
        Ok(self.noise(history, built, now)? - self.noise(history, now, now)?)
    }

    /// Its part of the mean of sigma over shading points, as far as the tree's shape decides.
    fn noise(&self, history: &History, built: usize, now: usize) -> Result<f64, SceneError> {
        let ((built, then), (now, moment)) = (&history.moments[built], &history.moments[now]);
        if let Some(noise) = lock(&history.noises).get(&(*built, *now)) {
            return Ok(*noise);
        }
        let mut tree = LightTree::new(then.lights.to_vec())?;
        if built != now {
            tree.set_lights(&(0..).zip(moment.lights.iter().copied()).collect::<Vec<_>>())?;
            tree.refit_without_attributes();
        }
        let lux = self.lux(history, *now, moment)?;
        let mut chances = Vec::new();
        let mut noise = 0.0;
        for (seen, lux) in moment.views.iter().zip(&*lux) {
            let at = inside(&self.shading_points[seen.shading_point], &history.placements[seen.instance], self.origin);
            tree.distribution(&at, SPLITS, &mut chances);
            let part = |(lux, chance): (&f32, &f32)| match *chance > 0.0 {
                true => f64::from(*lux).powi(2) / f64::from(*chance),
                false => 0.0,
            };
            noise += seen.weight * lux.iter().zip(&chances).map(part).sum::<f64>();
        }
        lock(&history.noises).insert((*built, *now), noise);
        Ok(noise)
    }

    fn lux(&self, history: &History, frame: u32, moment: &Moment) -> Result<Arc<Vec<Vec<f32>>>, SceneError> {
        if let Some(lux) = lock(&history.lux).get(&frame) {
            return Ok(Arc::clone(lux));
        }
        let mut world = LightWorld::new();
        world.set_origin(self.origin)?;
        let tree = world.add_tree(moment.lights.to_vec())?;
        let place = |placement: &Placement| world.add_instance(tree, *placement, Policy::Static);
        let instances: Vec<InstanceKey> = history.placements.iter().map(place).collect::<Result<_, _>>()?;
        let sampler = world.sampler();
        let of_view = |seen: &Seen| {
            let instance = instances[seen.instance];
            let ids: Vec<LightId> =
                (0..moment.lights.len() as u32).map(|light| LightId::Local { instance, light }).collect();
            contributions(&sampler, &ids, &self.shading_points[seen.shading_point])
        };
        let lux = Arc::new(moment.views.iter().map(of_view).collect::<Vec<_>>());
        lock(&history.lux).insert(frame, Arc::clone(&lux));
        Ok(lux)
    }
}

impl History {
    /// The last change up to a frame.
    fn at(&self, frame: u32) -> Option<usize> {
        self.moments.partition_point(|(of, _)| *of <= frame).checked_sub(1)
    }
}

/// A shading point as a tree's own space has it. For instances without shear: chances do not depend on scale.
fn inside(at: &ShadingPoint, placement: &Placement, origin: DVec3) -> ShadingPoint {
    let offset = origin + at.position.as_dvec3() - placement.translation;
    let position = placement.linear.inverse() * offset.as_vec3();
    ShadingPoint::surface(position, (placement.linear.transpose() * at.normal).normalize_or_zero())
}
