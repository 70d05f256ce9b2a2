// Children of a tree whose instance is scaled, sheared or mirrored, as the world sees them. Twin of
// `ClusterView::in_world` in src/shading/importance.rs. Reads the instance again instead of keeping
// its matrices, which would need registers in every walk. Reads the buffers that sample.wgsl binds;
// binds nothing itself.

// #if NON_RIGID
// #if CONES | AREAS
// The shares of the flux of a child that come from lights without size and from surfaces. `code`
// are four bits of a node's `area_ratios`, and `steps` those of the node. Twin of
// `Node::flux_shares`.
fn light_flux_shares(code: u32, steps: u32) -> vec2<f32> {
    // 2^(code - 7 - 3 s) from its exponent.
    let shift = bitcast<i32>(steps) >> 28u;
    let ratio = bitcast<f32>(bitcast<u32>(i32(code) + 120 - 3 * shift) << 23u);
    let punctual = 1.0 / (1.0 + ratio);
    let shares = select(vec2(punctual, ratio * punctual), vec2(1.0, 0.0), code == 0u);
    return select(shares, vec2(0.0, 1.0), code == 15u);
}

// #endif

// #if CONES
// Whether the axis of emission is that of surfaces. See `FluxShares::has_normal`.
fn light_has_normal(code: u32) -> bool {
    return code >= LIGHT_LEAST_NORMAL_CODE;
}
// #endif

// Converts the lengths, cosines and fluxes of a child from tree space to the world. `packed` holds
// the same child, and the other arguments are as in `light_unpack`. Bounds hold in tree space only:
// test for darkness before this call.
fn light_into_world(
    child: ptr<function, LightChild>, packed: LightPackedChild, instance_slot: u32, view: LightNodeView,
    local_normal: vec3<f32>,
) {
    let instance = light_instance(instance_slot);
    let rows = instance.to_world;
    let to_local = instance.to_local;
    let seen = light_linear(rows, light_to_mean(packed, view));
    let dist_sq = light_sum_axes(seen * seen);
    (*child).dist_sq = dist_sq;
    let gap = light_linear(rows, light_to_box(packed, view));
    (*child).gap_sq = light_sum_axes(gap * gap);

    // #if CONES | AREAS
    let shares = light_flux_shares(packed.area_ratio, view.steps);
    // The rows of the matrix of cofactors, negated for mirrors, are these vectors times `volume`.
    let volume = abs(to_local[0].w);
    let area_x = vec3(to_local[0].x, to_local[1].x, to_local[2].x);
    let area_y = vec3(to_local[0].y, to_local[1].y, to_local[2].y);
    let area_z = vec3(to_local[0].z, to_local[1].z, to_local[2].z);
    let area_sq = dot(area_x, area_x) + dot(area_y, area_y) + dot(area_z, area_z);
    var area_factor = sqrt(area_sq * (1.0 / 3.0));
    // #if CONES
    let axis = light_unit_axis(packed.lobe.x);
    let beam_axis = light_linear(rows, axis);
    let beam = light_sum_axes(beam_axis * seen) / sqrt(light_sum_axes(beam_axis * beam_axis));
    let normal = vec3(
        light_sum_axes(axis * area_x), light_sum_axes(axis * area_y), light_sum_axes(axis * area_z),
    );
    let along_axis = sqrt(light_sum_axes(normal * normal));
    (*child).facing = select(beam, (*child).facing / along_axis, light_has_normal(packed.area_ratio));
    let agreement = min(1.5 * (*child).axis_length, 1.0);
    area_factor = agreement * along_axis + (1.0 - agreement) * area_factor;
    // #endif
    let flux = (*child).flux * shares;
    (*child).flux = min(flux.x + flux.y * (volume * area_factor), LIGHT_MAX_FLUX);
    // #endif

    // The distance in the world between two planes that are parallel to the surface and one metre
    // apart in the tree's space.
    var normal_scale = 1.0;
    if any(local_normal != vec3(0.0)) {
        normal_scale = 1.0 / length(light_transposed(to_local, local_normal));
    }
    (*child).along *= normal_scale;
    (*child).highest *= normal_scale;
    let deviation = light_deviation(packed);
    let column_sq = rows[0].xyz * rows[0].xyz + rows[1].xyz * rows[1].xyz + rows[2].xyz * rows[2].xyz;
    let half_size = light_half_size(packed, view.steps);
    (*child).variance = deviation * deviation * light_sum_axes(half_size * half_size * column_sq);
    (*child).normal_variance = min(normal_scale * normal_scale * (*child).normal_variance, (*child).variance);
}

// #if SEGMENTS
// #if CONES
// The part along the axis of emission of a child of a unit vector of the world. `facing` is this
// part in the tree's space, of the vector there that becomes the unit vector.
fn light_facing_along_in_world(facing: f32, packed: LightPackedChild, instance_slot: u32, unit: vec3<f32>) -> f32 {
    let instance = light_instance(instance_slot);
    let to_local = instance.to_local;
    let axis = light_unit_axis(packed.lobe.x);
    let beam_axis = light_linear(instance.to_world, axis);
    let beam = light_sum_axes(beam_axis * unit) / sqrt(light_sum_axes(beam_axis * beam_axis));
    let normal = vec3(
        dot(axis, vec3(to_local[0].x, to_local[1].x, to_local[2].x)),
        dot(axis, vec3(to_local[0].y, to_local[1].y, to_local[2].y)),
        dot(axis, vec3(to_local[0].z, to_local[1].z, to_local[2].z)),
    );
    return select(beam, facing / length(normal), light_has_normal(packed.area_ratio));
}
// #endif
// #endif

// #if CONES
// The cosine of the half-angle of a cap that is widened by the angle with this cosine and sine. Twin
// of `Linear::widened`.
fn light_widened(cos: f32, turn: vec2<f32>) -> f32 {
    let sin = sqrt(max(1.0 - cos * cos, 0.0));
    return select(cos * turn.x - sin * turn.y, -1.0, cos <= -turn.x);
}
// #endif
// #endif
