//! What must be known before the experiment: the standard deviations of the attributes over rebuilt
//! trees, and the time of always rebuilding. The animation is played once for it.

use super::decisions::Rule;
use super::pool::timed;
use super::stages::{Film, Source, Timing};
use super::strategies::{Strategy, TreeKind};
use super::trees::{OneTree, build};
use super::worlds::{Contender, Times};
use girandole::Attributes;
use rayon::ThreadPool;
use testbed::scene::SceneError;

/// The number of frames, at equal distances, in which trees are rebuilt: the fixed points of [SS].
const POINTS: u32 = 8;

/// The kinds of trees over all lights.
const KINDS: [TreeKind; 2] = [TreeKind::Binary, TreeKind::Library];

/// One kind of tree over all lights.
#[derive(Clone, Copy, Debug, Default)]
pub struct Calibration {
    /// The standard deviation of each attribute over rebuilt trees.
    pub deviations: Attributes,
    /// The mean times of work on the tree.
    pub times: Times,
}

/// What was measured.
#[derive(Clone, Copy, Debug)]
pub struct Survey {
    pub binary: Calibration,
    pub library: Calibration,
    /// The mean times per frame of work on the trees of the two levels. No lights if no tree
    /// changes.
    pub two_levels: Times,
}

impl Survey {
    /// Plays a scene. `tick` is called after each point.
    pub fn new(
        source: &Source,
        (frames, timing): (u32, Timing),
        threads: &ThreadPool,
        tick: impl Fn(),
    ) -> Result<Self, SceneError> {
        let mut film = Film::new(source, timing)?;
        let mut rebuilt = [Vec::new(), Vec::new()];
        let mut world = Contender::two_levels(Strategy::Rule(Rule::Always), None, &film.stage.world)?;
        let mut two_levels = Times::default();
        let points = points(frames);
        let per_step = 1.0 / f64::from(points.max(2) - 1);
        let mut first: Option<[Box<dyn OneTree>; 2]> = None;
        for point in 0..points {
            let frame = point * frames / points;
            let mut update_ms = [None; 2];
            if frame > 0 {
                film.advance(frame)?;
                let (step, lights) = world.advance((&film.stage.world, &film.changes), 0.0, threads)?;
                two_levels.rebuild_ms += step.rebuild_ms * per_step;
                two_levels.update_ms += step.update_ms * per_step;
                two_levels.lights += lights as f64 * per_step;
                for (tree, update_ms) in first.iter_mut().flatten().zip(&mut update_ms) {
                    let (result, ms) = timed(threads, || tree.refit(&film.changes));
                    result?;
                    *update_ms = Some(ms);
                }
            }
            let mut trees = Vec::with_capacity(KINDS.len());
            for ((kind, rebuilt), update_ms) in KINDS.into_iter().zip(&mut rebuilt).zip(update_ms) {
                let lights = film.lights.clone();
                let (tree, rebuild_ms) = timed(threads, || build(kind, lights));
                trees.push(tree?);
                rebuilt.push(Sample { attributes: trees[trees.len() - 1].attributes(), rebuild_ms, update_ms });
            }
            if first.is_none() {
                first = trees.try_into().ok();
            }
            tick();
        }
        let lights = film.lights.len();
        let [binary, library] = rebuilt.map(|rebuilt| calibration(&rebuilt, lights));
        Ok(Self { binary, library, two_levels })
    }

    /// What was measured of one kind of tree over all lights.
    pub fn of(&self, kind: TreeKind) -> Calibration {
        if kind == TreeKind::Binary { self.binary } else { self.library }
    }
}

/// The number of calls of `tick` of [`Survey::new`].
pub fn points(frames: u32) -> u32 {
    POINTS.min(frames)
}

/// What was measured of one kind of tree at one point.
struct Sample {
    /// Of the rebuilt tree.
    attributes: Attributes,
    rebuild_ms: f64,
    /// The update of the tree that was built at the first point.
    update_ms: Option<f64>,
}

fn calibration(samples: &[Sample], lights: usize) -> Calibration {
    let deviation = |of: fn(&Attributes) -> f32| {
        let values = || samples.iter().map(|sample| f64::from(of(&sample.attributes)));
        let center = mean(values());
        mean(values().map(|value| (value - center).powi(2))).sqrt() as f32
    };
    Calibration {
        deviations: Attributes {
            distance: deviation(|a| a.distance),
            overlap: deviation(|a| a.overlap),
            variance: deviation(|a| a.variance),
            splitting_cost: deviation(|a| a.splitting_cost),
        },
        times: Times {
            rebuild_ms: mean(samples.iter().map(|sample| sample.rebuild_ms)),
            update_ms: mean(samples.iter().filter_map(|sample| sample.update_ms)),
            lights: lights as f64,
        },
    }
}

/// The mean; 0 of nothing.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_and_times_have_values_computed_by_hand() {
        let sample = |(overlap, update_ms)| {
            let attributes = Attributes { overlap, ..Attributes::default() };
            Sample { attributes, rebuild_ms: 2.0 * f64::from(overlap), update_ms }
        };
        let samples = [(1.0, None), (2.0, Some(0.5)), (6.0, Some(1.5))].map(sample);
        let Calibration { deviations, times } = calibration(&samples, 7);
        // The mean is 3, the squared deviations are 4, 1 and 9.
        assert!((deviations.overlap - (14.0_f32 / 3.0).sqrt()).abs() < 1.0e-6);
        assert_eq!(deviations.distance, 0.0);
        assert_eq!(times, Times { rebuild_ms: 6.0, update_ms: 1.0, lights: 7.0 });
    }
}
