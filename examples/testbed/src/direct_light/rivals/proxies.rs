//! Lights in proportion to weights, as a list in which each light stands as often as its weight says.

/// Proxies for each light, in the mean.
const PROXIES_PER_LIGHT: usize = 4;
/// The fewest proxies.
const LEAST_PROXIES: usize = 65_536;

/// The list. Lights without weight are not in it; all others are at least once.
#[derive(Default)]
pub struct Proxies {
    lights: Vec<u32>,
    counts: Vec<u32>,
}

impl Proxies {
    /// Fills the list anew. O(lights).
    pub fn fill(&mut self, weights: &[f64]) {
        let total: f64 = weights.iter().sum();
        let per_weight = (PROXIES_PER_LIGHT * weights.len()).max(LEAST_PROXIES) as f64 / total;
        self.lights.clear();
        self.counts.clear();
        for (light, weight) in (0..).zip(weights) {
            let count = if *weight > 0.0 { (weight * per_weight).round().max(1.0) as u32 } else { 0 };
            self.counts.push(count);
            self.lights.extend(std::iter::repeat_n(light, count as usize));
        }
    }

    /// The size of the list.
    pub fn bytes(&self) -> usize {
        (self.lights.len() + self.counts.len()) * size_of::<u32>()
    }

    /// A light; `u` in [0, 1).
    pub fn draw(&self, u: f32) -> u32 {
        self.lights[((u * self.lights.len() as f32) as usize).min(self.lights.len() - 1)]
    }

    /// The probability of a light.
    pub fn probability(&self, light: u32) -> f32 {
        self.counts[light as usize] as f32 / self.lights.len() as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_stand_in_proportion_to_their_weights_and_at_least_once() {
        let mut proxies = Proxies::default();
        proxies.fill(&[3.0, 0.0, 1.0, 1.0e-12]);
        assert_eq!(proxies.counts[..2], [49_152, 0]);
        assert_eq!((proxies.counts[2], proxies.counts[3]), (16_384, 1));
        assert_eq!(proxies.lights.len(), 65_537);
        assert_eq!([0.0, 0.7, 0.9, 1.0_f32.next_down()].map(|u| proxies.draw(u)), [0, 0, 2, 3]);
        let sum: f32 = (0..4).map(|light| proxies.probability(light)).sum();
        assert!((sum - 1.0).abs() < 1.0e-6);
    }
}
