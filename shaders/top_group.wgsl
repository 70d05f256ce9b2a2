// Top level, the first stage of a round: divides the units into pieces of neighbours along the
// curve, and splits each piece into groups. A group of several units becomes a node, a single unit
// stays a unit. Twin of `groups_of_pieces` in src/top/mod.rs. One workgroup for each piece.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
@group(0) @binding(2) var<storage, read_write> bounds: array<u32, 8>;
@group(0) @binding(3) var<storage, read_write> nodes: array<u32>;
@group(0) @binding(5) var<storage, read_write> order: array<u32>;
@group(0) @binding(6) var<storage, read_write> units: array<u32>;

// Rounds need no record of their splits.
fn split_record(lane: u32, parts: u32) {
}

// For the start of this piece and of the next: the rank of the best place in the window, and the
// step of that place from the first in the window. See `piece_start` in src/top/mod.rs.
var<workgroup> group_starts: array<atomic<u32>, 2>;

// The start of a piece if all pieces had the same size.
fn group_even(total: u32, pieces: u32, piece: u32) -> u32 {
    return piece * (total / pieces) + min(piece, total % pieces);
}

// The key of the unit at an index.
fn group_key(index: u32) -> u32 {
    return curve_key_of(clusters[gather_unit(index)].mean);
}

// Ranks the places in the windows of both starts. Half of the invocations work on each window.
fn group_rank_starts(lane: u32, total: u32, pieces: u32, piece: u32) {
    let side = lane / (2u * TOP_WINDOW);
    let step = lane % (2u * TOP_WINDOW);
    if side > 1u || piece + side == 0u || piece + side == pieces {
        return;
    }
    let even = group_even(total, pieces, piece + side);
    let unit = even - TOP_WINDOW + step;
    let digit = 32u - countLeadingZeros(group_key(unit) ^ group_key(unit - 1u));
    let near = TOP_WINDOW - (max(unit, even) - min(unit, even));
    atomicMax(&group_starts[side], (digit << 16u) | (near << 8u) | step);
}

// The start of this piece (`side` 0) or of the next piece (`side` 1).
fn group_start(total: u32, pieces: u32, piece: u32, side: u32) -> u32 {
    let even = group_even(total, pieces, piece + side);
    if piece + side == 0u || piece + side == pieces {
        return even;
    }
    return even - TOP_WINDOW + (atomicLoad(&group_starts[side]) & 0xffu);
}

@compute @workgroup_size(TOP_SPLIT_LANES)
fn top_group(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups_of_pass: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let piece = group.x + group.y * groups_of_pass.x;
    // A dispatch of two dimensions has workgroups without a piece. The words at their places are
    // those of the list of units.
    if piece >= top_pass.pieces {
        return;
    }
    split_clear_extremes(lane);
    if lane < 2u {
        atomicStore(&group_starts[lane], 0u);
    }
    // Its barriers come before the first extreme and the first rank.
    let total = gather_count(lane);
    let left = top_pass.units_after + top_pass.pieces;
    if total <= TOP_ROOT_UNITS {
        // The upper part can hold all units, so they are passed on as the units of the first piece.
        if piece == 0u && lane < total {
            units[left + lane] = gather_unit(lane);
        }
        if lane == 0u {
            units[top_pass.units_after + piece] = select(0u, total, piece == 0u);
        }
        return;
    }
    let pieces = (total + TOP_SHARE - 1u) / TOP_SHARE;
    if piece >= pieces {
        if lane == 0u {
            units[top_pass.units_after + piece] = 0u;
        }
        return;
    }
    group_rank_starts(lane, total, pieces, piece);
    workgroupBarrier();
    let start = group_start(total, pieces, piece, 0u);
    let count = group_start(total, pieces, piece, 1u) - start;
    var own: array<u32, SPLIT_EACH>;
    for (var i = 0u; i < SPLIT_EACH; i++) {
        let unit = lane + i * TOP_SPLIT_LANES;
        if unit < count {
            own[i] = gather_unit(start + unit);
            split_add_to_extremes(clusters[own[i]]);
        }
    }
    workgroupBarrier();
    for (var i = 0u; i < SPLIT_EACH; i++) {
        let unit = lane + i * TOP_SPLIT_LANES;
        if unit < count {
            split_put(unit, clusters[own[i]]);
        }
    }
    split_all(lane, count);

    // The grid is not needed any more, so the first row of its words takes the numbers of the
    // units.
    workgroupBarrier();
    split_clear(lane);
    for (var i = 0u; i < SPLIT_EACH; i++) {
        split_words[lane + i * TOP_SPLIT_LANES] = own[i];
    }
    workgroupBarrier();
    for (var place = lane; place < count; place += TOP_SPLIT_LANES) {
        if split_part(place).first == place {
            split_set_bit(SPLIT_HEAD_ROW, place);
        }
    }
    workgroupBarrier();
    var groups = split_count_bits(SPLIT_HEAD_ROW, 0u, count);
    let is_scattered = groups > (count + 3u) / 4u;
    if is_scattered {
        groups = (count + LIGHT_WIDTH - 1u) / LIGHT_WIDTH;
    }
    for (var place = lane; place < count; place += TOP_SPLIT_LANES) {
        var part = split_part(place);
        var index = split_count_bits(SPLIT_HEAD_ROW, 0u, place + 1u) - 1u;
        if is_scattered {
            index = place / LIGHT_WIDTH;
            part = SplitPart(index * LIGHT_WIDTH, min(LIGHT_WIDTH, count - index * LIGHT_WIDTH));
        }
        let unit = split_words[split_unit(place)];
        let node = top_pass.first_node + piece * TOP_MAX_GROUPS + index;
        let is_alone = part.count == 1u;
        if !is_alone {
            node_store_target(node_layout(), node * LIGHT_WIDTH + place - part.first, gather_target(unit));
        }
        if place == part.first {
            units[left + piece * TOP_MAX_GROUPS + index] = select(top_pass.capacity + node, unit, is_alone);
            for (var slot = part.count; slot < LIGHT_WIDTH && !is_alone; slot++) {
                node_store_target(node_layout(), node * LIGHT_WIDTH + slot, LIGHT_EMPTY_SLOT);
            }
        }
    }
    if lane == 0u {
        units[top_pass.units_after + piece] = groups;
    }
}
