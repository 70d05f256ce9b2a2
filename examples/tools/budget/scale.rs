//! How noisy the choice inside a tree is, from the tree as it stands, refitted or fresh: the scale to which ratios
//! are relative, and a prediction of what a rebuild buys by itself.

use super::figures::Kind;
use super::fit::MIN_NOISE;
use super::observations::{Observation, SPLITS, Shape};
use super::regression::{Line, Point, best_tenth, mean, r_squared, spearman};

/// Attributes below this count as this.
const FLOOR: f64 = 1.0e-3;

/// Sets of features, by name.
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

/// Logarithms of the number of lights and of the attributes by spread, the length of the mean direction; the variance's
/// logarithm.
fn point(lights: usize, shape: &Shape, variance: f64) -> Point {
    let values = shape.values();
    let units = [shape.box_per_spread.sqrt(), 1.0, shape.box_per_spread, shape.box_per_spread];
    let mut x = [(lights as f64).ln(), 0.0, 0.0, 0.0, 0.0, shape.axis];
    (0..4).for_each(|i| x[i + 1] = (values[i].max(FLOOR) * units[i]).ln());
    Point { x, y: variance.max(MIN_NOISE).ln() }
}

/// How the observations are held out in parts: the part of one of them.
type Fold = fn(&Observation) -> usize;

fn by_kind(observation: &Observation) -> usize {
    Kind::ALL.iter().position(|kind| *kind == observation.kind).unwrap_or(0)
}

fn by_tree(observation: &Observation) -> usize {
    observation.tree % PARTS
}

/// Of either way to hold out.
const PARTS: usize = Kind::ALL.len();

/// Trees as they stand before a rebuild, after it, and after the last one, as far as that is known.
struct Trees<'a> {
    observations: &'a [Observation],
    now: Vec<Point>,
    fresh: Vec<Point>,
    rebuilt: Vec<Point>,
}

impl Trees<'_> {
    /// Predictions for each of the three kinds of points, from a line through those of other parts, now and fresh.
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

/// Prints how well the variance of trees as they stand is told, and the gain as the difference between now and the last
/// rebuild.
pub fn run(observations: &[Observation], splits: usize) {
    let gain: Vec<f64> = observations.iter().map(|o| o.refitted[splits] - o.fresh[splits]).collect();
    let of = |f: fn(&Observation, usize) -> Point| observations.iter().map(|o| f(o, splits)).collect::<Vec<Point>>();
    let trees = Trees {
        observations,
        now: of(|o, splits| point(o.lights, &o.now, o.refitted[splits])),
        fresh: of(|o, splits| point(o.lights, &o.fresh_shape, o.fresh[splits])),
        rebuilt: of(|o, splits| point(o.lights, &o.rebuilt, o.fresh[splits])),
    };
    println!("\nln(s2) of a tree as it stands, {} opened, {} trees\n", SPLITS[splits], 2 * observations.len());
    println!(
        "| of | held out | R2 | R2 held out | Spearman held out | of gain | best tenth | residual | of trees | constant \
         | ln lights | ln distance | ln overlap | ln variance | ln cost | axis |"
    );
    println!("|{}", "---|".repeat(16));
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
        println!("| {name} | {fold_name} | {} |", all.join(" | "));
    }
}

/// Nothing for what does not tell trees apart.
fn number(number: f64) -> String {
    if number.is_nan() { String::new() } else { format!("{number:.3}") }
}

/// Standard deviation across trees of what is left on average of each; `rest` holds all now and then all fresh.
fn of_trees(observations: &[Observation], rest: &[f64]) -> f64 {
    let count = observations.iter().map(|o| o.tree + 1).max().unwrap_or(0);
    let mut sums = vec![(0.0, 0.0); count];
    for (observation, rest) in observations.iter().chain(observations).zip(rest) {
        sums[observation.tree].0 += rest;
        sums[observation.tree].1 += 1.0;
    }
    mean(sums.iter().filter(|sum| sum.1 > 0.0).map(|sum| (sum.0 / sum.1).powi(2))).sqrt()
}
