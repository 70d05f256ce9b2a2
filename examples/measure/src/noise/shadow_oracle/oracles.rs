//! Probabilities that account for visibility.

/// The share of the library's own probabilities that all oracles keep, so that no light that is
/// wrongly held to be shadowed loses all of its probability.
pub const FLOOR: f64 = 0.02;

/// The probabilities of an oracle: those of the library, each times the visibility of the light,
/// normalised and mixed with those of the library.
///
/// `visibility` is called with the index of each light and returns values in [0, 1]. The result is
/// the library's own where the oracle holds everything to be shadowed.
pub fn guided(pmfs: &[f32], floor: f64, visibility: impl Fn(usize) -> f64) -> Vec<f32> {
    let guided: Vec<f64> = pmfs.iter().enumerate().map(|(light, pmf)| f64::from(*pmf) * visibility(light)).collect();
    let sum: f64 = guided.iter().sum();
    if sum <= 0.0 {
        return pmfs.to_vec();
    }
    let mixed = |(guided, pmf): (f64, &f32)| ((1.0 - floor) * guided / sum + floor * f64::from(*pmf)) as f32;
    guided.into_iter().zip(pmfs).map(mixed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_have_values_computed_by_hand() {
        // A fifth of the draws ends without a light. The first light is shadowed.
        let pmfs = [0.4, 0.2, 0.2];
        let hidden = |light: usize| if light == 0 { 0.0 } else { 1.0 };
        assert_eq!(guided(&pmfs, 0.5, hidden), [0.2, 0.35, 0.35]);
        assert_eq!(guided(&pmfs, 0.5, |_| 0.0), pmfs);
        let sum: f32 = guided(&pmfs, 0.0, |_| 1.0).iter().sum();
        assert!((sum - 1.0).abs() < 1e-6);
    }
}
