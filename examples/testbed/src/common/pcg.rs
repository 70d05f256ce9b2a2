//! PCG-RXS-M-XS-32, the random numbers of scenes and measuring tools: a seed gives the same scene
//! on every machine.
//!
//! Source: O'Neill, PCG: A Family of Simple Fast Space-Efficient Statistically Good Algorithms for
//! Random Number Generation (2014).

/// A seeded generator with 32 bits of state. Different `stream` numbers give sequences that are
/// independent enough for scenes.
#[derive(Clone, Copy, Debug)]
pub struct Rng {
    state: u32,
}

fn mix(state: u32) -> u32 {
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

impl Rng {
    /// The generator of one stream of a seed. Each use of random numbers has a stream of its own.
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut state = 0x9e37_79b9_u32;
        for word in [seed as u32, (seed >> 32) as u32, stream as u32, (stream >> 32) as u32] {
            state = mix(state.wrapping_add(word).wrapping_mul(747_796_405).wrapping_add(2_891_336_453));
        }
        Self { state }
    }

    /// 32 random bits.
    pub fn bits(&mut self) -> u32 {
        self.state = self.state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        mix(self.state)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    /// Uniform in [low, high).
    pub fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Uniform in `0..count`; `count` must not be 0.
    pub fn below(&mut self, count: usize) -> usize {
        ((self.bits() as u64 * count as u64) >> 32) as usize
    }

    /// True with the given probability.
    pub fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }

    /// A random item of a list, which must not be empty.
    pub fn pick<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.below(items.len())]
    }
}
