//! How well a tree as it is, refitted or fresh, predicts the noise of a choice inside it. That
//! noise is the scale of the ratios in `fit.rs`, and its difference between two states predicts the
//! gain of a rebuild.

use super::figures::Kind;
use super::observations::{MIN_NOISE, Observation, SPLITS, Shape};
use super::regression::{Line, Point, best_tenth, mean, r_squared, spearman};
use testbed::common::table::markdown_head;

/// The least value of an attribute; lower values count as this.
const FLOOR: f64 = 1.0e-3;

/// Sets of features and their names.
const SETS: [(&str, &[usize]); 9] = [
    ("lights", &[0]),
    ("variance", &[3]),
    ("cost", &[4]),
    ("axis", &[5]),
    ("lights, variance", &[0, 3]),
    ("variance, axis", &[3, 5]),
    ("lights, variance, axis", &[0, 3, 5]),
    ("lights, cost, axis", &[0, 4, 5]),
    ("lights, all four, axis", &[0, 1, 2, 3, 4, 5]),
];

/// The columns of the table.
const COLUMNS: [&str; 16] = [
    "features",
    "held out",
    "R2",
    "R2 held out",
    "Spearman held out",
    "Spearman of gain",
    "best tenth of gain",
    "residual",
    "residual of trees",
    "constant",
    "ln lights",
    "ln distance",
    "ln overlap",
    "ln variance",
    "ln cost",
    "axis",
];

/// The features are the logarithm of the number of lights, the logarithms of the attributes
/// relative to the spread of the lights, and the length of the mean direction. The value is the
/// logarithm of the variance.
fn point(lights: usize, shape: &Shape, variance: f64) -> Point {
    let values = shape.values();
    let units = [shape.box_per_spread.sqrt(), 1.0, shape.box_per_spread, shape.box_per_spread];
    let mut x = [(lights as f64).ln(), 0.0, 0.0, 0.0, 0.0, shape.axis];
    (0..4).for_each(|i| x[i + 1] = (values[i].max(FLOOR) * units[i]).ln());
    Point { x, y: variance.max(MIN_NOISE).ln() }
}

/// Assigns an observation to one of the parts that are held out in turn.
type Fold = fn(&Observation) -> usize;

fn by_kind(observation: &Observation) -> usize {
    Kind::ALL.iter().position(|kind| *kind == observation.kind).unwrap_or(0)
}

fn by_tree(observation: &Observation) -> usize {
    observation.tree % PARTS
}

/// The number of parts of either way to hold out.
const PARTS: usize = Kind::ALL.len();

/// The trees before a rebuild, after it, and after the last rebuild; the variance of the latter is
/// taken from the fresh tree.
struct Trees<'a> {
    observations: &'a [Observation],
    now: Vec<Point>,
    fresh: Vec<Point>,
    rebuilt: Vec<Point>,
}

impl Trees<'_> {
    /// Predictions for each of the three states, from a line through the other parts' points before
    /// and after the rebuild.
    fn held_out(&self, set: &[usize], fold: Fold) -> [Vec<f64>; 3] {
        let count = self.observations.len();
        let mut predicted: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; count]);
        for part in 0..PARTS {
            let (own, others): (Vec<usize>, Vec<usize>) =
                (0..count).partition(|i| fold(&self.observations[*i]) == part);
            let others: Vec<&Point> = others.into_iter().flat_map(|i| [&self.now[i], &self.fresh[i]]).collect();
            let line = Line::fit(&others, set);
            for (points, predicted) in [&self.now, &self.fresh, &self.rebuilt].into_iter().zip(&mut predicted) {
                own.iter().for_each(|i| predicted[*i] = line.predict(&points[*i].x));
            }
        }
        predicted
    }
}

/// Prints how well the variance of a tree is predicted, and the gain of a rebuild as the predicted
/// difference between now and the last rebuild.
pub fn run(observations: &[Observation], splits: usize) {
    let gain: Vec<f64> = observations.iter().map(|o| o.refitted[splits] - o.fresh[splits]).collect();
    let of = |f: fn(&Observation, usize) -> Point| observations.iter().map(|o| f(o, splits)).collect::<Vec<Point>>();
    let trees = Trees {
        observations,
        now: of(|o, splits| point(o.lights, &o.now, o.refitted[splits])),
        fresh: of(|o, splits| point(o.lights, &o.fresh_shape, o.fresh[splits])),
        rebuilt: of(|o, splits| point(o.lights, &o.rebuilt, o.fresh[splits])),
    };
    testbed::say!("\nln(s2) of a tree as it is, {} splits, {} trees\n", SPLITS[splits], 2 * observations.len());
    testbed::say!("{}", markdown_head(&COLUMNS));
    let both: Vec<&Point> = trees.now.iter().chain(&trees.fresh).collect();
    let y: Vec<f64> = both.iter().map(|p| p.y).collect();
    let folds: [(&str, Fold); 2] = [("kinds", by_kind), ("trees", by_tree)];
    for ((name, set), (fold_name, fold)) in SETS.iter().flat_map(|set| folds.map(|fold| (set, fold))) {
        let line = Line::fit(&both, set);
        let own: Vec<f64> = both.iter().map(|p| line.predict(&p.x)).collect();
        let [now, fresh, rebuilt] = trees.held_out(set, fold);
        let gains: Vec<f64> = now.iter().zip(&rebuilt).map(|(now, rebuilt)| now.exp() - rebuilt.exp()).collect();
        let held_out: Vec<f64> = now.into_iter().chain(fresh).collect();
        let rest: Vec<f64> = y.iter().zip(&own).map(|(y, own)| y - own).collect();
        let numbers = [
            r_squared(&own, &y),
            r_squared(&held_out, &y),
            spearman(&held_out, &y),
            spearman(&gains, &gain),
            best_tenth(&gains, &gain),
            mean(rest.iter().map(|rest| rest * rest)).sqrt(),
            of_trees(observations, &rest),
            line.constant,
        ];
        let all: Vec<String> = numbers.into_iter().chain(line.coefficients).map(number).collect();
        testbed::say!("| {name} | {fold_name} | {} |", all.join(" | "));
    }
}

/// Three digits; nothing for a correlation that does not exist because all values are equal.
fn number(number: f64) -> String {
    if number.is_nan() { String::new() } else { format!("{number:.3}") }
}

/// The standard deviation across trees of each tree's mean residual. `rest` has the residuals of
/// all observations before the rebuild and then those after it.
fn of_trees(observations: &[Observation], rest: &[f64]) -> f64 {
    let count = observations.iter().map(|o| o.tree + 1).max().unwrap_or(0);
    let mut sums = vec![(0.0, 0.0); count];
    for (observation, rest) in observations.iter().chain(observations).zip(rest) {
        sums[observation.tree].0 += rest;
        sums[observation.tree].1 += 1.0;
    }
    mean(sums.iter().filter(|sum| sum.1 > 0.0).map(|sum| (sum.0 / sum.1).powi(2))).sqrt()
}
