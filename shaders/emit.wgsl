// Samples a point on a chosen light. Twin of src/sampling/emit.rs, which explains it. Binds
// nothing.

// The light that arrives from a point on a light, not yet shadowed. Twin of `Incident`.
struct LightIncident {
    // Unit vector from the shading point to the point on the light.
    direction: vec3<f32>,
    // Distance in metres; LIGHT_UNLIMITED_RANGE for a directional light.
    dist: f32,
    // Nits for surfaces, lux for lights without size; zero if no light arrives.
    radiance: vec3<f32>,
    // Density per steradian for surfaces, 1 for lights without size.
    pdf: f32,
    is_delta: bool,
}

// No light arrives.
fn light_nothing() -> LightIncident {
    return LightIncident(vec3(0.0), 0.0, vec3(0.0), 0.0, false);
}

// #if RANGES
// The factor by which a range dims a light; 0 from the range on.
fn light_range_window(dist_sq: f32, range: f32) -> f32 {
    if range >= LIGHT_UNLIMITED_RANGE {
        return 1.0;
    }
    let range_sq = range * range;
    if dist_sq >= range_sq {
        return 0.0;
    }
    let ratio_sq = dist_sq / range_sq;
    return 1.0 - ratio_sq * ratio_sq;
}
// #endif

fn light_arriving(
    shading_point: LightShadingPoint, direction: vec3<f32>, dist: f32, radiance: vec3<f32>, pdf: f32,
    is_delta: bool,
) -> LightIncident {
    let is_above = all(shading_point.normal == vec3(0.0)) || dot(shading_point.normal, direction) > 0.0;
    if is_above && any(radiance != vec3(0.0)) {
        return LightIncident(direction, dist, radiance, pdf, is_delta);
    }
    return light_nothing();
}

// `falloff` is that of a spot, or 1.
fn light_from_delta(
    light: LightRecord, toward: vec3<f32>, falloff: f32, shading_point: LightShadingPoint,
) -> LightIncident {
    let dist_sq = dot(toward, toward);
    if dist_sq < LIGHT_MIN_DIST_SQ {
        return light_nothing();
    }
    var share = falloff;
    // #if RANGES
    share *= light_range_window(dist_sq, light.range);
    // #endif
    share /= dist_sq;
    let dist = sqrt(dist_sq);
    return light_arriving(shading_point, toward / dist, dist, light.emission * share, 1.0, true);
}

// The vector in the world from a shading point to a point of the tree's space. Twin of
// `InstanceTransform::toward`.
fn light_toward(p: vec3<f32>, instance: LightInstance, shading_point: LightShadingPoint) -> vec3<f32> {
    return light_linear(instance.to_world, p) + (light_translation(instance.to_world) - shading_point.position);
}

// #if CONES
fn light_from_spot(light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint) -> LightIncident {
    let toward = light_toward(light.a, instance, shading_point);
    let axis = light_normalize_or_zero(light_linear(instance.to_world, light.b));
    let cos = -dot(axis, light_normalize_or_zero(toward));
    let falloff = clamp(cos * light.c.x + light.c.y, 0.0, 1.0);
    return light_from_delta(light, toward, falloff * falloff, shading_point);
}
// #endif

// #if AREAS
// Whether a quotient is a density inside the limits that f32 allows.
fn light_is_density(dividend: f32, divisor: f32) -> bool {
    return divisor >= dividend * LIGHT_MIN_INVERSE_PDF && dividend >= divisor * LIGHT_MIN_PDF;
}

// `normal_area` is the normal of the front times the area.
fn light_from_surface(
    light: LightRecord, toward: vec3<f32>, normal_area: vec3<f32>, shading_point: LightShadingPoint,
) -> LightIncident {
    let dist_sq = dot(toward, toward);
    if dist_sq < LIGHT_MIN_DIST_SQ {
        return light_nothing();
    }
    let dist = sqrt(dist_sq);
    let direction = toward / dist;
    var facing_area = -dot(normal_area, direction);
    if (light.kind & LIGHT_TWO_SIDED) != 0u {
        facing_area = abs(facing_area);
    }
    if facing_area <= 0.0 || !light_is_density(dist_sq, facing_area) {
        return light_nothing();
    }
    var radiance = light.emission;
    // #if RANGES
    radiance *= light_range_window(dist_sq, light.range);
    // #endif
    return light_arriving(shading_point, direction, dist, radiance, dist_sq / facing_area, false);
}

fn light_from_rectangle(
    light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint, u: vec2<f32>,
) -> LightIncident {
    let toward = light_toward(light.a, instance, shading_point);
    let half_u = light_linear(instance.to_world, light.b);
    let half_v = light_linear(instance.to_world, light.c);
    let point = toward + half_u * (2.0 * u.x - 1.0) + half_v * (2.0 * u.y - 1.0);
    return light_from_surface(light, point, light_normal_area(cross(light.b, light.c) * 4.0, instance), shading_point);
}

fn light_from_triangle(
    light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint, u: vec2<f32>,
) -> LightIncident {
    let toward = light_toward(light.a, instance, shading_point);
    let edge_q = light_linear(instance.to_world, light.b - light.a);
    let edge_r = light_linear(instance.to_world, light.c - light.a);
    let root = sqrt(u.x);
    let point = toward + edge_q * (root * (1.0 - u.y)) + edge_r * (root * u.y);
    let normal_area = cross(light.b - light.a, light.c - light.a) * 0.5;
    return light_from_surface(light, point, light_normal_area(normal_area, instance), shading_point);
}

// The normal of a rectangle or triangle times its area, in the world.
fn light_flat_normal_area(light: LightRecord, instance: LightInstance) -> vec3<f32> {
    var normal_area = cross(light.b, light.c) * 4.0;
    if (light.kind & LIGHT_KIND_MASK) == LIGHT_KIND_TRIANGLE {
        normal_area = cross(light.b - light.a, light.c - light.a) * 0.5;
    }
    return light_normal_area(normal_area, instance);
}

// #if SOLID_ANGLES
// A rectangle or triangle as a shading point sees it.
fn light_near(light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint) -> LightNearSurface {
    let is_parallelogram = (light.kind & LIGHT_KIND_MASK) == LIGHT_KIND_RECTANGLE;
    let start = select(light.a, vec3(0.0), is_parallelogram);
    let edge_scale = select(1.0, 2.0, is_parallelogram);
    let u = light_linear(instance.to_world, (light.b - start) * edge_scale);
    let v = light_linear(instance.to_world, (light.c - start) * edge_scale);
    let to_corner = light_toward(light.a, instance, shading_point) - select(vec3(0.0), 0.5 * (u + v), is_parallelogram);
    return light_near_surface(to_corner, u, v, is_parallelogram);
}

// Whether a flat surface emits to the side of the shading point. Twin of `is_lit_side`.
fn light_is_lit_side(light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint) -> bool {
    let to_plane = light_toward(light.a, instance, shading_point);
    return (light.kind & LIGHT_TWO_SIDED) != 0u || dot(light_flat_normal_area(light, instance), to_plane) < 0.0;
}

// From a rectangle or triangle that is sampled by solid angle. Twin of `from_near_surface`.
fn light_from_near_surface(
    light: LightRecord, instance: LightInstance, near: LightNearSurface, shading_point: LightShadingPoint,
    u: vec2<f32>,
) -> LightIncident {
    let toward = light_sample_near_surface(near, u);
    let dist_sq = dot(toward, toward);
    if dist_sq < LIGHT_MIN_DIST_SQ || !light_is_lit_side(light, instance, shading_point) {
        return light_nothing();
    }
    let dist = sqrt(dist_sq);
    var radiance = light.emission;
    // #if RANGES
    radiance *= light_range_window(dist_sq, light.range);
    // #endif
    return light_arriving(shading_point, toward / dist, dist, radiance, 1.0 / near.solid_angle, false);
}
// #endif

// A unit vector perpendicular to a unit vector.
fn light_orthonormal(v: vec3<f32>) -> vec3<f32> {
    let sign = select(-1.0, 1.0, v.z >= 0.0);
    let a = -1.0 / (sign + v.z);
    return vec3(v.x * v.y * a, sign + v.y * v.y * a, -v.y);
}

fn light_from_sphere(
    light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint, u: vec2<f32>,
) -> LightIncident {
    let world_center = light_toward(light.a, instance, shading_point);
    let to_center = light_into_tree(instance, world_center);
    let radius = light.c.x;
    let dist_sq = dot(to_center, to_center);
    if dist_sq < LIGHT_TINY || radius * radius >= dist_sq {
        return light_nothing();
    }
    let to_center_length = sqrt(dist_sq);
    let sin_max_sq = radius * radius / dist_sq;
    let one_minus_cos_max = sin_max_sq / (1.0 + sqrt(1.0 - sin_max_sq));
    let one_minus_cos = u.x * one_minus_cos_max;
    let cosine = 1.0 - one_minus_cos;
    let sin_sq = clamp(one_minus_cos * (2.0 - one_minus_cos), 0.0, sin_max_sq);
    let axis = to_center / to_center_length;
    let side = light_orthonormal(axis);
    let phi = 0.5 * LIGHT_FOUR_PI * u.y;
    let around = side * cos(phi) + cross(axis, side) * sin(phi);
    var root = 0.0;
    if sin_max_sq > 0.0 {
        root = sqrt(max(1.0 - sin_sq / sin_max_sq, 0.0));
    }
    let hit = (to_center_length - radius) * (to_center_length + radius) / (to_center_length * cosine + radius * root);
    let solid_angle = 0.5 * LIGHT_FOUR_PI * one_minus_cos_max * light_volume_scale(instance);
    if hit <= 0.0 || solid_angle < LIGHT_TINY {
        return light_nothing();
    }
    let ray = light_linear(instance.to_world, axis * cosine + around * sqrt(sin_sq));
    var toward = ray * hit;
    var stretch = length(ray);
    if hit > LIGHT_CLOSE * to_center_length {
        let cos_normal = min(sin_sq / sqrt(sin_max_sq) + cosine * root, 1.0);
        let normal = around * sqrt(max(1.0 - cos_normal * cos_normal, 0.0)) - axis * cos_normal;
        toward = world_center + light_linear(instance.to_world, normal * radius);
        stretch = length(toward) / hit;
    }
    let world_dist_sq = dot(toward, toward);
    let cubed = stretch * stretch * stretch;
    if world_dist_sq < LIGHT_MIN_DIST_SQ || !light_is_density(cubed, solid_angle) {
        return light_nothing();
    }
    let dist = sqrt(world_dist_sq);
    var radiance = light.emission;
    // #if RANGES
    radiance *= light_range_window(world_dist_sq, light.range);
    // #endif
    return light_arriving(shading_point, toward / dist, dist, radiance, cubed / solid_angle, false);
}
// #endif

// Samples a point on a light. Twin of `sample_light`.
fn light_incident(
    light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint, random: vec2<f32>,
) -> LightIncident {
    // #if AREAS | SKY
    let u = vec2(light_clamp_unit(random.x), light_clamp_unit(random.y));
    // #endif
    // #if CONES | AREAS | DIRECTIONAL | SKY | PROFILES
    let kind = light.kind & LIGHT_KIND_MASK;
    // #endif
    // #if SKY
    if kind == LIGHT_KIND_SKY {
        return light_sky_incident(light, instance, shading_point, u);
    }
    // #endif
    // #if DIRECTIONAL
    if kind == LIGHT_KIND_DIRECTIONAL {
        return light_arriving(shading_point, -light.b, LIGHT_UNLIMITED_RANGE, light.emission, 1.0, true);
    }
    // #endif
    // #if CONES
    if kind == LIGHT_KIND_SPOT {
        return light_from_spot(light, instance, shading_point);
    }
    // #endif
    // #if PROFILES
    if kind == LIGHT_KIND_PROFILE {
        return light_from_profile(light, instance, shading_point);
    }
    // #endif
    // #if AREAS
    // #if SOLID_ANGLES
    if kind == LIGHT_KIND_RECTANGLE || kind == LIGHT_KIND_TRIANGLE {
        let near = light_near(light, instance, shading_point);
        if near.solid_angle > 0.0 {
            return light_from_near_surface(light, instance, near, shading_point, u);
        }
    }
    // #endif
    if kind == LIGHT_KIND_RECTANGLE {
        return light_from_rectangle(light, instance, shading_point, u);
    }
    if kind == LIGHT_KIND_TRIANGLE {
        return light_from_triangle(light, instance, shading_point, u);
    }
    if kind == LIGHT_KIND_SPHERE {
        return light_from_sphere(light, instance, shading_point, u);
    }
    // #endif
    return light_from_delta(light, light_toward(light.a, instance, shading_point), 1.0, shading_point);
}
