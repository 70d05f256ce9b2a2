// Splits the units of a piece in two, again and again, until every part fits into a node. Twin of
// src/top/split.rs, which explains the splits. One workgroup splits a piece. Each invocation holds
// SPLIT_EACH units and knows which part each is in. Binds nothing.
//
// First all large parts are cut, round by round: the units add themselves to bins of their part.
// Then the units are rounded to the grids of their parts and write themselves to their places, and
// small parts are cut: each unit tries the cut after itself. Small parts are sets of units, one bit for each, so units do not move any more.

// The number of units for each invocation.
const SPLIT_EACH: u32 = (TOP_PIECE + TOP_SPLIT_LANES) / TOP_SPLIT_LANES;
// The words of a row with one bit for each place.
const SPLIT_ROW_WORDS: u32 = (TOP_PIECE + 31u) / 32u;
// The greatest number of large parts of a piece, and of small parts that are cut in one round.
const SPLIT_LARGE: u32 = TOP_PIECE / (TOP_SMALL + 1u);
const SPLIT_PARTS: u32 = TOP_PIECE / (LIGHT_WIDTH + 1u);
const SPLIT_NO_CUT: u32 = 0xffffffffu;
const SPLIT_LAST_CELL: u32 = (1u << TOP_CELL_BITS) - 1u;
// The words of a unit of a small part: its box along x, y and z (see split_pair), and its flux. Word w
// of the unit at a place is at w * TOP_PIECE + place.
const SPLIT_UNIT_WORDS: u32 = 4u;
// The words of a bin: six extremes as maxima of ordered floats, and a count with the flux above it.
const SPLIT_BIN_WORDS: u32 = 7u;
// The words of a large part while it is cut: its bins, and its best cut, which is stored inverted as a
// maximum.
const SPLIT_PART_WORDS: u32 = TOP_BINS * SPLIT_BIN_WORDS + 1u;
const SPLIT_BEST: u32 = TOP_BINS * SPLIT_BIN_WORDS;
// The words of a small part while it is cut: its best cut, the units on the left side of that cut, and
// the boxes of its halves.
const SPLIT_SMALL_WORDS: u32 = 8u;
// Where the boxes of the halves of large parts are in `split_words`, twelve words for each part, and
// the number of cells per metre of each part.
const SPLIT_BOXES: u32 = SPLIT_LARGE * SPLIT_PART_WORDS;
const SPLIT_CELLS: u32 = SPLIT_BOXES + 12u * SPLIT_LARGE;
// Set beside the number of the cut of a side that is tiny.
const SPLIT_TINY: u32 = 0x100u;

// While large parts are cut, the sums of their bins from the first on, and the boxes of their halves.
// Then the units at their places. Later stages use the words for their own ends.
var<workgroup> split_words: array<u32, TOP_PIECE * SPLIT_UNIT_WORDS>;
// What the units of parts find together. The sums of bins up to the last take the place of the bins.
var<workgroup> split_found: array<atomic<u32>, SPLIT_LARGE * SPLIT_PART_WORDS>;
// Two rows with a bit for each place. First row: the unit goes to the left. Second row: a part that
// is cut begins here.
var<workgroup> split_bits: array<atomic<u32>, SPLIT_ROW_WORDS * 2u>;
// For each word of a row the number of bits that are set in the words before it.
var<workgroup> split_sums: array<u32, SPLIT_ROW_WORDS * 2u>;
// The extremes of all units of the piece: the minimum corner as complements, the maximum corner, and
// the largest flux. All are ordered as integers and found as maxima.
var<workgroup> split_extremes: array<atomic<u32>, 7>;
var<workgroup> split_part_count: u32;

// All cuts of the piece, each after those that it needs: the part that is cut, as
// first | count << 9 | left << 18; the bits of its cost; and the numbers of the cuts that cut
// its sides, the right one above the left one, each plus one, or 0, with SPLIT_TINY.
var<workgroup> split_cut_parts: array<u32, TOP_MAX_CUTS>;
var<workgroup> split_cut_costs: array<u32, TOP_MAX_CUTS>;
var<workgroup> split_cut_sides: array<atomic<u32>, TOP_MAX_CUTS>;

const SPLIT_LEFT_ROW: u32 = 0u;
const SPLIT_HEAD_ROW: u32 = SPLIT_ROW_WORDS;

// A unit, and where it is. Twin of `Item` and `PartState` in src/top/split.rs.
struct SplitUnit {
    // Its box in metres.
    low: vec3<f32>,
    high: vec3<f32>,
    flux: u32,
    // Its place in the order of the parts.
    place: u32,
    // The first place and the number of units of its part.
    first: u32,
    count: u32,
    // Which side of which cut its part is: 2 * c + 1 for the left side of cut c, 2 * c + 2 for the
    // right side, 0 for the whole piece. The cut of the part stores its number there.
    made_by: u32,
    // The axis along which a box around its part is longest, with the least coordinate and the extent
    // of that box along the axis, and the power of two of cells per metre.
    axis: u32,
    start: f32,
    extent: f32,
    power: i32,
    // While small parts are cut: the first place of all bits, and the units of the part as bits.
    base: u32,
    bits: u32,
}

// The units of an invocation.
var<private> split_own: array<SplitUnit, SPLIT_EACH>;
// The power of two of cells per metre of the whole piece.
var<private> split_piece_power: i32;
// Parts of more units than this may count as tiny. The stage sets it.
var<private> split_tiny_above: u32;

// The box, the summed flux and the number of several units. Twin of `Sums` in src/top/split.rs.
struct SplitSums {
    low: vec3<f32>,
    high: vec3<f32>,
    flux: u32,
    count: u32,
}

// The lowest `count` bits, of at most 32.
fn split_low_bits(count: u32) -> u32 {
    return select((1u << (count % 32u)) - 1u, 0xffffffffu, count >= 32u);
}

// Adds up the bits of a row for split_bits_before. Call from uniform control flow, after a barrier,
// and let another one follow.
fn split_sum_row(lane: u32, row: u32) {
    if lane < SPLIT_ROW_WORDS {
        var sum = 0u;
        for (var word = 0u; word < lane; word++) {
            sum += countOneBits(atomicLoad(&split_bits[row + word]));
        }
        split_sums[row + lane] = sum;
    }
}

// The number of bits of a summed row before a place.
fn split_bits_before(row: u32, place: u32) -> u32 {
    let word = row + place / 32u;
    return split_sums[word] + countOneBits(atomicLoad(&split_bits[word]) & split_low_bits(place % 32u));
}

// Whether the bit of a place is set.
fn split_has_bit(row: u32, place: u32) -> bool {
    return ((atomicLoad(&split_bits[row + place / 32u]) >> (place % 32u)) & 1u) == 1u;
}

fn split_set_bit(row: u32, place: u32) {
    atomicOr(&split_bits[row + place / 32u], 1u << (place % 32u));
}

// Clears both rows of bits.
fn split_clear_bits(lane: u32) {
    if lane < SPLIT_ROW_WORDS * 2u {
        atomicStore(&split_bits[lane], 0u);
    }
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

// Two whole coordinates in one word.
fn split_pair(low: f32, high: f32) -> u32 {
    return u32(low) | (u32(high) << 16u);
}

// A unit in the whole piece of `count` units. All extremes must be known.
fn split_unit(cluster: LightCluster, place: u32, count: u32) -> SplitUnit {
    let most = bitcast<f32>(atomicLoad(&split_extremes[6]));
    let per_flux = space_power_of_two(i32(TOP_FLUX_BITS) - 1 - space_exponent(most));
    var low: vec3<f32>;
    var high: vec3<f32>;
    for (var k = 0u; k < 3u; k++) {
        low[k] = top_unordered(~atomicLoad(&split_extremes[k]));
        high[k] = top_unordered(atomicLoad(&split_extremes[k + 3u]));
    }
    var unit: SplitUnit;
    unit.low = cluster.box_min;
    unit.high = cluster.box_max;
    unit.flux = max(u32(cluster.flux * per_flux), 1u);
    unit.place = place;
    unit.count = count;
    unit = split_on_grid(split_within(unit, low, high));
    split_piece_power = unit.power;
    return unit;
}

fn split_empty() -> SplitSums {
    return SplitSums(vec3(f32(SPLIT_LAST_CELL)), vec3(0.0), 0u, 0u);
}

fn split_and(a: SplitSums, b: SplitSums) -> SplitSums {
    return SplitSums(min(a.low, b.low), max(a.high, b.high), a.flux + b.flux, a.count + b.count);
}

// The cost of some units. Twin of `Sums::cost`.
fn split_cost(sums: SplitSums, cells: f32) -> f32 {
    let e = (vec3<u32>(max((sums.high - sums.low) * cells, vec3(0.0))) + vec3(1u)) / vec3(2u);
    let diagonal = e.x * e.x + e.y * e.y + e.z * e.z;
    let size = e.x * e.y + e.y * e.z + e.z * e.x + (diagonal + TOP_DIAGONAL_SHARE - 1u) / TOP_DIAGONAL_SHARE;
    let cost = bitcast<u32>(f32(size) * f32(sums.flux));
    return bitcast<f32>((cost >> TOP_COST_SLACK) << TOP_COST_SLACK);
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

// The cost of a cut with a number below 32, or SPLIT_NO_CUT if a side would not fill nodes. Twin of
// `cost_of_cut`.
fn split_cost_of_cut(left: SplitSums, right: SplitSums, cells: f32, number: u32) -> u32 {
    if !split_fills_nodes(left.count) || !split_fills_nodes(right.count) {
        return SPLIT_NO_CUT;
    }
    let cost = bitcast<u32>(split_cost(left, cells) + split_cost(right, cells));
    return ((cost >> TOP_COST_SLACK) << 5u) | number;
}

// The number of the best cut.
fn split_number(best: u32) -> u32 {
    return best & 31u;
}

// The unit in a part with this box. Twin of `longest`.
fn split_within(before: SplitUnit, low: vec3<f32>, high: vec3<f32>) -> SplitUnit {
    let extent = high - low;
    var unit = before;
    unit.axis = space_longest(bitcast<vec3<u32>>(extent));
    unit.start = low[unit.axis];
    unit.extent = extent[unit.axis];
    return unit;
}

// The unit with the grid of its part.
fn split_on_grid(before: SplitUnit) -> SplitUnit {
    var unit = before;
    unit.power = i32(TOP_CELL_BITS) - 1 - space_exponent(unit.extent);
    return unit;
}

// The box of some units of a small part; see split_pair.
fn split_box(sums: SplitSums) -> vec3<u32> {
    return vec3<u32>(sums.low) | (vec3<u32>(sums.high) << vec3(16u));
}

// Records a cut: its part, its cost on the grid of the piece, and its number where its part was made.
// Called by the first invocation of the part.
fn split_record(cut: u32, unit: SplitUnit, left: u32) {
    split_cut_parts[cut] = unit.first | (unit.count << 9u) | (left << 18u);
    let zoom = space_power_of_two(2 * clamp(split_piece_power - unit.power, -i32(TOP_MAX_ZOOM), 0));
    var cost = bitcast<u32>(bitcast<f32>(split_cut_costs[cut]) * zoom);
    if unit.made_by != 0u {
        let made_by = unit.made_by - 1u;
        cost = min(cost, split_cut_costs[made_by / 2u]);
        atomicOr(&split_cut_sides[made_by / 2u], (cut + 1u) << (16u * (made_by % 2u)));
    }
    split_cut_costs[cut] = cost;
}

// Marks the half that a unit is in as tiny if it is beside the part, whose box was this long.
fn split_mark_tiny(unit: SplitUnit, cut: u32, is_left: bool, extent: f32) {
    if unit.count > split_tiny_above && unit.extent * f32(TOP_TINY_SHARE) < extent {
        atomicOr(&split_cut_sides[cut], select(SPLIT_TINY << 16u, SPLIT_TINY, is_left));
    }
}

// The unit in its half of the part that is cut by a cut.
fn split_half(before: SplitUnit, cut: u32, left: u32, is_left: bool) -> SplitUnit {
    var unit = before;
    unit.first = select(before.first + left, before.first, is_left);
    unit.count = select(before.count - left, left, is_left);
    unit.made_by = 2u * cut + select(2u, 1u, is_left);
    return unit;
}

// The sums that are stored in the words of a bin. The box has no meaning for no units.
fn split_sums_of(words: array<u32, SPLIT_BIN_WORDS>) -> SplitSums {
    return SplitSums(
        vec3(top_unordered(~words[0]), top_unordered(~words[1]), top_unordered(~words[2])),
        vec3(top_unordered(words[3]), top_unordered(words[4]), top_unordered(words[5])),
        words[6] >> 9u, words[6] & 0x1ffu,
    );
}

// Adds up one word of the bins of a large part, from both ends.
fn split_sum_bins(part: u32, word: u32) {
    let first = part * SPLIT_PART_WORDS + word;
    var sum = 0u;
    for (var bin = 0u; bin < TOP_BINS; bin++) {
        let at = first + bin * SPLIT_BIN_WORDS;
        let own = atomicLoad(&split_found[at]);
        sum = select(max(sum, own), sum + own, word == SPLIT_BIN_WORDS - 1u);
        split_words[at] = sum;
    }
    sum = 0u;
    for (var bin = TOP_BINS; bin > 0u; bin--) {
        let at = first + (bin - 1u) * SPLIT_BIN_WORDS;
        let own = atomicLoad(&split_found[at]);
        sum = select(max(sum, own), sum + own, word == SPLIT_BIN_WORDS - 1u);
        atomicStore(&split_found[at], sum);
    }
}

// The bin of a unit in its part.
fn split_bin_of(unit: SplitUnit) -> u32 {
    let cells = space_power_of_two(unit.power);
    let centre = (unit.low[unit.axis] + unit.high[unit.axis]) * 0.5;
    return u32((centre - unit.start) * cells) * TOP_BINS / (u32(unit.extent * cells) + 1u);
}

// Adds a unit to its bin.
fn split_add_to_bin(unit: SplitUnit, part: u32) {
    let at = part * SPLIT_PART_WORDS + split_bin_of(unit) * SPLIT_BIN_WORDS;
    for (var k = 0u; k < 3u; k++) {
        atomicMax(&split_found[at + k], ~top_ordered(unit.low[k]));
        atomicMax(&split_found[at + 3u + k], top_ordered(unit.high[k]));
    }
    atomicAdd(&split_found[at + 6u], 1u | (unit.flux << 9u));
}

// The two sides of the cut of a large part after a bin.
struct SplitSides {
    left: SplitSums,
    right: SplitSums,
}

// `last` is not the last bin.
fn split_sides(part: u32, last: u32) -> SplitSides {
    let at = part * SPLIT_PART_WORDS + last * SPLIT_BIN_WORDS;
    var left: array<u32, SPLIT_BIN_WORDS>;
    var right: array<u32, SPLIT_BIN_WORDS>;
    for (var word = 0u; word < SPLIT_BIN_WORDS; word++) {
        left[word] = split_words[at + word];
        right[word] = atomicLoad(&split_found[at + SPLIT_BIN_WORDS + word]);
    }
    return SplitSides(split_sums_of(left), split_sums_of(right));
}

// The sums of all units of a large part.
fn split_whole(part: u32) -> SplitSums {
    var words: array<u32, SPLIT_BIN_WORDS>;
    for (var word = 0u; word < SPLIT_BIN_WORDS; word++) {
        words[word] = atomicLoad(&split_found[part * SPLIT_PART_WORDS + word]);
    }
    return split_sums_of(words);
}

// Tries the cut of a large part after a bin. After the last bin there is no cut; its invocation
// finds the cost of the part.
fn split_try_bin(part: u32, last: u32, cut: u32) {
    let cells = bitcast<f32>(split_words[SPLIT_CELLS + part]);
    if last == TOP_BINS - 1u {
        split_cut_costs[cut] = bitcast<u32>(split_cost(split_whole(part), cells));
        return;
    }
    let sides = split_sides(part, last);
    let cost = split_cost_of_cut(sides.left, sides.right, cells, last);
    atomicMax(&split_found[part * SPLIT_PART_WORDS + SPLIT_BEST], ~cost);
}

// Stores the boxes of the halves of a large part, of a halved part its own box twice.
fn split_store_boxes(part: u32, may_bin: bool) {
    let best = split_best_of_large(part);
    var sides: SplitSides;
    if best == SPLIT_NO_CUT || !may_bin {
        sides.left = split_whole(part);
        sides.right = sides.left;
    } else {
        sides = split_sides(part, split_number(best));
    }
    let at = SPLIT_BOXES + 12u * part;
    for (var k = 0u; k < 3u; k++) {
        split_words[at + k] = bitcast<u32>(sides.left.low[k]);
        split_words[at + 3u + k] = bitcast<u32>(sides.left.high[k]);
        split_words[at + 6u + k] = bitcast<u32>(sides.right.low[k]);
        split_words[at + 9u + k] = bitcast<u32>(sides.right.high[k]);
    }
}

// Three words as floats.
fn split_corner(at: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(vec3(split_words[at], split_words[at + 1u], split_words[at + 2u]));
}

// The best cut of a large part.
fn split_best_of_large(part: u32) -> u32 {
    return ~atomicLoad(&split_found[part * SPLIT_PART_WORDS + SPLIT_BEST]);
}

// The number of parts that are cut in this round, from the row of their first places, which it sums.
// Call from uniform control flow.
fn split_parts(lane: u32) -> u32 {
    workgroupBarrier();
    split_sum_row(lane, SPLIT_HEAD_ROW);
    if lane == SPLIT_ROW_WORDS - 1u {
        let last = SPLIT_HEAD_ROW + SPLIT_ROW_WORDS - 1u;
        split_part_count = split_sums[last] + countOneBits(atomicLoad(&split_bits[last]));
    }
    return workgroupUniformLoad(&split_part_count);
}

// The number of a unit's part among those that are cut in this round.
fn split_part(unit: SplitUnit) -> u32 {
    return split_bits_before(SPLIT_HEAD_ROW, unit.first);
}

// Cuts all large parts, twin of `cut_large`. Returns the number of cuts.
fn split_all_large(lane: u32) -> u32 {
    var cuts = 0u;
    // Then parts are halved, so these rounds are enough for any piece.
    for (var round = 0u; round < TOP_LARGE_ROUNDS + TOP_LARGE_HALVINGS; round++) {
        split_clear_bits(lane);
        workgroupBarrier();
        for (var i = 0u; i < SPLIT_EACH; i++) {
            let unit = split_own[i];
            if unit.count > TOP_SMALL && unit.place == unit.first {
                split_set_bit(SPLIT_HEAD_ROW, unit.first);
            }
        }
        let parts = split_parts(lane);
        if parts == 0u {
            break;
        }
        for (var word = lane; word < parts * SPLIT_PART_WORDS; word += TOP_SPLIT_LANES) {
            atomicStore(&split_found[word], 0u);
        }
        workgroupBarrier();
        var part_of: array<u32, SPLIT_EACH>;
        for (var i = 0u; i < SPLIT_EACH; i++) {
            if split_own[i].count > TOP_SMALL {
                part_of[i] = split_part(split_own[i]);
                split_own[i] = split_on_grid(split_own[i]);
                split_add_to_bin(split_own[i], part_of[i]);
                if split_own[i].place == split_own[i].first {
                    let cells = space_power_of_two(split_own[i].power);
                    split_words[SPLIT_CELLS + part_of[i]] = bitcast<u32>(cells);
                }
            }
        }
        workgroupBarrier();
        if lane < parts * SPLIT_BIN_WORDS {
            split_sum_bins(lane / SPLIT_BIN_WORDS, lane % SPLIT_BIN_WORDS);
        }
        workgroupBarrier();
        if lane < parts * TOP_BINS {
            split_try_bin(lane / TOP_BINS, lane % TOP_BINS, cuts + lane / TOP_BINS);
        }
        workgroupBarrier();
        if lane < parts {
            split_store_boxes(lane, round < TOP_LARGE_ROUNDS);
        }
        var is_halved: array<bool, SPLIT_EACH>;
        for (var i = 0u; i < SPLIT_EACH; i++) {
            let unit = split_own[i];
            if unit.count > TOP_SMALL {
                let best = split_best_of_large(part_of[i]);
                var is_left = split_bin_of(unit) <= split_number(best);
                is_halved[i] = best == SPLIT_NO_CUT || round >= TOP_LARGE_ROUNDS;
                if is_halved[i] {
                    is_left = unit.place - unit.first < split_middle(unit.count);
                }
                if is_left {
                    split_set_bit(SPLIT_LEFT_ROW, unit.place);
                }
            }
        }
        workgroupBarrier();
        split_sum_row(lane, SPLIT_LEFT_ROW);
        workgroupBarrier();
        for (var i = 0u; i < SPLIT_EACH; i++) {
            var unit = split_own[i];
            if unit.count > TOP_SMALL {
                let cut = cuts + part_of[i];
                let lefts_before = split_bits_before(SPLIT_LEFT_ROW, unit.first);
                let left = split_bits_before(SPLIT_LEFT_ROW, unit.first + unit.count) - lefts_before;
                let before = split_bits_before(SPLIT_LEFT_ROW, unit.place) - lefts_before;
                let is_left = split_has_bit(SPLIT_LEFT_ROW, unit.place);
                if unit.place == unit.first {
                    split_record(cut, unit, left);
                }
                let at = SPLIT_BOXES + 12u * part_of[i] + select(6u, 0u, is_left);
                let extent = unit.extent;
                let steps = unit.place - unit.first;
                unit = split_within(unit, split_corner(at), split_corner(at + 3u));
                unit = split_half(unit, cut, left, is_left);
                split_mark_tiny(unit, cut, is_left, extent);
                unit.place = unit.first + select(steps - before, before, is_left);
                split_own[i] = unit;
            }
        }
        cuts += parts;
        workgroupBarrier();
    }
    return cuts;
}

// The unit of a small part that was written to a place, in cells.
fn split_read(place: u32) -> SplitSums {
    let box = vec3(split_words[place], split_words[TOP_PIECE + place], split_words[2u * TOP_PIECE + place]);
    return SplitSums(
        vec3<f32>(box & vec3(0xffffu)), vec3<f32>(box >> vec3(16u)), split_words[3u * TOP_PIECE + place], 1u,
    );
}

// The centre of its box along an axis.
fn split_centre(unit: SplitSums, axis: u32) -> u32 {
    return u32((unit.low[axis] + unit.high[axis]) * 0.5);
}

// The cut of a small part after one of its units: the units on the left, the boxes of both sides, and
// the costs of the part and of the cut.
struct SplitTry {
    left: u32,
    left_box: vec3<u32>,
    right_box: vec3<u32>,
    part_cost: u32,
    cut_cost: u32,
}

fn split_try_unit(own: SplitUnit) -> SplitTry {
    let border = split_centre(split_read(own.place), own.axis);
    let own_bit = own.place - own.base;
    var left = split_empty();
    var right = split_empty();
    var tried = SplitTry();
    for (var bits = own.bits; bits != 0u; bits &= bits - 1u) {
        let bit = countTrailingZeros(bits);
        let unit = split_read(own.base + bit);
        let centre = split_centre(unit, own.axis);
        if centre < border || (centre == border && bit <= own_bit) {
            left = split_and(left, unit);
            tried.left |= 1u << bit;
        } else {
            right = split_and(right, unit);
        }
    }
    tried.left_box = split_box(left);
    tried.right_box = split_box(right);
    tried.part_cost = bitcast<u32>(split_cost(split_and(left, right), 1.0));
    tried.cut_cost = split_cost_of_cut(left, right, 1.0, own_bit);
    return tried;
}

// Whether a unit is the first of a small part that is cut.
fn split_is_head(unit: SplitUnit) -> bool {
    return unit.count > LIGHT_WIDTH && countTrailingZeros(unit.bits) == unit.place - unit.base;
}

// Rounds the units of small parts to grids over the boxes of their parts, and writes them to their
// places. Twin of `round_to_cells`. Call from uniform control flow.
fn split_round_all(lane: u32) {
    split_clear_bits(lane);
    for (var word = lane; word < SPLIT_PARTS * SPLIT_SMALL_WORDS; word += TOP_SPLIT_LANES) {
        atomicStore(&split_found[word], 0u);
    }
    for (var i = 0u; i < SPLIT_EACH; i++) {
        split_own[i].base = split_own[i].first;
        split_own[i].bits = split_low_bits(split_own[i].count);
    }
    workgroupBarrier();
    for (var i = 0u; i < SPLIT_EACH; i++) {
        if split_is_head(split_own[i]) {
            split_set_bit(SPLIT_HEAD_ROW, split_own[i].first);
        }
    }
    let parts = split_parts(lane);
    for (var i = 0u; i < SPLIT_EACH; i++) {
        let unit = split_own[i];
        if unit.count > LIGHT_WIDTH {
            let at = split_part(unit) * SPLIT_SMALL_WORDS;
            for (var k = 0u; k < 3u; k++) {
                atomicMax(&split_found[at + k], ~top_ordered(unit.low[k]));
                atomicMax(&split_found[at + 3u + k], top_ordered(unit.high[k]));
            }
        }
    }
    workgroupBarrier();
    for (var i = 0u; i < SPLIT_EACH; i++) {
        var unit = split_own[i];
        if unit.count > LIGHT_WIDTH {
            let at = split_part(unit) * SPLIT_SMALL_WORDS;
            var low: vec3<f32>;
            var high: vec3<f32>;
            for (var k = 0u; k < 3u; k++) {
                low[k] = top_unordered(~atomicLoad(&split_found[at + k]));
                high[k] = top_unordered(atomicLoad(&split_found[at + 3u + k]));
            }
            unit = split_on_grid(split_within(unit, low, high));
            let cells = space_power_of_two(unit.power);
            for (var k = 0u; k < 3u; k++) {
                let pair = split_pair((unit.low[k] - low[k]) * cells, (unit.high[k] - low[k]) * cells);
                split_words[k * TOP_PIECE + unit.place] = pair;
            }
            split_words[3u * TOP_PIECE + unit.place] = unit.flux;
            // From here on in cells.
            split_own[i] = split_within(unit, vec3(0.0), floor((high - low) * cells));
        }
    }
    workgroupBarrier();
}

// Cuts all small parts, twin of `cut_small`, after `before` cuts of large parts. Returns the number
// of all cuts.
fn split_all_small(lane: u32, before: u32) -> u32 {
    split_round_all(lane);
    var cuts = before;
    // Then parts are halved, so these rounds are enough for any part.
    for (var round = 0u; round < TOP_SMALL_ROUNDS + TOP_SMALL_HALVINGS; round++) {
        split_clear_bits(lane);
        if lane < SPLIT_PARTS {
            atomicStore(&split_found[lane * SPLIT_SMALL_WORDS], SPLIT_NO_CUT);
        }
        workgroupBarrier();
        for (var i = 0u; i < SPLIT_EACH; i++) {
            if split_is_head(split_own[i]) {
                split_set_bit(SPLIT_HEAD_ROW, split_own[i].first);
            }
        }
        let parts = split_parts(lane);
        if parts == 0u {
            break;
        }
        var tried: array<SplitTry, SPLIT_EACH>;
        var part_of: array<u32, SPLIT_EACH>;
        for (var i = 0u; i < SPLIT_EACH; i++) {
            let unit = split_own[i];
            if unit.count > LIGHT_WIDTH {
                part_of[i] = split_part(unit);
                tried[i] = split_try_unit(unit);
                if round < TOP_SMALL_ROUNDS {
                    atomicMin(&split_found[part_of[i] * SPLIT_SMALL_WORDS], tried[i].cut_cost);
                }
                if split_is_head(unit) {
                    split_cut_costs[cuts + part_of[i]] = tried[i].part_cost;
                }
            }
        }
        workgroupBarrier();
        for (var i = 0u; i < SPLIT_EACH; i++) {
            let unit = split_own[i];
            if unit.count > LIGHT_WIDTH {
                let at = part_of[i] * SPLIT_SMALL_WORDS;
                let best = atomicLoad(&split_found[at]);
                let to_own = unit.bits & split_low_bits(unit.place - unit.base + 1u);
                if best == SPLIT_NO_CUT {
                    if countOneBits(to_own) == split_middle(unit.count) {
                        atomicStore(&split_found[at + 1u], to_own);
                    }
                } else if best == tried[i].cut_cost {
                    atomicStore(&split_found[at + 1u], tried[i].left);
                    for (var k = 0u; k < 3u; k++) {
                        atomicStore(&split_found[at + 2u + k], tried[i].left_box[k]);
                        atomicStore(&split_found[at + 5u + k], tried[i].right_box[k]);
                    }
                }
            }
        }
        workgroupBarrier();
        for (var i = 0u; i < SPLIT_EACH; i++) {
            var unit = split_own[i];
            if unit.count > LIGHT_WIDTH {
                let at = part_of[i] * SPLIT_SMALL_WORDS;
                let left = atomicLoad(&split_found[at + 1u]);
                let is_left = ((left >> (unit.place - unit.base)) & 1u) == 1u;
                if split_is_head(unit) {
                    split_record(cuts + part_of[i], unit, countOneBits(left));
                }
                unit = split_half(unit, cuts + part_of[i], countOneBits(left), is_left);
                if atomicLoad(&split_found[at]) != SPLIT_NO_CUT {
                    let box = at + select(5u, 2u, is_left);
                    let words = vec3(
                        atomicLoad(&split_found[box]),
                        atomicLoad(&split_found[box + 1u]),
                        atomicLoad(&split_found[box + 2u]),
                    );
                    let extent = unit.extent;
                    unit = split_within(unit, vec3<f32>(words & vec3(0xffffu)), vec3<f32>(words >> vec3(16u)));
                    split_mark_tiny(unit, cuts + part_of[i], is_left, extent);
                }
                unit.bits = select(unit.bits & ~left, left, is_left);
                split_own[i] = unit;
            }
        }
        cuts += parts;
        workgroupBarrier();
    }
    return cuts;
}

// Splits the units that `split_own` holds; unused ones have the count 0. Afterwards each unit is in a
// part that fits into a node, and at its place. Returns the number of cuts. Call from uniform
// control flow.
fn split_all(lane: u32) -> u32 {
    for (var cut = lane; cut < TOP_MAX_CUTS; cut += TOP_SPLIT_LANES) {
        atomicStore(&split_cut_sides[cut], 0u);
    }
    let cuts = split_all_small(lane, split_all_large(lane));
    for (var i = 0u; i < SPLIT_EACH; i++) {
        let unit = split_own[i];
        let before = unit.bits & (split_low_bits(unit.place - unit.base + 1u) >> 1u);
        split_own[i].place = unit.first + countOneBits(before);
    }
    return cuts;
}
