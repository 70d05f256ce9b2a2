// The first light that a ray hits. Twin of src/sampling/hit.rs, which explains it. Reads the buffers that
// sample.wgsl binds.

// #if AREAS
// A ray in the space of a tree, or of the top level. Its parameter is the distance in the world.
struct LightRay {
    position: vec3<f32>,
    margin: f32,
    inverse: vec3<f32>,
}

fn light_ray(position: vec3<f32>, direction: vec3<f32>, margin: f32) -> LightRay {
    let size = max(abs(direction), vec3(LIGHT_MIN_DIRECTION));
    return LightRay(position, margin, 1.0 / select(size, -size, direction < vec3(0.0)));
}

// Whether a ray meets the box of a child before a distance. Twin of `Ray::meets`.
fn light_meets(ray: LightRay, head: vec4<u32>, packed: LightPackedChild, dist: f32) -> bool {
    let view = light_view_from(head, ray.position, ray.margin);
    let low = light_low(packed);
    let high = light_high(packed);
    let half_step = light_half_steps(view.steps);
    let center = view.origin + (high + low) * half_step;
    let half_size = (high - low) * half_step + view.margin;
    let one = (center - half_size) * ray.inverse;
    let other = (center + half_size) * ray.inverse;
    let nears = min(one, other);
    let fars = max(one, other);
    let near = max(max(nears.x, nears.y), max(nears.z, 0.0));
    let far = min(min(fars.x, fars.y), min(fars.z, dist));
    return light_has_flux(packed) && near <= far * LIGHT_BOX_ROUNDING;
}

// Where a ray meets the plane of a triangle or parallelogram: how far that is along both edges from the first
// corner, as x and y, and the distance. Twin of `flat_hit`.
fn light_flat_hit(
    light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint, direction: vec3<f32>,
) -> vec3<f32> {
    let is_parallelogram = (light.kind & LIGHT_KIND_MASK) == LIGHT_KIND_RECTANGLE;
    let to_corner = light_toward(light_flat_corner(light), instance, shading_point);
    let u = light_linear(instance.to_world, select(light.b - light.a, 2.0 * light.b, is_parallelogram));
    let v = light_linear(instance.to_world, select(light.c - light.a, 2.0 * light.c, is_parallelogram));
    let across = cross(direction, v);
    let determinant = dot(u, across);
    // Compilers may assume that no number is NaN.
    let inverse = select(0.0, 1.0 / determinant, determinant != 0.0);
    let around = cross(u, to_corner);
    return vec3(-dot(to_corner, across), dot(direction, around), dot(v, around)) * inverse;
}

fn light_flat_corner(light: LightRecord) -> vec3<f32> {
    let is_parallelogram = (light.kind & LIGHT_KIND_MASK) == LIGHT_KIND_RECTANGLE;
    return light.a - select(vec3(0.0), light.b + light.c, is_parallelogram);
}

// The distance at which a ray hits a light that shines toward the ray's origin, or a number that is not
// above 0.
fn light_hit_dist(
    light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint, direction: vec3<f32>,
) -> f32 {
    let kind = light.kind & LIGHT_KIND_MASK;
    if kind == LIGHT_KIND_SPHERE {
        let radius_sq = light.c.x * light.c.x;
        let to_center = light_into_tree(instance, light_toward(light.a, instance, shading_point));
        let local = light_into_tree(instance, direction);
        let length_sq = dot(local, local);
        let along = dot(to_center, local) / length_sq;
        let beside = to_center - local * along;
        let beside_sq = dot(beside, beside);
        let outside = dot(to_center, to_center) - radius_sq;
        let half_chord = sqrt(max(radius_sq - beside_sq, 0.0) / length_sq);
        let is_hit = outside > 0.0 && along > 0.0 && beside_sq <= radius_sq;
        return select(0.0, outside / (length_sq * (along + half_chord)), is_hit);
    }
    let is_parallelogram = kind == LIGHT_KIND_RECTANGLE;
    if !is_parallelogram && kind != LIGHT_KIND_TRIANGLE {
        return 0.0;
    }
    let hit = light_flat_hit(light, instance, shading_point, direction);
    let to_corner = light_toward(light_flat_corner(light), instance, shading_point);
    let is_lit =
        (light.kind & LIGHT_TWO_SIDED) != 0u || dot(light_flat_normal_area(light, instance), to_corner) < 0.0;
    let is_inside = hit.x >= 0.0 && hit.y >= 0.0 && select(hit.x + hit.y, max(hit.x, hit.y), is_parallelogram) <= 1.0;
    return select(0.0, hit.z, is_inside && is_lit);
}

// A light and its distance. `instance` is LIGHT_NO_INSTANCE if no light is hit.
struct LightFirstHit {
    instance: u32,
    light: u32,
    dist: f32,
}

// Twin of `first_hit`.
fn light_first_hit(shading_point: LightShadingPoint, direction: vec3<f32>, max_dist: f32) -> LightFirstHit {
    var found = LightFirstHit(LIGHT_NO_INSTANCE, 0u, max_dist);
    if light_params.slots == 0u {
        return found;
    }
    let in_world = light_ray(shading_point.position, direction, LIGHT_POSITION_MARGIN);
    var ray = in_world;
    var place = LightPlace(LIGHT_NO_INSTANCE, 0u);
    var slot = 0u;
    // The node at which a tree was entered, and the place in the top level where its part is.
    var entry = 0u;
    var part = 0u;
    loop {
        let in_top = place.instance == LIGHT_NO_INSTANCE;
        if slot == LIGHT_WIDTH {
            if place.index == entry {
                if in_top {
                    break;
                }
                place = LightPlace(LIGHT_NO_INSTANCE, part / LIGHT_WIDTH);
                slot = part % LIGHT_WIDTH + 1u;
                entry = 0u;
                ray = in_world;
                continue;
            }
            let up = light_parent(in_top, place.index);
            place.index = up / LIGHT_WIDTH;
            if !in_top {
                place.index += light_node_base(place.instance);
            }
            slot = up % LIGHT_WIDTH + 1u;
            continue;
        }
        let at = place.index * LIGHT_NODE_QUADS;
        let packed = light_packed_child(in_top, at, slot);
        slot++;
        if !light_meets(ray, light_quad(in_top, at), packed, found.dist) {
            continue;
        }
        let below = light_place_below(place, packed.child_bits);
        if below.instance == LIGHT_NO_INSTANCE {
            place = below;
            slot = 0u;
            continue;
        }
        let instance = light_instance(below.instance);
        // #if MASKS
        if (instance.mask & shading_point.mask) == 0u {
            continue;
        }
        // #endif
        if (below.index & LIGHT_LEAF) != 0u {
            let index = below.index & ~LIGHT_LEAF;
            let light = light_record(instance.light_base + index);
            let dist = light_hit_dist(light, instance, shading_point, direction);
            let dist_sq = dist * dist;
            var reaches = dist > 0.0 && dist < found.dist && dist_sq >= LIGHT_MIN_DIST_SQ;
            // #if RANGES
            reaches = reaches && light_range_window(dist_sq, light.range) > 0.0;
            // #endif
            // #if FACTORS
            // What a factor makes black hides nothing.
            let sent = light_factored(LightIncident(direction, dist, light.emission, 0.0, false), 0u, instance);
            reaches = reaches && any(sent.radiance != vec3(0.0));
            // #endif
            if reaches {
                found = LightFirstHit(below.instance, index, dist);
            }
            continue;
        }
        if in_top {
            part = place.index * LIGHT_WIDTH + slot - 1u;
            entry = below.index;
            let origin = light_into_tree(instance, shading_point.position - light_translation(instance.to_world));
            ray = light_ray(origin, light_into_tree(instance, direction), light_tree_margin(instance));
        }
        place = below;
        slot = 0u;
    }
    return found;
}
// #endif

// Returns the first light that a ray from a shading point hits, before `max_dist` metres: the sample that
// light_sample would have returned for this direction, a unit vector. Its radiance is 0 if there is none. A ray
// that hits nothing finds the sky if `max_dist` is 1e18 or more.
// Twin of `LightSampler::hit`.
fn light_hit(shading_point: LightShadingPoint, direction: vec3<f32>, max_dist: f32) -> LightSample {
    var hit = LightSample(vec3(0.0), 0.0, vec3(0.0), 0.0, 0.0, 0u, 0u, 0u);
    // #if AREAS | SKY
    // #if SEGMENTS
    if light_is_segment(shading_point) {
        return hit;
    }
    // #endif
    let ray = light_limited(direction);
    if any(shading_point.normal != vec3(0.0)) && dot(shading_point.normal, ray) <= 0.0 {
        return hit;
    }
    // #endif
    // #if AREAS | SKY
    var slot = LIGHT_NO_INSTANCE;
    var light = 0u;
    var incident = light_nothing();
    // #endif
    // #if AREAS
    let found = light_first_hit(shading_point, ray, max_dist);
    if found.instance != LIGHT_NO_INSTANCE {
        slot = found.instance;
        light = found.light;
        let instance = light_instance(slot);
        let record = light_record(instance.light_base + light);
        incident = LightIncident(ray, found.dist, record.emission, 0.0, false);
        incident.pdf = light_point_pdf(record, instance, shading_point, ray * found.dist);
        // #if RANGES
        incident.radiance *= light_range_window(found.dist * found.dist, record.range);
        // #endif
    }
    // #endif
    // #if SKY
    if slot == LIGHT_NO_INSTANCE && max_dist >= LIGHT_UNLIMITED_RANGE && light_sees_sky(shading_point) {
        let instance = light_instance(light_params.sky);
        let texel = light_sky_texel_at(instance, ray);
        light = light_patch_of(instance, texel);
        if light != LIGHT_NO_INSTANCE {
            slot = light_params.sky;
            incident = light_sky_from(light_record(instance.light_base + light), texel, instance, shading_point, ray);
        }
    }
    // #endif
    // #if AREAS | SKY
    if slot != LIGHT_NO_INSTANCE {
        // #if FACTORS
        incident = light_factored(incident, slot, light_instance(slot));
        // #endif
        let pmf = light_pmf(shading_point, slot, light);
        hit = LightSample(incident.direction, incident.dist, incident.radiance, incident.pdf, pmf, slot, light, 0u);
    }
    // #endif
    return hit;
}

// Where on a triangle or parallelogram the point of a sample or of a hit is: how far it is along both edges from the
// first corner, each from 0 to 1. 0 for other lights. Twin of `LightSampler::place_on_light`.
fn light_place_on(shading_point: LightShadingPoint, s: LightSample) -> vec2<f32> {
    var place = vec2(0.0);
    // #if AREAS
    let index = light_find(s.instance, s.light);
    if s.pmf > 0.0 && index != LIGHT_NO_LIGHT {
        let instance = light_instance(s.instance);
        let record = light_record(index);
        let kind = record.kind & LIGHT_KIND_MASK;
        let is_parallelogram = kind == LIGHT_KIND_RECTANGLE;
        if is_parallelogram || kind == LIGHT_KIND_TRIANGLE {
            // Rounding may lead a little beyond the edges.
            place = clamp(light_flat_hit(record, instance, shading_point, s.direction).xy, vec2(0.0), vec2(1.0));
            place -= select(0.5 * max(place.x + place.y - 1.0, 0.0), 0.0, is_parallelogram);
        }
    }
    // #endif
    return place;
}
