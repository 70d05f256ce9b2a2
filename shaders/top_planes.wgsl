// Top level, stage 2: the first planes of the order in space, as medians of a sample of the parts.
// Twin of `Curve::new` in src/tree/curve.rs. One workgroup, whose invocations hold two samples each.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
@group(0) @binding(2) var<storage, read_write> bounds: array<u32, TOP_CURVE_WORDS>;

const PLANES_EACH: u32 = TOP_SAMPLES / TOP_SPLIT_LANES;

// The samples, those of a cell side by side.
var<workgroup> planes_samples: array<vec3<f32>, TOP_SAMPLES>;
// For each cell and axis the ends of the middle half of its samples.
var<workgroup> planes_lows: array<f32, 3u * TOP_PLANES / 2u>;
var<workgroup> planes_highs: array<f32, 3u * TOP_PLANES / 2u>;
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

// The box that planes without a median halve: without what is far beyond the middle half of all
// samples. Twin of `middle_box`.
fn planes_write_box(axis: u32) {
    let low = planes_lows[axis];
    let high = planes_highs[axis];
    let beyond = (high - low) * 2.0;
    var box = vec2(top_unordered(~bounds[axis + 3u]), top_unordered(bounds[axis]));
    if beyond > 0.0 {
        box = vec2(max(box.x, low - beyond), min(box.y, high + beyond));
    }
    bounds[TOP_BOUNDS_WORDS + axis] = bitcast<u32>(box.x);
    bounds[TOP_BOUNDS_WORDS + 3u + axis] = bitcast<u32>(box.y);
}

@compute @workgroup_size(TOP_SPLIT_LANES)
fn top_planes(@builtin(local_invocation_index) lane: u32) {
    if lane < 3u {
        planes_lows[lane] = 0.0;
        planes_highs[lane] = 0.0;
    }
    workgroupBarrier();
    if lane < TOP_PLANES {
        planes_found[lane] = vec2(TOP_NO_AXIS, 0u);
    }
    let levels = planes_levels();
    let count = levels.y;
    for (var sample = lane; sample < count; sample += TOP_SPLIT_LANES) {
        planes_samples[sample] = clusters[planes_part(levels.x, sample)].mean;
    }
    workgroupBarrier();
    // The cell of the sample at each place of this invocation. A cell has the same places before and
    // after its samples are sorted.
    var cells: array<u32, PLANES_EACH>;
    for (var level = 0u; level < TOP_PLANE_BITS; level++) {
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
        if level == 0u && lane < 3u {
            planes_write_box(lane);
        }
        var axes: array<u32, PLANES_EACH>;
        var samples: array<vec3<f32>, PLANES_EACH>;
        for (var i = 0u; i < PLANES_EACH; i++) {
            let at = 3u * cells[i];
            axes[i] = curve_longest(vec3(
                planes_highs[at] - planes_lows[at],
                planes_highs[at + 1u] - planes_lows[at + 1u],
                planes_highs[at + 2u] - planes_lows[at + 2u],
            ));
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
                let at = (planes_samples[middle - 1u][axes[i]] + planes_samples[middle][axes[i]]) * 0.5;
                planes_found[(1u << level) + cell] = vec2(axes[i], bitcast<u32>(at));
            }
            cells[i] = 2u * cell + select(0u, 1u, place >= middle);
        }
    }
    workgroupBarrier();
    if lane < TOP_PLANES {
        bounds[curve_plane_word(lane)] = planes_found[lane].x;
        bounds[curve_plane_word(lane) + 1u] = planes_found[lane].y;
    }
}
