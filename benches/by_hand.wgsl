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

// 160 bytes.
struct Node {
    origin: vec3<f32>,
    steps: u32,
    targets: array<vec4<u32>, 2>,
    flux: vec4<u32>,
    // Minimum corners, maximum corners and means, each along x, then y, then z, for children 0 to 3
    // and 4 to 7; then the deviations.
    boxes: array<vec4<u32>, 5>,
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

const BLOCKS: u32 = LIGHT_MAX_SPLITS + 1u;

struct ShadingPoint {
    position: vec3<f32>,
    normal: vec3<f32>,
}

struct View {
    position: vec3<f32>,
    normal: vec3<f32>,
    has_normal: bool,
    margin: f32,
    // The bit of a target that marks a single light; 0 in the top level.
    light_bit: u32,
}

struct Dice {
    u: f32,
    state: u32,
}

struct Four {
    importance: vec4<f32>,
    doubt: vec4<f32>,
}

struct Estimate {
    importance: mat2x4<f32>,
    doubt: mat2x4<f32>,
    has_unresolved: bool,
}

struct Cut {
    count: u32,
    total: f32,
    has_unresolved: bool,
    instances: array<u32, BLOCKS>,
    nodes: array<u32, BLOCKS>,
    totals: array<f32, BLOCKS>,
    doubtful: array<u32, BLOCKS>,
    max_doubt: array<f32, BLOCKS>,
    values: array<mat2x4<f32>, BLOCKS>,
    doubts: array<mat2x4<f32>, BLOCKS>,
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

fn world_view(shading_point: ShadingPoint) -> View {
    let normal = unit_or_zero(shading_point.normal);
    return View(shading_point.position, normal, any(normal != vec3(0.0)), LIGHT_POSITION_MARGIN, 0u);
}

fn tree_view(instance: u32, shading_point: ShadingPoint) -> View {
    let rows = instances[instance].to_world;
    let p = shading_point.position - vec3(rows[0].w, rows[1].w, rows[2].w);
    let n = shading_point.normal;
    let normal = unit_or_zero(rows[0].xyz * n.x + rows[1].xyz * n.y + rows[2].xyz * n.z);
    return View(
        rows[0].xyz * p.x + rows[1].xyz * p.y + rows[2].xyz * p.z, normal, any(normal != vec3(0.0)),
        LIGHT_POSITION_MARGIN + LIGHT_RIGID_TOLERANCE, LIGHT_LEAF,
    );
}

fn view_in(instance: u32, shading_point: ShadingPoint) -> View {
    if instance == LIGHT_NO_INSTANCE {
        return world_view(shading_point);
    }
    return tree_view(instance, shading_point);
}

fn node_at(in_top: bool, index: u32) -> Node {
    if in_top {
        return top[index];
    }
    return nodes[index];
}

fn target_of(in_top: bool, index: u32, slot: u32) -> u32 {
    if in_top {
        return top[index].targets[slot / 4u][slot % 4u];
    }
    return nodes[index].targets[slot / 4u][slot % 4u];
}

fn bytes(word: u32) -> vec4<f32> {
    return vec4<f32>((vec4(word) >> vec4(0u, 8u, 16u, 24u)) & vec4(0xffu));
}

fn halves(words: vec2<u32>) -> vec4<f32> {
    return bitcast<vec4<f32>>(vec4(words.x << 16u, words.x & 0xffff0000u, words.y << 16u, words.y & 0xffff0000u));
}

fn step_along(steps: u32, axis: u32) -> f32 {
    return bitcast<f32>(((steps >> (8u * axis)) & 0xffu) << 23u);
}

// The estimated illuminance of four children, and the error that each estimate may have.
fn estimate_four(
    low: vec3<u32>, high: vec3<u32>, mean: vec3<u32>, deviations: u32, fluxes: vec2<u32>, targets: vec4<u32>,
    origin: vec3<f32>, half_step: vec3<f32>, view: View, margin: f32, error_sq: f32,
) -> Four {
    let low_x = bytes(low.x);
    let low_y = bytes(low.y);
    let low_z = bytes(low.z);
    let high_x = bytes(high.x);
    let high_y = bytes(high.y);
    let high_z = bytes(high.z);
    let width_x = high_x - low_x;
    let width_y = high_y - low_y;
    let width_z = high_z - low_z;
    let half_x = width_x * half_step.x;
    let half_y = width_y * half_step.y;
    let half_z = width_z * half_step.z;
    let x = origin.x + (low_x + width_x * (bytes(mean.x) * (1.0 / LIGHT_STEPS))) * (2.0 * half_step.x);
    let y = origin.y + (low_y + width_y * (bytes(mean.y) * (1.0 / LIGHT_STEPS))) * (2.0 * half_step.y);
    let z = origin.z + (low_z + width_z * (bytes(mean.z) * (1.0 / LIGHT_STEPS))) * (2.0 * half_step.z);
    let radius_sq = half_x * half_x + half_y * half_y + half_z * half_z;
    let deviation = bytes(deviations) * (1.0 / LIGHT_STEPS);
    let variance = deviation * deviation * radius_sq;
    let flux = halves(fluxes);

    let n = view.normal;
    let center_x = origin.x + (high_x + low_x) * half_step.x;
    let center_y = origin.y + (high_y + low_y) * half_step.y;
    let center_z = origin.z + (high_z + low_z) * half_step.z;
    let out_x = max(abs(center_x) - (half_x + margin), vec4(0.0));
    let out_y = max(abs(center_y) - (half_y + margin), vec4(0.0));
    let out_z = max(abs(center_z) - (half_z + margin), vec4(0.0));
    let gap_sq = out_x * out_x + out_y * out_y + out_z * out_z;
    let dist_sq = max(x * x + y * y + z * z, vec4(LIGHT_MIN_IMPORTANCE));
    let dist = sqrt(dist_sq);
    let spread = variance / (dist_sq + variance);
    let mean_sq = dist_sq + LIGHT_VARIANCE_SHARE * variance;
    let nearer = mean_sq / max(gap_sq + LIGHT_NEAR_VARIANCE * variance, LIGHT_MIN_GAP * mean_sq);
    let is_light = (targets & vec4(view.light_bit)) != vec4(0u);
    let doubt = select(spread * nearer, vec4(0.0), is_light);
    let along = n.x * x + n.y * y + n.z * z;
    let across_sq = (n.x * half_x) * (n.x * half_x) + (n.y * half_y) * (n.y * half_y) + (n.z * half_z) * (n.z * half_z);
    let normal_variance = min(3.0 * (deviation * deviation) * across_sq, variance);
    let width_sq = LIGHT_COSINE_WIDTH_SQ * normal_variance * (1.0 - spread);
    let rounded = 0.5 * (along + sqrt(along * along + width_sq));
    let steep = abs(n);
    let highest = (n.x * center_x + steep.x * half_x)
        + (n.y * center_y + steep.y * half_y)
        + (n.z * center_z + steep.z * half_z);
    let limited = min(rounded, max(along, vec4(0.0)) + LIGHT_HORIZON_SHARE * highest);
    let cosine = select(dist, max(limited, LIGHT_MIN_COSINE * dist), view.has_normal);
    let lux = (flux * (1.0 / LIGHT_FOUR_PI) * (1.0 + LIGHT_NEAR_GAIN * doubt)) * (cosine / dist / mean_sq);
    let at_least_min = select(vec4(LIGHT_MIN_IMPORTANCE), lux, lux > vec4(LIGHT_MIN_IMPORTANCE));

    // A child that lies wholly below the horizon sends nothing.
    let is_dark = vec4(view.has_normal) & (highest + margin * (steep.x + steep.y + steep.z) <= vec4(0.0));
    let is_lit = (flux > vec4(0.0)) & !is_dark;
    let importance = min(at_least_min, vec4(LIGHT_MAX_IMPORTANCE));
    let is_unresolved = dist_sq + variance <= LIGHT_MEAN_ERROR_SQ * radius_sq + error_sq;
    return Four(select(vec4(0.0), select(importance, -importance, is_unresolved), is_lit), doubt);
}

fn sum(v: mat2x4<f32>) -> f32 {
    return ((v[1].w + v[1].z) + (v[1].y + v[1].x)) + ((v[0].w + v[0].z) + (v[0].y + v[0].x));
}

fn estimate(node: Node, view: View) -> Estimate {
    let origin = node.origin - view.position;
    let half_step = 0.5 * vec3(step_along(node.steps, 0u), step_along(node.steps, 1u), step_along(node.steps, 2u));
    let far = abs(node.origin) + 2.0 * LIGHT_STEPS * half_step + abs(view.position);
    let margin = (far.x + far.y + far.z) * view.margin;
    let own = abs(view.position);
    let error = LIGHT_POSITION_ERROR * (own.x + own.y + own.z) + LIGHT_MIN_POSITION_ERROR;
    let error_sq = (2.0 * 3.0) * (error * error);
    let b = node.boxes;
    let first = estimate_four(
        vec3(b[0].x, b[0].z, b[1].x), vec3(b[1].z, b[2].x, b[2].z), vec3(b[3].x, b[3].z, b[4].x), b[4].z,
        node.flux.xy, node.targets[0], origin, half_step, view, margin, error_sq,
    );
    let last = estimate_four(
        vec3(b[0].y, b[0].w, b[1].y), vec3(b[1].w, b[2].y, b[2].w), vec3(b[3].y, b[3].w, b[4].y), b[4].w,
        node.flux.zw, node.targets[1], origin, half_step, view, margin, error_sq,
    );
    return Estimate(
        mat2x4(first.importance, last.importance), mat2x4(first.doubt, last.doubt),
        any(min(first.importance, last.importance) < vec4(0.0)),
    );
}

fn resolved_sum(v: mat2x4<f32>) -> f32 {
    return sum(mat2x4(max(v[0], vec4(0.0)), max(v[1], vec4(0.0))));
}

fn unresolved_sum(v: mat2x4<f32>) -> f32 {
    return resolved_sum(mat2x4(-v[0], -v[1]));
}

fn unresolved_scale(others: f32, unresolved: f32) -> f32 {
    return select(1.0, others / unresolved, others > 0.0 && unresolved > others);
}

fn scale_unresolved(v: mat2x4<f32>, scale: f32) -> mat2x4<f32> {
    let least = vec4(LIGHT_MIN_IMPORTANCE);
    return mat2x4(
        select(v[0], max(-v[0] * scale, least), v[0] < vec4(0.0)),
        select(v[1], max(-v[1] * scale, least), v[1] < vec4(0.0)),
    );
}

fn weights_of(estimated: Estimate) -> mat2x4<f32> {
    var weights = estimated.importance;
    if estimated.has_unresolved {
        weights = scale_unresolved(weights, unresolved_scale(resolved_sum(weights), unresolved_sum(weights)));
    }
    return weights;
}

fn total_block(cut: ptr<function, Cut>, block: u32) {
    (*cut).totals[block] = resolved_sum((*cut).values[block]);
    var slot = 0u;
    var greatest = 0u;
    for (var i = 0u; i < LIGHT_WIDTH; i++) {
        let doubt = bitcast<u32>((*cut).doubts[block][i / 4u][i % 4u]) & ~(LIGHT_WIDTH - 1u);
        if doubt > greatest {
            slot = i;
            greatest = doubt;
        }
    }
    (*cut).doubtful[block] = slot;
    (*cut).max_doubt[block] = bitcast<f32>(greatest);
}

fn add_block(cut: ptr<function, Cut>, instance: u32, index: u32, shading_point: ShadingPoint) {
    let in_top = instance == LIGHT_NO_INSTANCE;
    let node = node_at(in_top, index);
    let view = view_in(instance, shading_point);
    let estimated = estimate(node, view);
    let block = (*cut).count;
    (*cut).count = block + 1u;
    (*cut).instances[block] = instance;
    (*cut).nodes[block] = index;
    (*cut).values[block] = estimated.importance;
    var doubts = mat2x4(estimated.importance[0] * estimated.doubt[0], estimated.importance[1] * estimated.doubt[1]);
    if estimated.has_unresolved {
        (*cut).has_unresolved = true;
        let first = (node.targets[0] & vec4(view.light_bit)) == vec4(0u);
        let last = (node.targets[1] & vec4(view.light_bit)) == vec4(0u);
        let split_first = select(vec4(0.0), estimated.importance[0] * -LIGHT_UNRESOLVED_DOUBT, first);
        let split_last = select(vec4(0.0), estimated.importance[1] * -LIGHT_UNRESOLVED_DOUBT, last);
        doubts[0] = select(doubts[0], split_first, estimated.importance[0] < vec4(0.0));
        doubts[1] = select(doubts[1], split_last, estimated.importance[1] < vec4(0.0));
    }
    (*cut).doubts[block] = doubts;
    total_block(cut, block);
}

fn limit_unresolved(cut: ptr<function, Cut>) {
    var unresolved = 0.0;
    for (var i = 0u; i < (*cut).count; i++) {
        unresolved += unresolved_sum((*cut).values[i]);
    }
    let scale = unresolved_scale((*cut).total, unresolved);
    var total = 0.0;
    for (var i = 0u; i < (*cut).count; i++) {
        let weights = scale_unresolved((*cut).values[i], scale);
        (*cut).values[i] = weights;
        (*cut).totals[i] = sum(weights);
        total += (*cut).totals[i];
    }
    (*cut).total = total;
}

fn split_cut(cut: ptr<function, Cut>, shading_point: ShadingPoint) {
    let splits = min(params.splits, LIGHT_MAX_SPLITS);
    (*cut).count = 0u;
    (*cut).has_unresolved = false;
    var instance = LIGHT_NO_INSTANCE;
    var index = 0u;
    loop {
        add_block(cut, instance, index, shading_point);
        let count = (*cut).count;
        var total = 0.0;
        for (var i = 0u; i < count; i++) {
            total += (*cut).totals[i];
        }
        (*cut).total = total;
        var greatest = LIGHT_MIN_DOUBT * total;
        var block = count;
        for (var i = 0u; i < count; i++) {
            if (*cut).max_doubt[i] > greatest {
                greatest = (*cut).max_doubt[i];
                block = i;
            }
        }
        if block == count || count > splits {
            break;
        }
        instance = (*cut).instances[block];
        let slot = (*cut).doubtful[block];
        let bits = target_of(instance == LIGHT_NO_INSTANCE, (*cut).nodes[block], slot);
        if (bits & LIGHT_LEAF) != 0u {
            instance = bits & ~LIGHT_LEAF;
            index = instances[instance].node_base;
        } else if instance == LIGHT_NO_INSTANCE {
            index = bits;
        } else {
            index = instances[instance].node_base + bits;
        }
        (*cut).values[block][slot / 4u][slot % 4u] = 0.0;
        (*cut).doubts[block][slot / 4u][slot % 4u] = 0.0;
        total_block(cut, block);
    }
    if (*cut).has_unresolved {
        limit_unresolved(cut);
    }
}

fn pick_lane(all: mat2x4<f32>, start: f32, point: f32) -> Lane {
    var values = all;
    var before = start;
    var chosen = Lane(0u, start, 0.0);
    for (var slot = 0u; slot < LIGHT_WIDTH; slot++) {
        let value = values[slot / 4u][slot % 4u];
        if value > 0.0 && point >= before {
            chosen = Lane(slot, before, value);
        }
        before += value;
    }
    return chosen;
}

fn descend(cut: ptr<function, Cut>, shading_point: ShadingPoint, u: vec2<f32>) -> Pick {
    let total = (*cut).total;
    if total <= 0.0 {
        return Pick(0u, 0u, 0.0);
    }
    var outer = new_dice(u.x, u.y);
    var inner = new_dice(u.y, u.x);
    let cut_point = outer.u * total;
    var before = 0.0;
    var block = 0u;
    var block_before = 0.0;
    for (var i = 0u; i < (*cut).count; i++) {
        if (*cut).totals[i] > 0.0 && cut_point >= before {
            block = i;
            block_before = before;
        }
        before += (*cut).totals[i];
    }
    let first = pick_lane((*cut).values[block], block_before, cut_point);
    var pmf = share(first.value, total);
    outer = stretch(outer, (cut_point - first.before) / total, pmf);
    var instance = (*cut).instances[block];
    var index = (*cut).nodes[block];
    var slot = first.slot;
    var base = 0u;
    if instance != LIGHT_NO_INSTANCE {
        base = instances[instance].node_base;
    }
    var view = view_in(instance, shading_point);
    var pick = Pick(0u, 0u, 0.0);
    loop {
        let bits = target_of(instance == LIGHT_NO_INSTANCE, index, slot);
        if (bits & LIGHT_LEAF) == 0u {
            index = base + bits;
        } else if instance == LIGHT_NO_INSTANCE {
            instance = bits & ~LIGHT_LEAF;
            base = instances[instance].node_base;
            view = tree_view(instance, shading_point);
            index = base;
        } else {
            pick = Pick(instance, bits & ~LIGHT_LEAF, pmf);
            break;
        }
        let in_top = instance == LIGHT_NO_INSTANCE;
        let weights = weights_of(estimate(node_at(in_top, index), view));
        let total = sum(weights);
        if total <= 0.0 {
            break;
        }
        let point = select(inner.u, outer.u, in_top) * total;
        let lane = pick_lane(weights, 0.0, point);
        let chance = share(lane.value, total);
        pmf = joint(pmf, chance);
        let offset = (point - lane.before) / total;
        if in_top {
            outer = stretch(outer, offset, chance);
        } else {
            inner = stretch(inner, offset, chance);
        }
        slot = lane.slot;
    }
    return pick;
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
    var cut: Cut;
    split_cut(&cut, shading_point);
    let pick = descend(&cut, shading_point, u.xy);
    if pick.pmf <= 0.0 {
        samples[i] = Sample(vec3(0.0), 0.0, vec3(0.0), 0.0, 0.0, 0u, 0u, 0u);
        return;
    }
    samples[i] = sample_point(pick, shading_point);
}
