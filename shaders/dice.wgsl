// Random numbers for chains of choices, and the arithmetic of their probabilities. Twin of
// src/math/dice.rs. Binds nothing.

// A random number that serves any number of choices in turn.
struct LightDice {
    u: f32,
    state: u32,
}

fn light_hash(x: u32) -> u32 {
    let state = x * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// Clamps to [0, 1). NaN becomes 0. Compares bits, because a compiler may assume that a float is no
// NaN: the bits of negative numbers are above those of infinity, and so are the bits of NaN.
fn light_clamp_unit(u: f32) -> f32 {
    let bits = bitcast<u32>(u);
    return bitcast<f32>(select(0u, min(bits, LIGHT_ONE_MINUS_EPSILON_BITS), bits <= LIGHT_INFINITY_BITS));
}

// A hash of two random numbers, which count as what they are clamped to. Twin of `hash_both`.
fn light_hash_both(u: f32, more: f32) -> u32 {
    return light_hash(bitcast<u32>(light_clamp_unit(u)) ^ light_hash(bitcast<u32>(light_clamp_unit(more))));
}

// A random number below 2^-24.
fn light_fresh(state: u32) -> f32 {
    return f32(state >> 8u) * LIGHT_U_STEP * LIGHT_U_STEP;
}

// Twin of `Dice::new`.
fn light_dice(u: f32, more: f32) -> LightDice {
    let state = light_hash_both(u, more);
    return LightDice(light_clamp_unit(light_clamp_unit(u) + light_fresh(state)), state);
}

// Remaps the number to [0, 1) after a choice: the chosen interval has `length`, and the number lies
// `offset` inside it. The low bits are fresh. Twin of `Dice::remap`.
fn light_remap(dice: LightDice, offset: f32, length: f32) -> LightDice {
    let state = light_hash(dice.state);
    return LightDice(light_clamp_unit((offset + light_fresh(state)) / length), state);
}

// The probability of two independent choices; 0 only if one of them is impossible. Twin of
// `joint_pmf`.
fn light_joint_pmf(a: f32, b: f32) -> f32 {
    return select(0.0, max(a * b, LIGHT_MIN_PMF), a > 0.0 && b > 0.0);
}

// The probability of a choice whose weight is a part of `total`. Twin of `choice_pmf`.
fn light_choice_pmf(weight: f32, total: f32) -> f32 {
    return select(0.0, max(weight / total, LIGHT_MIN_PMF), weight > 0.0);
}
