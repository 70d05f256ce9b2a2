//! Least squares in a few dimensions, rank correlation, and the spread of coefficients from tree to
//! tree.

/// The most features that a model can have.
pub const MAX_FEATURES: usize = 6;

/// A square matrix over features. Rows and columns of unused features are ignored.
pub type Matrix = [[f64; MAX_FEATURES]; MAX_FEATURES];

/// One observation: features, and the value that they predict. Unused features are 0.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub x: [f64; MAX_FEATURES],
    pub y: f64,
}

/// The prediction of a linear model without a constant.
pub fn predict(coefficients: &[f64; MAX_FEATURES], x: &[f64; MAX_FEATURES]) -> f64 {
    coefficients.iter().zip(x).map(|(c, x)| c * x).sum()
}

/// Solves `a x = b` for the features in `active` by Gaussian elimination with pivots; the others
/// stay 0. `None` if the matrix is singular.
fn solve(a: &Matrix, b: &[f64; MAX_FEATURES], active: &[usize]) -> Option<[f64; MAX_FEATURES]> {
    let n = active.len();
    let mut rows: Vec<Vec<f64>> =
        active.iter().map(|i| active.iter().map(|j| a[*i][*j]).chain([b[*i]]).collect()).collect();
    for column in 0..n {
        let pivot = (column..n).max_by(|p, q| rows[*p][column].abs().total_cmp(&rows[*q][column].abs()))?;
        rows.swap(column, pivot);
        let lead = rows[column].clone();
        if lead[column].abs() < 1.0e-12 * a[active[column]][active[column]].abs().max(1.0e-300) {
            return None;
        }
        for row in (0..n).filter(|row| *row != column) {
            let factor = rows[row][column] / lead[column];
            rows[row].iter_mut().zip(&lead).for_each(|(entry, lead)| *entry -= factor * lead);
        }
    }
    let mut x = [0.0; MAX_FEATURES];
    for (place, i) in active.iter().enumerate() {
        x[*i] = rows[place][n] / rows[place][place];
    }
    Some(x)
}

/// The normal equations: sums of products of features, and of features and values.
fn normal_equations<'a>(points: impl Iterator<Item = &'a Point>) -> (Matrix, [f64; MAX_FEATURES]) {
    let (mut a, mut b) = ([[0.0; MAX_FEATURES]; MAX_FEATURES], [0.0; MAX_FEATURES]);
    for Point { x, y } in points {
        for i in 0..MAX_FEATURES {
            b[i] += x[i] * y;
            for j in 0..MAX_FEATURES {
                a[i][j] += x[i] * x[j];
            }
        }
    }
    (a, b)
}

/// Least squares without a constant and without negative coefficients, over the features in use. Of
/// all subsets of features whose plain solution has no negative coefficient, the one with the least
/// residual wins.
pub fn fit(points: &[&Point], features: &[usize]) -> [f64; MAX_FEATURES] {
    let (a, b) = normal_equations(points.iter().copied());
    let mut best = (0.0, [0.0; MAX_FEATURES]);
    for set in 1_u32..1 << features.len() {
        let active: Vec<usize> = (0..features.len()).filter(|i| set >> i & 1 == 1).map(|i| features[i]).collect();
        let Some(x) = solve(&a, &b, &active) else { continue };
        // The sum of squared residuals is a constant minus this.
        let explained: f64 = (0..MAX_FEATURES).map(|i| x[i] * b[i]).sum();
        if x.iter().all(|c| *c >= 0.0) && explained > best.0 {
            best = (explained, x);
        }
    }
    best.1
}

/// The share of the variance of `y` that predictions explain; negative if the mean of `y` predicts
/// better.
pub fn r_squared(predicted: &[f64], y: &[f64]) -> f64 {
    let mean = y.iter().sum::<f64>() / y.len() as f64;
    let left: f64 = predicted.iter().zip(y).map(|(p, y)| (y - p).powi(2)).sum();
    1.0 - left / y.iter().map(|y| (y - mean).powi(2)).sum::<f64>()
}

/// Spearman's rank correlation; equal values share the mean of their ranks.
pub fn spearman(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (ranks(a), ranks(b));
    let mean = (a.len() as f64 - 1.0) / 2.0;
    let product = |p: &[f64], q: &[f64]| p.iter().zip(q).map(|(p, q)| (p - mean) * (q - mean)).sum::<f64>();
    product(&a, &b) / (product(&a, &a) * product(&b, &b)).sqrt()
}

fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    while first < order.len() {
        let same = order[first..].iter().take_while(|i| values[**i] == values[order[first]]).count();
        order[first..first + same].iter().for_each(|i| ranks[*i] = first as f64 + (same as f64 - 1.0) / 2.0);
        first += same;
    }
    ranks
}

/// The gain of the tenth of the trees with the largest predictions, as a share of the gain of the
/// best tenth.
pub fn best_tenth(predicted: &[f64], gain: &[f64]) -> f64 {
    let taken = |by: &[f64]| {
        let mut order: Vec<usize> = (0..gain.len()).collect();
        order.sort_by(|a, b| by[*b].total_cmp(&by[*a]));
        order[..gain.len() / 10].iter().map(|i| gain[*i]).sum::<f64>()
    };
    taken(predicted) / taken(gain)
}

/// The mean of some values; 0 if there are none.
pub fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    sum / f64::from(count.max(1))
}

/// A linear model with a constant and coefficients of any sign.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// The prediction where all features are 0.
    pub constant: f64,
    pub coefficients: [f64; MAX_FEATURES],
}

impl Line {
    /// Fits by least squares; only the constant if some features are linearly dependent.
    pub fn fit(points: &[&Point], features: &[usize]) -> Self {
        let means: [f64; MAX_FEATURES] = std::array::from_fn(|i| mean(points.iter().map(|p| p.x[i])));
        let y = mean(points.iter().map(|p| p.y));
        let centered: Vec<Point> =
            points.iter().map(|p| Point { x: std::array::from_fn(|i| p.x[i] - means[i]), y: p.y - y }).collect();
        let (a, b) = normal_equations(centered.iter());
        let coefficients = solve(&a, &b, features).unwrap_or([0.0; MAX_FEATURES]);
        Self { constant: y - predict(&coefficients, &means), coefficients }
    }

    /// The prediction for some features.
    pub fn predict(&self, x: &[f64; MAX_FEATURES]) -> f64 {
        self.constant + predict(&self.coefficients, x)
    }
}

/// The spread of coefficients from tree to tree.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    /// The covariance of a tree's coefficients around those of all trees.
    pub covariance: Matrix,
    /// The standard deviation of the residuals of a tree's points.
    pub noise: f64,
}

/// Rounds of expectation and maximization. After the last the covariance changes by less than a
/// percent.
const ROUNDS: usize = 60;

/// Fits `y = (coefficients + own) x + noise`, where `own` is normally distributed over groups of
/// points, by expectation and maximization (Laird and Ware 1982). The result is the prior of a
/// regression that each tree then updates by itself.
pub fn spread(groups: &[Vec<&Point>], coefficients: &[f64; MAX_FEATURES], features: &[usize]) -> Spread {
    let sums: Vec<(Matrix, [f64; MAX_FEATURES], f64, f64)> = groups
        .iter()
        .map(|points| {
            let rest: Vec<Point> =
                points.iter().map(|p| Point { x: p.x, y: p.y - predict(coefficients, &p.x) }).collect();
            let (a, b) = normal_equations(rest.iter());
            (a, b, rest.iter().map(|p| p.y * p.y).sum(), rest.len() as f64)
        })
        .collect();
    let count: f64 = sums.iter().map(|sum| sum.3).sum();
    let mut noise_sq = sums.iter().map(|sum| sum.2).sum::<f64>() / count;
    let mut covariance = [[0.0; MAX_FEATURES]; MAX_FEATURES];
    features.iter().for_each(|i| covariance[*i][*i] = 1.0);
    for _ in 0..ROUNDS {
        let prior = inverse(&covariance, features);
        let (mut next, mut left) = ([[0.0; MAX_FEATURES]; MAX_FEATURES], 0.0);
        for (a, b, squares, _) in &sums {
            let mut precision = prior;
            let mut pull = [0.0; MAX_FEATURES];
            for i in 0..MAX_FEATURES {
                pull[i] = b[i] / noise_sq;
                for j in 0..MAX_FEATURES {
                    precision[i][j] += a[i][j] / noise_sq;
                }
            }
            let posterior = inverse(&precision, features);
            let own: [f64; MAX_FEATURES] =
                std::array::from_fn(|i| (0..MAX_FEATURES).map(|j| posterior[i][j] * pull[j]).sum());
            left += squares;
            for i in 0..MAX_FEATURES {
                left -= 2.0 * own[i] * b[i];
                for j in 0..MAX_FEATURES {
                    left += a[i][j] * (own[i] * own[j] + posterior[i][j]);
                    next[i][j] += (own[i] * own[j] + posterior[i][j]) / groups.len() as f64;
                }
            }
        }
        covariance = next;
        noise_sq = left / count;
    }
    Spread { covariance, noise: noise_sq.sqrt() }
}

/// The inverse of the rows and columns in use. A little is added to the diagonal, so that it
/// exists.
fn inverse(matrix: &Matrix, features: &[usize]) -> Matrix {
    let mut regular = *matrix;
    features.iter().for_each(|i| regular[*i][*i] += 1.0e-9);
    let mut inverse = [[0.0; MAX_FEATURES]; MAX_FEATURES];
    for column in features {
        let mut unit = [0.0; MAX_FEATURES];
        unit[*column] = 1.0;
        if let Some(x) = solve(&regular, &unit, features) {
            (0..MAX_FEATURES).for_each(|row| inverse[row][*column] = x[row]);
        }
    }
    inverse
}
