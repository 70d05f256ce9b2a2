// Finds the units of a pass: the parts in the order in space, or the units that the last
// pass has left. Binds nothing; reads the variables `units`, `order` and `bounds` of the stage,
// and uses `split_words` of top_split.wgsl as scratch memory.

var<workgroup> gather_total: u32;

// The first of the three words about a piece of the last pass. The entries of the list follow the
// last piece.
fn gather_header(piece: u32) -> u32 {
    return top_pass.units_before + 1u + 3u * piece;
}

// The number of pieces of the last pass whose units one invocation adds up.
fn gather_share() -> u32 {
    return (top_pass.pieces_before + TOP_SPLIT_LANES - 1u) / TOP_SPLIT_LANES;
}

// The number of units. `split_words` then holds, for each invocation, the number of units before
// its share. Call from uniform control flow.
fn gather_count(lane: u32) -> u32 {
    if top_pass.units_before == TOP_FIRST_PASS {
        if lane == 0u {
            gather_total = bounds[6];
        }
        return workgroupUniformLoad(&gather_total);
    }
    let share = gather_share();
    var own = 0u;
    for (var piece = lane * share; piece < min((lane + 1u) * share, top_pass.pieces_before); piece++) {
        own += units[gather_header(piece)];
    }
    // A prefix sum after Hillis and Steele (1986).
    var sum = own;
    for (var reach = 1u; reach < TOP_SPLIT_LANES; reach *= 2u) {
        split_words[lane] = sum;
        workgroupBarrier();
        if lane >= reach {
            sum += split_words[lane - reach];
        }
        workgroupBarrier();
    }
    split_words[lane] = sum - own;
    if lane == TOP_SPLIT_LANES - 1u {
        gather_total = sum;
    }
    return workgroupUniformLoad(&gather_total);
}

// The unit at an index among all units of the pass.
fn gather_unit(index: u32) -> u32 {
    if top_pass.units_before == TOP_FIRST_PASS {
        return order[index];
    }
    // The last share that begins at or before the index.
    var low = 0u;
    var high = TOP_SPLIT_LANES;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if split_words[middle] <= index {
            low = middle;
        } else {
            high = middle;
        }
    }
    var rest = index - split_words[low];
    var piece = low * gather_share();
    while rest >= units[gather_header(piece)] {
        rest -= units[gather_header(piece)];
        piece++;
    }
    let stride = units[top_pass.units_before];
    return units[gather_header(top_pass.pieces_before) + piece * stride + rest];
}

// The child bits of a child that is this unit. Of a part they are its number until node_pack
// replaces them.
fn gather_child(unit: u32) -> u32 {
    if unit < top_pass.capacity {
        return LIGHT_LEAF | unit;
    }
    return unit - top_pass.capacity;
}
