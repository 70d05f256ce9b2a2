// The cluster of a light as its record says. Twin of `Light::cluster`. Binds nothing; uses the variables
// `sources` and `lights` of the stage.

// A cluster, and what a refit knows of it besides. Twin of `RefitCluster` in src/plan/sources/records.rs.
struct RefitCluster {
    cluster: LightCluster,
    punctual_flux: f32,
    area_flux: f32,
    // The sums of `AttributeSums` in src/tree/attributes.rs, per lumen of the cluster.
    distance: f32,
    overlap: f32,
    variance: f32,
    cost: f32,
}

const REFIT_EMPTY = RefitCluster(CLUSTER_EMPTY, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);

// The half space in front of a flat emitter, as the normal; zero for all directions. Twin of `half_space`
// in src/light/mod.rs.
fn refit_normal(u: vec3<f32>, v: vec3<f32>) -> vec3<f32> {
    let normal = cross(u, v);
    let is_thin = dot(normal, normal) < REFIT_MIN_SINE * REFIT_MIN_SINE * dot(u, u) * dot(v, v);
    if is_thin || max(abs(normal.x), max(abs(normal.y), abs(normal.z))) < REFIT_MIN_CROSS {
        return vec3(0.0);
    }
    return normalize_or(normal, vec3(0.0));
}

// A light of a source.
fn refit_light(source: u32, light: u32) -> RefitCluster {
    let at = (sources[source].light_base + light) * LIGHT_RECORD_QUADS;
    let kind = lights[at].w;
    let a = bitcast<vec3<f32>>(lights[at].xyz);
    let emission = bitcast<vec3<f32>>(lights[at + 1u].xyz);
    let b = bitcast<vec3<f32>>(lights[at + 2u].xyz);
    let range = bitcast<f32>(lights[at + 2u].w);
    let c = bitcast<vec3<f32>>(lights[at + 3u].xyz);
    let mean_cosine = bitcast<f32>(lights[at + 3u].w);
    let luminance = dot(emission, vec3(0.2126, 0.7152, 0.0722));
    var found = REFIT_EMPTY;
    found.cluster.mean = a;
    found.cluster.box_min = a;
    found.cluster.box_max = a;
    found.cluster.cos_half_angle = -1.0;
    var flux = 4.0 * LIGHT_SOURCE_PI * luminance;
    var normal = vec3(0.0);
    switch kind & LIGHT_KIND_MASK {
        case LIGHT_KIND_SPOT: {
            flux = luminance * c.z;
            // As `Light::emission_cone`: a little wider than the spot, the more the narrower it is, for
            // the rounding of its cosine.
            let cos = clamp(-c.y / c.x - REFIT_COSINE_ERROR, -1.0, 1.0);
            let sin = sqrt(max(1.0 - cos * cos, 0.0));
            if mean_cosine > 0.0 && cos > -REFIT_COS_RIM {
                found.cluster.axis = normalize_or(b, vec3(0.0, 0.0, 1.0)) * mean_cosine;
                found.cluster.cos_half_angle = cos * REFIT_COS_RIM - sin * REFIT_SIN_RIM - CAP_PADDING;
            }
        }
        case LIGHT_KIND_RECTANGLE: {
            found.cluster.box_min = min(min(a - b - c, a - b + c), min(a + b - c, a + b + c));
            found.cluster.box_max = max(max(a - b - c, a - b + c), max(a + b - c, a + b + c));
            found.cluster.variance = (dot(b, b) + dot(c, c)) / 3.0;
            normal = refit_normal(b, c);
        }
        case LIGHT_KIND_TRIANGLE: {
            let mean = (a + b + c) / 3.0;
            found.cluster.mean = mean;
            found.cluster.box_min = min(a, min(b, c));
            found.cluster.box_max = max(a, max(b, c));
            found.cluster.variance = (dot(a - mean, a - mean) + dot(b - mean, b - mean) + dot(c - mean, c - mean)) / 12.0;
            normal = refit_normal(b - a, c - a);
        }
        case LIGHT_KIND_SPHERE: {
            found.cluster.box_min = a - c.x;
            found.cluster.box_max = a + c.x;
            found.cluster.variance = c.x * c.x;
        }
        default: {}
    }
    let has_size = (kind & LIGHT_KIND_MASK) != LIGHT_KIND_POINT && (kind & LIGHT_KIND_MASK) != LIGHT_KIND_SPOT;
    if has_size {
        flux = LIGHT_SOURCE_PI * luminance * light_emitting_area(kind, a, b, c);
        if (kind & LIGHT_TWO_SIDED) == 0u && any(normal != vec3(0.0)) {
            found.cluster.axis = normal * REFIT_LAMBERTIAN;
            found.cluster.cos_half_angle = REFIT_COS_RIGHT_ANGLE - CAP_PADDING;
        }
    }
    if all(emission <= vec3(0.0)) {
        let mean = found.cluster.mean;
        found = REFIT_EMPTY;
        found.cluster.mean = mean;
        return found;
    }
    // A light that emits keeps a flux.
    flux = clamp(flux, LIGHT_MIN_FLUX, LIGHT_MAX_FLUX);
    found.cluster.flux = flux;
    found.cluster.range = range;
    found.punctual_flux = select(flux, 0.0, has_size);
    found.area_flux = select(0.0, flux, has_size);
    return found;
}
