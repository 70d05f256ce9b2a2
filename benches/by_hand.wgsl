// Chooses one light for each shading point of a buffer, in a world of points in rotated and
// translated instances. Does what shaders/batch.wgsl does in its variant without effects, but is
// written by hand for just that: without directives, and with the records as structs.
// benches/effects.rs puts the constants of that variant and shaders/request.wgsl before it, checks
// that both kernels give the same samples, and times one against the other.

struct Params {
    slots: u32,
    unused_a: u32,
    unused_b: u32,
    splits: u32,
}

// 160 bytes. Of each child the target; the minimum corner and the deviation; the maximum corner and
// the mean along x; the mean along y and z, and the flux.
struct Node {
    origin: vec3<f32>,
    steps: u32,
    children: array<vec4<u32>, 8>,
    parent: vec4<u32>,
}

// 32 bytes.
struct Point {
    position: vec3<f32>,
    kind: u32,
    intensity: vec3<f32>,
    place: u32,
}

// 80 bytes.
struct Instance {
    // Rows of the matrix; the fourth components are the translation.
    to_world: array<vec4<f32>, 3>,
    flags: u32,
    tree: u32,
    node_base: u32,
    light_base: u32,
    place: vec4<u32>,
}

struct Sample {
    direction: vec3<f32>,
    dist: f32,
    lux: vec3<f32>,
    pdf: f32,
    pmf: f32,
    instance: u32,
    light: u32,
    is_delta: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> top: array<Node>;
@group(0) @binding(2) var<storage, read> nodes: array<Node>;
@group(0) @binding(3) var<storage, read> instances: array<Instance>;
@group(0) @binding(4) var<storage, read> points: array<Point>;
@group(1) @binding(0) var<storage, read> requests: array<Request>;
@group(1) @binding(1) var<storage, read_write> samples: array<Sample>;

struct ShadingPoint {
    position: vec3<f32>,
    normal: vec3<f32>,
}

struct View {
    position: vec3<f32>,
    normal: vec3<f32>,
    margin: f32,
    // The bit of a target that marks a single light.
    light_bit: u32,
}

struct Dice {
    u: f32,
    state: u32,
}

struct Estimate {
    lux: f32,
    doubt: f32,
}

struct Eight {
    a: vec4<f32>,
    b: vec4<f32>,
}

struct Place {
    instance: u32,
    index: u32,
}

struct Cut {
    count: u32,
    links: vec2<u32>,
    sums: Eight,
    total: f32,
    unresolved: f32,
    unresolved_blocks: u32,
    keys_a: vec4<u32>,
    keys_b: vec4<u32>,
    lux: Eight,
}

struct Lane {
    slot: u32,
    before: f32,
    value: f32,
}

struct Pick {
    instance: u32,
    light: u32,
    pmf: f32,
}

fn hash(x: u32) -> u32 {
    let state = x * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

fn clamp_unit(u: f32) -> f32 {
    let bits = bitcast<u32>(u);
    return bitcast<f32>(select(0u, min(bits, LIGHT_ONE_MINUS_EPSILON_BITS), bits <= LIGHT_INFINITY_BITS));
}

fn limited(v: vec3<f32>) -> vec3<f32> {
    let bits = bitcast<vec3<u32>>(v);
    let magnitude = min(bits & vec3(0x7fffffffu), vec3(LIGHT_FARTHEST_BITS));
    return bitcast<vec3<f32>>((bits & vec3(0x80000000u)) | magnitude);
}

fn fresh(state: u32) -> f32 {
    return f32(state >> 8u) * LIGHT_U_STEP * LIGHT_U_STEP;
}

fn new_dice(u: f32, more: f32) -> Dice {
    let state = hash(bitcast<u32>(u) ^ hash(bitcast<u32>(more)));
    return Dice(clamp_unit(clamp_unit(u) + fresh(state)), state);
}

fn stretch(dice: Dice, offset: f32, length: f32) -> Dice {
    let state = hash(dice.state);
    return Dice(clamp_unit((offset + fresh(state)) / length), state);
}

fn joint(a: f32, b: f32) -> f32 {
    return select(0.0, max(a * b, LIGHT_MIN_PMF), a > 0.0 && b > 0.0);
}

fn share(value: f32, total: f32) -> f32 {
    return select(0.0, max(value / total, LIGHT_MIN_PMF), value > 0.0);
}

fn unit_or_zero(v: vec3<f32>) -> vec3<f32> {
    let length_sq = dot(v, v);
    if length_sq > 0.0 {
        return v / sqrt(length_sq);
    }
    return vec3(0.0);
}

fn view_in(instance: u32, shading_point: ShadingPoint) -> View {
    if instance == LIGHT_NO_INSTANCE {
        return View(
            shading_point.position, unit_or_zero(shading_point.normal), LIGHT_POSITION_MARGIN, LIGHT_SINGLE,
        );
    }
    let rows = instances[instance].to_world;
    let p = shading_point.position - vec3(rows[0].w, rows[1].w, rows[2].w);
    let n = shading_point.normal;
    return View(
        rows[0].xyz * p.x + rows[1].xyz * p.y + rows[2].xyz * p.z,
        unit_or_zero(rows[0].xyz * n.x + rows[1].xyz * n.y + rows[2].xyz * n.z),
        LIGHT_POSITION_MARGIN + LIGHT_RIGID_TOLERANCE, LIGHT_LEAF,
    );
}

fn child_at(place: Place, slot: u32) -> vec4<u32> {
    if place.instance == LIGHT_NO_INSTANCE {
        return top[place.index].children[slot];
    }
    return nodes[place.index].children[slot];
}

fn below(place: Place, slot: u32) -> Place {
    let bits = child_at(place, slot).x;
    var next = Place(place.instance, bits);
    if place.instance == LIGHT_NO_INSTANCE && (bits & LIGHT_LEAF) != 0u {
        next = Place(bits & ~LIGHT_LEAF, 0u);
    }
    if next.instance != LIGHT_NO_INSTANCE && (next.index & LIGHT_LEAF) == 0u {
        next.index += instances[next.instance].node_base;
    }
    return next;
}

fn link_of(links: vec2<u32>, block: u32) -> u32 {
    return extractBits(select(links.x, links.y, block > 4u), 6u * ((block - 1u) & 3u), 6u);
}

fn block_place(links: vec2<u32>, number: u32) -> Place {
    var slots = 0u;
    var depth = 0u;
    for (var block = number; block != 0u; block = link_of(links, block) >> 3u) {
        slots = (slots << 3u) | (link_of(links, block) & 7u);
        depth++;
    }
    var place = Place(LIGHT_NO_INSTANCE, 0u);
    for (; depth != 0u; depth--) {
        place = below(place, slots & 7u);
        slots >>= 3u;
    }
    return place;
}

fn opened(cut: ptr<function, Cut>, number: u32) -> u32 {
    var bits = 0u;
    for (var block = 1u; block < (*cut).count; block++) {
        let id = link_of((*cut).links, block);
        bits |= select(0u, 1u << (id & 7u), (id >> 3u) == number);
    }
    return bits;
}

fn byte_of(word: u32, i: u32) -> f32 {
    return f32((word >> (8u * i)) & 0xffu);
}

fn add_axes(v: vec3<f32>) -> f32 {
    return v.x + v.y + v.z;
}

fn half_steps(steps: u32) -> vec3<f32> {
    let bits = (vec3(steps) >> vec3(0u, 8u, 16u)) & vec3(0xffu);
    return 0.5 * bitcast<vec3<f32>>(bits << vec3(23u));
}

// The estimated illuminance of a child, and the error that the estimate may have.
fn estimate(child: vec4<u32>, view: View, origin: vec3<f32>, steps: u32, margin: f32) -> Estimate {
    let half_step = half_steps(steps);
    let low = vec3(byte_of(child.y, 0u), byte_of(child.y, 1u), byte_of(child.y, 2u));
    let high = vec3(byte_of(child.z, 0u), byte_of(child.z, 1u), byte_of(child.z, 2u));
    let mean = vec3(byte_of(child.z, 3u), byte_of(child.w, 0u), byte_of(child.w, 1u));
    let width = high - low;
    let half_size = width * half_step;
    let center = origin + (high + low) * half_step;
    let toward = origin + (low + width * (mean * (1.0 / LIGHT_STEPS))) * (2.0 * half_step);
    let outside = max(abs(center) - (half_size + margin), vec3(0.0));
    let n = view.normal;
    let has_normal = any(n != vec3(0.0));
    let half_along = n * half_size;
    let along = add_axes(n * toward);
    let highest = add_axes(n * center + abs(n) * half_size);
    let gap_sq = add_axes(outside * outside);
    let radius_sq = add_axes(half_size * half_size);
    let deviation = byte_of(child.y, 3u) * (1.0 / LIGHT_STEPS);
    let variance = deviation * deviation * radius_sq;
    let normal_variance = min(3.0 * (deviation * deviation) * add_axes(half_along * half_along), variance);
    let flux = bitcast<f32>(child.w & 0xffff0000u);
    let is_dark = has_normal && highest + margin * (abs(n.x) + abs(n.y) + abs(n.z)) <= 0.0;
    let error = LIGHT_POSITION_ERROR * add_axes(abs(view.position)) + LIGHT_MIN_POSITION_ERROR;
    let error_sq = LIGHT_MEAN_ERROR_SQ * radius_sq + (2.0 * 3.0) * (error * error);
    let is_unresolved = add_axes(toward * toward) + variance <= error_sq;

    let dist_sq = max(add_axes(toward * toward), LIGHT_MIN_IMPORTANCE);
    let dist = sqrt(dist_sq);
    let spread = variance / (dist_sq + variance);
    let mean_sq = dist_sq + LIGHT_VARIANCE_SHARE * variance;
    let nearer = mean_sq / max(gap_sq + LIGHT_NEAR_VARIANCE * variance, LIGHT_MIN_GAP * mean_sq);
    let doubt = select(spread * nearer, 0.0, (child.x & view.light_bit) != 0u);
    let width_sq = LIGHT_COSINE_WIDTH_SQ * normal_variance * (1.0 - spread);
    let rounded = 0.5 * (along + sqrt(along * along + width_sq));
    let limited = min(rounded, max(along, 0.0) + LIGHT_HORIZON_SHARE * highest);
    let cosine = select(dist, max(limited, LIGHT_MIN_COSINE * dist), has_normal);
    let lux = (flux * (1.0 / LIGHT_FOUR_PI) * (1.0 + LIGHT_NEAR_GAIN * doubt)) * (cosine * (1.0 / dist) / mean_sq);
    let at_least_min = select(LIGHT_MIN_IMPORTANCE, lux, lux > LIGHT_MIN_IMPORTANCE);
    let importance = min(at_least_min, LIGHT_MAX_IMPORTANCE);
    return Estimate(select(select(importance, -importance, is_unresolved), 0.0, is_dark), doubt);
}

fn sum(v: Eight) -> f32 {
    return ((v.b.w + v.b.z) + (v.b.y + v.b.x)) + ((v.a.w + v.a.z) + (v.a.y + v.a.x));
}

fn resolved_sum(v: Eight) -> f32 {
    return sum(Eight(max(v.a, vec4(0.0)), max(v.b, vec4(0.0))));
}

fn unresolved_scale(others: f32, unresolved: f32) -> f32 {
    return select(1.0, others / unresolved, others > 0.0 && unresolved > others);
}

fn scale_unresolved(v: Eight, scale: f32) -> Eight {
    let least = vec4(LIGHT_MIN_IMPORTANCE);
    return Eight(
        select(v.a, max(-v.a * scale, least), v.a < vec4(0.0)),
        select(v.b, max(-v.b * scale, least), v.b < vec4(0.0)),
    );
}

fn weights_of(v: Eight) -> Eight {
    if any(min(v.a, v.b) < vec4(0.0)) {
        return scale_unresolved(v, unresolved_scale(resolved_sum(v), resolved_sum(Eight(-v.a, -v.b))));
    }
    return v;
}

fn add_to_sum(cut: ptr<function, Cut>, block: u32, lux: f32) {
    if lux < 0.0 {
        (*cut).unresolved -= lux;
        (*cut).unresolved_blocks |= 1u << block;
        return;
    }
    (*cut).sums.a += select(vec4(0.0), vec4(lux), vec4(block) == vec4(0u, 1u, 2u, 3u));
    (*cut).sums.b += select(vec4(0.0), vec4(lux), vec4(block) == vec4(4u, 5u, 6u, 7u));
}

// Puts a child in its place among those that may be opened next, if it has any doubt.
fn add_pending(cut: ptr<function, Cut>, doubt: f32, id: u32, lux: f32) {
    var added = id;
    var added_lux = lux;
    let doubt_bits = bitcast<u32>(doubt) & ~63u;
    if doubt_bits != 0u {
        let key = doubt_bits | (63u - id);
        let ka = (*cut).keys_a;
        let kb = (*cut).keys_b;
        let la = (*cut).lux.a;
        let lb = (*cut).lux.b;
        let moves_a = vec4(key) > ka;
        let moves_b = vec4(key) > kb;
        let follows_a = vec4(false, moves_a.xyz);
        let follows_b = vec4(moves_a.w, moves_b.xyz);
        (*cut).keys_a = select(ka, select(vec4(key), vec4(key, ka.xyz), follows_a), moves_a);
        (*cut).keys_b = select(kb, select(vec4(key), vec4(ka.w, kb.xyz), follows_b), moves_b);
        (*cut).lux.a = select(la, select(vec4(lux), vec4(lux, la.xyz), follows_a), moves_a);
        (*cut).lux.b = select(lb, select(vec4(lux), vec4(la.w, lb.xyz), follows_b), moves_b);
        added = 63u - ((*cut).keys_b.w & 63u);
        added_lux = (*cut).lux.b.w;
        (*cut).keys_b.w = 0u;
        (*cut).lux.b.w = 0.0;
    }
    add_to_sum(cut, added >> 3u, added_lux);
}

fn shift_pending(cut: ptr<function, Cut>) {
    (*cut).keys_a = vec4((*cut).keys_a.yzw, (*cut).keys_b.x);
    (*cut).keys_b = vec4((*cut).keys_b.yzw, 0u);
    (*cut).lux.a = vec4((*cut).lux.a.yzw, (*cut).lux.b.x);
    (*cut).lux.b = vec4((*cut).lux.b.yzw, 0.0);
}

fn pass_lane(lane: ptr<function, Lane>, slot: u32, value: f32, before: f32, point: f32) -> f32 {
    if value > 0.0 && point >= before {
        *lane = Lane(slot, before, value);
    }
    return before + value;
}

fn pick_lane(all: Eight, start: f32, point: f32) -> Lane {
    var lane = Lane(0u, start, 0.0);
    var before = pass_lane(&lane, 0u, all.a.x, start, point);
    before = pass_lane(&lane, 1u, all.a.y, before, point);
    before = pass_lane(&lane, 2u, all.a.z, before, point);
    before = pass_lane(&lane, 3u, all.a.w, before, point);
    before = pass_lane(&lane, 4u, all.b.x, before, point);
    before = pass_lane(&lane, 5u, all.b.y, before, point);
    before = pass_lane(&lane, 6u, all.b.z, before, point);
    before = pass_lane(&lane, 7u, all.b.w, before, point);
    return lane;
}

// Estimates the children of a node: opens it, or returns the estimates.
fn weigh(cut: ptr<function, Cut>, place: Place, view: View, skipped: u32, is_opened: bool) -> Eight {
    var corner: vec3<f32>;
    var steps: u32;
    if place.instance == LIGHT_NO_INSTANCE {
        corner = top[place.index].origin;
        steps = top[place.index].steps;
    } else {
        corner = nodes[place.index].origin;
        steps = nodes[place.index].steps;
    }
    let farthest = abs(corner) + 2.0 * LIGHT_STEPS * half_steps(steps) + abs(view.position);
    let margin = add_axes(farthest) * view.margin;
    var lanes = Eight(vec4(0.0), vec4(0.0));
    for (var slot = 0u; slot < 8u; slot++) {
        let child = child_at(place, slot);
        if child.w < 0x10000u || (skipped & (1u << slot)) != 0u {
            continue;
        }
        let found = estimate(child, view, corner - view.position, steps, margin);
        if !is_opened {
            lanes.a = select(lanes.a, vec4(found.lux), vec4(slot) == vec4(0u, 1u, 2u, 3u));
            lanes.b = select(lanes.b, vec4(found.lux), vec4(slot) == vec4(4u, 5u, 6u, 7u));
        } else if found.lux != 0.0 {
            let is_light = (child.x & view.light_bit) != 0u;
            let unresolved = select(-found.lux * LIGHT_UNRESOLVED_DOUBT, 0.0, is_light);
            let doubt = select(found.lux * found.doubt, unresolved, found.lux < 0.0);
            add_pending(cut, doubt, (*cut).count * 8u + slot, found.lux);
        }
    }
    return lanes;
}

// Takes the next child to open from those that are pending, or ends.
fn open_next(cut: ptr<function, Cut>) -> bool {
    (*cut).count++;
    let count = (*cut).count;
    let total = sum((*cut).sums) + resolved_sum((*cut).lux);
    let key = (*cut).keys_a.x;
    if bitcast<f32>(key & ~63u) > LIGHT_MIN_DOUBT * total && count <= min(params.splits, LIGHT_MAX_SPLITS) {
        let link = (63u - (key & 63u)) << (6u * ((count - 1u) & 3u));
        (*cut).links |= select(vec2(link, 0u), vec2(0u, link), count > 4u);
        shift_pending(cut);
        return true;
    }
    while (*cut).keys_a.x != 0u {
        add_to_sum(cut, (63u - ((*cut).keys_a.x & 63u)) >> 3u, (*cut).lux.a.x);
        shift_pending(cut);
    }
    (*cut).total = sum((*cut).sums);
    return false;
}

fn make_cut(cut: ptr<function, Cut>, shading_point: ShadingPoint) {
    var view: View;
    var viewed = LIGHT_NO_INSTANCE;
    var block = 0u;
    var skipped = 0u;
    var is_opened = true;
    loop {
        let place = block_place((*cut).links, block);
        if block == 0u || place.instance != viewed {
            view = view_in(place.instance, shading_point);
            viewed = place.instance;
        }
        let lanes = weigh(cut, place, view, skipped, is_opened);
        if is_opened {
            if open_next(cut) {
                block = (*cut).count;
                continue;
            }
            (*cut).unresolved = unresolved_scale((*cut).total, (*cut).unresolved);
            is_opened = false;
        } else {
            let value = sum(scale_unresolved(lanes, (*cut).unresolved));
            (*cut).sums.a = select((*cut).sums.a, vec4(value), vec4(block) == vec4(0u, 1u, 2u, 3u));
            (*cut).sums.b = select((*cut).sums.b, vec4(value), vec4(block) == vec4(4u, 5u, 6u, 7u));
            (*cut).total = sum((*cut).sums);
            (*cut).unresolved_blocks &= ~(1u << block);
        }
        if (*cut).unresolved_blocks == 0u {
            break;
        }
        block = firstTrailingBit((*cut).unresolved_blocks);
        skipped = opened(cut, block);
    }
}

fn pick_light(shading_point: ShadingPoint, u: vec2<f32>) -> Pick {
    var cut: Cut;
    make_cut(&cut, shading_point);
    var total = cut.total;
    if total <= 0.0 {
        return Pick(0u, 0u, 0.0);
    }
    var outer = new_dice(u.x, u.y);
    var inner = new_dice(u.y, u.x);
    var pmf = 1.0;
    var point = outer.u * total;
    let chosen = pick_lane(cut.sums, 0.0, point);
    var start = chosen.before;
    var skipped = opened(&cut, chosen.slot);
    var place = block_place(cut.links, chosen.slot);
    var is_first = true;
    var view: View;
    var viewed = LIGHT_NO_INSTANCE;
    loop {
        if is_first || viewed != place.instance {
            view = view_in(place.instance, shading_point);
            viewed = place.instance;
        }
        let in_top = place.instance == LIGHT_NO_INSTANCE;
        var lanes = weigh(&cut, place, view, skipped, false);
        if is_first {
            lanes = scale_unresolved(lanes, cut.unresolved);
        } else {
            lanes = weights_of(lanes);
            total = sum(lanes);
            if total <= 0.0 {
                break;
            }
            start = 0.0;
            point = select(inner.u, outer.u, in_top) * total;
        }
        let lane = pick_lane(lanes, start, point);
        let chance = share(lane.value, total);
        pmf = joint(pmf, chance);
        let offset = (point - lane.before) / total;
        if in_top || is_first {
            outer = stretch(outer, offset, chance);
        } else {
            inner = stretch(inner, offset, chance);
        }
        place = below(place, lane.slot);
        if (place.index & LIGHT_LEAF) != 0u {
            return Pick(place.instance, place.index & ~LIGHT_LEAF, pmf);
        }
        is_first = false;
        skipped = 0u;
    }
    return Pick(0u, 0u, 0.0);
}

fn sample_point(pick: Pick, shading_point: ShadingPoint) -> Sample {
    let rows = instances[pick.instance].to_world;
    let point = points[instances[pick.instance].light_base + pick.light];
    let p = point.position;
    let toward = vec3(dot(rows[0].xyz, p), dot(rows[1].xyz, p), dot(rows[2].xyz, p))
        + (vec3(rows[0].w, rows[1].w, rows[2].w) - shading_point.position);
    let dist_sq = dot(toward, toward);
    let dist = sqrt(dist_sq);
    let direction = toward / dist;
    let lux = point.intensity * (1.0 / dist_sq);
    let above = all(shading_point.normal == vec3(0.0)) || dot(shading_point.normal, direction) > 0.0;
    if dist_sq < LIGHT_MIN_DIST_SQ || !above || all(lux == vec3(0.0)) {
        return Sample(vec3(0.0), 0.0, vec3(0.0), 0.0, 0.0, pick.instance, pick.light, 0u);
    }
    return Sample(direction, dist, lux, 1.0, pick.pmf, pick.instance, pick.light, 1u);
}

@compute @workgroup_size(64)
fn by_hand(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.x + id.y * groups.x * 64u;
    if i >= arrayLength(&requests) {
        return;
    }
    let shading_point = ShadingPoint(limited(requests[i].position), limited(requests[i].normal));
    let u = requests[i].u;
    let pick = pick_light(shading_point, u.xy);
    if pick.pmf <= 0.0 {
        samples[i] = Sample(vec3(0.0), 0.0, vec3(0.0), 0.0, 0.0, 0u, 0u, 0u);
        return;
    }
    samples[i] = sample_point(pick, shading_point);
}
