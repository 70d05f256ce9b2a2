// A random number for any number of choices. Twin of `Dice` in src/walk.rs. Binds nothing.

struct LightDice {
    u: f32,
    state: u32,
}

fn light_hash(x: u32) -> u32 {
    let state = x * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

fn light_clamp_unit(u: f32) -> f32 {
    // NaN is not above 0; WGSL's max may keep it.
    return select(0.0, min(u, LIGHT_ONE_MINUS_EPSILON), u > 0.0);
}

fn light_dice(u: f32, more: f32) -> LightDice {
    return LightDice(light_clamp_unit(u), light_hash(bitcast<u32>(u) ^ light_hash(bitcast<u32>(more))));
}

// After the interval of `length` was chosen, `offset` into it: stretches the rest to [0, 1), with fresh low bits.
fn light_stretch(dice: LightDice, offset: f32, length: f32) -> LightDice {
    let state = light_hash(dice.state);
    let fresh = f32(state >> 8u) * LIGHT_U_STEP * LIGHT_U_STEP;
    return LightDice(light_clamp_unit((offset + fresh) / length), state);
}

// The chance of two choices; 0 only if one of them is impossible. Twin of `joint`.
fn light_joint(a: f32, b: f32) -> f32 {
    return select(0.0, max(a * b, LIGHT_MIN_CHANCE), a > 0.0 && b > 0.0);
}

// The chance of a choice of weight `value`, which is part of `total`. Twin of `share`.
fn light_share(value: f32, total: f32) -> f32 {
    return select(0.0, max(value / total, LIGHT_MIN_CHANCE), value > 0.0);
}
