// Refits pieces of trees whose lights the engine has written on the GPU: the deepest nodes of a piece
// first. Twin of `NodeSlices::refit` in src/tree/refit.rs. One workgroup for each piece, and eight
// invocations for each node.

@group(0) @binding(0) var<uniform> refit_pass: RefitPass;
@group(0) @binding(1) var<storage, read_write> nodes: array<u32>;
@group(0) @binding(2) var<storage, read_write> sources: array<LightSourceRecord>;
// The clusters of the uppermost nodes of all pieces.
@group(0) @binding(3) var<storage, read_write> clusters: array<RefitCluster>;
@group(0) @binding(4) var<storage, read_write> measures: array<LightMeasure>;
@group(0) @binding(5) var<storage, read> lights: array<vec4<u32>>;
// See `Piece` in src/plan/sources/pieces.rs.
@group(0) @binding(6) var<storage, read> pieces: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read> lists: array<u32>;

// The clusters of the entries of the piece that are done.
var<workgroup> refit_done: array<RefitCluster, REFIT_ENTRIES>;

// A child of a node. `below` says which entries are the children that are nodes.
fn refit_child(source: u32, child_bits: u32, slot: u32, below: u32) -> RefitCluster {
    if child_bits == LIGHT_EMPTY_SLOT {
        return REFIT_EMPTY;
    }
    if (child_bits & LIGHT_LEAF) != 0u {
        return refit_light(source, child_bits & ~LIGHT_LEAF);
    }
    let before = countOneBits((below >> 24u) & ((1u << slot) - 1u));
    return refit_done[(below & 0xffffffu) + before];
}

// What the flux of a child counts as in the tree's reference instance. Twin of the weights in
// `WideCluster::merged_for`.
fn refit_weight(source: u32, child: RefitCluster) -> f32 {
    if sources[source].flags == 0u || child.cluster.flux <= 0.0 {
        return child.cluster.flux;
    }
    var map: Linear;
    map.area_x = sources[source].weights[0].xyz;
    map.area_y = sources[source].weights[1].xyz;
    map.area_z = sources[source].weights[2].xyz;
    return max(linear_flux(map, child.punctual_flux, child.area_flux, child.cluster.axis), LIGHT_MIN_FLUX);
}

// Adds up to seven numbers of the eight invocations of a node. Call from uniform control flow.
fn refit_sums(lane: u32, words: array<f32, 7>) -> array<f32, 7> {
    let first = lane - lane % LIGHT_WIDTH;
    var sums = words;
    for (var i = 0u; i < 7u; i++) {
        pack_words[pack_word(i, lane)] = bitcast<u32>(sums[i]);
    }
    workgroupBarrier();
    for (var i = 0u; i < 7u; i++) {
        sums[i] = pack_sum(i, first);
    }
    workgroupBarrier();
    return sums;
}

// The size of a box with these edges. Twin of `size` in src/tree/cost.rs.
fn refit_size(edges: vec3<f32>) -> f32 {
    return edges.x * edges.y + edges.y * edges.z + edges.z * edges.x + dot(edges, edges) * REFIT_DIAGONAL_WEIGHT;
}

// Twin of `orientation` in src/tree/cost.rs.
fn refit_orientation(length: f32) -> f32 {
    let wide = REFIT_ALL_SIDES - REFIT_FALL_TO_FLAT * length;
    return LIGHT_SOURCE_PI * max(max(wide, REFIT_FALL_TO_BEAM * (1.0 - length)), 0.0);
}

// The half perimeters of the intersections of this child's box with those of the next four children,
// the fourth by half. Twin of `overlap` in src/tree/attributes.rs. Call from uniform control flow.
fn refit_overlap(lane: u32, cluster: LightCluster) -> f32 {
    let slot = lane % LIGHT_WIDTH;
    let first = lane - slot;
    let is_lit = cluster.flux > 0.0;
    let low = select(vec3(REFIT_FAR), cluster.box_min, is_lit);
    let high = select(vec3(-REFIT_FAR), cluster.box_max, is_lit);
    for (var k = 0u; k < 3u; k++) {
        pack_words[pack_word(k, lane)] = bitcast<u32>(low[k]);
        pack_words[pack_word(3u + k, lane)] = bitcast<u32>(high[k]);
    }
    workgroupBarrier();
    var shared_edges = 0.0;
    for (var offset = 1u; offset <= LIGHT_WIDTH / 2u; offset++) {
        let other = (slot + offset) % LIGHT_WIDTH;
        let other_low = vec3(pack_value(0u, first, other), pack_value(1u, first, other), pack_value(2u, first, other));
        let other_high = vec3(pack_value(3u, first, other), pack_value(4u, first, other), pack_value(5u, first, other));
        let edges = min(high, other_high) - max(low, other_low);
        let weight = select(1.0, 0.5, offset == LIGHT_WIDTH / 2u);
        if min(edges.x, min(edges.y, edges.z)) >= 0.0 {
            shared_edges += weight * (edges.x + edges.y + edges.z);
        }
    }
    workgroupBarrier();
    return shared_edges;
}

// Four bits that say how flux is divided between surfaces and lights without size. Twin of
// `Node::pack_area_ratios`.
fn refit_area_code(child: RefitCluster, steps: u32) -> u32 {
    if child.area_flux <= 0.0 {
        return 0u;
    }
    if child.punctual_flux <= 0.0 {
        return LIGHT_ALL_SURFACES;
    }
    let shift = bitcast<i32>(steps) >> 28u;
    // A difference, because the quotient may leave f32.
    let ratio = log2(child.area_flux) - log2(child.punctual_flux) + f32(3 * shift);
    return u32(clamp(round(ratio + 7.0), 1.0, 14.0));
}

// Refits a node. `entry` is its place in the piece. Call from uniform control flow; invocations without
// a node have `is_used` false.
fn refit_node(lane: u32, source: u32, entry: u32, words: vec2<u32>, is_used: bool) -> RefitCluster {
    let slot = lane % LIGHT_WIDTH;
    let first = lane - slot;
    let node = sources[source].node_base + words.x;
    let place = node * LIGHT_WIDTH + slot;
    var child = REFIT_EMPTY;
    if is_used {
        child = refit_child(source, nodes[node_child_word(place)], slot, words.y);
    }
    var merged: RefitCluster;
    merged.cluster = pack_merged(lane, child.cluster, refit_weight(source, child));
    let between = pack_between(first, merged.cluster);
    merged.cluster = pack_finished(first, merged.cluster, between);
    workgroupBarrier();
    let fluxes = refit_sums(
        lane, array(child.cluster.flux, child.punctual_flux, child.area_flux, 0.0, 0.0, 0.0, 0.0),
    );
    merged.cluster.flux = min(fluxes[0], LIGHT_MAX_FLUX);
    merged.punctual_flux = min(fluxes[1], LIGHT_MAX_FLUX);
    merged.area_flux = min(fluxes[2], LIGHT_MAX_FLUX);
    var share = 0.0;
    if merged.cluster.flux > 0.0 {
        share = child.cluster.flux / merged.cluster.flux;
    }
    let overlap = refit_overlap(lane, child.cluster);
    let edges = select(vec3(0.0), child.cluster.box_max - child.cluster.box_min, child.cluster.flux > 0.0);
    let cost = refit_size(edges) * refit_orientation(length(child.cluster.axis));
    let sums = refit_sums(lane, array(
        overlap, share * child.distance, share * child.overlap, share * child.variance,
        share * (child.cost + cost), 0.0, 0.0,
    ));
    let extent = merged.cluster.box_max - merged.cluster.box_min;
    let perimeter = extent.x + extent.y + extent.z;
    merged.distance = sqrt(between) + sums[1];
    merged.overlap = select(0.0, sums[0] / max(perimeter, LIGHT_MIN_FLUX), perimeter > 0.0) + sums[2];
    merged.variance = merged.cluster.variance + sums[3];
    merged.cost = sums[4];

    let bits = vec3(
        step_bits(merged.cluster.box_min.x, merged.cluster.box_max.x),
        step_bits(merged.cluster.box_min.y, merged.cluster.box_max.y),
        step_bits(merged.cluster.box_min.z, merged.cluster.box_max.z),
    );
    // The number of children and the shift of the ratios stay as they are.
    let head = 4u * node * LIGHT_NODE_QUADS;
    var steps = 0u;
    if is_used {
        steps = nodes[head + 3u] & 0xff000000u;
        node_store_child(place, child_packed(child.cluster, merged.cluster.box_min, bits));
    }
    pack_words[pack_word(0u, lane)] = refit_area_code(child, steps) << (4u * slot);
    workgroupBarrier();
    if is_used && slot == 0u {
        var ratios = 0u;
        for (var i = 0u; i < LIGHT_WIDTH; i++) {
            ratios |= pack_words[pack_word(0u, first + i)];
        }
        let origin = bitcast<vec3<u32>>(merged.cluster.box_min);
        node_store_words(node * LIGHT_NODE_QUADS, vec4(origin, steps | bits.x | (bits.y << 8u) | (bits.z << 16u)));
        nodes[node_tail_word(node) + 1u] = ratios;
        refit_done[entry] = merged;
    }
    // The clusters of this round are read in the next one.
    workgroupBarrier();
    return merged;
}

// What is known of the tree whose root was refitted. Twin of `AttributeSums::relative_to`, and of what
// `TreeFeatures::of` reads of a tree.
fn refit_measure(source: u32, root: RefitCluster) {
    // The dispatch that writes the records of parts adds the refusals.
    var measure = LightMeasure(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0u);
    if root.cluster.flux > 0.0 {
        let extent = root.cluster.box_max - root.cluster.box_min;
        let diagonal_sq = dot(extent, extent);
        let axis_length = length(root.cluster.axis);
        let cost = refit_size(extent) * refit_orientation(axis_length);
        if diagonal_sq > 0.0 {
            measure.distance = root.distance / sqrt(diagonal_sq);
            measure.variance = root.variance / diagonal_sq;
        }
        measure.overlap = root.overlap;
        if cost > 0.0 {
            measure.splitting_cost = root.cost / cost;
        }
        if root.cluster.variance > 0.0 {
            measure.spread = diagonal_sq / root.cluster.variance;
        }
        measure.axis_length = axis_length;
        measure.flux = root.cluster.flux;
    }
    measures[source] = measure;
}

@compute @workgroup_size(TOP_NODE_LANES)
fn refit(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = refit_group(group, groups);
    if index >= refit_pass.count {
        return;
    }
    let piece = lists[refit_pass.first + index];
    let source = pieces[piece].x;
    let rounds = pieces[piece].y;
    let first_round = piece + 2u;
    let first_entry = first_round + rounds;
    for (var i = 0u; i < rounds; i++) {
        let round = pieces[first_round + i];
        let entry = round.x + lane / LIGHT_WIDTH;
        let is_listed = lane / LIGHT_WIDTH < round.y;
        var words = vec2(0u);
        if is_listed {
            words = pieces[first_entry + entry];
        }
        // The uppermost node of a piece below, which another dispatch has refitted.
        let is_stored = is_listed && (words.x & REFIT_STORED) != 0u;
        if is_stored && lane % LIGHT_WIDTH == 0u {
            refit_done[entry] = clusters[words.x & ~REFIT_STORED];
        }
        let merged = refit_node(lane, source, entry, words, is_listed && !is_stored);
        if i + 1u == rounds && lane == 0u {
            clusters[pieces[piece + 1u].x & ~REFIT_STORED] = merged;
            if words.x == 0u {
                refit_measure(source, merged);
            }
        }
    }
}
