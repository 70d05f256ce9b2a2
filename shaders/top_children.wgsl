// Chooses the children of a node from the parts of a piece that has been split. Twin of
// src/tree/shape/children.rs. Binds nothing; reads the cuts of top_split.wgsl.
//
// A part is one word: first | count << 9 | cut << 18, where `cut` is the number of the cut that cuts
// it, plus one, or 0. Above that number, CHILDREN_TINY may be set. The lists of children are in
// `split_words`, eight words for each node.

// Set in the word of a part whose units are children of the node themselves.
const CHILDREN_INLINED: u32 = 0x80000000u;

// Set in the word of a part that is tiny beside its node: see `ChildGroup::is_tiny`.
const CHILDREN_TINY: u32 = SPLIT_TINY << 18u;

fn children_first(part: u32) -> u32 {
    return part & 0x1ffu;
}

fn children_count(part: u32) -> u32 {
    return (part >> 9u) & 0x1ffu;
}

// The number of the cut of a part, plus one; 0 if it is not cut.
fn children_cut(part: u32) -> u32 {
    return (part >> 18u) & 0xffu;
}

// The part on the left (`side` 0) or on the right (`side` 1) of a cut.
fn children_side(cut: u32, side: u32) -> u32 {
    let whole = split_cut_parts[cut];
    let left = (whole >> 18u) & 0x1ffu;
    let below = ((atomicLoad(&split_cut_sides[cut]) >> (16u * side)) & 0xffffu) << 18u;
    if side == 0u {
        return children_first(whole) | (left << 9u) | below;
    }
    return (children_first(whole) + left) | ((children_count(whole) - left) << 9u) | below;
}

// Whether the cut of one part comes before that of another: the costlier part first, of equals the
// larger, then the first.
fn children_is_before(part: u32, other: u32) -> bool {
    let cost = split_cut_costs[children_cut(part) - 1u];
    let other_cost = split_cut_costs[children_cut(other) - 1u];
    if cost != other_cost {
        return cost > other_cost;
    }
    if children_count(part) != children_count(other) {
        return children_count(part) > children_count(other);
    }
    return children_first(part) < children_first(other);
}

// Replaces a part by its halves, from the costliest on, while the node has room. The list begins at
// `at` and holds the part `whole` at first. Returns the number of children.
fn children_divide(at: u32, whole: u32) -> u32 {
    split_words[at] = whole & ~CHILDREN_TINY;
    var count = 1u;
    while count < LIGHT_WIDTH {
        var place = LIGHT_WIDTH;
        var costliest = 0u;
        for (var i = 0u; i < count; i++) {
            let part = split_words[at + i];
            if children_cut(part) != 0u && (part & CHILDREN_TINY) == 0u {
                var is_first = costliest == 0u;
                if !is_first {
                    is_first = children_is_before(part, costliest);
                }
                if is_first {
                    place = i;
                    costliest = part;
                }
            }
        }
        if costliest == 0u {
            break;
        }
        for (var i = count; i > place + 1u; i--) {
            split_words[at + i] = split_words[at + i - 1u];
        }
        let cut = children_cut(costliest) - 1u;
        split_words[at + place] = children_side(cut, 0u);
        split_words[at + place + 1u] = children_side(cut, 1u);
        count++;
    }
    return count;
}

// Inlines the smallest of `count` children while the node has room. Returns how many children are
// nodes.
fn children_inline(at: u32, count: u32) -> u32 {
    var room = LIGHT_WIDTH - count;
    var nodes = 0u;
    for (var i = 0u; i < count; i++) {
        nodes += select(0u, 1u, children_count(split_words[at + i]) > 1u);
    }
    while nodes > 0u {
        var place = 0u;
        var smallest = 0xffffffffu;
        for (var i = 0u; i < count; i++) {
            let part = split_words[at + i];
            let size = children_count(part);
            if size > 1u && (part & (CHILDREN_INLINED | CHILDREN_TINY)) == 0u && size < smallest {
                place = i;
                smallest = size;
            }
        }
        if smallest > room + 1u {
            break;
        }
        split_words[at + place] |= CHILDREN_INLINED;
        room -= smallest - 1u;
        nodes--;
    }
    return nodes;
}
