// What the choice of lights looks like, as colours for people. Reads the buffers that sample.wgsl binds.

// How many samples a colour is made of.
const LIGHT_HEAT_DRAWS: u32 = 16u;

// Dark blue for 0, green for 0.5, yellow for 1 and more.
fn light_heat_color(value: f32) -> vec3<f32> {
    let place = 2.0 * clamp(value, 0.0, 1.0);
    let low = mix(vec3(0.02, 0.02, 0.25), vec3(0.05, 0.5, 0.3), min(place, 1.0));
    return mix(low, vec3(1.0, 0.9, 0.2), max(place - 1.0, 0.0));
}

// A colour that tells numbers apart.
fn light_number_color(number: u32) -> vec3<f32> {
    let bits = light_hash(number);
    return 0.1 + 0.9 * vec3<f32>(vec3(bits, bits >> 10u, bits >> 20u) & vec3(1023u)) / 1023.0;
}

// The cut of its cell that the point chooses from.
fn light_heat_of_cut(shading_point: LightShadingPoint) -> vec3<f32> {
    var directional_lux = 0.0;
    // #if DIRECTIONAL
    directional_lux = light_directional_lux(shading_point);
    // #endif
    var cut: LightCut;
    light_new_cut(&cut, directional_lux, shading_point);
    return select(vec3(0.0), light_number_color(cut.row), cut.row != 0u);
}

// See `HeatMap`.
fn light_heat_map(shading_point: LightShadingPoint, shown: u32, seed: u32) -> vec3<f32> {
    if shown == LIGHT_HEAT_CUTS {
        return light_heat_of_cut(shading_point);
    }
    var first = vec3(0.0);
    var misses = 0.0;
    // Welford's sums.
    var mean = 0.0;
    var squares = 0.0;
    var state = light_hash(seed);
    for (var i = 0u; i < LIGHT_HEAT_DRAWS; i++) {
        var u: vec4<f32>;
        for (var k = 0u; k < 4u; k++) {
            state = light_hash(state + 0x9e3779b9u);
            u[k] = f32(state >> 8u) / 16777216.0;
        }
        let drawn = light_sample(shading_point, u);
        var weight = 0.0;
        if drawn.pmf > 0.0 {
            weight = light_illuminance_weight(shading_point, drawn);
            if all(first == vec3(0.0)) {
                first = light_number_color(drawn.instance ^ light_hash(drawn.light));
            }
        } else {
            misses += 1.0;
        }
        let difference = weight - mean;
        mean += difference / f32(i + 1u);
        squares += difference * (weight - mean);
    }
    if shown == LIGHT_HEAT_LIGHTS {
        return first;
    }
    if shown == LIGHT_HEAT_MISSES {
        return light_heat_color(misses / f32(LIGHT_HEAT_DRAWS));
    }
    if mean <= 0.0 {
        return vec3(0.0);
    }
    // At most the root of the number of samples.
    let noise = sqrt(squares / f32(LIGHT_HEAT_DRAWS - 1u)) / mean;
    return light_heat_color(log2(1.0 + noise) / log2(1.0 + sqrt(f32(LIGHT_HEAT_DRAWS))));
}
