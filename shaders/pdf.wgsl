// The density with which light_sample chooses the direction to a point on a light. Twin of
// src/sampling/pdf.rs, which explains it.

// #if AREAS
// `to_plane` is the vector from the shading point to any point of the surface. Twin of
// `surface_pdf`.
fn light_surface_pdf(to_plane: vec3<f32>, normal_area: vec3<f32>, kind: u32, dist_sq: f32) -> f32 {
    var facing_area = -dot(normal_area, to_plane) / sqrt(dist_sq);
    if (kind & LIGHT_TWO_SIDED) != 0u {
        facing_area = abs(facing_area);
    }
    if facing_area <= 0.0 || !light_is_density(dist_sq, facing_area) {
        return 0.0;
    }
    return dist_sq / facing_area;
}

// Twin of `sphere_pdf`.
fn light_sphere_pdf(
    light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint, toward: vec3<f32>,
) -> f32 {
    let radius = light.c.x;
    let world_center = light_toward(light.a, instance, shading_point);
    let to_center = light_into_tree(instance, world_center);
    let dist_sq = dot(to_center, to_center);
    if dist_sq < LIGHT_TINY || radius * radius >= dist_sq {
        return 0.0;
    }
    let sin_max_sq = radius * radius / dist_sq;
    let one_minus_cos_max = sin_max_sq / (1.0 + sqrt(1.0 - sin_max_sq));
    let from_center = light_into_tree(instance, toward - world_center);
    let hit = length(to_center + light_normalize_or_zero(from_center) * radius);
    var local = hit;
    if hit <= LIGHT_CLOSE * sqrt(dist_sq) {
        local = length(light_into_tree(instance, toward));
    }
    let solid_angle = 0.5 * LIGHT_FOUR_PI * one_minus_cos_max * light_volume_scale(instance);
    if local <= 0.0 || solid_angle < LIGHT_TINY {
        return 0.0;
    }
    let stretch = length(toward) / local;
    let cubed = stretch * stretch * stretch;
    if !light_is_density(cubed, solid_angle) {
        return 0.0;
    }
    return cubed / solid_angle;
}

// The density per steradian of the direction to a point on a given light. Twin of `point_pdf`.
fn light_point_pdf(
    light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint, toward: vec3<f32>,
) -> f32 {
    let dist_sq = dot(toward, toward);
    let is_above = all(shading_point.normal == vec3(0.0)) || dot(shading_point.normal, toward) > 0.0;
    if !is_above || dist_sq < LIGHT_MIN_DIST_SQ || all(light.emission == vec3(0.0)) {
        return 0.0;
    }
    // #if RANGES
    if light_range_window(dist_sq, light.range) <= 0.0 {
        return 0.0;
    }
    // #endif
    let kind = light.kind & LIGHT_KIND_MASK;
    if kind == LIGHT_KIND_SPHERE {
        return light_sphere_pdf(light, instance, shading_point, toward);
    }
    if kind != LIGHT_KIND_RECTANGLE && kind != LIGHT_KIND_TRIANGLE {
        return 0.0;
    }
    // #if SOLID_ANGLES
    let near = light_near(light, instance, shading_point);
    if near.solid_angle > 0.0 {
        return select(0.0, 1.0 / near.solid_angle, light_is_lit_side(light, instance, shading_point));
    }
    // #endif
    let to_plane = light_toward(light.a, instance, shading_point);
    return light_surface_pdf(to_plane, light_flat_normal_area(light, instance), light.kind, dist_sq);
}
// #endif

// Returns the density with which light_sample chooses a light and the direction to `point`, for
// multiple importance sampling of rays that hit lights: pmf * pdf, per steradian. `point` lies on
// the light, in metres relative to the world's origin; for the sky at any distance in the direction. 0 for lights without size, and where
// light_sample would find nothing.
fn light_pdf(shading_point: LightShadingPoint, instance: u32, light: u32, point: vec3<f32>) -> f32 {
    // #if AREAS | SKY
    // #if SEGMENTS
    if light_is_segment(shading_point) {
        return 0.0;
    }
    // #endif
    let index = light_find(instance, light);
    if index == LIGHT_NO_LIGHT {
        return 0.0;
    }
    let placed = light_instance(instance);
    let record = light_record(index);
    let toward = light_limited(point) - shading_point.position;
    var pdf = 0.0;
    // #if AREAS
    pdf = light_point_pdf(record, placed, shading_point, toward);
    // #endif
    // #if SKY
    if (record.kind & LIGHT_KIND_MASK) == LIGHT_KIND_SKY {
        pdf = light_sky_pdf(record, placed, shading_point, toward);
    }
    // #endif
    if pdf > 0.0 {
        return pdf * light_pmf(shading_point, instance, light);
    }
    // #endif
    return 0.0;
}
