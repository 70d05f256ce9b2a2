// Finds the units of a round: instances in the curve's order, or what the last round left. Reads what the stage binds
// as `units`, `slots` and `bounds`; borrows the memory of `split_order`.

var<workgroup> gather_total: u32;

// Numbers of the last round that one invocation adds up.
fn gather_share() -> u32 {
    return (top_pass.pieces_before + TOP_SPLIT_LANES - 1u) / TOP_SPLIT_LANES;
}

// How many units there are; `split_order` then holds how many come before each invocation's share. Call from uniform
// control flow.
fn gather_count(lane: u32) -> u32 {
    if top_pass.units_before == TOP_SORTED {
        if lane == 0u {
            gather_total = bounds[6];
        }
        return workgroupUniformLoad(&gather_total);
    }
    let share = gather_share();
    var own = 0u;
    for (var piece = lane * share; piece < min((lane + 1u) * share, top_pass.pieces_before); piece++) {
        own += units[top_pass.units_before + piece];
    }
    // Hillis and Steele (1986).
    var sum = own;
    for (var reach = 1u; reach < TOP_SPLIT_LANES; reach *= 2u) {
        split_order[lane] = sum;
        workgroupBarrier();
        if lane >= reach {
            sum += split_order[lane - reach];
        }
        workgroupBarrier();
    }
    split_order[lane] = sum - own;
    if lane == TOP_SPLIT_LANES - 1u {
        gather_total = sum;
    }
    return workgroupUniformLoad(&gather_total);
}

// The unit with this number among all.
fn gather_unit(index: u32) -> u32 {
    if top_pass.units_before == TOP_SORTED {
        return slots[index];
    }
    // The last share that begins at or before it.
    var low = 0u;
    var high = TOP_SPLIT_LANES;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if split_order[middle] <= index {
            low = middle;
        } else {
            high = middle;
        }
    }
    var rest = index - split_order[low];
    var piece = low * gather_share();
    while rest >= units[top_pass.units_before + piece] {
        rest -= units[top_pass.units_before + piece];
        piece++;
    }
    return units[top_pass.units_before + top_pass.pieces_before + piece * TOP_LEFT + rest];
}

// What a child's target says of a unit.
fn gather_target(unit: u32) -> u32 {
    if unit < top_pass.capacity {
        return LIGHT_LEAF | unit;
    }
    return unit - top_pass.capacity;
}
