// Samples flat emitters uniformly by the solid angle that they subtend. Twin of
// src/math/solid_angle.rs, which explains it. Reads light_params; binds nothing itself.

// #if AREAS
// #if SOLID_ANGLES
// The determinant of the unit vectors to the corners of a triangle, and its solid angle in
// steradians; zeros if it is touched, seen from its edge or a sliver. `u` and `v` are the edges
// from `corner`. Twin of `SphericalTriangle::new`.
fn light_spherical_triangle(corner: vec3<f32>, u: vec3<f32>, v: vec3<f32>) -> vec2<f32> {
    let to_u = corner + u;
    let to_v = corner + v;
    let lengths = vec3(length(corner), length(to_u), length(to_v));
    if min(lengths.x, min(lengths.y, lengths.z)) < LIGHT_TINY {
        return vec2(0.0);
    }
    let direction = corner / lengths.x;
    let determinant = abs(dot(cross(u, v), direction)) / (lengths.y * lengths.z);
    // False for NaN.
    if determinant >= LIGHT_MIN_DETERMINANT && determinant <= LIGHT_MAX_DETERMINANT {
        let sum = direction + to_u / lengths.y + to_v / lengths.z;
        return vec2(determinant, 2.0 * atan2(determinant, 0.5 * (dot(sum, sum) - 1.0)));
    }
    return vec2(0.0);
}

// A flat emitter that is sampled by solid angle. Twin of `NearSurface`.
struct LightNearSurface {
    // A corner, and the edges from it.
    corner: vec3<f32>,
    u: vec3<f32>,
    v: vec3<f32>,
    // The determinants and solid angles of the triangle at the corner, and of the other half of a
    // parallelogram.
    first: vec2<f32>,
    second: vec2<f32>,
    // In steradians; 0 if the emitter is sampled by area.
    solid_angle: f32,
}

// `corner` is the vector from the shading point to a corner, `u` and `v` are the edges from there.
fn light_near_surface(corner: vec3<f32>, u: vec3<f32>, v: vec3<f32>, is_parallelogram: bool) -> LightNearSurface {
    var surface = LightNearSurface(corner, u, v, vec2(0.0), vec2(0.0), 0.0);
    let center = corner + (u + v) * select(1.0 / 3.0, 0.5, is_parallelogram);
    if light_params.solid_angles == 0u || dot(u, u) + dot(v, v) < LIGHT_NEAR_SIZE_SQ * dot(center, center) {
        return surface;
    }
    surface.first = light_spherical_triangle(corner, u, v);
    if is_parallelogram {
        surface.second = light_spherical_triangle(corner + u + v, -u, -v);
    }
    if surface.first.y > 0.0 && (surface.second.y > 0.0 || !is_parallelogram) {
        surface.solid_angle = surface.first.y + surface.second.y;
    }
    return surface;
}

// Twin of `share`. `part` and `all` are sines and cosines of half angles.
fn light_share(first: f32, last: f32, part: vec2<f32>, all: vec2<f32>) -> f32 {
    let before = first * part.x * part.y;
    let after = last * max(all.x * part.y - all.y * part.x, 0.0) * (all.y * part.y + all.x * part.x);
    if before > 0.0 {
        return before / (before + after);
    }
    return 0.0;
}

// The vector to a point of the emitter. Twin of `NearSurface::sample`.
fn light_sample_near_surface(surface: LightNearSurface, random: vec2<f32>) -> vec3<f32> {
    var corner = surface.corner;
    var u = surface.u;
    var v = surface.v;
    var triangle = surface.first;
    var at = random.x * surface.solid_angle;
    if at >= surface.first.y && surface.second.y > 0.0 {
        corner += u + v;
        u = -u;
        v = -v;
        triangle = surface.second;
        at -= surface.first.y;
    }
    let to_u = corner + u;
    let to_v = corner + v;
    let a_length = length(corner);
    let b_length = length(to_u);
    let c_length = length(to_v);
    let a = corner / a_length;
    let b = to_u / b_length;
    let c = to_v / c_length;
    var arc = 0.5 * vec2(length(a - c), length(a + c));
    let half_at = 0.5 * min(at, triangle.y);
    let at_sin = sin(half_at);
    let middle = a + b;
    let divided = vec2(
        at_sin * dot(middle, middle) * arc.x * arc.y,
        max(cos(half_at) * triangle.x - at_sin * (dot(b, c) - dot(a, b) * dot(a, c)), 0.0),
    );
    let opposite = corner + v * light_share(a_length, c_length, divided, arc);
    let opposite_length = length(opposite);
    let d = opposite / opposite_length;
    arc = vec2(min(0.5 * length(b - d), 1.0), 0.5 * length(b + d));
    let part = vec2(sqrt(random.y) * arc.x, sqrt(1.0 - random.y * arc.x * arc.x));
    return to_u + (opposite - to_u) * light_share(b_length, opposite_length, part, arc);
}
// #endif
// #endif
