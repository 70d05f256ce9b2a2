//! How well a tree's attributes predict the gain of a rebuild: linear models of the rise of the
//! tree's noise, each tested on kinds of trees that it was not fitted to.

use super::figures::Kind;
use super::observations::{self, MIN_NOISE, Observation, SPLITS};
use super::regression::{MAX_FEATURES, Point, best_tenth, fit, mean, predict, r_squared, spearman, spread};
use super::scale;
use girandole::WorldError;
use testbed::common::table::markdown_head;

/// The least value of an attribute in ratios and logarithms; lower values count as this.
const FLOOR: f64 = 1.0e-6;

/// Logarithms of ratios are clamped to this magnitude, as in the library.
const MAX_RISE: f64 = 3.0;
/// About the mean number of lights over all observations.
const MEAN_LIGHTS: f64 = 250.0;

/// The inputs of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Features {
    /// Logarithms of the ratios of the attributes now to those after the last rebuild.
    LogRatios,
    /// The attributes now minus those after the last rebuild.
    Differences,
    /// The same differences, divided by the attributes after the last rebuild.
    RelativeRises,
    /// Logarithms of ratios, of attributes relative to the spread of the lights instead of the box
    /// around them.
    SpreadLogRatios,
    /// Logarithms of the ratios of the attributes now to those of the fresh tree, which are known
    /// only after a rebuild.
    Drops,
}

impl Features {
    const ALL: [Self; 5] =
        [Self::LogRatios, Self::Differences, Self::RelativeRises, Self::SpreadLogRatios, Self::Drops];

    fn name(self) -> &'static str {
        match self {
            Self::LogRatios => "ln(now / rebuilt)",
            Self::Differences => "now - rebuilt",
            Self::RelativeRises => "(now - rebuilt) / rebuilt",
            Self::SpreadLogRatios => "ln(now / rebuilt), by spread",
            Self::Drops => "ln(now / fresh)",
        }
    }

    fn of(self, observation: &Observation) -> [f64; MAX_FEATURES] {
        let before = if self == Self::Drops { &observation.fresh_shape } else { &observation.rebuilt };
        let (now, rebuilt) = (observation.now.values(), before.values());
        let units = observation.now.box_per_spread / observation.rebuilt.box_per_spread;
        let units = [units.sqrt(), 1.0, units, units];
        let mut x = [0.0; MAX_FEATURES];
        for i in 0..4 {
            let ratio = now[i].max(FLOOR) / rebuilt[i].max(FLOOR);
            x[i] = match self {
                Self::LogRatios | Self::Drops => ratio.ln().clamp(-MAX_RISE, MAX_RISE),
                Self::Differences => now[i] - rebuilt[i],
                Self::RelativeRises => (now[i] - rebuilt[i]) / rebuilt[i].max(FLOOR),
                Self::SpreadLogRatios => (ratio * units[i]).ln().clamp(-MAX_RISE, MAX_RISE),
            };
        }
        let rise = observation.cost_rise.max(-0.9);
        x[4] = match self {
            Self::LogRatios | Self::SpreadLogRatios | Self::Drops => rise.ln_1p(),
            Self::Differences | Self::RelativeRises => rise,
        };
        x[5] = x[4] * (observation.lights as f64 / MEAN_LIGHTS).ln();
        x
    }
}

/// The output of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Target {
    /// The logarithm of the ratio of the variance to that of a fresh tree.
    LogRatio,
    /// The variance minus that of a fresh tree.
    Difference,
    /// The standard deviation minus that of a fresh tree.
    SigmaDifference,
}

impl Target {
    const ALL: [Self; 3] = [Self::LogRatio, Self::Difference, Self::SigmaDifference];

    fn name(self) -> &'static str {
        match self {
            Self::LogRatio => "ln(s2 / fresh s2)",
            Self::Difference => "s2 - fresh s2",
            Self::SigmaDifference => "s - fresh s",
        }
    }

    fn of(self, observation: &Observation, splits: usize) -> f64 {
        let (now, fresh) = (observation.refitted[splits], observation.fresh[splits]);
        match self {
            Self::LogRatio => (now.max(MIN_NOISE) / fresh.max(MIN_NOISE)).ln(),
            Self::Difference => now - fresh,
            Self::SigmaDifference => now.sqrt() - fresh.sqrt(),
        }
    }
}

/// The columns of the table of models.
const COLUMNS: [&str; 15] = [
    "target",
    "features",
    "set",
    "R2",
    "Spearman",
    "R2 held out",
    "Spearman held out",
    "Spearman of gain",
    "best tenth of gain",
    "distance",
    "overlap",
    "variance",
    "cost",
    "cost rise",
    "times ln lights",
];

/// Sets of features and their names.
const SETS: [(&str, &[usize]); 8] = [
    ("distance", &[0]),
    ("overlap", &[1]),
    ("variance", &[2]),
    ("splitting cost", &[3]),
    ("cost rise", &[4]),
    ("all four", &[0, 1, 2, 3]),
    ("all four and cost rise", &[0, 1, 2, 3, 4]),
    ("cost rise, and times ln lights", &[4, 5]),
];

/// The quality of a model.
struct Quality {
    coefficients: [f64; MAX_FEATURES],
    /// R squared and rank correlation on the observations that it was fitted to.
    own: [f64; 2],
    /// The same, where each kind is predicted by a fit to the other kinds.
    held_out: [f64; 2],
    /// The predictions of these fits.
    predicted: Vec<f64>,
}

fn judge(points: &[Point], kinds: &[Kind], features: &[usize]) -> Quality {
    let y: Vec<f64> = points.iter().map(|point| point.y).collect();
    let all: Vec<&Point> = points.iter().collect();
    let coefficients = fit(&all, features);
    let own: Vec<f64> = points.iter().map(|point| predict(&coefficients, &point.x)).collect();
    let mut predicted = vec![0.0; points.len()];
    for kind in Kind::ALL {
        let others: Vec<&Point> = points.iter().zip(kinds).filter(|(_, k)| **k != kind).map(|(p, _)| p).collect();
        let coefficients = fit(&others, features);
        for (i, _) in kinds.iter().enumerate().filter(|(_, k)| **k == kind) {
            predicted[i] = predict(&coefficients, &points[i].x);
        }
    }
    let quality = |predicted: &[f64]| [r_squared(predicted, &y), spearman(predicted, &y)];
    Quality { coefficients, own: quality(&own), held_out: quality(&predicted), predicted }
}

fn points(observations: &[Observation], features: Features, target: Target, splits: usize) -> Vec<Point> {
    let point = |o: &Observation| Point { x: features.of(o), y: target.of(o, splits) };
    observations.iter().map(point).collect()
}

/// Prints all tables.
pub fn run() -> Result<(), WorldError> {
    let observations = observations::all()?;
    testbed::say!("{} observations of {} trees", observations.len(), trees(&observations).len());
    kinds_table(&observations);
    for splits in 0..SPLITS.len() {
        models(&observations, splits);
    }
    for splits in 0..SPLITS.len() {
        scale::run(&observations, splits);
    }
    for features in [Features::LogRatios, Features::SpreadLogRatios] {
        for (name, set) in [SETS[3], SETS[4], SETS[5]] {
            prior(&observations, features, name, set);
        }
    }
    Ok(())
}

/// The largest relative rise of any attribute.
fn worsening(observation: &Observation) -> f64 {
    let rises = Features::RelativeRises.of(observation);
    rises[..4].iter().copied().fold(0.0, f64::max)
}

/// The indices of the observations of each tree.
fn trees(observations: &[Observation]) -> Vec<Vec<usize>> {
    let count = observations.iter().map(|o| o.tree + 1).max().unwrap_or(0);
    let mut trees = vec![Vec::new(); count];
    observations.iter().enumerate().for_each(|(i, o)| trees[o.tree].push(i));
    trees
}

/// Prints the noise of each kind of tree, refitted and fresh.
fn kinds_table(observations: &[Observation]) {
    testbed::say!(
        "\n| kind | lights | s2 fresh, {} splits | refitted | s2 fresh, {} splits | refitted | mean ln ratio | deviation |",
        SPLITS[0],
        SPLITS[1]
    );
    testbed::say!("|---|---|---|---|---|---|---|---|");
    for kind in Kind::ALL {
        let own = || observations.iter().filter(move |o| o.kind == kind);
        let [plain, cut] = [0, 1].map(|splits| {
            let fresh = mean(own().map(|o| o.fresh[splits]));
            let refitted = mean(own().map(|o| o.refitted[splits]));
            format!("{fresh:.3} | {refitted:.3}")
        });
        let ratio = mean(own().map(|o| Target::LogRatio.of(o, 1)));
        let deviation = mean(own().map(|o| (Target::LogRatio.of(o, 1) - ratio).powi(2))).sqrt();
        let lights = mean(own().map(|o| o.lights as f64));
        let (least, most) = own().fold((usize::MAX, 0), |(low, high), o| (low.min(o.lights), high.max(o.lights)));
        testbed::say!(
            "| {} | {lights:.0} ({least} to {most}) | {plain} | {cut} | {ratio:.2} | {deviation:.2} |",
            kind.name()
        );
    }
}

/// Prints the table of models. The columns "Spearman of gain" and "best tenth of gain" compare the
/// prediction with what the scheduler needs: the trees whose rebuild removes the most variance.
fn models(observations: &[Observation], splits: usize) {
    let kinds: Vec<Kind> = observations.iter().map(|o| o.kind).collect();
    let gain: Vec<f64> = observations.iter().map(|o| Target::Difference.of(o, splits)).collect();
    testbed::say!("\n{} splits, {} observations\n", SPLITS[splits], observations.len());
    testbed::say!("{}", markdown_head(&COLUMNS));
    let worsening: Vec<f64> = observations.iter().map(worsening).collect();
    for target in Target::ALL {
        let y: Vec<f64> = observations.iter().map(|o| target.of(o, splits)).collect();
        let rank = spearman(&worsening, &y);
        let [of_gain, tenth] = [spearman(&worsening, &gain), best_tenth(&worsening, &gain)];
        testbed::say!("| {} | largest relative rise | | | {rank:.3} | | | {of_gain:.3} | {tenth:.3} |", target.name());
        for features in Features::ALL {
            let points = points(observations, features, target, splits);
            for (name, set) in SETS {
                let Quality { coefficients, own, held_out, predicted } = judge(&points, &kinds, set);
                let ranks = [spearman(&predicted, &gain), best_tenth(&predicted, &gain)];
                let numbers = own.into_iter().chain(held_out).chain(ranks).chain(coefficients);
                let numbers: Vec<String> = numbers.map(|number| format!("{number:.3}")).collect();
                testbed::say!("| {} | {} | {name} | {} |", target.name(), features.name(), numbers.join(" | "));
            }
        }
    }
}

/// Prints how coefficients differ from tree to tree. They are fitted to the measured noise, and to
/// what the scheduler can see of it: the model's prediction from the drop of the attributes to
/// those of the fresh tree.
fn prior(observations: &[Observation], features: Features, name: &str, set: &[usize]) {
    let points = points(observations, features, Target::LogRatio, 1);
    let coefficients = fit(&points.iter().collect::<Vec<_>>(), set);
    testbed::say!("\n{}, {name}: coefficients {coefficients:.3?}", features.name());
    let visible = |(point, observation): (&Point, &Observation)| Point {
        y: predict(&coefficients, &Features::Drops.of(observation)),
        ..*point
    };
    let visible: Vec<Point> = points.iter().zip(observations).map(visible).collect();
    // The rise of the cost has no drop to a fresh tree, so the scheduler sees nothing of it.
    let shown = if set.contains(&4) { 1 } else { 2 };
    for (what, points) in [("measured", &points), ("visible", &visible)].into_iter().take(shown) {
        let groups: Vec<Vec<&Point>> =
            trees(observations).into_iter().map(|tree| tree.into_iter().map(|i| &points[i]).collect()).collect();
        let spread = spread(&groups, &coefficients, set);
        let residual = mean(points.iter().map(|p| (p.y - predict(&coefficients, &p.x)).powi(2))).sqrt();
        testbed::say!("{what}: residual {residual:.3}, with coefficients of each tree's own {:.3}", spread.noise);
        testbed::say!("deviations of coefficients across trees and their correlations:");
        for i in set {
            let deviation = |i: usize| spread.covariance[i][i].sqrt();
            let row: Vec<String> = set
                .iter()
                .map(|j| format!("{:.2}", spread.covariance[*i][*j] / (deviation(*i) * deviation(*j)).max(1.0e-12)))
                .collect();
            testbed::say!("| {:.3} | {} |", deviation(*i), row.join(" | "));
        }
    }
}
