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
    return min(max(u, 0.0), LIGHT_BELOW_ONE);
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
