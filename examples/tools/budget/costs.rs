//! What work on trees takes, measured here and then played back: a run on these costs repeats bit for bit.

use super::scene::SceneError;
use super::scene::rng::Rng;
use girandole::glam::{Vec3, vec3};
use girandole::scheduler::{Clock, Work, WorkKind};
use girandole::{Light, LightTree};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Kind {
    Build,
    Part,
    Snapshot,
    Refit,
}

const KINDS: [(Kind, &str); 4] =
    [(Kind::Build, "build"), (Kind::Part, "part"), (Kind::Snapshot, "snapshot"), (Kind::Refit, "refit")];

/// Sizes are powers of two from 2^4 to 2^14 lights.
const POWERS: std::ops::RangeInclusive<u32> = 4..=14;

/// How long each size is measured, and how often at least and at most.
struct Effort {
    time: Duration,
    least: usize,
    most: usize,
}

const FULL: Effort = Effort { time: Duration::from_millis(500), least: 40, most: 400 };
const QUICK: Effort = Effort { time: Duration::from_millis(50), least: 10, most: 100 };

/// A clock's draws start here.
const SEED: u64 = 0x9172_a0de;

/// Nanoseconds of each kind of work by number of lights, each sorted.
#[derive(Clone, Debug, PartialEq)]
pub struct Costs(BTreeMap<(Kind, usize), Vec<u64>>);

impl Costs {
    /// Measures on this machine, with rayon's threads as they are; of builds always the faster of two, so that what
    /// others do on the machine hardly counts. Takes some 10 seconds, or one if `is_quick`.
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
                let (snapshot, copied) = timed(|| cloud.clone());
                push(Kind::Snapshot, lights, copied);
                let (_, once) = timed(|| LightTree::new(cloud.clone()));
                let (tree, again) = timed(|| LightTree::new(snapshot));
                push(Kind::Build, lights, once.min(again));
                // Lights that fly apart, some faster than others, and take their subtrees along to where they are bad.
                let mut tree = tree?;
                let moved: Vec<(u32, Light)> = (0..).zip(fly(&cloud, &mut rng)).collect();
                tree.set_lights(&moved)?;
                push(Kind::Refit, lights, timed(|| tree.refit()).1);
                // Then only one corner goes bad, which is a part worth rebuilding.
                tree.rebuild();
                let share = [2, 4, 8][count % 3];
                tree.set_lights(&jumble(tree.lights(), lights / share, &mut rng))?;
                tree.refit();
                let (rebuilt, took) = timed(|| tree.rebuild_worst(lights * 3 / 4));
                if rebuilt > 0 && rebuilt < lights {
                    // As if what was rebuilt had been one part of the nearest power of two.
                    let near = 1_usize << (rebuilt as f64).log2().round() as u32;
                    let whole = took as f64 * near as f64 / rebuilt as f64;
                    push(Kind::Part, near.clamp(1 << POWERS.start(), 1 << POWERS.end()), whole as u64);
                }
                count += 1;
            }
        }
        samples.values_mut().for_each(|nanos| nanos.sort_unstable());
        Self(samples).checked()
    }

    /// Reads what [`Costs::write`] wrote.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let refuse = |what: String| SceneError(format!("cannot read {}: {what}", path.display()));
        let mut reader = csv::Reader::from_path(path).map_err(|error| refuse(error.to_string()))?;
        let mut samples: BTreeMap<(Kind, usize), Vec<u64>> = BTreeMap::new();
        for record in reader.deserialize() {
            let (name, lights, nanos): (String, usize, u64) = record.map_err(|error| refuse(error.to_string()))?;
            let kind = KINDS.iter().find(|(_, n)| *n == name).map(|(kind, _)| *kind);
            let kind = kind.ok_or_else(|| refuse(format!("no work is called {name:?}")))?;
            samples.entry((kind, lights.max(1))).or_default().push(nanos.max(1));
        }
        samples.values_mut().for_each(|nanos| nanos.sort_unstable());
        Self(samples).checked().map_err(|error| refuse(error.0))
    }

    /// One line a measurement: kind, lights, nanoseconds.
    pub fn write(&self, path: &Path) -> Result<(), SceneError> {
        let mut table = super::report::Table::create(path, &["kind", "lights", "nanoseconds"])?;
        for ((kind, lights), nanos) in &self.0 {
            let name = KINDS.iter().find(|(k, _)| k == kind).map_or("", |(_, name)| *name);
            for nanos in nanos {
                table.line([name.to_owned(), lights.to_string(), nanos.to_string()])?;
            }
        }
        table.finish()
    }

    fn checked(self) -> Result<Self, SceneError> {
        let lacks = KINDS.iter().find(|(kind, _)| self.sizes(*kind).next().is_none());
        match lacks {
            None => Ok(self),
            Some((_, name)) => Err(SceneError(format!("no costs of {name}"))),
        }
    }

    /// What rebuilding a tree of so many lights takes on average.
    pub fn rebuild(&self, lights: usize) -> Duration {
        let mean = |nanos: &[u64]| nanos.iter().sum::<u64>() as f64 / nanos.len() as f64;
        self.between(Kind::Build, lights, mean)
    }

    /// Of all measurements of such work, that which a share `u` of them is below.
    fn at(&self, work: Work, u: f64) -> Duration {
        let quantile = |nanos: &[u64]| nanos[((u * nanos.len() as f64) as usize).min(nanos.len() - 1)] as f64;
        match work.kind {
            WorkKind::Refit => self.between(Kind::Refit, work.lights, quantile),
            WorkKind::RebuildPart => self.between(Kind::Part, work.lights, quantile),
            WorkKind::Snapshot => self.between(Kind::Snapshot, work.lights, quantile),
            WorkKind::Rebuild | WorkKind::Background => self.between(Kind::Build, work.lights, quantile),
            // The others take time that no budget has to pay.
            _ => Duration::ZERO,
        }
    }

    fn sizes(&self, kind: Kind) -> impl Iterator<Item = (usize, &[u64])> {
        self.0.iter().filter(move |((k, _), _)| *k == kind).map(|((_, size), nanos)| (*size, nanos.as_slice()))
    }

    /// A power law between the sizes that were measured. What is smaller costs what the smallest does; what is larger,
    /// as much a light and level as the largest.
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

/// Time goes by what work takes, and by what it is told to wait; every run is the same.
pub struct PlayedClock {
    costs: Arc<Costs>,
    state: Mutex<Played>,
}

#[derive(Default)]
struct Played {
    now: Duration,
    /// Pieces of work so far.
    count: u64,
    /// When the last build in the background began, and what it takes.
    build: Option<(Duration, Duration)>,
    background: Duration,
}

impl PlayedClock {
    /// Starts at zero. What takes how long depends on how much was done before.
    pub fn new(costs: &Arc<Costs>) -> Self {
        Self { costs: Arc::clone(costs), state: Mutex::default() }
    }

    /// Waits.
    pub fn advance(&self, time: Duration) {
        self.lock().now += time;
    }

    /// What builds in the background have taken so far, and will until they are done.
    pub fn spent_beside(&self) -> Duration {
        self.lock().background
    }

    fn lock(&self) -> MutexGuard<'_, Played> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the next piece of work takes.
    fn draw(&self, state: &mut Played, work: Work) -> Duration {
        state.count += 1;
        let mut rng = Rng::new(SEED, state.count);
        // 48 bits: rare stalls are among a few hundred samples, but draws should not repeat.
        let u = f64::from(rng.unit()) + f64::from(rng.unit()) / f64::from(1 << 24);
        self.costs.at(work, u)
    }
}

impl Clock for PlayedClock {
    fn now(&self) -> Duration {
        self.lock().now
    }

    fn worked(&self, work: Work) {
        let mut state = self.lock();
        let took = self.draw(&mut state, work);
        state.now += took;
    }

    fn background(&self, started: Duration, work: Work, _: Option<Duration>) -> Option<Duration> {
        let mut state = self.lock();
        let took = match state.build {
            Some((of, took)) if of == started => took,
            _ => {
                let took = self.draw(&mut state, work);
                state.build = Some((started, took));
                state.background += took;
                took
            }
        };
        (state.now >= started + took).then_some(took)
    }
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let start = Instant::now();
    let done = work();
    (done, start.elapsed().as_nanos().clamp(1, u128::from(u64::MAX)) as u64)
}

fn cloud(count: usize, size: f32, rng: &mut Rng) -> Vec<Light> {
    let mut place = || vec3(rng.range(-size, size), 0.2 * rng.range(-size, size), rng.range(-size, size));
    (0..count).map(|_| Light::sphere(place(), 0.05, Vec3::splat(100.0))).collect()
}

/// Half of the lights stay about where they are, the others go anywhere.
fn fly(cloud: &[Light], rng: &mut Rng) -> Vec<Light> {
    let far = [0.5, 8.0];
    let moved = |(index, light): (usize, &Light)| {
        let size = far[index * 2 / cloud.len()];
        let offset = vec3(rng.range(-size, size), rng.range(-size, size), rng.range(-size, size));
        Light::sphere(light.cluster().mean + offset, 0.05, Vec3::splat(100.0))
    };
    cloud.iter().enumerate().map(moved).collect()
}

/// The `count` lights of least x change places with each other.
fn jumble(lights: &[Light], count: usize, rng: &mut Rng) -> Vec<(u32, Light)> {
    let mut corner: Vec<u32> = (0..lights.len() as u32).collect();
    let x = |light: &u32| lights[*light as usize].cluster().mean.x;
    corner.sort_by(|a, b| x(a).total_cmp(&x(b)));
    corner.truncate(count);
    let mut places: Vec<Light> = corner.iter().map(|light| lights[*light as usize]).collect();
    (1..places.len()).for_each(|i| places.swap(i, rng.below(i + 1)));
    corner.into_iter().zip(places).collect()
}

#[cfg(test)]
impl Costs {
    /// A microsecond a light for all work, so that tests can reckon.
    pub fn plain() -> Self {
        let sizes = KINDS.iter().flat_map(|(kind, _)| POWERS.map(move |power| (*kind, 1_usize << power)));
        Self(sizes.map(|(kind, size)| ((kind, size), vec![size as u64 * 1_000])).collect())
    }
}
