// Writes the lights of trees with a source: to be called by kernels of the engine, in each frame between
// the upload and the build of the top level. Twin of `LightWorld::set_lights` where the text says so.

@group(LIGHT_GROUP) @binding(0) var<storage, read_write> light_source_table: array<LightSourceRecord>;
@group(LIGHT_GROUP) @binding(1) var<storage, read_write> light_source_records: array<vec4<u32>>;

// Returns how many lights a source has; 0 while the GPU does not hold its tree, and for numbers of no
// source. Removed lights count.
fn light_source_count(source: u32) -> u32 {
    if source >= arrayLength(&light_source_table) {
        return 0u;
    }
    return light_source_table[source].light_count;
}

// Sets a point light. All writes keep the kind, the range, the sides and the opening angles that the
// light has on the CPU. A write is refused if the light is of another kind, or if the CPU would not
// accept the values: the light is dark then, and the refusal is counted. Writes to lights that are not
// there do nothing.
fn light_put_point(source: u32, light: u32, position: vec3<f32>, intensity: vec3<f32>) {
    light_put(source, light, LIGHT_KIND_POINT, array(position, vec3(0.0), vec3(0.0)), intensity);
}

// Sets a spot. `direction` has unit length, to within 0.001.
fn light_put_spot(source: u32, light: u32, position: vec3<f32>, direction: vec3<f32>, intensity: vec3<f32>) {
    light_put(source, light, LIGHT_KIND_SPOT, array(position, direction, vec3(0.0)), intensity);
}

// Sets a rectangle from its centre and half edges.
fn light_put_rectangle(
    source: u32, light: u32, center: vec3<f32>, half_u: vec3<f32>, half_v: vec3<f32>, radiance: vec3<f32>,
) {
    light_put(source, light, LIGHT_KIND_RECTANGLE, array(center, half_u, half_v), radiance);
}

// Sets a triangle from its vertices.
fn light_put_triangle(
    source: u32, light: u32, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, radiance: vec3<f32>,
) {
    light_put(source, light, LIGHT_KIND_TRIANGLE, array(a, b, c), radiance);
}

// Sets a sphere.
fn light_put_sphere(source: u32, light: u32, center: vec3<f32>, radius: f32, radiance: vec3<f32>) {
    light_put(source, light, LIGHT_KIND_SPHERE, array(center, vec3(0.0), vec3(radius, 0.0, 0.0)), radiance);
}

// Makes a light dark: it keeps its place and emits nothing.
fn light_put_dark(source: u32, light: u32) {
    if light < light_source_count(source) {
        light_put_emission(light_source_at(source, light), vec3(0.0));
    }
}

// Tells that a light is another one from now on, so that light_generation changes: for particles that
// are born where another has died.
fn light_put_new(source: u32, light: u32) {
    if light < light_source_count(source) {
        light_source_records[light_source_at(source, light)].w += 1u << LIGHT_BIRTH_SHIFT;
    }
}

// Where the record of a light begins.
fn light_source_at(source: u32, light: u32) -> u32 {
    return (light_source_table[source].light_base + light) * LIGHT_RECORD_QUADS;
}

fn light_put_emission(at: u32, emission: vec3<f32>) {
    let place = light_source_records[at + 1u].w;
    light_source_records[at + 1u] = vec4(bitcast<vec3<u32>>(emission), place);
}

// Whether numbers are finite and within the limit of coordinates. Compares bits: compilers may assume
// that no float is NaN.
fn light_are_coordinates(v: vec3<f32>) -> bool {
    return all((bitcast<vec3<u32>>(v) & vec3(0x7fffffffu)) <= vec3(LIGHT_MAX_COORDINATE_BITS));
}

// Whether numbers are from 0 up to the limit of emission; the bits of a negative number are greater.
fn light_are_emission(v: vec3<f32>) -> bool {
    let bits = bitcast<vec3<u32>>(v);
    return all((bits <= vec3(LIGHT_MAX_EMISSION_BITS)) | (bits == vec3(0x80000000u)));
}

// Sets a light from the vectors of its record; see `LightRecord` in src/plan/layout.rs.
fn light_put(source: u32, light: u32, kind: u32, place: array<vec3<f32>, 3>, emission: vec3<f32>) {
    if light >= light_source_count(source) {
        return;
    }
    let at = light_source_at(source, light);
    let former = light_source_records[at].w;
    var is_sound = (former & LIGHT_KIND_MASK) == kind && light_are_emission(emission)
        && light_are_coordinates(place[0]) && light_are_coordinates(place[1]) && light_are_coordinates(place[2]);
    if kind == LIGHT_KIND_SPOT && is_sound {
        is_sound = abs(length(place[1]) - 1.0) <= LIGHT_UNIT_TOLERANCE;
    }
    if kind == LIGHT_KIND_SPHERE && is_sound {
        is_sound = place[2].x >= 0.0;
    }
    if !is_sound {
        light_put_emission(at, vec3(0.0));
        atomicAdd(&light_source_table[source].refused, 1u);
        return;
    }
    light_source_records[at] = vec4(bitcast<vec3<u32>>(place[0]), former);
    let has_size = kind != LIGHT_KIND_POINT && kind != LIGHT_KIND_SPOT;
    // What has no area must not emit: shaders do not see the flux.
    let is_flat = has_size && light_emitting_area(former, place[0], place[1], place[2]) <= 0.0;
    light_put_emission(at, select(max(emission, vec3(0.0)), vec3(0.0), is_flat));
    if kind != LIGHT_KIND_POINT {
        let range = light_source_records[at + 2u].w;
        light_source_records[at + 2u] = vec4(bitcast<vec3<u32>>(place[1]), range);
        if has_size {
            let last = light_source_records[at + 3u].w;
            light_source_records[at + 3u] = vec4(bitcast<vec3<u32>>(place[2]), last);
        }
    }
}
