// Photometric profiles. Twin of src/profile/grid.rs and src/profile/stored.rs, which explain it. Reads the buffers that
// sample.wgsl binds; binds nothing itself.

// #if PROFILES
// A table: its first quad, and the numbers of angles from the pole and around it.
struct LightProfile {
    first: u32,
    polar: u32,
    around: u32,
}

// A number of a table.
fn light_profile_number(table: LightProfile, number: u32) -> f32 {
    let at = table.first + 1u + number / 4u;
    return bitcast<f32>(light_top[at][number % 4u]);
}

// The cell of `count` angles that holds an angle, and how far it is from the cell's first side to its second, or -1 if
// no cell does. Twin of `cell`.
fn light_profile_cell(table: LightProfile, first: u32, count: u32, angle: f32) -> vec2<f32> {
    var low = 0u;
    var high = count - 1u;
    var sides = vec2(light_profile_number(table, first), light_profile_number(table, first + high));
    if !(angle >= sides.x && angle <= sides.y) {
        return vec2(0.0, -1.0);
    }
    while low + 1u < high {
        let middle = (low + high) / 2u;
        let side = light_profile_number(table, first + middle);
        let is_beyond = side <= angle;
        low = select(low, middle, is_beyond);
        high = select(middle, high, is_beyond);
        sides = select(vec2(sides.x, side), vec2(side, sides.y), is_beyond);
    }
    return vec2(f32(low), (angle - sides.x) / (sides.y - sides.x));
}

// The intensity between two angles from the pole, for one angle around it.
fn light_profile_column(table: LightProfile, around: u32, cell: u32, share: f32) -> f32 {
    let at = table.polar + table.around + around * table.polar + cell;
    let low = light_profile_number(table, at);
    return low + (light_profile_number(table, at + 1u) - low) * share;
}

// The intensity of a lamp in a direction in the space of its tree, of any length but 0. Twin of `Grid::candela`.
fn light_profile_candela(light: LightRecord, direction: vec3<f32>) -> f32 {
    // The lamp's record holds the pole and the direction of angle 0 around it.
    let across = vec2(dot(light.c, direction), dot(cross(light.c, light.b), direction));
    let start = light_params.sky_map - light.profile;
    let head = light_top[start];
    let table = LightProfile(start, head.x, head.y);
    // Angles may round to more than half a turn, and to more than a whole one.
    let from_pole = min(atan2(length(across), dot(light.b, direction)), 0.25 * LIGHT_FOUR_PI);
    let polar = light_profile_cell(table, 0u, table.polar, from_pole);
    // A single angle around the pole stands for all.
    var around = vec2(0.0);
    if table.around > 1u {
        let angle = atan2(across.y, across.x);
        let first = light_profile_number(table, table.polar);
        let last = light_profile_number(table, table.polar + table.around - 1u);
        var turned = select(angle, angle + 0.5 * LIGHT_FOUR_PI, angle < first);
        turned = select(turned, min(turned, last), last - first >= LIGHT_WHOLE_TURN);
        around = light_profile_cell(table, table.polar, table.around, turned);
    }
    if polar.y < 0.0 || around.y < 0.0 {
        return 0.0;
    }
    var candela = light_profile_column(table, u32(around.x), u32(polar.x), polar.y);
    if around.y > 0.0 {
        let next = light_profile_column(table, u32(around.x) + 1u, u32(polar.x), polar.y);
        candela += (next - candela) * around.y;
    }
    return candela;
}

// Twin of `sample_light`.
fn light_from_profile(light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint) -> LightIncident {
    let toward = light_toward(light.a, instance, shading_point);
    let candela = light_profile_candela(light, light_into_tree(instance, -toward));
    return light_from_delta(light, toward, candela, shading_point);
}
// #endif
