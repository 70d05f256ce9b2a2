// The sky: an instance whose lights are patches of a map, as far away from every shading point, and whose
// tree is a second root of the cut. Twin of src/sky and src/sampling/sky.rs, which explain it. Reads the
// buffers that sample.wgsl binds; binds nothing itself.

// #if SKY
// What marks the sky in shading points: see LightLocalShadingPoint.
const LIGHT_SKY_BITS: u32 = LIGHT_LEAF | LIGHT_SINGLE;

// Whether the world has a sky that a shading point sees. Twin of `LightSampler::sky_view`.
fn light_sees_sky(shading_point: LightShadingPoint) -> bool {
    var sees = light_params.sky != LIGHT_NO_INSTANCE;
    // #if MASKS
    if sees {
        sees = (light_instance(light_params.sky).mask & shading_point.mask) != 0u;
    }
    // #endif
    return sees;
}

// The root of its tree.
fn light_sky_root() -> LightPlace {
    return LightPlace(light_params.sky, light_node_base(light_params.sky));
}

// The map's columns and rows, the number of patches, and the bits of what stored radiances are multiplied by.
fn light_sky_head() -> vec4<u32> {
    return light_top[light_params.sky_map];
}

// A square of texels, 2^level wide. Twin of `Square`.
struct LightSquare {
    level: u32,
    at: vec2<u32>,
}

// Whether it holds a texel.
fn light_square_holds(square: LightSquare, texel: vec2<u32>) -> bool {
    return all((texel >> vec2(square.level)) == square.at);
}

// The square of a patch.
fn light_patch_square(patch_record: LightRecord) -> LightSquare {
    let words = vec3<u32>(patch_record.emission);
    return LightSquare(words.z - 1u, words.xy);
}

// The words of the four squares of a stored level below the square `at` of the level above it. Twin of
// `Levels::quad`.
fn light_sky_quad(stored: u32, at: vec2<u32>) -> vec4<u32> {
    let place = light_top[light_params.sky_map + 1u + stored];
    let block = (at.y / 2u) * place.y + at.x / 2u;
    return light_top[light_params.sky_map + place.x + 4u * block + 2u * (at.y % 2u) + at.x % 2u];
}

// Twin of `decode`.
fn light_shared_exponent(code: u32) -> vec3<f32> {
    let step = bitcast<f32>(((code >> 27u) + 103u) << 23u);
    return vec3<f32>(vec3(code, code >> 9u, code >> 18u) & vec3(511u)) * step;
}

// The radiance of a texel, in nits.
fn light_sky_texel(texel: vec2<u32>) -> vec3<f32> {
    let code = light_sky_quad(0u, texel / 2u)[2u * (texel.y % 2u) + texel.x % 2u];
    return light_shared_exponent(code) * bitcast<f32>(light_sky_head().w);
}

fn light_sky_luminance(radiance: vec3<f32>) -> f32 {
    return dot(radiance, vec3(0.2126, 0.7152, 0.0722));
}

// The lux of the four squares of a quad. Twin of `lux_of_quad`.
fn light_sky_quad_lux(stored: u32, at: vec2<u32>) -> vec4<f32> {
    let words = light_sky_quad(stored, at);
    if stored > 0u {
        return bitcast<vec4<f32>>(words);
    }
    // A table has the solid angles of rows: sines are not exact enough.
    let head = light_sky_head();
    let angles = bitcast<vec4<f32>>(light_top[light_params.sky_map + 1u + LIGHT_SKY_LEVELS + at.y / 2u]);
    let pair = select(angles.xy, angles.zw, at.y % 2u == 1u) * bitcast<f32>(head.w);
    var lux: vec4<f32>;
    for (var k = 0u; k < 4u; k++) {
        lux[k] = light_sky_luminance(light_shared_exponent(words[k])) * pair[k / 2u];
    }
    return lux;
}

// The lux of the four squares below a square. Twin of `Levels::children`.
fn light_sky_lux(square: LightSquare) -> vec4<f32> {
    let stored = (square.level - 1u) / 2u;
    if square.level % 2u == 1u {
        return light_sky_quad_lux(stored, square.at);
    }
    var lux: vec4<f32>;
    for (var k = 0u; k < 4u; k++) {
        let quad = light_sky_quad_lux(stored, 2u * square.at + vec2(k % 2u, k / 2u));
        lux[k] = (quad.x + quad.y) + (quad.z + quad.w);
    }
    return lux;
}

// Whether the second of two is chosen, as x, and the number stretched over the choice, as y. Twin of `choose`.
fn light_sky_choose(u: f32, first: f32, second: f32) -> vec2<f32> {
    let share = first / (first + second);
    let is_second = (u >= share || first <= 0.0) && second > 0.0;
    let stretched = select(u / share, (u - share) / (1.0 - share), is_second);
    return vec2(select(0.0, 1.0, is_second), clamp(stretched, 0.0, 1.0 - LIGHT_U_STEP));
}

// The direction of a column and a row, in fractions.
fn light_sky_direction(at: vec2<f32>) -> vec3<f32> {
    let size = vec2<f32>(light_sky_head().xy);
    let phi = 0.5 * LIGHT_FOUR_PI * (at.x / size.x - 0.5);
    let theta = 0.25 * LIGHT_FOUR_PI * at.y / size.y;
    return vec3(sin(theta) * cos(phi), cos(theta), sin(theta) * sin(phi));
}

// The row, in fractions, above which a part of a row's solid angle lies. Twin of `Levels::row_of`.
fn light_sky_row(row: u32, u: f32) -> f32 {
    let half_step = 0.125 * LIGHT_FOUR_PI / f32(light_sky_head().y);
    let sines = sin(half_step * vec2(f32(row), f32(row) + 1.0));
    let squares = sines * sines;
    let angle = 2.0 * asin(sqrt(clamp(squares.x + (squares.y - squares.x) * u, 0.0, 1.0)));
    return clamp(0.5 * angle / half_step, f32(row), f32(row) + 1.0);
}

// What arrives from a direction of the map. Twin of `arriving`.
fn light_sky_arriving(
    in_map: vec3<f32>, radiance: vec3<f32>, pdf: f32, instance: LightInstance, shading_point: LightShadingPoint,
) -> LightIncident {
    let along = light_linear(instance.to_world, in_map);
    let stretch = length(along);
    // A solid angle of the map becomes one of the world.
    let density = clamp(
        pdf * (stretch * stretch * stretch) / light_volume_scale(instance), LIGHT_MIN_PDF, LIGHT_MAX_DENSITY,
    );
    return light_arriving(shading_point, along / stretch, LIGHT_UNLIMITED_RANGE, radiance, density, false);
}

// Chooses a point of a patch. Twin of `Levels::sample`.
fn light_sky_incident(
    patch_record: LightRecord, instance: LightInstance, shading_point: LightShadingPoint, random: vec2<f32>,
) -> LightIncident {
    var u = random;
    var square = light_patch_square(patch_record);
    while square.level > 0u {
        let lux = light_sky_lux(square);
        let column = light_sky_choose(u.x, lux.x + lux.z, lux.y + lux.w);
        let pair = select(lux.xz, lux.yw, column.x > 0.0);
        let row = light_sky_choose(u.y, pair.x, pair.y);
        u = vec2(column.y, row.y);
        square = LightSquare(square.level - 1u, 2u * square.at + vec2(u32(column.x), u32(row.x)));
    }
    let radiance = light_sky_texel(square.at);
    let at = vec2(f32(square.at.x) + u.x, light_sky_row(square.at.y, u.y));
    let pdf = light_sky_luminance(radiance) / patch_record.a.x;
    return light_sky_arriving(light_sky_direction(at), radiance, pdf, instance, shading_point);
}

// The texel in a direction of the world. Twin of `Levels::texel_at`.
fn light_sky_texel_at(instance: LightInstance, toward: vec3<f32>) -> vec2<u32> {
    let size = light_sky_head().xy;
    let in_map = light_normalize_or_zero(light_into_tree(instance, toward));
    let around = atan2(in_map.z, in_map.x) / (0.5 * LIGHT_FOUR_PI) + 0.5;
    let down = atan2(length(in_map.xz), in_map.y) / (0.25 * LIGHT_FOUR_PI);
    let texel = vec2<u32>(max(vec2(around, down) * vec2<f32>(size), vec2(0.0)));
    return vec2(texel.x % size.x, min(texel.y, size.y - 1u));
}

// What arrives from a texel of a patch, in a direction of the world.
fn light_sky_from(
    patch_record: LightRecord, texel: vec2<u32>, instance: LightInstance, shading_point: LightShadingPoint,
    toward: vec3<f32>,
) -> LightIncident {
    let radiance = light_sky_texel(texel);
    let pdf = light_sky_luminance(radiance) / patch_record.a.x;
    return light_sky_arriving(
        light_normalize_or_zero(light_into_tree(instance, toward)), radiance, pdf, instance, shading_point,
    );
}

// The density of a direction, if that is of a patch. Twin of `LightSampler::sky_pdf`.
fn light_sky_pdf(
    patch_record: LightRecord, instance: LightInstance, shading_point: LightShadingPoint, toward: vec3<f32>,
) -> f32 {
    let texel = light_sky_texel_at(instance, toward);
    if !light_square_holds(light_patch_square(patch_record), texel) {
        return 0.0;
    }
    return light_sky_from(patch_record, texel, instance, shading_point, toward).pdf;
}

// The place of a texel in an order in which all texels of each square follow each other. Twin of `in_order`.
fn light_in_order(texel: vec2<u32>) -> u32 {
    var spread = texel;
    spread = (spread | (spread << vec2(8u))) & vec2(0x00ff00ffu);
    spread = (spread | (spread << vec2(4u))) & vec2(0x0f0f0f0fu);
    spread = (spread | (spread << vec2(2u))) & vec2(0x33333333u);
    spread = (spread | (spread << vec2(1u))) & vec2(0x55555555u);
    return spread.x | (spread.y << 1u);
}

// The patch that holds a texel; LIGHT_NO_INSTANCE where the sky is dark. Twin of `Sky::point`.
fn light_patch_of(instance: LightInstance, texel: vec2<u32>) -> u32 {
    let order = light_in_order(texel);
    // The last patch that does not begin after the texel.
    var first = 0u;
    var end = light_sky_head().z;
    while first + 1u < end {
        let middle = (first + end) / 2u;
        let square = light_patch_square(light_record(instance.light_base + middle));
        let is_after = light_in_order(square.at << vec2(square.level)) > order;
        first = select(middle, first, is_after);
        end = select(end, middle, is_after);
    }
    let holds = end != 0u && light_square_holds(light_patch_square(light_record(instance.light_base + first)), texel);
    return select(LIGHT_NO_INSTANCE, first, holds);
}

// #if PORTALS
// A quad of a portal's record. Twin of `portal_quads`.
fn light_portal_quad(portal: u32, quad: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(light_top[light_params.parts - 7u - 6u * portal + quad]);
}

// Whether a point is in the room of a portal.
fn light_is_in_room(portal: u32, position: vec3<f32>) -> bool {
    let at = vec4(position, 1.0);
    let in_room = vec3(
        dot(light_portal_quad(portal, 0u), at), dot(light_portal_quad(portal, 1u), at),
        dot(light_portal_quad(portal, 2u), at),
    );
    return all(abs(in_room) <= vec3(1.0));
}

// A bit for each portal of the rooms that a shading point is in, for nodes of the sky; 0 for others. Twin of
// `PortalsInSight::new`.
fn light_portals_in_sight(place: LightPlace, shading_point: LightShadingPoint) -> u32 {
    // Without a sky, both may be no instance.
    if place.instance != light_params.sky || place.instance == LIGHT_NO_INSTANCE {
        return 0u;
    }
    // #if SEGMENTS
    if light_is_segment(shading_point) {
        return 0u;
    }
    // #endif
    var seen = 0u;
    let count = light_top[light_params.parts - 1u].x;
    for (var portal = 0u; portal < count; portal++) {
        seen |= select(0u, 1u << portal, light_is_in_room(portal, shading_point.position));
    }
    return seen;
}

// The distance of a box's centre to a plane, positive in front, how far the box reaches along its normal, and the
// distance to the middle of the portal.
fn light_portal_side(
    in_world: vec3<f32>, depth: f32, instance: LightInstance, center: vec3<f32>, half_size: vec3<f32>,
) -> vec3<f32> {
    let normal = light_transposed(instance.to_world, in_world);
    let length_sq = dot(normal, normal);
    let inverse = select(0.0, inverseSqrt(length_sq), length_sq > 0.0);
    return vec3(
        dot(normal, center) * inverse, dot(abs(normal), half_size) * inverse,
        select(1.0, depth * inverse, length_sq > 0.0),
    );
}

// Twin of `share_between`.
fn light_share_between(a: vec3<f32>, b: vec3<f32>) -> f32 {
    let filled = min(a.x + LIGHT_FILLED_WIDTH * a.y, b.x + LIGHT_FILLED_WIDTH * b.y);
    let share = min(filled, a.z + b.z) / (LIGHT_FILLED_WIDTH * (a.y + b.y));
    return select(clamp(share, LIGHT_LEAST_SHARE, 1.0), 0.0, min(a.x + a.y, b.x + b.y) <= 0.0);
}

// The share of a child of the sky that is behind portals. Twin of `PortalsInSight::weigh`.
fn light_portal_share(
    portals: u32, head: vec4<u32>, packed: LightPackedChild, shading_point: LightShadingPoint,
) -> f32 {
    let half_step = light_half_steps(head.w);
    let low = light_low(packed);
    let high = light_high(packed);
    let center = bitcast<vec3<f32>>(head.xyz) + (high + low) * half_step;
    let half_size = (high - low) * half_step + LIGHT_PORTAL_SLACK;
    let instance = light_instance(light_params.sky);
    var share = 0.0;
    for (var rest = portals; rest != 0u; rest &= rest - 1u) {
        let portal = firstTrailingBit(rest);
        let to = light_portal_quad(portal, 3u).xyz - shading_point.position;
        let u = light_portal_quad(portal, 4u).xyz;
        let v = light_portal_quad(portal, 5u).xyz;
        let normal = cross(u, v);
        let volume = dot(normal, to);
        if abs(volume) <= LIGHT_IN_PLANE * length(normal) * length(to) {
            return 1.0;
        }
        let turn = select(1.0, -1.0, volume < 0.0);
        let depth = abs(volume) / length(to);
        let along_u = light_share_between(
            light_portal_side(turn * cross(to + u, v), depth, instance, center, half_size),
            light_portal_side(turn * cross(u - to, v), depth, instance, center, half_size),
        );
        let along_v = light_share_between(
            light_portal_side(turn * cross(-to - v, u), depth, instance, center, half_size),
            light_portal_side(turn * cross(to - v, u), depth, instance, center, half_size),
        );
        share += along_u * along_v;
    }
    return min(share, 1.0);
}
// #endif
// #endif
