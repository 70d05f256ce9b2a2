// Merges the clusters of the children of a node. Twin of `WideCluster::merged_by`. Eight neighbouring
// invocations merge the children of a node, one for each child. Binds nothing.

// What the invocations of a node exchange: seven words of each, by word and invocation. Rows have one
// word more, so that the eight words of a node are in different banks of memory.
var<workgroup> pack_words: array<u32, 7u * (TOP_NODE_LANES + 1u)>;
// One word for each invocation: what the first seven have made of the eight values of one word.
var<workgroup> pack_results: array<u32, TOP_NODE_LANES>;

fn pack_word(word: u32, lane: u32) -> u32 {
    return word * (TOP_NODE_LANES + 1u) + lane;
}

// A word of the eight invocations of a node, of which `first` is the first.
fn pack_value(word: u32, first: u32, child: u32) -> f32 {
    return bitcast<f32>(pack_words[pack_word(word, first + child)]);
}

// The sum over the children of a node, in the order of `reduce` in src/tree/wide.rs.
fn pack_sum(word: u32, first: u32) -> f32 {
    let even = (pack_value(word, first, 0u) + pack_value(word, first, 4u))
        + (pack_value(word, first, 2u) + pack_value(word, first, 6u));
    let odd = (pack_value(word, first, 1u) + pack_value(word, first, 5u))
        + (pack_value(word, first, 3u) + pack_value(word, first, 7u));
    return even + odd;
}

fn pack_least(word: u32, first: u32) -> f32 {
    var least = pack_value(word, first, 0u);
    for (var child = 1u; child < LIGHT_WIDTH; child++) {
        least = min(least, pack_value(word, first, child));
    }
    return least;
}

fn pack_greatest(word: u32, first: u32) -> f32 {
    var greatest = pack_value(word, first, 0u);
    for (var child = 1u; child < LIGHT_WIDTH; child++) {
        greatest = max(greatest, pack_value(word, first, child));
    }
    return greatest;
}

fn pack_result(first: u32, word: u32) -> f32 {
    return bitcast<f32>(pack_results[first + word]);
}

fn pack_result3(first: u32, word: u32) -> vec3<f32> {
    return vec3(pack_result(first, word), pack_result(first, word + 1u), pack_result(first, word + 2u));
}

// Merges the clusters of the eight invocations of a node, of which this one has `child`. Weights are
// positive where fluxes are. The flux of the result is the sum of the weights. What else it needs is in
// pack_words, for pack_between and pack_finished, until they are written again after a barrier. Call from
// uniform control flow.
fn pack_merged(lane: u32, child: LightCluster, weight: f32) -> LightCluster {
    let slot = lane % LIGHT_WIDTH;
    let first = lane - slot;
    let is_lit = child.flux > 0.0;
    pack_words[pack_word(0u, lane)] = bitcast<u32>(weight);
    for (var k = 0u; k < 3u; k++) {
        pack_words[pack_word(1u + k, lane)] = bitcast<u32>(select(NOWHERE, child.box_min[k], is_lit));
        pack_words[pack_word(4u + k, lane)] = bitcast<u32>(select(-NOWHERE, child.box_max[k], is_lit));
    }
    workgroupBarrier();
    // Each of seven invocations finds the result of one word.
    if slot == 0u {
        pack_results[lane] = bitcast<u32>(pack_sum(slot, first));
    } else if slot < 4u {
        pack_results[lane] = bitcast<u32>(pack_least(slot, first));
    } else if slot < 7u {
        pack_results[lane] = bitcast<u32>(pack_greatest(slot, first));
    }
    workgroupBarrier();
    let total = pack_result(first, 0u);
    var merged = CLUSTER_EMPTY;
    var share = 0.0;
    if total > 0.0 {
        share = weight * (1.0 / total);
        merged.flux = min(total, LIGHT_MAX_FLUX);
        merged.box_min = pack_result3(first, 1u);
        merged.box_max = pack_result3(first, 4u);
    }
    let middle = 0.5 * (merged.box_min + merged.box_max);
    for (var k = 0u; k < 3u; k++) {
        pack_words[pack_word(k, lane)] = bitcast<u32>(share * (child.mean[k] - middle[k]));
        pack_words[pack_word(3u + k, lane)] = bitcast<u32>(share * child.axis[k]);
    }
    pack_words[pack_word(6u, lane)] = bitcast<u32>(share * child.variance);
    workgroupBarrier();
    if slot < 7u {
        pack_results[lane] = bitcast<u32>(pack_sum(slot, first));
    }
    workgroupBarrier();
    var unit = vec3(0.0);
    if total > 0.0 {
        merged.mean = middle + pack_result3(first, 0u);
        merged.axis = pack_result3(first, 3u);
        let length = length(merged.axis);
        if length <= MIN_AXIS {
            merged.axis = vec3(0.0);
        } else {
            unit = merged.axis / length;
        }
    }
    let way = child.mean - merged.mean;
    pack_words[pack_word(0u, lane)] = bitcast<u32>(share * (way.x * way.x + way.y * way.y + way.z * way.z));
    pack_words[pack_word(1u, lane)] = bitcast<u32>(cap_about(unit, child));
    pack_words[pack_word(2u, lane)] = bitcast<u32>(child.range);
    workgroupBarrier();
    if total > 0.0 {
        merged.variance = pack_result(first, 6u);
    }
    return merged;
}

// The variance of the mean positions of the children about that of the cluster.
fn pack_between(first: u32, merged: LightCluster) -> f32 {
    return select(0.0, pack_sum(0u, first), merged.flux > 0.0);
}

// A merged cluster with its variance, cap and range. `between` is that of pack_between.
fn pack_finished(first: u32, merged: LightCluster, between: f32) -> LightCluster {
    var finished = merged;
    if merged.flux > 0.0 {
        finished.variance = between + merged.variance;
        finished.cos_half_angle = -1.0;
        if any(merged.axis != vec3(0.0)) {
            finished.cos_half_angle = pack_least(1u, first);
        }
        finished.range = pack_greatest(2u, first);
    }
    return finished;
}
