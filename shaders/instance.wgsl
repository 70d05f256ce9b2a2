// Transforms points and normals between an instance's tree and the world. Twin of
// `InstanceTransform` in src/instance/transform.rs and of `InstanceRecord::of`. Binds nothing.

// The linear part of a map, given by its rows, times a vector.
fn light_linear(rows: array<vec4<f32>, 3>, v: vec3<f32>) -> vec3<f32> {
    return vec3(dot(rows[0].xyz, v), dot(rows[1].xyz, v), dot(rows[2].xyz, v));
}

// The transpose of the linear part times a vector.
fn light_transposed(rows: array<vec4<f32>, 3>, v: vec3<f32>) -> vec3<f32> {
    return rows[0].xyz * v.x + rows[1].xyz * v.y + rows[2].xyz * v.z;
}

fn light_translation(rows: array<vec4<f32>, 3>) -> vec3<f32> {
    return vec3(rows[0].w, rows[1].w, rows[2].w);
}

// A map from its stored rows.
fn light_rows(x: vec4<u32>, y: vec4<u32>, z: vec4<u32>) -> array<vec4<f32>, 3> {
    return array(bitcast<vec4<f32>>(x), bitcast<vec4<f32>>(y), bitcast<vec4<f32>>(z));
}

// A map with its translation relative to the centre of the sector `home`, instead of that of
// `sector`. Twin of `SectorPoint::relative_to`.
fn light_from_home(rows: array<vec4<f32>, 3>, sector: vec3<i32>, home: vec3<i32>) -> array<vec4<f32>, 3> {
    let away = vec3<f32>(sector - home) * LIGHT_SECTOR_EDGE;
    var moved = rows;
    moved[0].w += away.x;
    moved[1].w += away.y;
    moved[2].w += away.z;
    return moved;
}

// #if FACTORS
// What the flux of lights with this factor is multiplied by: its luminance. Twin of
// `Appearance::brightness`.
fn light_brightness(factor: vec3<f32>) -> f32 {
    return dot(factor, vec3(0.2126, 0.7152, 0.0722));
}
// #endif

// #if NON_RIGID
// #if CONES
// The cosine of the half-angle of the image of a cap. `is_kind` says whether the axis is that of
// surfaces, and whether there are surfaces alone; `greatest` is the greatest factor of areas over that
// of the axis. Twin of `Linear::cap`.
fn light_cap_cosine(cos: f32, is_kind: vec2<bool>, greatest: f32, instance: LightInstance) -> f32 {
    let widened = cos * instance.cos_turn - sqrt(max(1.0 - cos * cos, 0.0)) * instance.sin_turn;
    let surfaces = select(-1.0, max((min(cos, 0.0) - LIGHT_AXIS_ROUNDING) * greatest, -1.0), is_kind.y);
    let image = select(select(widened, -1.0, cos <= -instance.cos_turn), surfaces, is_kind.x);
    return select(image, cos, instance.cos_turn >= 1.0);
}

// #endif
// #endif
// #if AREAS | SKY | PROFILES
// A vector of the world in the tree's space.
fn light_into_tree(instance: LightInstance, v: vec3<f32>) -> vec3<f32> {
    var local = light_transposed(instance.to_world, v);
    // #if NON_RIGID
    local = light_linear(instance.to_local, v);
    // #endif
    return local;
}
// #endif

// #if AREAS
// The largest rounding error of a position in the tree's space, per metre of its coordinates. Twin
// of `Placed::tree_margin`.
fn light_tree_margin(instance: LightInstance) -> f32 {
    var squeeze = 1.0;
    // #if NON_RIGID
    squeeze = max(sqrt(instance.to_local[2].w) * instance.to_local[1].w, 1.0);
    // #endif
    return LIGHT_POSITION_MARGIN * squeeze + LIGHT_RIGID_TOLERANCE;
}

// #endif

// #if AREAS | SKY
// The volume in the world of one cubic metre of the tree's space.
fn light_volume_scale(instance: LightInstance) -> f32 {
    var volume = 1.0;
    // #if NON_RIGID
    volume = abs(instance.to_local[0].w);
    // #endif
    return volume;
}
// #endif

// #if AREAS
// A normal times an area, transformed by the matrix of cofactors. Twin of
// `InstanceTransform::normal_area`.
fn light_normal_area(normal_area: vec3<f32>, instance: LightInstance) -> vec3<f32> {
    var transformed = light_linear(instance.to_world, normal_area);
    // #if NON_RIGID
    transformed = light_transposed(instance.to_local, normal_area) * abs(instance.to_local[0].w);
    // #endif
    return transformed;
}
// #endif
