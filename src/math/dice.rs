//! Random numbers for chains of choices, and the arithmetic of their probabilities.
//!
//! Twin of `shaders/dice.wgsl`. A choice remaps its random number to [0, 1), as is usual, and so
//! consumes its leading bits. A hash of all bits replaces the lost ones; otherwise all choices past
//! the 24th bit would be the same.

/// The largest f32 below 1.
pub(crate) const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

/// Spacing of the random numbers in [0.5, 1).
pub(crate) const U_STEP: f32 = f32::EPSILON / 2.0;

/// The least probability above 0. One that rounded to 0 would be divided by, or would hide a light
/// that contributes. It is far below the spacing of 24-bit random numbers, so the sum of all
/// probabilities does not show it.
pub(crate) const MIN_PMF: f32 = 1.0e-30;

/// The probability of two independent choices; 0 only if one of them is impossible. The floor does
/// not depend on the order in which probabilities are multiplied.
pub(crate) fn joint_pmf(a: f32, b: f32) -> f32 {
    if a > 0.0 && b > 0.0 { (a * b).max(MIN_PMF) } else { 0.0 }
}

/// The probability of a choice whose weight is a part of `total`; 0 only if the weight is 0.
pub(crate) fn choice_pmf(weight: f32, total: f32) -> f32 {
    if weight > 0.0 { (weight / total).max(MIN_PMF) } else { 0.0 }
}

/// A random number that serves any number of choices in turn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dice {
    u: f32,
    state: u32,
}

impl Dice {
    /// Starts from `u` in [0, 1); the bits of `more` go into the hash as well.
    ///
    /// The number stands for an interval of 2^-24, so fresh bits follow its own. Otherwise 0 would
    /// choose the first of all children, however improbable it is.
    pub fn new(u: f32, more: f32) -> Self {
        let state = hash_both([u, more]);
        Self { u: clamp_unit(clamp_unit(u) + fresh(state)), state }
    }

    /// The point in [0, `total`) that decides a choice among weights with that sum.
    pub fn point(&self, total: f32) -> f32 {
        self.u * total
    }

    /// Remaps the number to [0, 1) after a choice: the chosen interval has `length`, and the number
    /// lies `offset` inside it, both as shares of all weights.
    pub fn remap(&mut self, offset: f32, length: f32) {
        self.state = hash(self.state);
        self.u = clamp_unit((offset + fresh(self.state)) / length);
    }
}

/// A random number below 2^-24.
fn fresh(state: u32) -> f32 {
    (state >> 8) as f32 * U_STEP * U_STEP
}

/// Clamps to [0, 1). NaN and -0 become 0: their bits are above those of infinity.
pub(crate) fn clamp_unit(u: f32) -> f32 {
    let bits = u.to_bits();
    if bits <= f32::INFINITY.to_bits() { f32::from_bits(bits.min(ONE_MINUS_EPSILON.to_bits())) } else { 0.0 }
}

/// A hash of two random numbers, which count as what they are clamped to.
fn hash_both([u, more]: [f32; 2]) -> u32 {
    hash(clamp_unit(u).to_bits() ^ hash(clamp_unit(more).to_bits()))
}

/// A number in [0, 1) with 24 bits from a hash of two others.
pub(crate) fn hashed_unit(u: [f32; 2]) -> f32 {
    (hash_both(u) >> 8) as f32 * U_STEP
}

/// Source: Jarzynski and Olano, Hash Functions for GPU Rendering (JCGT 2020), the 1-D PCG hash.
pub(crate) fn hash(x: u32) -> u32 {
    let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_stays_uniform_after_sixty_choices() {
        // 60 halvings use up 24 bits more than twice; without fresh bits the last choices would all
        // be the same. 4096 trials of a fair coin: a share outside 0.5 +- 0.04 has a probability
        // below 4e-7.
        let mut heads = 0;
        for trial in 0..4096_u32 {
            let mut dice = Dice::new((trial as f32 + 0.5) / 4096.0, 0.25);
            let mut head = false;
            for _ in 0..60 {
                let point = dice.point(1.0);
                head = point >= 0.5;
                dice.remap(if head { point - 0.5 } else { point }, 0.5);
            }
            heads += u32::from(head);
        }
        assert!((f64::from(heads) / 4096.0 - 0.5).abs() < 0.04, "{heads}");
    }

    #[test]
    fn zero_chooses_a_child_as_often_as_it_is_probable() {
        // 65,536 numbers that stand for the interval from 0 to 2^-24. A quarter of it holds a share of
        // 0.25 +- 0.01, but for a probability of 4e-9.
        let below = |i: u32| Dice::new(0.0, i as f32 / 65_536.0).point(1.0) < 0.25 * U_STEP;
        let share = (0..65_536).filter(|i| below(*i)).count() as f64 / 65_536.0;
        assert!((share - 0.25).abs() < 0.01, "{share}");
    }

    #[test]
    fn numbers_outside_the_unit_interval_and_nan_are_clamped_into_it() {
        let clamped = [-0.0, -1.0, f32::NAN, -f32::NAN, 1.0, f32::INFINITY].map(clamp_unit).map(f32::to_bits);
        assert_eq!(clamped, [0.0, 0.0, 0.0, 0.0, ONE_MINUS_EPSILON, ONE_MINUS_EPSILON].map(f32::to_bits));
        for u in [0.0, ONE_MINUS_EPSILON, 1.0, -1.0, f32::NAN, f32::INFINITY] {
            let mut dice = Dice::new(u, u);
            for _ in 0..100 {
                assert!((0.0..1.0).contains(&dice.point(1.0)));
                dice.remap(dice.point(1.0), 1.0);
            }
        }
    }
}
