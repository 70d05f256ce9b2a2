// Splits the units of a piece in two, again and again, until every part fits into a node. Twin of
// src/top/split.rs, which explains the splits. One workgroup splits a piece: it splits all parts in
// each round, and each invocation tries some cuts. TOP_PIECE is the largest number of units. A
// stage defines `split_record(lane, parts)`, which is called after each round. Binds nothing.

// The words of a row with one bit for each place.
const SPLIT_ROW_WORDS: u32 = TOP_PIECE / 32u;
// The largest number of parts that a round splits: each has more than LIGHT_WIDTH units.
const SPLIT_PARTS: u32 = TOP_PIECE / (LIGHT_WIDTH + 1u) + 1u;
// The number of units for each invocation.
const SPLIT_EACH: u32 = TOP_PIECE / TOP_SPLIT_LANES;
const SPLIT_NO_CUT: u32 = 0xffffffffu;

// Six words for each unit, on the grid of the piece. Word w of unit i is at w * TOP_PIECE + i.
// 0 to 2: the minimum and the maximum of the box along x, y and z, 16 bits each.
// 3: the mean along x and y.
// 4: the mean along z, and the upper half of the flux.
// 5: three bytes of direction.
var<workgroup> split_words: array<u32, TOP_PIECE * 6u>;
// For each place its unit and the part that it belongs to: unit | first << 10 | count << 20.
var<workgroup> split_order: array<u32, TOP_PIECE>;
// Two rows with a bit for each place. First row: the unit goes to the left. Second row: a part that
// is split begins here; after the last round any part.
var<workgroup> split_bits: array<atomic<u32>, SPLIT_ROW_WORDS * 2u>;
// The first place of each part that is split.
var<workgroup> split_heads: array<u32, SPLIT_PARTS>;
// The cost and the number of the best cut of each part.
var<workgroup> split_best: array<atomic<u32>, SPLIT_PARTS>;
// For each part and axis the minimum and the maximum of the means, 16 bits each.
var<workgroup> split_ranges: array<u32, SPLIT_PARTS * 3u>;
// The minimum corner as complements, the maximum corner, and the largest flux. All are ordered as
// integers and found as maxima.
var<workgroup> split_extremes: array<atomic<u32>, 7>;
var<workgroup> split_part_count: u32;

const SPLIT_LEFT_ROW: u32 = 0u;
const SPLIT_HEAD_ROW: u32 = SPLIT_ROW_WORDS;

// Consecutive places.
struct SplitPart {
    first: u32,
    count: u32,
}

// One unit on the grid. Twin of `GridItem` in src/top/split.rs.
struct SplitItem {
    low: vec3<u32>,
    high: vec3<u32>,
    mean: vec3<u32>,
    flux: f32,
    // The flux times the mean direction.
    power: vec3<f32>,
}

// The box and flux of several units. Twin of `GridSums` in src/top/split.rs.
struct SplitSums {
    low: vec3<u32>,
    high: vec3<u32>,
    flux: f32,
    power: vec3<f32>,
}

// The exponent e of a number in [2^e, 2^(e + 1)); -127 for zero. Twin of `exponent` in
// src/curve.rs.
fn split_exponent(x: f32) -> i32 {
    return i32(bitcast<u32>(x) >> 23u) - 127;
}

// 2^e, or the nearest normal power of two. Twin of `power_of_two` in src/curve.rs.
fn split_power_of_two(e: i32) -> f32 {
    return bitcast<f32>(u32(clamp(e, -126, 127) + 127) << 23u);
}

// The part that a place belongs to.
fn split_part(place: u32) -> SplitPart {
    let word = split_order[place];
    return SplitPart((word >> 10u) & 0x3ffu, word >> 20u);
}

// The unit at a place.
fn split_unit(place: u32) -> u32 {
    return split_order[place] & 0x3ffu;
}

// The number of bits of a row that are set from place `begin` to before `end`.
fn split_count_bits(row: u32, begin: u32, end: u32) -> u32 {
    var count = 0u;
    for (var word = begin / 32u; word * 32u < end; word++) {
        var bits = atomicLoad(&split_bits[row + word]);
        if word == begin / 32u {
            bits &= 0xffffffffu << (begin % 32u);
        }
        if end - word * 32u < 32u {
            bits &= (1u << (end % 32u)) - 1u;
        }
        count += countOneBits(bits);
    }
    return count;
}

fn split_set_bit(row: u32, place: u32) {
    atomicOr(&split_bits[row + place / 32u], 1u << (place % 32u));
}

// Clears both rows of bits.
fn split_clear(lane: u32) {
    if lane < SPLIT_ROW_WORDS {
        atomicStore(&split_bits[lane], 0u);
        atomicStore(&split_bits[SPLIT_HEAD_ROW + lane], 0u);
    }
}

// Two coordinates in one word.
fn split_pair(low: f32, high: f32) -> u32 {
    return min(u32(low), TOP_LAST_CELL) | (min(u32(high), TOP_LAST_CELL) << 16u);
}

// One byte of direction, moved up by `shift` bits.
fn split_direction(v: f32, shift: u32) -> u32 {
    return (bitcast<u32>(i32(v * TOP_AXIS_STEPS)) & 0xffu) << shift;
}

// Writes a unit on the grid. All extremes must be known.
fn split_put(unit: u32, cluster: LightCluster) {
    let low_corner = vec3(
        top_unordered(~atomicLoad(&split_extremes[0])),
        top_unordered(~atomicLoad(&split_extremes[1])),
        top_unordered(~atomicLoad(&split_extremes[2])),
    );
    let extent = vec3(
        top_unordered(atomicLoad(&split_extremes[3])),
        top_unordered(atomicLoad(&split_extremes[4])),
        top_unordered(atomicLoad(&split_extremes[5])),
    ) - low_corner;
    let cells = split_power_of_two(15 - split_exponent(max(extent.x, max(extent.y, extent.z))));
    let per_flux = split_power_of_two(-split_exponent(bitcast<f32>(atomicLoad(&split_extremes[6]))));
    let low = (cluster.box_min - low_corner) * cells;
    let high = (cluster.box_max - low_corner) * cells;
    let mean = (cluster.mean - low_corner) * cells;
    split_words[unit] = split_pair(low.x, high.x);
    split_words[TOP_PIECE + unit] = split_pair(low.y, high.y);
    split_words[2u * TOP_PIECE + unit] = split_pair(low.z, high.z);
    split_words[3u * TOP_PIECE + unit] = split_pair(mean.x, mean.y);
    split_words[4u * TOP_PIECE + unit] =
        min(u32(mean.z), TOP_LAST_CELL) | (bitcast<u32>(cluster.flux * per_flux) & 0xffff0000u);
    split_words[5u * TOP_PIECE + unit] = split_direction(cluster.axis.x, 0u)
        | split_direction(cluster.axis.y, 8u) | split_direction(cluster.axis.z, 16u);
}

// Lets the extremes start anew.
fn split_clear_extremes(lane: u32) {
    if lane < 7u {
        atomicStore(&split_extremes[lane], 0u);
    }
}

// Takes a unit into account in the extremes.
fn split_add_to_extremes(cluster: LightCluster) {
    for (var k = 0u; k < 3u; k++) {
        atomicMax(&split_extremes[k], ~top_ordered(cluster.box_min[k]));
        atomicMax(&split_extremes[k + 3u], top_ordered(cluster.box_max[k]));
    }
    atomicMax(&split_extremes[6], bitcast<u32>(cluster.flux));
}

// The mean of a unit on the grid.
fn split_mean(unit: u32) -> vec3<u32> {
    let xy = split_words[3u * TOP_PIECE + unit];
    return vec3(xy & 0xffffu, xy >> 16u, split_words[4u * TOP_PIECE + unit] & 0xffffu);
}

// A unit on the grid.
fn split_item(unit: u32) -> SplitItem {
    let x = split_words[unit];
    let y = split_words[TOP_PIECE + unit];
    let z = split_words[2u * TOP_PIECE + unit];
    let flux = bitcast<f32>(split_words[4u * TOP_PIECE + unit] & 0xffff0000u);
    let packed = split_words[5u * TOP_PIECE + unit];
    let direction = vec3<f32>(bitcast<vec3<i32>>(vec3(packed) << vec3(24u, 16u, 8u)) >> vec3(24u));
    return SplitItem(
        vec3(x & 0xffffu, y & 0xffffu, z & 0xffffu),
        vec3(x >> 16u, y >> 16u, z >> 16u),
        split_mean(unit),
        flux,
        flux * (direction * (1.0 / TOP_AXIS_STEPS)),
    );
}

fn split_empty() -> SplitSums {
    return SplitSums(vec3(TOP_LAST_CELL), vec3(0u), 0.0, vec3(0.0));
}

fn split_add(sums: SplitSums, item: SplitItem) -> SplitSums {
    return SplitSums(
        min(sums.low, item.low), max(sums.high, item.high), sums.flux + item.flux, sums.power + item.power,
    );
}

// The cost of a part. Twin of `Sums::cost`.
fn split_cost(sums: SplitSums) -> f32 {
    let e = vec3<f32>(max(sums.high, sums.low) - sums.low);
    let size = e.x * e.y + e.y * e.z + e.z * e.x + TOP_DIAGONAL_WEIGHT * (e.x * e.x + e.y * e.y + e.z * e.z);
    let p = sums.power;
    let axis = sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
    let wide = 4.0 * sums.flux - (3.0 / LIGHT_LAMBERTIAN) * axis;
    let narrow = 3.0 * (sums.flux - axis);
    return size * max(max(wide, narrow), TOP_MIN_ORIENTATION * sums.flux);
}

// Whether `count` units can be divided into nodes of six or more units each; a single unit needs no
// node.
fn split_fills_nodes(count: u32) -> bool {
    return count >= 32u || ((TOP_SPARSE_COUNTS >> (count % 32u)) & 1u) == 0u;
}

// A count near half that fills nodes on both sides. Twin of `middle` in src/tree/shape.
fn split_middle(count: u32) -> u32 {
    if count == 9u || count == 17u {
        return 1u;
    }
    if count == 10u || count == 11u {
        return count - TOP_FULL;
    }
    let nodes = (count + LIGHT_WIDTH - 1u) / LIGHT_WIDTH;
    return max(nodes / 2u, 1u) * (count / nodes);
}

// A cut: the last cell of the left side, and the last place in that cell that is on the left. Twin
// of `PieceCut` in src/top/split.rs.
struct SplitCut {
    axis: u32,
    border: u32,
    end: u32,
}

// The last place on the left side in the border cell. In a part with few units each cut comes after
// a unit; in a part with many, all units of the border cell are on the left side.
fn split_end(part: SplitPart, number: u32) -> u32 {
    return select(part.first + number % TOP_CUTS, part.first + part.count, part.count > TOP_CUTS);
}

// The last cell on the left side. `range` holds the minimum and the maximum of the part's means.
fn split_border(part: SplitPart, number: u32, range: u32) -> u32 {
    if part.count > TOP_CUTS {
        let low = range & 0xffffu;
        let high = range >> 16u;
        return low + (high - low) * (number % TOP_CUTS + 1u) / (TOP_CUTS + 1u);
    }
    return split_mean(split_unit(part.first + number % TOP_CUTS))[number / TOP_CUTS];
}

fn split_is_left_of(cut: SplitCut, mean: vec3<u32>, place: u32) -> bool {
    return mean[cut.axis] < cut.border || (mean[cut.axis] == cut.border && place <= cut.end);
}

// The minimum and the maximum of a part's means along an axis, 16 bits each.
fn split_range(part: SplitPart, axis: u32) -> u32 {
    var low = TOP_LAST_CELL;
    var high = 0u;
    for (var place = part.first; place < part.first + part.count; place++) {
        let mean = split_mean(split_unit(place))[axis];
        low = min(low, mean);
        high = max(high, mean);
    }
    return low | (high << 16u);
}

// The cost and the number of a cut of a part, or SPLIT_NO_CUT.
fn split_try(head: u32, number: u32) -> u32 {
    let part = split_part(split_heads[head]);
    let axis = number / TOP_CUTS;
    if number % TOP_CUTS >= part.count {
        return SPLIT_NO_CUT;
    }
    let ranges = vec3(split_ranges[3u * head], split_ranges[3u * head + 1u], split_ranges[3u * head + 2u]);
    let extent = (ranges >> vec3(16u)) - (ranges & vec3(0xffffu));
    if extent[axis] == 0u {
        return SPLIT_NO_CUT;
    }
    let cut = SplitCut(axis, split_border(part, number, ranges[axis]), split_end(part, number));
    var left = split_empty();
    var right = split_empty();
    var count = 0u;
    for (var place = part.first; place < part.first + part.count; place++) {
        let item = split_item(split_unit(place));
        if split_is_left_of(cut, item.mean, place) {
            left = split_add(left, item);
            count++;
        } else {
            right = split_add(right, item);
        }
    }
    if count == part.count || !split_fills_nodes(count) || !split_fills_nodes(part.count - count) {
        return SPLIT_NO_CUT;
    }
    let stretch = f32(max(extent.x, max(extent.y, extent.z))) / f32(extent[axis]);
    let cost = stretch * (split_cost(left) + split_cost(right));
    return ((bitcast<u32>(cost) >> TOP_COST_SLACK) << TOP_CUT_BITS) | number;
}

// The number of the best cut.
fn split_number(best: u32) -> u32 {
    return best & ((1u << TOP_CUT_BITS) - 1u);
}

// Whether the unit at a place of a part goes to the left.
fn split_is_left(part: SplitPart, place: u32, head: u32) -> bool {
    let best = atomicLoad(&split_best[head]);
    if best == SPLIT_NO_CUT {
        return place - part.first < split_middle(part.count);
    }
    let number = split_number(best);
    let axis = number / TOP_CUTS;
    let cut = SplitCut(axis, split_border(part, number, split_ranges[3u * head + axis]), split_end(part, number));
    return split_is_left_of(cut, split_mean(split_unit(place)), place);
}

// Splits `count` units, which are on the grid already. Call from uniform control flow.
fn split_all(lane: u32, count: u32) {
    for (var i = 0u; i < SPLIT_EACH; i++) {
        let place = lane + i * TOP_SPLIT_LANES;
        split_order[place] = place | (count << 20u);
    }
    // After TOP_ROUNDS rounds parts are halved, so ten more rounds are enough for any piece.
    for (var round = 0u; round < TOP_ROUNDS + 10u; round++) {
        split_clear(lane);
        workgroupBarrier();
        for (var place = lane; place < count; place += TOP_SPLIT_LANES) {
            let part = split_part(place);
            if part.first == place && part.count > LIGHT_WIDTH {
                split_set_bit(SPLIT_HEAD_ROW, place);
            }
        }
        workgroupBarrier();
        for (var place = lane; place < count; place += TOP_SPLIT_LANES) {
            let part = split_part(place);
            if part.first == place && part.count > LIGHT_WIDTH {
                let head = split_count_bits(SPLIT_HEAD_ROW, 0u, place);
                split_heads[head] = place;
                atomicStore(&split_best[head], SPLIT_NO_CUT);
            }
        }
        if lane == 0u {
            split_part_count = split_count_bits(SPLIT_HEAD_ROW, 0u, count);
        }
        let parts = workgroupUniformLoad(&split_part_count);
        if parts == 0u {
            break;
        }
        if round < TOP_ROUNDS {
            for (var task = lane; task < parts * 3u; task += TOP_SPLIT_LANES) {
                split_ranges[task] = split_range(split_part(split_heads[task / 3u]), task % 3u);
            }
            workgroupBarrier();
            for (var task = lane; task < parts * 3u * TOP_CUTS; task += TOP_SPLIT_LANES) {
                let head = task / (3u * TOP_CUTS);
                atomicMin(&split_best[head], split_try(head, task % (3u * TOP_CUTS)));
            }
        }
        workgroupBarrier();
        for (var place = lane; place < count; place += TOP_SPLIT_LANES) {
            let part = split_part(place);
            if part.count > LIGHT_WIDTH {
                let head = split_count_bits(SPLIT_HEAD_ROW, 0u, part.first);
                if split_is_left(part, place, head) {
                    split_set_bit(SPLIT_LEFT_ROW, place);
                }
            }
        }
        workgroupBarrier();
        var moved_to: array<u32, SPLIT_EACH>;
        var moved: array<u32, SPLIT_EACH>;
        for (var i = 0u; i < SPLIT_EACH; i++) {
            let place = lane + i * TOP_SPLIT_LANES;
            moved_to[i] = place;
            moved[i] = split_order[place];
            let part = split_part(place);
            if place < count && part.count > LIGHT_WIDTH {
                let lefts = split_count_bits(SPLIT_LEFT_ROW, part.first, part.first + part.count);
                let before = split_count_bits(SPLIT_LEFT_ROW, part.first, place);
                let is_left = split_count_bits(SPLIT_LEFT_ROW, place, place + 1u) == 1u;
                let middle = part.first + lefts;
                moved_to[i] = select(middle + (place - part.first - before), part.first + before, is_left);
                moved[i] = split_unit(place) | select(
                    (middle << 10u) | ((part.count - lefts) << 20u),
                    (part.first << 10u) | (lefts << 20u),
                    is_left,
                );
            }
        }
        workgroupBarrier();
        for (var i = 0u; i < SPLIT_EACH; i++) {
            split_order[moved_to[i]] = moved[i];
        }
        workgroupBarrier();
        split_record(lane, parts);
    }
}
