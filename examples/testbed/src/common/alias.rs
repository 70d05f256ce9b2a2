//! Draws from a fixed list of weights in constant time.
//!
//! Source: Vose, A Linear Algorithm for Generating Random Numbers with a Given Distribution (1991).

/// A table for one list of weights.
pub struct Alias {
    /// For each index, the share of its column that is its own, and the index that has the rest.
    columns: Vec<(f32, u32)>,
    probabilities: Vec<f32>,
}

impl Alias {
    /// Builds the table. O(n). The weights must be finite and not negative, and at least one must be
    /// positive.
    pub fn new(weights: &[f64]) -> Self {
        let (total, count) = (weights.iter().sum::<f64>(), weights.len());
        let mut rest: Vec<f64> = weights.iter().map(|weight| weight / total * count as f64).collect();
        let mut columns: Vec<(f32, u32)> = (0..count as u32).map(|index| (1.0, index)).collect();
        let (mut low, mut high): (Vec<usize>, Vec<usize>) = (0..count).partition(|index| rest[*index] < 1.0);
        while let (Some(short), Some(long)) = (low.pop(), high.pop()) {
            columns[short] = (rest[short] as f32, long as u32);
            rest[long] -= 1.0 - rest[short];
            if rest[long] < 1.0 { low.push(long) } else { high.push(long) }
        }
        // What is left differs from 1 by rounding only; a column without weight is never left.
        for index in low.into_iter().filter(|index| weights[*index] <= 0.0) {
            columns[index] =
                (0.0, columns.iter().zip(weights).position(|(_, weight)| *weight > 0.0).unwrap_or(0) as u32);
        }
        Self { columns, probabilities: weights.iter().map(|weight| (weight / total) as f32).collect() }
    }

    /// Draws an index. `u` in [0, 1)^2.
    pub fn draw(&self, u: [f32; 2]) -> usize {
        let column = ((f64::from(u[0]) * self.columns.len() as f64) as usize).min(self.columns.len() - 1);
        let (own, other) = self.columns[column];
        if u[1] < own { column } else { other as usize }
    }

    /// The probability of an index.
    pub fn probability(&self, index: usize) -> f32 {
        self.probabilities[index]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::split_mix::Rng;

    #[test]
    fn the_columns_share_out_the_weights_exactly() {
        let mut rng = Rng(5);
        for count in [1, 2, 3, 17, 1_000] {
            let mut weights: Vec<f64> = (0..count).map(|_| f64::from(rng.unit()).powi(8) * 1.0e6).collect();
            weights[count / 2] = 0.0;
            weights[0] = 1.0;
            let alias = Alias::new(&weights);
            let mut shares = vec![0.0; count];
            for (index, (own, other)) in alias.columns.iter().enumerate() {
                shares[index] += f64::from(*own) / count as f64;
                shares[*other as usize] += f64::from(1.0 - own) / count as f64;
            }
            for (index, share) in shares.iter().enumerate() {
                let exact = weights[index] / weights.iter().sum::<f64>();
                // Shares of columns are rounded to f32.
                assert!((share - exact).abs() < 1.0e-6, "{index} of {count}: {share}, not {exact}");
                assert!(weights[index] > 0.0 || *share == 0.0);
                assert!((f64::from(alias.probability(index)) - exact).abs() < 1.0e-6);
            }
            assert!(weights[alias.draw([1.0_f32.next_down(); 2])] > 0.0 && weights[alias.draw([0.0; 2])] > 0.0);
        }
    }
}
