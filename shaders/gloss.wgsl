// Reflection by a rough surface: a diffuse part and a GGX part, widened by the size of a cluster.
// Twin of src/shading/gloss.rs, which explains it and owns the constants. Binds nothing.

// #if GLOSSY
// How a shading point reflects. Twin of `LocalGloss`.
struct LightGloss {
    // Tangents of the world: one in the plane of the view and the normal, and one across.
    tangent: vec3<f32>,
    // 0 if the surface is matte.
    alpha: f32,
    bitangent: vec3<f32>,
    specular: f32,
    // The view along the tangent and along the normal.
    view: vec2<f32>,
    // What is reflected alike to all sides.
    flat_part: f32,
}

// Twin of `LocalGloss::of`; `normal` is a unit vector or zero, and `view` is limited.
fn light_gloss(normal: vec3<f32>, view: vec3<f32>, roughness: f32, specular: f32, diffuse: f32) -> LightGloss {
    var gloss: LightGloss;
    let view_sq = dot(view, view);
    let has_view = view_sq >= LIGHT_MIN_VIEW_SQ && view_sq <= LIGHT_MAX_VIEW_SQ;
    // NaN and infinity have all bits of the exponent.
    let exponents = bitcast<vec3<u32>>(vec3(roughness, specular, diffuse)) & vec3(LIGHT_INFINITY_BITS);
    let is_finite = all(exponents != vec3(LIGHT_INFINITY_BITS));
    if !has_view || !is_finite || specular < LIGHT_MIN_SPECULAR || all(normal == vec3(0.0)) {
        return gloss;
    }
    let unit_view = view / sqrt(view_sq);
    let cosine = dot(unit_view, normal);
    var across = unit_view - normal * cosine;
    let sine_sq = dot(across, across);
    gloss.view = vec2(sqrt(sine_sq), max(cosine, LIGHT_MIN_VIEW_COSINE));
    if sine_sq <= LIGHT_MIN_VIEW_SINE_SQ {
        // The view is along the normal: any two tangents do.
        gloss.view.x = 0.0;
        across = cross(normal, select(vec3(0.0, 0.0, 1.0), vec3(1.0, 0.0, 0.0), abs(normal.z) > 0.7));
    }
    gloss.tangent = normalize(across);
    gloss.bitangent = cross(normal, gloss.tangent);
    let rough = clamp(roughness, 0.0, 1.0);
    gloss.alpha = max(rough * rough, LIGHT_MIN_ALPHA);
    gloss.specular = min(specular, 1.0);
    let diffuse_part = clamp(diffuse, 0.0, 1.0);
    gloss.flat_part = diffuse_part + LIGHT_MIN_GLOSS * (diffuse_part + gloss.specular);
    return gloss;
}

struct LightReflected {
    // The mean of the BRDF, times pi.
    value: f32,
    doubt: f32,
}

// Twin of `LocalGloss::reflected`.
fn light_reflected(
    gloss: LightGloss, x: f32, y: f32, z: f32, spread: f32,
) -> LightReflected {
    let alpha_sq = gloss.alpha * gloss.alpha;
    let height = z + gloss.view.y;
    let inverse = 1.0 / height;
    let slope_x = (x + gloss.view.x) * inverse;
    let slope_y = y * inverse;
    let along_x = x - slope_x * z;
    let along_y = y - slope_y * z;
    let width = LIGHT_GLOSS_WIDTH * spread * (inverse * inverse);
    let xx = alpha_sq + width * (1.0 + slope_x * slope_x - along_x * along_x);
    let xy = width * (slope_x * slope_y - along_x * along_y);
    let yy = alpha_sq + width * (1.0 + slope_y * slope_y - along_y * along_y);
    let det = max(xx * yy - xy * xy, alpha_sq * alpha_sq);
    let square_x = slope_x * slope_x;
    let square_y = slope_y * slope_y;
    let outside = square_x * yy - 2.0 * (slope_x * slope_y) * xy + square_y * xx;
    let slope_sq = square_x + square_y;
    let area = 1.0 + slope_sq * (2.0 * alpha_sq / (xx + yy));
    let grazing = max(1.0 - 0.5 * height * sqrt(area), 0.0);
    let grazing_sq = grazing * grazing;
    let fresnel = gloss.specular + (1.0 - gloss.specular) * (grazing_sq * grazing_sq * grazing);
    let product = 2.0 * z * gloss.view.y;
    let shadowing = product + gloss.alpha * (height - product);
    let below = (det + outside) * (det + outside);
    let lobe = 0.5 * fresnel * (area * area) * (det * sqrt(det)) / (below * shadowing);
    let value = gloss.flat_part + lobe;
    return LightReflected(value, lobe / value * (width * (1.0 + area) * (1.0 / alpha_sq)));
}

// Twin of `LocalGloss::toward`; 1 for a matte surface.
fn light_reflectance(gloss: LightGloss, direction: vec3<f32>, cosine: f32) -> f32 {
    if gloss.alpha <= 0.0 {
        return 1.0;
    }
    let x = dot(gloss.tangent, direction);
    let y = dot(gloss.bitangent, direction);
    return light_reflected(gloss, x, y, cosine, 0.0).value;
}
// #endif
