// Children of a tree whose instance is scaled, sheared or mirrored, in the axes of the instance. Twin
// of src/shading/world_map.rs, which explains them. Reads the instance again instead of keeping its
// matrices, which would need registers in every walk. Reads the buffers that sample.wgsl binds; binds
// nothing itself.

// #if NON_RIGID
// The axes of a scaled instance, as the rows of a map to the world. Twin of `WorldMap::axes`.
fn light_axes(instance: LightInstance) -> array<vec4<f32>, 3> {
    let rows = instance.to_world;
    let x = light_normalize_or_zero(vec3(rows[0].x, rows[1].x, rows[2].x));
    let z = light_normalize_or_zero(instance.to_local[2].xyz);
    let y = cross(z, x);
    return array(vec4(x.x, y.x, z.x, 0.0), vec4(x.y, y.y, z.y, 0.0), vec4(x.z, y.z, z.z, 0.0));
}

// A box that was mapped, and what the variance is a share of: the squared length that half its
// diagonal would have if the images of its edges were perpendicular to each other.
struct LightMappedBox {
    bounds: LightBox,
    size_sq: f32,
}

// Maps a box from the space of the tree to the axes of the instance. Twin of a part of
// `WorldMap::child`.
fn light_box_in_axes(bounds: LightBox, local: LightLocalShadingPoint) -> LightMappedBox {
    let instance = light_instance(local.scaled_instance);
    let axes = light_axes(instance);
    let x = light_transposed(instance.to_world, vec3(axes[0].x, axes[1].x, axes[2].x));
    let y = light_transposed(instance.to_world, vec3(axes[0].y, axes[1].y, axes[2].y));
    let z = light_transposed(instance.to_world, vec3(axes[0].z, axes[1].z, axes[2].z));
    let toward = vec3(dot(x, bounds.toward), dot(y, bounds.toward), dot(z, bounds.toward));
    let center = vec3(dot(x, bounds.center), dot(y, bounds.center), dot(z, bounds.center));
    let half_size = bounds.half_size;
    let mapped = vec3(dot(abs(x), half_size), dot(abs(y), half_size), dot(abs(z), half_size));
    let size_sq = light_sum_axes(half_size * half_size * (x * x + y * y + z * z));
    return LightMappedBox(LightBox(toward - local.position, center - local.position, mapped), size_sq);
}

// #if CONES
// Maps the axis of emission of a child. Twin of a part of `Linear::cap`.
fn light_axis_in_axes(packed: LightPackedChild, instance: LightInstance) -> vec3<f32> {
    let axis = light_unit_axis(packed.lobe.x);
    let beam = light_linear(instance.to_world, axis);
    let normal = light_transposed(instance.to_local, axis);
    let image = select(beam, normal, packed.area_ratio >= LIGHT_LEAST_NORMAL_CODE);
    return light_transposed(light_axes(instance), light_normalize_or_zero(image));
}
// #endif

// A child of a scaled instance in the axes of the instance. Twin of `WorldMap::child`.
fn light_scaled_child(
    packed: LightPackedChild, view: LightNodeView, margin: f32, local: LightLocalShadingPoint,
) -> LightChild {
    let mapped = light_box_in_axes(light_unpack_box(packed, view), local);
    var child = light_see_box(mapped.bounds, packed, margin, local);
    let deviation = light_deviation(packed);
    child.variance = deviation * deviation * mapped.size_sq;
    child.normal_variance = min(child.normal_variance, child.variance);
    // #if CONES | AREAS
    let instance = light_instance(local.scaled_instance);
    let shares = light_flux_shares(packed.area_ratio, view.steps);
    // The matrix of cofactors, negated for mirrors, is the transpose of this one times `volume`.
    let to_local = instance.to_local;
    let volume = abs(to_local[0].w);
    let area_sq = dot(to_local[0].xyz, to_local[0].xyz) + dot(to_local[1].xyz, to_local[1].xyz)
        + dot(to_local[2].xyz, to_local[2].xyz);
    var area_factor = sqrt(area_sq * (1.0 / 3.0));
    // #if CONES
    light_see_axis(&child, light_axis_in_axes(packed, instance), mapped.bounds, packed);
    let along_axis = length(light_transposed(to_local, light_unit_axis(packed.lobe.x)));
    let is_kind = vec2(packed.area_ratio >= LIGHT_LEAST_NORMAL_CODE, packed.area_ratio == LIGHT_ALL_SURFACES);
    child.cos_half_angle = light_cap_cosine(child.cos_half_angle, is_kind, to_local[1].w / along_axis, instance);
    let agreement = min(1.5 * child.axis_length, 1.0);
    area_factor = agreement * along_axis + (1.0 - agreement) * area_factor;
    // #endif
    let flux = child.flux * shares;
    child.flux = min(flux.x + flux.y * (volume * area_factor), LIGHT_MAX_FLUX);
    // #endif
    return child;
}
// #endif
