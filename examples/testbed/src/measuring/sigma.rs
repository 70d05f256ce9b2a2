//! The measure: the exact relative standard deviation of one sample, and its spread over shading
//! points.

/// A light with less than this share of the illuminance that is never chosen counts as lost to
/// rounding. Published formulas have no margins, so a light that is on the horizon within the
/// rounding of f32 may get probability 0. The shading point is then counted as unreached, but its
/// sigma stays finite, which favours those formulas.
const ROUNDING_SHARE: f64 = 1.0e-6;

/// The noise at one shading point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Relative standard deviation of one sample.
    pub sigma: f64,
    /// Some light contributes and is never chosen.
    pub has_unreached: bool,
}

impl Noise {
    /// Computes `sigma = sqrt(sum f^2 / p / (sum f)^2 - 1)` of contributions f that are chosen with
    /// probabilities p.
    ///
    /// Sigma is infinite where a light contributes and is never chosen, except below
    /// [`ROUNDING_SHARE`]. A probability that is NaN counts as 0. `None` where nothing contributes.
    pub fn of<T: Copy + Into<f64>>(contributions: &[T], pmfs: &[f32]) -> Option<Self> {
        let contributions = contributions.iter().map(|f| (*f).into());
        let sum: f64 = contributions.clone().sum();
        let (mut second, mut has_unreached) = (0.0, false);
        for (f, p) in contributions.zip(pmfs).filter(|(f, _)| *f > 0.0) {
            // NaN is not greater.
            let p = if *p > 0.0 { f64::from(*p) } else { 0.0 };
            has_unreached |= p == 0.0;
            if p > 0.0 || f > ROUNDING_SHARE * sum {
                second += f.powi(2) / p;
            }
        }
        let sigma = (second / (sum * sum) - 1.0).max(0.0).sqrt();
        (sum > 0.0).then_some(Self { sigma, has_unreached })
    }
}

/// The noise of one sampler over all shading points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    pub mean: f64,
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99.9th percentile: the fireflies.
    pub p999: f64,
    /// Root mean square.
    pub rms: f64,
    /// The number of shading points where some light contributes and is never chosen.
    pub unreached: usize,
}

impl Summary {
    /// Sums up at least one value. The 95th percentile is the least value that at least 95 % of the
    /// values do not exceed; the others likewise.
    pub fn of(noises: &[Noise]) -> Self {
        let mut sigmas: Vec<f64> = noises.iter().map(|noise| noise.sigma).collect();
        sigmas.sort_by(f64::total_cmp);
        let count = sigmas.len();
        let per_mille = |share: usize| sigmas[(count * share).div_ceil(1000).max(1) - 1];
        Self {
            mean: sigmas.iter().sum::<f64>() / count as f64,
            median: per_mille(500),
            p95: per_mille(950),
            p999: per_mille(999),
            rms: (sigmas.iter().map(|sigma| sigma * sigma).sum::<f64>() / count as f64).sqrt(),
            unreached: noises.iter().filter(|noise| noise.has_unreached).count(),
        }
    }
}
