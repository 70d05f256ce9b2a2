// Top level, stage 2: the first planes of the order in space, as medians of a sample of the parts.
// Twin of `SpaceOrder::new` in src/tree/space_order.rs. One workgroup, whose invocations hold two samples each.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
@group(0) @binding(2) var<storage, read_write> bounds: array<u32, TOP_SPACE_WORDS>;

const PLANES_EACH: u32 = TOP_SAMPLES / TOP_SPLIT_LANES;

// The samples, those of a cell side by side: first as ordered coordinates, then as codes.
var<workgroup> planes_samples: array<vec3<u32>, TOP_SAMPLES>;
// For each cell and axis the ends of the middle half of its samples.
var<workgroup> planes_lows: array<u32, 3u * TOP_PLANES / 2u>;
var<workgroup> planes_highs: array<u32, 3u * TOP_PLANES / 2u>;
// The axis of each plane, and the bits of where it is.
var<workgroup> planes_found: array<vec2<u32>, TOP_PLANES>;

// The least level of the sample, and the number of parts of that level and above. Twin of `sample`.
fn planes_levels() -> vec2<u32> {
    var least = TOP_LEVELS;
    var count = 0u;
    while least > 0u {
        let more = count + bounds[8u + least - 1u];
        if more > TOP_SAMPLES || more - count > TOP_LEVEL_SAMPLES {
            break;
        }
        least--;
        count = more;
    }
    return vec2(least, count);
}

// The part that is a sample.
fn planes_part(least: u32, sample: u32) -> u32 {
    var level = least;
    var rest = sample;
    while rest >= bounds[8u + level] {
        rest -= bounds[8u + level];
        level++;
    }
    return bounds[TOP_LISTS_AT + level * TOP_LEVEL_SAMPLES + rest];
}

// Twin of `first_sample`.
fn planes_first(count: u32, cell: u32, level: u32) -> u32 {
    let pieces = (bounds[6] + TOP_SHARE - 1u) / TOP_SHARE;
    return ((cell * pieces) >> level) * count / max(pieces, 1u);
}

// For each axis the number of samples before a sample among those from `first` to `end`. Twin of
// `order`.
fn planes_ranks(sample: u32, first: u32, end: u32) -> vec3<u32> {
    let own = planes_samples[sample];
    var ranks = vec3(0u);
    for (var other = first; other < end; other++) {
        let at = planes_samples[other];
        let less = at < own;
        let equal = at == own;
        let after = (equal.yzx & equal.zxy & vec3(other < sample)) | less.yzx | (equal.yzx & less.zxy);
        ranks += select(vec3(0u), vec3(1u), less | (equal & after));
    }
    return ranks;
}

fn planes_low(cell: u32) -> vec3<u32> {
    return vec3(planes_lows[3u * cell], planes_lows[3u * cell + 1u], planes_lows[3u * cell + 2u]);
}

fn planes_high(cell: u32) -> vec3<u32> {
    return vec3(planes_highs[3u * cell], planes_highs[3u * cell + 1u], planes_highs[3u * cell + 2u]);
}

fn planes_unordered(ordered: vec3<u32>) -> vec3<f32> {
    return vec3(top_unordered(ordered.x), top_unordered(ordered.y), top_unordered(ordered.z));
}

@compute @workgroup_size(TOP_SPLIT_LANES)
fn top_planes(@builtin(local_invocation_index) lane: u32) {
    if lane < 3u {
        planes_lows[lane] = top_ordered(0.0);
        planes_highs[lane] = top_ordered(0.0);
    }
    if lane < TOP_PLANES {
        planes_found[lane] = vec2(TOP_NO_AXIS, 0u);
    }
    let levels = planes_levels();
    let count = levels.y;
    for (var sample = lane; sample < count; sample += TOP_SPLIT_LANES) {
        let mean = clusters[planes_part(levels.x, sample)].mean;
        planes_samples[sample] = vec3(top_ordered(mean.x), top_ordered(mean.y), top_ordered(mean.z));
    }
    workgroupBarrier();
    // The cell of the sample at each place of this invocation. A cell has the same places before and
    // after its samples are sorted.
    var cells: array<u32, PLANES_EACH>;
    // The first sweep finds the lens. Each of the others divides the cells of a level.
    for (var sweep = 0u; sweep <= TOP_PLANE_BITS; sweep++) {
        let level = max(sweep, 1u) - 1u;
        var ranks: array<vec3<u32>, PLANES_EACH>;
        for (var i = 0u; i < PLANES_EACH; i++) {
            let place = lane + i * TOP_SPLIT_LANES;
            let first = planes_first(count, cells[i], level);
            let end = planes_first(count, cells[i] + 1u, level);
            if place < count {
                ranks[i] = planes_ranks(place, first, end);
            }
            let quarter = (end - first) / 4u;
            for (var axis = 0u; axis < 3u; axis++) {
                if place < count {
                    if ranks[i][axis] == quarter {
                        planes_lows[3u * cells[i] + axis] = planes_samples[place][axis];
                    }
                    if ranks[i][axis] + quarter + 1u == end - first {
                        planes_highs[3u * cells[i] + axis] = planes_samples[place][axis];
                    }
                }
            }
        }
        workgroupBarrier();
        if sweep == 0u {
            let low = planes_unordered(planes_low(0u));
            let high = planes_unordered(planes_high(0u));
            // Twin of `Lens::new`. Distances are not negative, so their bits are ordered as they are.
            let extent = bitcast<vec3<u32>>(high - low);
            let exponent = max(i32(extent[space_longest(extent)] >> 23u), i32(TOP_LEAST_LENGTH)) - 127;
            let middle = (low + high) * 0.5;
            let power = space_power_of_two(-1 - exponent);
            for (var sample = lane; sample < count; sample += TOP_SPLIT_LANES) {
                planes_samples[sample] = space_code(planes_unordered(planes_samples[sample]), middle, power);
            }
            if lane == 0u {
                let least = space_code(planes_unordered(~space_words(3u)), middle, power);
                let most = space_code(planes_unordered(space_words(0u)), middle, power);
                for (var axis = 0u; axis < 3u; axis++) {
                    bounds[TOP_BOX_AT + axis] = least[axis];
                    bounds[TOP_BOX_AT + 3u + axis] = most[axis];
                    bounds[TOP_LENS_AT + axis] = bitcast<u32>(middle[axis]);
                }
                bounds[TOP_LENS_AT + 3u] = bitcast<u32>(power);
            }
            workgroupBarrier();
            continue;
        }
        var axes: array<u32, PLANES_EACH>;
        var samples: array<vec3<u32>, PLANES_EACH>;
        for (var i = 0u; i < PLANES_EACH; i++) {
            axes[i] = space_longest(planes_high(cells[i]) - planes_low(cells[i]));
            samples[i] = planes_samples[lane + i * TOP_SPLIT_LANES];
        }
        workgroupBarrier();
        for (var i = 0u; i < PLANES_EACH; i++) {
            if lane + i * TOP_SPLIT_LANES < count {
                planes_samples[planes_first(count, cells[i], level) + ranks[i][axes[i]]] = samples[i];
            }
        }
        workgroupBarrier();
        for (var i = 0u; i < PLANES_EACH; i++) {
            let place = lane + i * TOP_SPLIT_LANES;
            let cell = cells[i];
            let middle = planes_first(count, 2u * cell + 1u, level + 1u);
            if place == middle && place < count && middle > planes_first(count, cell, level) {
                let below = planes_samples[middle - 1u][axes[i]];
                let at = below + (planes_samples[middle][axes[i]] - below + 1u) / 2u;
                planes_found[(1u << level) + cell] = vec2(axes[i], at);
            }
            cells[i] = 2u * cell + select(0u, 1u, place >= middle);
        }
    }
    workgroupBarrier();
    if lane < TOP_PLANES {
        bounds[space_plane_word(lane)] = planes_found[lane].x;
        bounds[space_plane_word(lane) + 1u] = planes_found[lane].y;
    }
}
