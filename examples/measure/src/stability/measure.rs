//! The noise and the error of a sampler at one step of a sweep.

use super::sweep::Sweep;
use girandole::WorldError;
use rayon::prelude::*;
use testbed::measuring::irradiance::exact_irradiance;
use testbed::measuring::sigma::Noise;
use testbed::measuring::street::Street;
use testbed::measuring::street_samplers::Subject;

/// How far the probabilities in f32 are from those in f64. The difference of two probabilities is
/// relative to the larger one: 0 if they are equal, 1 if one of them is 0 or NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Error {
    /// The mean over the shading points, where each light counts by its share of the illuminance.
    pub mean: f64,
    /// Lights with 99 % of the illuminance of all shading points have no greater difference.
    pub high: f64,
}

/// A sampler at a step of a sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    pub sweep: Sweep,
    pub value: f64,
    pub sampler: &'static str,
    /// The mean of sigma over the shading points at which it is finite; `None` if there are none.
    pub sigma: Option<f64>,
    /// The share of the lit shading points at which sigma is infinite, because a light that
    /// contributes is never chosen.
    pub infinite: f64,
    /// The same share, counting lights with less than a millionth of the illuminance too.
    pub unreached: f64,
    /// The share of the lit shading points at which some probability is NaN.
    pub nan: f64,
    pub error: Option<Error>,
}

/// One shading point.
struct Point {
    noise: Noise,
    has_nan: bool,
    /// For each light that contributes, its share of the illuminance and the difference of its
    /// probabilities.
    differences: Option<Vec<(f64, f64)>>,
}

/// Measures all samplers at one step. Some shading point must be lit.
pub fn measure(street: &Street, sweep: Sweep, value: f64) -> Result<Vec<Measured>, WorldError> {
    let (street, shift) = sweep.at(street, value);
    let lights = street.lights();
    let lux: Vec<Vec<f64>> = street
        .receivers
        .par_iter()
        .map(|at| lights.iter().map(|light| exact_irradiance(light, at)).collect())
        .collect();
    let all = Subject::both(&street, shift)?;
    Ok(all.iter().map(|subject| measure_one(subject, &street, &lux, (sweep, value))).collect())
}

fn measure_one(subject: &Subject, street: &Street, lux: &[Vec<f64>], (sweep, value): (Sweep, f64)) -> Measured {
    let point = |(at, lux): (_, &Vec<f64>)| {
        let pmfs = subject.pmfs(at);
        let differences = subject.exact_pmfs(at).map(|exact| differences(lux, &pmfs, &exact));
        let has_nan = pmfs.iter().any(|pmf| pmf.is_nan());
        Some(Point { noise: Noise::of(lux, &pmfs)?, has_nan, differences })
    };
    let points: Vec<Point> = street.receivers.par_iter().zip(lux).filter_map(point).collect();
    let count = points.len() as f64;
    let share = |is: fn(&Point) -> bool| points.iter().filter(|point| is(point)).count() as f64 / count;
    let finite: Vec<f64> = points.iter().map(|point| point.noise.sigma).filter(|sigma| sigma.is_finite()).collect();
    Measured {
        sweep,
        value,
        sampler: subject.name(),
        sigma: (!finite.is_empty()).then(|| finite.iter().sum::<f64>() / finite.len() as f64),
        infinite: share(|point| point.noise.sigma.is_infinite()),
        unreached: share(|point| point.noise.has_unreached),
        nan: share(|point| point.has_nan),
        error: error(points),
    }
}

fn differences(lux: &[f64], pmfs: &[f32], exact: &[f64]) -> Vec<(f64, f64)> {
    let sum: f64 = lux.iter().sum();
    let lit = lux.iter().zip(pmfs).zip(exact).filter(|((lux, _), _)| **lux > 0.0);
    lit.map(|((lux, pmf), exact)| (lux / sum, difference(f64::from(*pmf), *exact))).collect()
}

/// See [`Error`].
fn difference(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() {
        return 1.0;
    }
    if a == b { 0.0 } else { (a - b).abs() / a.max(b) }
}

fn error(points: Vec<Point>) -> Option<Error> {
    let count = points.len() as f64;
    let mut all: Vec<(f64, f64)> =
        points.into_iter().map(|point| point.differences).collect::<Option<Vec<_>>>()?.concat();
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mean = all.iter().map(|(share, difference)| share * difference).sum::<f64>() / count;
    let mut below = 0.0;
    let is_high = |(share, _): &&(f64, f64)| {
        below += share / count;
        below >= 0.99
    };
    Some(Error { mean, high: all.iter().find(is_high).map_or(0.0, |(_, difference)| *difference) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_relative_to_the_larger_probability() {
        assert_eq!([difference(0.0, 0.0), difference(0.5, 0.25), difference(0.25, 0.5)], [0.0, 0.5, 0.5]);
        assert_eq!([difference(0.0, 0.1), difference(f64::NAN, 0.1), difference(0.1, 0.0)], [1.0; 3]);
    }

    #[test]
    fn errors_weigh_lights_by_their_share_of_the_illuminance() {
        let point = |differences: &[(f64, f64)]| Point {
            noise: Noise { sigma: 0.0, has_unreached: false },
            has_nan: false,
            differences: Some(differences.to_vec()),
        };
        let close = |points: Vec<Point>, mean: f64, high: f64| {
            let found = error(points).expect("all have differences");
            assert!((found.mean - mean).abs() < 1.0e-12 && found.high == high, "{found:?}");
        };
        close(vec![point(&[(0.25, 1.0), (0.75, 0.5)])], 0.625, 1.0);
        // Only half a percent of the illuminance has the greatest difference.
        close(vec![point(&[(0.01, 1.0), (0.99, 0.5)]), point(&[(1.0, 0.0)])], 0.2525, 0.5);
        let mut blind = point(&[]);
        blind.differences = None;
        assert_eq!(error(vec![blind]), None);
    }
}
