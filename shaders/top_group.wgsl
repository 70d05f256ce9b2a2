// Top level, the first stage of a pass: divides the units into pieces of neighbours in
// space, splits each piece, and chooses the children of its nodes. The costliest parts of a piece are
// the units that it leaves. In the last pass all units are one piece, which is the whole tree. Twin
// of `pieces_of` and `PieceTree` in src/top/mod.rs. One workgroup for each piece.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
@group(0) @binding(2) var<storage, read_write> bounds: array<u32, TOP_SPACE_WORDS>;
@group(0) @binding(3) var<storage, read_write> nodes: array<u32>;
@group(0) @binding(4) var<storage, read_write> keys: array<u32>;
@group(0) @binding(5) var<storage, read_write> order: array<u32>;
@group(0) @binding(6) var<storage, read_write> units: array<u32>;

// What `split_words` holds once the piece is split: the number of the unit at each place; for each
// node its part and the place of its parent; for each node of one depth the number of its children
// that are nodes, and the list of its children.
const GROUP_NODE_PARTS: u32 = TOP_PIECE;
const GROUP_PARENTS: u32 = GROUP_NODE_PARTS + TOP_MAX_NODES;
const GROUP_BELOW: u32 = GROUP_PARENTS + TOP_MAX_NODES;
const GROUP_CHILDREN: u32 = GROUP_BELOW + TOP_MAX_NODES;

// A row of bits of `split_bits` once the piece is split: a unit that is left begins at the place.
const GROUP_LEFT_ROW: u32 = SPLIT_HEAD_ROW;
// Of those, the nodes.
const GROUP_NODE_ROW: u32 = SPLIT_LEFT_ROW;

// For the start of this piece and of the next: the rank of the best place, and the step of that place
// from the first that it may be. See `piece_start` in src/top/mod.rs.
var<workgroup> group_starts: array<atomic<u32>, 2>;

// The number of nodes that the piece leaves.
var<workgroup> group_tops: u32;

// The start of a piece if all pieces had the same size.
fn group_even(total: u32, pieces: u32, piece: u32) -> u32 {
    return piece * (total / pieces) + min(piece, total % pieces);
}

// The key of the unit at an index.
fn group_key(index: u32) -> u32 {
    if top_pass.units_before == TOP_FIRST_PASS {
        return keys[index];
    }
    return space_key(clusters[gather_unit(index)].mean);
}

// A piece begins at most this far from its even start.
fn group_half_share(total: u32, pieces: u32) -> u32 {
    return (total / pieces - TOP_UNITS_PER_NODE) / 2u;
}

// Ranks the places where this piece and the next may begin.
fn group_rank_starts(lane: u32, total: u32, pieces: u32, piece: u32) {
    let half_share = group_half_share(total, pieces);
    for (var side = 0u; side < 2u; side++) {
        if piece + side == 0u || piece + side == pieces {
            continue;
        }
        let even = group_even(total, pieces, piece + side);
        for (var step = lane; step < 2u * half_share; step += TOP_SPLIT_LANES) {
            let unit = even - half_share + step;
            let digit = 32u - countLeadingZeros(group_key(unit) ^ group_key(unit - 1u));
            let near = half_share - (max(unit, even) - min(unit, even));
            atomicMax(&group_starts[side], (digit << 16u) | (near << 8u) | step);
        }
    }
}

// The start of this piece (`side` 0) or of the next piece (`side` 1).
fn group_start(total: u32, pieces: u32, piece: u32, side: u32) -> u32 {
    let even = group_even(total, pieces, piece + side);
    if piece + side == 0u || piece + side == pieces {
        return even;
    }
    return even - group_half_share(total, pieces) + (atomicLoad(&group_starts[side]) & 0xffu);
}

// Writes how many units a piece leaves, and where its nodes are.
fn group_write_header(piece: u32, left: u32, first_node: u32, count: u32) {
    let at = top_pass.units_after + 1u + 3u * piece;
    units[at] = left;
    units[at + 1u] = first_node;
    units[at + 2u] = count;
}

// The first entry in the list of units that this pass leaves.
fn group_entries() -> u32 {
    return top_pass.units_after + 1u + 3u * top_pass.pieces;
}

// Writes the unit of a part that the piece leaves. A part of one unit stays that unit. Any other part
// becomes a node, which enters the queue.
fn group_leave(part: u32, entries: u32, first_node: u32) {
    let first = children_first(part);
    let place = entries + split_bits_before(GROUP_LEFT_ROW, first);
    if !split_has_bit(GROUP_NODE_ROW, first) {
        units[place] = split_words[first];
        return;
    }
    let node = split_bits_before(GROUP_NODE_ROW, first);
    split_words[GROUP_NODE_PARTS + node] = part;
    split_words[GROUP_PARENTS + node] = LIGHT_NO_PARENT;
    // Nothing is left of the whole tree.
    if top_pass.pieces != 0u {
        units[place] = top_pass.capacity + first_node + node;
    }
}

// Marks a part that the piece leaves.
fn group_mark(part: u32) {
    split_set_bit(GROUP_LEFT_ROW, children_first(part));
    if children_count(part) > 1u || top_pass.pieces == 0u {
        split_set_bit(GROUP_NODE_ROW, children_first(part));
    }
}

// Whether a part is cut by one of the costliest cuts.
fn group_is_cut(part: u32) -> bool {
    let cut = children_cut(part);
    return cut != 0u && (split_cut_parts[max(cut, 1u) - 1u] & CHILDREN_INLINED) != 0u;
}

// The word of the whole piece.
fn group_whole(count: u32, cuts: u32) -> u32 {
    return (count << 9u) | (min(cuts, 1u) << 18u);
}

// Finds the parts that the costliest cuts leave, at most `most` of them, and enters their nodes into
// the queue. Twin of `SplitPiece::costliest_parts`.
fn group_leave_all(lane: u32, count: u32, cuts: u32, most: u32, entries: u32, first_node: u32) {
    split_clear_bits(lane);
    // There are more invocations than cuts.
    var is_costly = false;
    if lane < cuts {
        let own = (split_cut_parts[lane] & 0x3ffffu) | ((lane + 1u) << 18u);
        var before = 0u;
        for (var cut = 0u; cut < cuts; cut++) {
            let cost = split_cut_costs[cut];
            if cost > split_cut_costs[lane] {
                before++;
            } else if cost == split_cut_costs[lane] {
                let other = (split_cut_parts[cut] & 0x3ffffu) | ((cut + 1u) << 18u);
                before += select(0u, 1u, children_is_before(other, own));
            }
        }
        is_costly = before + 1u < most;
    }
    workgroupBarrier();
    if is_costly {
        split_cut_parts[lane] |= CHILDREN_INLINED;
    }
    workgroupBarrier();
    let whole = group_whole(count, cuts);
    let is_whole = lane == 0u && !group_is_cut(whole);
    var sides: array<u32, 2>;
    var is_left: array<bool, 2>;
    for (var side = 0u; side < 2u; side++) {
        if is_costly {
            sides[side] = children_side(lane, side);
            is_left[side] = !group_is_cut(sides[side]);
        }
    }
    if is_whole {
        group_mark(whole);
    }
    for (var side = 0u; side < 2u; side++) {
        if is_left[side] {
            group_mark(sides[side]);
        }
    }
    workgroupBarrier();
    split_sum_row(lane, GROUP_LEFT_ROW);
    split_sum_row(lane, GROUP_NODE_ROW);
    workgroupBarrier();
    if is_whole {
        group_leave(whole, entries, first_node);
    }
    for (var side = 0u; side < 2u; side++) {
        if is_left[side] {
            group_leave(sides[side], entries, first_node);
        }
    }
    if lane == 0u {
        group_tops = split_bits_before(GROUP_NODE_ROW, TOP_PIECE);
    }
}

// Writes the child bits of a node. Those children that are nodes enter the queue from `next` on.
fn group_write_children(node: u32, children: u32, count: u32, first_node: u32, next: u32) {
    var slot = 0u;
    var below = next;
    for (var i = 0u; i < count; i++) {
        let part = split_words[children + i];
        if (part & CHILDREN_INLINED) == 0u && children_count(part) > 1u {
            let place = (first_node + node) * LIGHT_WIDTH + slot;
            split_words[GROUP_NODE_PARTS + below] = part;
            split_words[GROUP_PARENTS + below] = place;
            node_store_child_bits(node_layout(), place, first_node + below);
            below++;
            slot++;
        } else {
            let first = children_first(part);
            for (var unit = first; unit < first + children_count(part); unit++) {
                let place = (first_node + node) * LIGHT_WIDTH + slot;
                let below_node = split_words[unit];
                node_store_child_bits(node_layout(), place, gather_child(below_node));
                if below_node >= top_pass.capacity {
                    node_store_parent(node_layout(), below_node - top_pass.capacity, place);
                }
                slot++;
            }
        }
    }
    for (; slot < LIGHT_WIDTH; slot++) {
        node_store_child_bits(node_layout(), (first_node + node) * LIGHT_WIDTH + slot, LIGHT_EMPTY_SLOT);
    }
}

// Makes the nodes below the `tops` first nodes of the queue, depth by depth. Returns the number of
// nodes.
fn group_make_nodes(lane: u32, tops: u32, first_node: u32) -> u32 {
    var begin = 0u;
    var end = tops;
    // No piece has more nodes than that, so no depth has.
    while begin < end {
        let node = begin + lane;
        let children = GROUP_CHILDREN + lane * LIGHT_WIDTH;
        var count = 0u;
        if node < end {
            count = children_divide(children, split_words[GROUP_NODE_PARTS + node]);
            split_words[GROUP_BELOW + lane] = children_inline(children, count);
        }
        workgroupBarrier();
        if node < end {
            var next = end;
            for (var other = 0u; other < lane; other++) {
                next += split_words[GROUP_BELOW + other];
            }
            group_write_children(node, children, count, first_node, next);
            node_store_parent(node_layout(), first_node + node, split_words[GROUP_PARENTS + node]);
            node_store_depth(node_layout(), first_node + node, first_node + begin);
            if node == end - 1u {
                gather_total = next + split_words[GROUP_BELOW + lane];
            }
        }
        begin = end;
        end = workgroupUniformLoad(&gather_total);
    }
    return end;
}

@compute @workgroup_size(TOP_SPLIT_LANES)
fn top_group(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups_of_pass: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let piece = group.x + group.y * groups_of_pass.x;
    let is_root = top_pass.pieces == 0u;
    // A dispatch of two dimensions has workgroups without a piece. The words at their places are
    // those of the list of units.
    if piece >= max(top_pass.pieces, 1u) {
        return;
    }
    split_clear_extremes(lane);
    if lane < 2u {
        atomicStore(&group_starts[lane], 0u);
    }
    // Its barriers come before the first extreme and the first rank.
    let total = gather_count(lane);
    if !is_root && total <= TOP_PIECE {
        // The last pass can hold all units, so they are passed on as the units of the first piece.
        if piece == 0u {
            for (var unit = lane; unit < total; unit += TOP_SPLIT_LANES) {
                units[group_entries() + unit] = gather_unit(unit);
            }
        }
        if lane == 0u && piece == 0u {
            units[top_pass.units_after] = TOP_PIECE;
        }
        if lane == 0u {
            group_write_header(piece, select(0u, total, piece == 0u), 0u, 0u);
        }
        return;
    }
    let pieces = select((total + TOP_SHARE - 1u) / TOP_SHARE, 1u, is_root);
    let most = select(max(TOP_PIECE / pieces, TOP_LEFT), 1u, is_root);
    if lane == 0u && piece == 0u {
        units[top_pass.units_after] = most;
    }
    if piece >= pieces {
        if lane == 0u {
            group_write_header(piece, 0u, 0u, 0u);
        }
        return;
    }
    group_rank_starts(lane, total, pieces, piece);
    workgroupBarrier();
    let start = group_start(total, pieces, piece, 0u);
    let count = group_start(total, pieces, piece, 1u) - start;
    let first_node = top_pass.first_node + start / TOP_UNITS_PER_NODE;
    var own: array<u32, SPLIT_EACH>;
    for (var i = 0u; i < SPLIT_EACH; i++) {
        let unit = lane + i * TOP_SPLIT_LANES;
        if unit < count {
            own[i] = gather_unit(start + unit);
            split_add_to_extremes(clusters[own[i]]);
        }
    }
    workgroupBarrier();
    split_tiny_above = select(TOP_PIECE, count / 3u, is_root);
    for (var i = 0u; i < SPLIT_EACH; i++) {
        let unit = lane + i * TOP_SPLIT_LANES;
        split_own[i] = SplitUnit();
        if unit < count {
            split_own[i] = split_unit(clusters[own[i]], unit, count);
        }
    }
    let cuts = split_all(lane);
    for (var i = 0u; i < SPLIT_EACH; i++) {
        if split_own[i].count > 0u {
            split_words[split_own[i].place] = own[i];
        }
    }
    let entries = group_entries() + piece * most;
    group_leave_all(lane, count, cuts, most, entries, first_node);
    let tops = workgroupUniformLoad(&group_tops);
    let made = group_make_nodes(lane, tops, first_node);
    if lane == 0u {
        group_write_header(piece, split_bits_before(GROUP_LEFT_ROW, TOP_PIECE), first_node, made);
    }
}
