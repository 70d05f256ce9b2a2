//! The time of work on trees: measured on this machine, then drawn at random from the measurements.
//! A run on the same costs repeats bit for bit.

use girandole::glam::{Vec3, vec3};
use girandole::scheduler::{VirtualClock, Work, WorkKind};
use girandole::{Light, LightTree};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use testbed::common::table::Table;
use testbed::scene::SceneError;
use testbed::scene::rng::Rng;

/// The kinds of work that are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Kind {
    Build,
    Refit,
}

const KINDS: [(Kind, &str); 2] = [(Kind::Build, "build"), (Kind::Refit, "refit")];

/// The sizes that are measured: powers of two, 2^4 to 2^14 lights.
const POWERS: std::ops::RangeInclusive<u32> = 4..=14;

/// How long each size is measured, and how often at least and at most.
struct Effort {
    time: Duration,
    least: usize,
    most: usize,
}

const FULL: Effort = Effort { time: Duration::from_millis(500), least: 40, most: 400 };
const QUICK: Effort = Effort { time: Duration::from_millis(50), least: 10, most: 100 };

/// Seeds the measured trees, and the draws of a clock.
const SEED: u64 = 0x9172_a0de;

/// Nanoseconds of each kind of work by number of lights, each sorted.
#[derive(Clone, Debug, PartialEq)]
pub struct Costs(BTreeMap<(Kind, usize), Vec<u64>>);

impl Costs {
    /// Measures on this machine, with rayon's threads as they are. Of two builds the faster counts,
    /// so that other programs on the machine have little influence. Takes about 10 seconds, or one
    /// if `is_quick`.
    pub fn measure(is_quick: bool) -> Result<Self, SceneError> {
        let effort = if is_quick { QUICK } else { FULL };
        let mut samples: BTreeMap<(Kind, usize), Vec<u64>> = BTreeMap::new();
        for power in POWERS {
            let lights = 1_usize << power;
            let mut rng = Rng::new(SEED, u64::from(power));
            let mut push = |kind, size, nanos| samples.entry((kind, size)).or_default().push(nanos);
            let start = Instant::now();
            let mut count = 0;
            while count < effort.least || (count < effort.most && start.elapsed() < effort.time) {
                let cloud = cloud(lights, 20.0, &mut rng);
                let copy = cloud.clone();
                let (_, once) = timed(|| LightTree::new(cloud.clone()));
                let (tree, again) = timed(|| LightTree::new(copy));
                push(Kind::Build, lights, once.min(again));
                let mut tree = tree?;
                let moved: Vec<(u32, Light)> = (0..).zip(fly(&cloud, &mut rng)).collect();
                tree.set_lights(&moved)?;
                push(Kind::Refit, lights, timed(|| tree.refit()).1);
                count += 1;
            }
        }
        samples.values_mut().for_each(|nanos| nanos.sort_unstable());
        Self(samples).checked()
    }

    /// Reads a file of [`Costs::write`]. Rows of other kinds of work are skipped: earlier versions
    /// measured more kinds.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let refuse = |what: String| SceneError(format!("cannot read {}: {what}", path.display()));
        let mut reader = csv::Reader::from_path(path).map_err(|error| refuse(error.to_string()))?;
        let mut samples: BTreeMap<(Kind, usize), Vec<u64>> = BTreeMap::new();
        for record in reader.deserialize() {
            let (name, lights, nanos): (String, usize, u64) = record.map_err(|error| refuse(error.to_string()))?;
            if let Some((kind, _)) = KINDS.iter().find(|(_, n)| *n == name) {
                samples.entry((*kind, lights.max(1))).or_default().push(nanos.max(1));
            }
        }
        samples.values_mut().for_each(|nanos| nanos.sort_unstable());
        Self(samples).checked().map_err(|error| refuse(error.0))
    }

    /// Writes one row per measurement: kind, lights, nanoseconds.
    pub fn write(&self, path: &Path) -> Result<(), SceneError> {
        let mut table = Table::create(path, &["kind", "lights", "nanoseconds"]).map_err(SceneError)?;
        for ((kind, lights), nanos) in &self.0 {
            let name = KINDS.iter().find(|(k, _)| k == kind).map_or("", |(_, name)| *name);
            for nanos in nanos {
                table.add([name, &lights.to_string(), &nanos.to_string()]).map_err(SceneError)?;
            }
        }
        Ok(())
    }

    /// Refuses costs that lack a kind of work.
    fn checked(self) -> Result<Self, SceneError> {
        let missing = KINDS.iter().find(|(kind, _)| self.sizes(*kind).next().is_none());
        match missing {
            None => Ok(self),
            Some((_, name)) => Err(SceneError(format!("there are no costs of kind {name:?}"))),
        }
    }

    /// The mean time of rebuilding a tree with this number of lights.
    pub fn rebuild(&self, lights: usize) -> Duration {
        let mean = |nanos: &[u64]| nanos.iter().sum::<u64>() as f64 / nanos.len() as f64;
        self.between(Kind::Build, lights, mean)
    }

    /// The `u`-quantile of the measured times of this work.
    fn at(&self, work: Work, u: f64) -> Duration {
        let quantile = |nanos: &[u64]| nanos[((u * nanos.len() as f64) as usize).min(nanos.len() - 1)] as f64;
        match work.kind {
            WorkKind::Refit => self.between(Kind::Refit, work.lights, quantile),
            WorkKind::Slice { tree_lights } => {
                let whole = self.between(Kind::Build, tree_lights, quantile);
                whole.mul_f64(work.lights as f64 / tree_lights.max(1) as f64)
            }
            WorkKind::Rebuild | WorkKind::Background => self.between(Kind::Build, work.lights, quantile),
            // Other work is not paid from a budget.
            _ => Duration::ZERO,
        }
    }

    /// The measured sizes of a kind of work in rising order, each with its times.
    fn sizes(&self, kind: Kind) -> impl Iterator<Item = (usize, &[u64])> {
        self.0.iter().filter(move |((k, _), _)| *k == kind).map(|((_, size), nanos)| (*size, nanos.as_slice()))
    }

    /// Interpolates between the measured sizes by a power law. A smaller size costs as much as the
    /// smallest; a larger one costs as much as the largest per light and level.
    fn between(&self, kind: Kind, lights: usize, value: impl Fn(&[u64]) -> f64) -> Duration {
        let (mut below, mut above) = (None, None);
        for (size, nanos) in self.sizes(kind) {
            if size <= lights {
                below = Some((size, nanos));
            } else if above.is_none() {
                above = Some((size, nanos));
            }
        }
        let units = |lights: usize| lights as f64 * (lights as f64).log2().max(1.0);
        let nanos = match (below, above) {
            (Some((small, a)), Some((large, b))) => {
                let (a, b) = (value(a).max(1.0), value(b).max(1.0));
                let t = (lights as f64 / small as f64).ln() / (large as f64 / small as f64).ln();
                (a.ln() + t * (b / a).ln()).exp()
            }
            (Some((size, nanos)), None) => value(nanos) * units(lights) / units(size),
            (None, Some((_, nanos))) => value(nanos),
            (None, None) => 0.0,
        };
        Duration::from_nanos(nanos.round() as u64)
    }
}

/// A clock on which time passes only by drawn costs and by [`PlayedClock::advance`], the same in
/// every run.
pub struct PlayedClock {
    /// For the world.
    pub clock: Arc<VirtualClock>,
    /// The time of all background builds.
    background: Arc<Mutex<Duration>>,
}

impl PlayedClock {
    /// Starts at zero. The draws depend only on how much work came before.
    pub fn new(costs: &Arc<Costs>) -> Self {
        let (costs, background) = (Arc::clone(costs), Arc::<Mutex<Duration>>::default());
        let (count, sum) = (AtomicU64::new(0), Arc::clone(&background));
        let draw = move |work: Work| {
            let mut rng = Rng::new(SEED, count.fetch_add(1, Ordering::Relaxed) + 1);
            // 48 bits: draws should not repeat, although there are only a few hundred measurements.
            let u = f64::from(rng.unit()) + f64::from(rng.unit()) / f64::from(1 << 24);
            let took = costs.at(work, u);
            if work.kind == WorkKind::Background {
                *lock(&sum) += took;
            }
            took
        };
        Self { clock: Arc::new(VirtualClock::new(draw)), background }
    }

    /// Lets time pass.
    pub fn advance(&self, time: Duration) {
        self.clock.advance(time);
    }

    /// The time of all background builds that have begun so far, until their end.
    pub fn background_time(&self) -> Duration {
        *lock(&self.background)
    }
}

fn lock(time: &Mutex<Duration>) -> MutexGuard<'_, Duration> {
    time.lock().unwrap_or_else(PoisonError::into_inner)
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let start = Instant::now();
    let done = work();
    (done, start.elapsed().as_nanos().clamp(1, u128::from(u64::MAX)) as u64)
}

/// Spheres in a flat cloud.
fn cloud(count: usize, size: f32, rng: &mut Rng) -> Vec<Light> {
    let mut position = || vec3(rng.range(-size, size), 0.2 * rng.range(-size, size), rng.range(-size, size));
    (0..count).map(|_| Light::sphere(position(), 0.05, Vec3::splat(100.0))).collect()
}

/// Moves half of the lights by up to half a metre and the others by up to eight metres along each
/// axis.
fn fly(cloud: &[Light], rng: &mut Rng) -> Vec<Light> {
    let reach = [0.5, 8.0];
    let moved = |(index, light): (usize, &Light)| {
        let size = reach[index * 2 / cloud.len()];
        let offset = vec3(rng.range(-size, size), rng.range(-size, size), rng.range(-size, size));
        Light::sphere(light.cluster().mean + offset, 0.05, Vec3::splat(100.0))
    };
    cloud.iter().enumerate().map(moved).collect()
}

impl Costs {
    /// One microsecond per light for all work, for tests that compute times by hand.
    pub fn plain() -> Self {
        let sizes = KINDS.iter().flat_map(|(kind, _)| POWERS.map(move |power| (*kind, 1_usize << power)));
        Self(sizes.map(|(kind, size)| ((kind, size), vec![size as u64 * 1_000])).collect())
    }
}
