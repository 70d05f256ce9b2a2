// The point of a segment at which the light of a chosen light is gathered. Twin of
// src/sampling/equiangular.rs and src/sampling/along.rs, which explain it. Reads the buffers that
// sample.wgsl binds.

// #if SEGMENTS
// The distance in metres from the start of a segment to the point at which the light of a sample
// arrives: of the last sample of a segment that this invocation took. The fields of the sample are as
// seen from there, and its pdf is multiplied by the density per metre of this distance. A variable,
// because samples have the same record for all effects.
var<private> light_along: f32;

// A distance from the start of a segment in metres, and its density per metre. The density is 0 if
// the light reaches no point of the segment.
struct LightAlong {
    along: f32,
    pdf: f32,
}

// The part of a segment that a light may reach. Twin of `Stretch`.
struct LightStretch {
    // Where the stretch starts, from the start of the segment.
    start: f32,
    // 0 if the light reaches no point of the segment.
    extent: f32,
    // Where it starts, relative to the foot.
    a: f32,
    // 0 for a directional light, which reaches all points alike.
    soft: f32,
    angle: f32,
}

// A light as a segment sees it. Twin of `Source`.
struct LightSource {
    // From the middle of the segment to the centre.
    toward: vec3<f32>,
    variance: f32,
    radius: f32,
    // The unit axis and the cosine of the half-angle of a cone that contains all emission; -1 if
    // there is none.
    axis: vec3<f32>,
    cos: f32,
}

// A source of three offsets from its centre.
fn light_source_of(toward: vec3<f32>, offsets: mat3x3<f32>, weight: f32) -> LightSource {
    let squares = vec3(dot(offsets[0], offsets[0]), dot(offsets[1], offsets[1]), dot(offsets[2], offsets[2]));
    let radius = sqrt(squares.x) + sqrt(squares.y) + sqrt(squares.z);
    return LightSource(toward, weight * (squares.x + squares.y + squares.z), radius, vec3(0.0), -1.0);
}

fn light_source(light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint) -> LightSource {
    // #if CONES | AREAS
    let kind = light.kind & LIGHT_KIND_MASK;
    // #endif
    // #if AREAS
    if kind == LIGHT_KIND_RECTANGLE || kind == LIGHT_KIND_TRIANGLE {
        var center = light.a;
        var offsets = mat3x3(light.b, light.c, vec3(0.0));
        if kind == LIGHT_KIND_TRIANGLE {
            center = (light.a + light.b + light.c) * (1.0 / 3.0);
            offsets = mat3x3(light.a - center, light.b - center, light.c - center);
        }
        let carried = mat3x3(
            light_linear(instance.to_world, offsets[0]), light_linear(instance.to_world, offsets[1]),
            light_linear(instance.to_world, offsets[2]),
        );
        let weight = select(1.0 / 3.0, 1.0 / 12.0, kind == LIGHT_KIND_TRIANGLE);
        var source = light_source_of(light_toward(center, instance, shading_point), carried, weight);
        if (light.kind & LIGHT_TWO_SIDED) == 0u {
            source.axis = light_normalize_or_zero(light_flat_normal_area(light, instance));
            source.cos = 0.0;
        }
        return source;
    }
    if kind == LIGHT_KIND_SPHERE {
        let rows = instance.to_world;
        let columns = mat3x3(
            vec3(rows[0].x, rows[1].x, rows[2].x), vec3(rows[0].y, rows[1].y, rows[2].y),
            vec3(rows[0].z, rows[1].z, rows[2].z),
        );
        return light_source_of(light_toward(light.a, instance, shading_point), columns * light.c.x, 1.0 / 3.0);
    }
    // #endif
    var source = light_source_of(light_toward(light.a, instance, shading_point), mat3x3<f32>(), 0.0);
    // #if CONES
    if kind == LIGHT_KIND_SPOT {
        source.axis = light_normalize_or_zero(light_linear(instance.to_world, light.b));
        source.cos = -light.c.y / light.c.x;
    }
    // #endif
    return source;
}

// #if CONES | AREAS
// The place of an angle at the centre, `line` metres from the line. Infinity is a large number.
fn light_cone_place(angle: f32, line: f32) -> f32 {
    let limit = 0.125 * LIGHT_FOUR_PI;
    if abs(angle) >= limit {
        return select(LIGHT_UNLIMITED_RANGE, -LIGHT_UNLIMITED_RANGE, angle < 0.0);
    }
    return line * tan(angle);
}
// #endif

// Twin of `Stretch::of`.
fn light_stretch(light: LightRecord, instance: LightInstance, shading_point: LightShadingPoint) -> LightStretch {
    let segment = light_local_segment(shading_point.segment);
    // #if DIRECTIONAL
    if (light.kind & LIGHT_KIND_MASK) == LIGHT_KIND_DIRECTIONAL {
        return LightStretch(0.0, 2.0 * segment.w, 0.0, 0.0, 0.0);
    }
    // #endif
    // #if SKY
    if (light.kind & LIGHT_KIND_MASK) == LIGHT_KIND_SKY {
        return LightStretch(0.0, 2.0 * segment.w, 0.0, 0.0, 0.0);
    }
    // #endif
    let source = light_source(light, instance, shading_point);
    let unit = segment.xyz;
    let foot = dot(unit, source.toward);
    let across = source.toward - unit * foot;
    let line_sq = dot(across, across);
    var a = -segment.w - foot;
    var b = segment.w - foot;
    // #if RANGES
    if light.range < LIGHT_UNLIMITED_RANGE {
        let reach = (light.range + source.radius) * (1.0 + LIGHT_RANGE_SLACK);
        let most = sqrt(max(reach * reach - line_sq, 0.0));
        a = max(a, -most);
        b = min(b, most);
    }
    // #endif
    // #if CONES | AREAS
    let line = sqrt(line_sq);
    if source.cos >= 0.0 && line > 0.0 {
        let tilted = vec2(dot(source.axis, unit * foot - source.toward), dot(source.axis, unit) * line);
        let tilt = length(tilted);
        let own = abs(shading_point.position);
        let reach = own.x + own.y + own.z + dot(abs(unit), vec3(1.0)) * segment.w + abs(foot);
        let slack = LIGHT_CONE_SLACK + LIGHT_CONE_MARGIN * reach / line;
        if slack < 0.125 * LIGHT_FOUR_PI && tilt > 0.0 {
            let turn = atan2(tilted.y, tilted.x);
            let width = acos(min(source.cos * line / tilt, 1.0)) + slack;
            a = max(a, light_cone_place(turn - width, line));
            b = min(b, light_cone_place(turn + width, line));
        }
    }
    // #endif
    let whole = 2.0 * segment.w;
    if !(b > a) {
        return LightStretch(0.0, 0.0, 0.0, 0.0, 0.0);
    }
    let start = select(0.0, clamp(a + (segment.w + foot), 0.0, whole), a > -segment.w - foot);
    let end = select(whole, clamp(b + (segment.w + foot), start, whole), b < segment.w - foot);
    let soft = max(sqrt(line_sq + source.variance), LIGHT_MIN_LINE_SHARE * max(abs(a), abs(b)));
    let length = end - start;
    return LightStretch(start, length, a, soft, atan2(length * soft, soft * soft + a * (a + length)));
}

// Twin of `Stretch::density`.
fn light_stretch_density(stretch: LightStretch, place: f32) -> f32 {
    if stretch.soft > 0.0 {
        return stretch.soft / (stretch.soft * stretch.soft + place * place) / stretch.angle;
    }
    return 1.0 / stretch.extent;
}

// Twin of `Stretch::sample`.
fn light_stretch_sample(stretch: LightStretch, u: f32) -> LightAlong {
    let length = stretch.extent;
    if !(length > 0.0) {
        return LightAlong(0.0, 0.0);
    }
    var from_a = u * length;
    if stretch.soft > 0.0 {
        let sine = sin(u * stretch.angle);
        let cosine = cos(u * stretch.angle);
        let scaled = sine * (stretch.soft * stretch.soft + stretch.a * stretch.a);
        from_a = clamp(scaled / (stretch.soft * cosine - stretch.a * sine), 0.0, length);
    }
    let place = stretch.a + from_a;
    return LightAlong(stretch.start + from_a, light_stretch_density(stretch, place));
}

// The stretch of a light that is there, which may be directional.
fn light_stretch_of(shading_point: LightShadingPoint, instance: u32, light: u32) -> LightStretch {
    var slot = instance;
    // #if DIRECTIONAL
    slot = select(slot, 0u, instance == LIGHT_DIRECTIONAL);
    // #endif
    let placed = light_instance(slot);
    var base = placed.light_base;
    // #if DIRECTIONAL
    base = select(base, light_params.directional_base, instance == LIGHT_DIRECTIONAL);
    // #endif
    return light_stretch(light_record(base + light), placed, shading_point);
}

// Chooses the distance along a segment at which the light of a given light is gathered. `u` in
// [0, 1). At 0 with the density 1 for a shading point without a segment; with the density 0 for a light that is
// not there.
fn light_sample_along(shading_point: LightShadingPoint, instance: u32, light: u32, u: f32) -> LightAlong {
    if !light_is_segment(shading_point) {
        return LightAlong(0.0, 1.0);
    }
    if light_find_any(instance, light) == LIGHT_NO_LIGHT {
        return LightAlong(0.0, 0.0);
    }
    return light_stretch_sample(light_stretch_of(shading_point, instance, light), light_clamp_unit(u));
}

// The density per metre with which light_sample_along chooses a distance.
fn light_along_pdf(shading_point: LightShadingPoint, instance: u32, light: u32, along: f32) -> f32 {
    if !light_is_segment(shading_point) {
        return 1.0;
    }
    if light_find_any(instance, light) == LIGHT_NO_LIGHT {
        return 0.0;
    }
    let stretch = light_stretch_of(shading_point, instance, light);
    let from_a = light_limited(vec3(along)).x - stretch.start;
    if stretch.extent > 0.0 && from_a >= 0.0 && from_a <= stretch.extent {
        return light_stretch_density(stretch, stretch.a + from_a);
    }
    return 0.0;
}

// The point of a segment at a distance from its start.
fn light_point_along(shading_point: LightShadingPoint, along: f32) -> LightShadingPoint {
    let segment = light_local_segment(shading_point.segment);
    var seen_from = light_volume_point(shading_point.position + segment.xyz * (along - segment.w));
    // #if MASKS
    seen_from.mask = shading_point.mask;
    // #endif
    return seen_from;
}
// #endif
