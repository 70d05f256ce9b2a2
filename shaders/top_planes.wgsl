// Top level, stage 2: the first planes of the order in space, as medians of a sample of the parts.
// Twin of `SpaceOrder::new` in src/tree/space_order.rs. One workgroup, whose invocations hold a sample each.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
@group(0) @binding(2) var<storage, read_write> bounds: array<u32, TOP_SPACE_WORDS>;

// Cells that are divided at once.
const PLANES_CELLS: u32 = TOP_PLANES / 2u;
// Words with a bit for each sample.
const PLANES_WORDS: u32 = TOP_SAMPLES / 32u;

// The numbers of parts in each level of the sample.
var<workgroup> planes_counts: array<u32, TOP_LEVELS>;
// The samples, as ordered coordinates.
var<workgroup> planes_samples: array<vec3<u32>, TOP_SAMPLES>;
// For each cell and axis the ranks of its samples among all samples, as bits.
var<workgroup> planes_ranks: array<atomic<u32>, 3u * PLANES_CELLS * PLANES_WORDS>;
// For each cell and axis the ends of the middle half of its samples.
var<workgroup> planes_lows: array<u32, 3u * PLANES_CELLS>;
var<workgroup> planes_highs: array<u32, 3u * PLANES_CELLS>;
// The axis of each plane, and the codes of the samples before and after it.
var<workgroup> planes_axes: array<u32, TOP_PLANES>;
var<workgroup> planes_befores: array<u32, TOP_PLANES>;
var<workgroup> planes_afters: array<u32, TOP_PLANES>;

// The least level of the sample, and the number of parts of that level and above. Twin of `sample`.
fn planes_levels() -> vec2<u32> {
    var least = TOP_LEVELS;
    var count = 0u;
    while least > 0u {
        let more = count + planes_counts[least - 1u];
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
    while rest >= planes_counts[level] {
        rest -= planes_counts[level];
        level++;
    }
    return bounds[TOP_LISTS_AT + level * TOP_LEVEL_SAMPLES + rest];
}

// Twin of `first_sample`.
fn planes_first(count: u32, pieces: u32, cell: u32, level: u32) -> u32 {
    return ((cell * pieces) >> level) * count / pieces;
}

// 1 for each axis along which sample `a` is before `b`. Equal coordinates are ordered by the next axis, as
// in `median`. Of equal samples, `a` is before `b` if `is_first` is set.
fn planes_before(a: vec3<u32>, b: vec3<u32>, is_first: bool) -> vec3<u32> {
    let less = a < b;
    let equal = a == b;
    let second = less.yzx | (equal.yzx & (less.zxy | (equal.zxy & vec3(is_first))));
    return select(vec3(0u), vec3(1u), less | (equal & second));
}

// The first word with the ranks of a cell along an axis.
fn planes_word(cell: u32, axis: u32) -> u32 {
    return (3u * cell + axis) * PLANES_WORDS;
}

// The number of samples of a cell that are before the one with this rank.
fn planes_count_before(cell: u32, axis: u32, rank: u32) -> u32 {
    let first = planes_word(cell, axis);
    let last = first + rank / 32u;
    var count = countOneBits(atomicLoad(&planes_ranks[last]) & ((1u << (rank % 32u)) - 1u));
    for (var word = first; word < last; word++) {
        count += countOneBits(atomicLoad(&planes_ranks[word]));
    }
    return count;
}

// Notes the coordinates at which the middle half of the samples of a cell begins and ends.
fn planes_note_half(cell: u32, axis: u32, size: u32, rank: u32, coordinate: u32) {
    if rank == size / 4u {
        planes_lows[3u * cell + axis] = coordinate;
    }
    if rank + size / 4u + 1u == size {
        planes_highs[3u * cell + axis] = coordinate;
    }
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

@compute @workgroup_size(TOP_SAMPLES)
fn top_planes(@builtin(local_invocation_index) lane: u32) {
    if lane < 3u {
        planes_lows[lane] = top_ordered(0.0);
        planes_highs[lane] = top_ordered(0.0);
    }
    if lane < TOP_PLANES {
        planes_axes[lane] = TOP_NO_AXIS;
    }
    if lane < TOP_LEVELS {
        planes_counts[lane] = bounds[8u + lane];
    }
    let pieces = max((bounds[6] + TOP_SHARE - 1u) / TOP_SHARE, 1u);
    workgroupBarrier();
    let levels = planes_levels();
    let count = levels.y;
    let is_sample = lane < count;
    var sample = vec3(0u);
    if is_sample {
        let mean = clusters[planes_part(levels.x, lane)].mean;
        sample = vec3(top_ordered(mean.x), top_ordered(mean.y), top_ordered(mean.z));
        planes_samples[lane] = sample;
    }
    workgroupBarrier();
    // The ranks of the sample among all, along each axis.
    var ranks = vec3(0u);
    for (var other = 0u; other < count; other++) {
        ranks += planes_before(planes_samples[other], sample, other < lane);
    }
    if is_sample {
        for (var axis = 0u; axis < 3u; axis++) {
            planes_note_half(0u, axis, count, ranks[axis], sample[axis]);
        }
    }
    workgroupBarrier();
    // Twin of `Lens::new`. Distances are not negative, so their bits are ordered as they are.
    let low = planes_unordered(planes_low(0u));
    let high = planes_unordered(planes_high(0u));
    let extent = bitcast<vec3<u32>>(high - low);
    let exponent = max(i32(extent[space_longest(extent)] >> 23u), i32(TOP_LEAST_LENGTH)) - 127;
    let middle = (low + high) * 0.5;
    let power = space_power_of_two(-1 - exponent);
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
    let code = space_code(planes_unordered(sample), middle, power);
    // The cell of the sample. Each level divides the cells of the one before.
    var cell = 0u;
    for (var level = 0u; level < TOP_PLANE_BITS; level++) {
        for (var word = lane; word < planes_word(1u << level, 0u); word += TOP_SAMPLES) {
            atomicStore(&planes_ranks[word], 0u);
        }
        workgroupBarrier();
        if is_sample {
            for (var axis = 0u; axis < 3u; axis++) {
                atomicOr(&planes_ranks[planes_word(cell, axis) + ranks[axis] / 32u], 1u << (ranks[axis] % 32u));
            }
        }
        workgroupBarrier();
        // The ranks among the samples of the cell.
        let first = planes_first(count, pieces, cell, level);
        let size = planes_first(count, pieces, cell + 1u, level) - first;
        var inner = vec3(0u);
        if is_sample {
            for (var axis = 0u; axis < 3u; axis++) {
                inner[axis] = planes_count_before(cell, axis, ranks[axis]);
                planes_note_half(cell, axis, size, inner[axis], code[axis]);
            }
        }
        workgroupBarrier();
        let axis = space_longest(planes_high(cell) - planes_low(cell));
        let below = planes_first(count, pieces, 2u * cell + 1u, level + 1u) - first;
        let rank = inner[axis];
        if is_sample && below > 0u {
            let plane = (1u << level) + cell;
            if rank + 1u == below {
                planes_befores[plane] = code[axis];
            }
            if rank == below {
                planes_afters[plane] = code[axis];
                planes_axes[plane] = axis;
            }
        }
        cell = 2u * cell + select(0u, 1u, rank >= below);
    }
    workgroupBarrier();
    if lane < TOP_PLANES {
        let before = planes_befores[lane];
        bounds[space_plane_word(lane)] = planes_axes[lane];
        bounds[space_plane_word(lane) + 1u] = before + (planes_afters[lane] - before + 1u) / 2u;
    }
}
