// Children of a tree whose instance is scaled, sheared or mirrored, as the world sees them. Twin of
// `ClusterView::in_world` in src/importance.rs. Reads the instance again instead of keeping its
// matrices, which would need registers in every walk. Reads the buffers that sample.wgsl binds;
// binds nothing itself.

// #if NON_RIGID
// #if CONES | AREAS
// The share of the flux of four children that comes from surfaces, from 16 bits of a node's
// `area_ratios`. Twin of `Node::area_share`.
fn light_area_shares(area_ratios: u32) -> vec4<f32> {
    let code = (vec4(area_ratios) >> vec4(0u, 4u, 8u, 12u)) & vec4(15u);
    // 2^(2 code - 15) from its exponent.
    let ratio = bitcast<vec4<f32>>((2u * code + 112u) << vec4(23u));
    let share = select(ratio / (1.0 + ratio), vec4(0.0), code == vec4(0u));
    return select(share, vec4(1.0), code == vec4(15u));
}
// #endif

// Converts the lengths, cosines and fluxes of four children from tree space to the world. `packed`
// holds the same four children, and the other arguments are as in `light_unpack`. Bounds hold in
// tree space only: test for darkness before this call.
fn light_four_into_world(
    four: ptr<function, LightFour>, packed: LightPackedFour, instance_slot: u32, origin: vec3<f32>,
    half_step: vec3<f32>, local_normal: vec3<f32>,
) {
    let instance = light_instance(instance_slot);
    let rows = instance.to_world;
    let to_local = instance.to_local;
    let mean = mat3x4(
        light_mean(packed.low.x, packed.high.x, packed.mean.x, origin.x, half_step.x),
        light_mean(packed.low.y, packed.high.y, packed.mean.y, origin.y, half_step.y),
        light_mean(packed.low.z, packed.high.z, packed.mean.z, origin.z, half_step.z),
    );
    let x = mean * rows[0].xyz;
    let y = mean * rows[1].xyz;
    let z = mean * rows[2].xyz;
    let dist_sq = x * x + y * y + z * z;
    (*four).gap_sq *= dist_sq / max((*four).dist_sq, vec4(LIGHT_MIN_IMPORTANCE));
    (*four).dist_sq = dist_sq;

    // #if CONES | AREAS
    let share = light_area_shares(packed.area_ratios);
    // The rows of the matrix of cofactors, negated for mirrors, are these vectors times `volume`.
    let volume = abs(to_local[0].w);
    let area_x = vec3(to_local[0].x, to_local[1].x, to_local[2].x);
    let area_y = vec3(to_local[0].y, to_local[1].y, to_local[2].y);
    let area_z = vec3(to_local[0].z, to_local[1].z, to_local[2].z);
    let area_sq = dot(area_x, area_x) + dot(area_y, area_y) + dot(area_z, area_z);
    var area_factor = vec4(sqrt(area_sq * (1.0 / 3.0)));
    // #if CONES
    let axis = light_unit_axes(packed.axis);
    let beam_x = axis * rows[0].xyz;
    let beam_y = axis * rows[1].xyz;
    let beam_z = axis * rows[2].xyz;
    let beam = (beam_x * x + beam_y * y + beam_z * z) / sqrt(beam_x * beam_x + beam_y * beam_y + beam_z * beam_z);
    let normal_x = axis * area_x;
    let normal_y = axis * area_y;
    let normal_z = axis * area_z;
    let along_axis = sqrt(normal_x * normal_x + normal_y * normal_y + normal_z * normal_z);
    (*four).facing = select(beam, (*four).facing / along_axis, share >= vec4(0.5));
    let agreement = min(1.5 * (*four).axis_length, vec4(1.0));
    area_factor = agreement * along_axis + (1.0 - agreement) * area_factor;
    // #endif
    let area = (*four).flux * share;
    (*four).flux = min(((*four).flux - area) + area * (volume * area_factor), vec4(LIGHT_MAX_FLUX));
    // #endif

    // The distance in the world between two planes that are parallel to the surface and one metre
    // apart in the tree's space.
    var normal_scale = 1.0;
    if any(local_normal != vec3(0.0)) {
        normal_scale = 1.0 / length(light_transposed(to_local, local_normal));
    }
    (*four).along *= normal_scale;
    (*four).highest *= normal_scale;
    let deviation = light_bytes(packed.deviation) * (1.0 / LIGHT_STEPS);
    let column_sq = rows[0].xyz * rows[0].xyz + rows[1].xyz * rows[1].xyz + rows[2].xyz * rows[2].xyz;
    (*four).variance = deviation * deviation * (
        light_half_sq(packed.low.x, packed.high.x, half_step.x) * column_sq.x
        + light_half_sq(packed.low.y, packed.high.y, half_step.y) * column_sq.y
        + light_half_sq(packed.low.z, packed.high.z, half_step.z) * column_sq.z
    );
    (*four).normal_variance = min(normal_scale * normal_scale * (*four).normal_variance, (*four).variance);
}

// #if SEGMENTS
// #if CONES
// The part along the axes of emission of four children of a unit vector of the world. `facing` are
// these parts in the tree's space, of the vector there that becomes the unit vector.
fn light_facing_along_in_world(
    facing: vec4<f32>, packed: LightPackedFour, instance_slot: u32, unit: vec3<f32>,
) -> vec4<f32> {
    let instance = light_instance(instance_slot);
    let rows = instance.to_world;
    let to_local = instance.to_local;
    let axis = light_unit_axes(packed.axis);
    let beam_x = axis * rows[0].xyz;
    let beam_y = axis * rows[1].xyz;
    let beam_z = axis * rows[2].xyz;
    let beam_length = sqrt(beam_x * beam_x + beam_y * beam_y + beam_z * beam_z);
    let beam = (beam_x * unit.x + beam_y * unit.y + beam_z * unit.z) / beam_length;
    let normal_x = axis * vec3(to_local[0].x, to_local[1].x, to_local[2].x);
    let normal_y = axis * vec3(to_local[0].y, to_local[1].y, to_local[2].y);
    let normal_z = axis * vec3(to_local[0].z, to_local[1].z, to_local[2].z);
    let normal_length = sqrt(normal_x * normal_x + normal_y * normal_y + normal_z * normal_z);
    return select(beam, facing / normal_length, light_area_shares(packed.area_ratios) >= vec4(0.5));
}
// #endif
// #endif

// Half the sizes of four boxes along one axis, squared.
fn light_half_sq(low_word: u32, high_word: u32, half_step: f32) -> vec4<f32> {
    let half_size = (light_bytes(high_word) - light_bytes(low_word)) * half_step;
    return half_size * half_size;
}

// #if CONES
// The cosines of the half-angles of caps that are widened by the angle with this cosine and sine.
// Twin of `Linear::widened`.
fn light_widened(cos: vec4<f32>, turn: vec2<f32>) -> vec4<f32> {
    let sin = sqrt(max(1.0 - cos * cos, vec4(0.0)));
    return select(cos * turn.x - sin * turn.y, vec4(-1.0), cos <= vec4(-turn.x));
}
// #endif
// #endif
