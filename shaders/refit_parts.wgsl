// Writes the records of the parts of trees with a source, which the top level is built from, and the
// refusals. Twin of
// `TreeRecord::of`. One workgroup for each block of neighbouring parts.

@group(0) @binding(0) var<uniform> refit_pass: RefitPass;
@group(0) @binding(1) var<storage, read_write> trees: array<LightTree>;
@group(0) @binding(2) var<storage, read_write> sources: array<LightSourceRecord>;
@group(0) @binding(3) var<storage, read> clusters: array<RefitCluster>;
@group(0) @binding(4) var<storage, read_write> nodes: array<u32>;
@group(0) @binding(5) var<storage, read> lights: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read> lists: array<u32>;
@group(0) @binding(7) var<storage, read_write> measures: array<LightMeasure>;

// The cluster of a child as a node says. Twin of `Node::cluster`.
fn refit_unpacked(place: u32) -> RefitCluster {
    let head = 4u * (place / LIGHT_WIDTH) * LIGHT_NODE_QUADS;
    let word = node_child_word(place);
    var packed: LightPackedChild;
    packed.low = nodes[word + 1u];
    packed.high = nodes[word + 2u];
    packed.mean = nodes[word + 3u];
    let lobe = node_lobe_word(place);
    packed.lobe = vec2(nodes[lobe], nodes[lobe + 1u]);
    var found = REFIT_EMPTY;
    if !light_has_flux(packed) {
        return found;
    }
    let origin = bitcast<vec3<f32>>(vec3(nodes[head], nodes[head + 1u], nodes[head + 2u]));
    let steps = nodes[head + 3u];
    let view = LightNodeView(origin, steps, 0.0);
    let step = 2.0 * light_half_steps(steps);
    let half_diagonal = 0.5 * (light_high(packed) - light_low(packed)) * step;
    let deviation = light_deviation(packed);
    let shortness = light_byte(packed.lobe.y, 0u) * (1.0 / LIGHT_STEPS);
    let flux = light_upper_half(packed.mean);
    let code = (nodes[node_tail_word(place / LIGHT_WIDTH) + 1u] >> (4u * (place % LIGHT_WIDTH))) & 15u;
    let shares = light_flux_shares(code, steps);
    found.cluster.flux = flux;
    found.cluster.box_min = origin + light_low(packed) * step;
    found.cluster.box_max = origin + light_high(packed) * step;
    found.cluster.mean = light_to_mean(packed, view);
    found.cluster.variance = deviation * deviation * light_sum_axes(half_diagonal * half_diagonal);
    found.cluster.axis = light_unit_axis(packed.lobe.x) * max(1.0 - shortness * shortness, MIN_AXIS);
    found.cluster.cos_half_angle = max(1.0 - light_byte(packed.lobe.x, 3u) * (1.0 / LIGHT_CAP_STEPS), -1.0);
    found.cluster.range = min(light_upper_half(packed.lobe.y), LIGHT_UNLIMITED_RANGE);
    found.punctual_flux = flux * shares.x;
    found.area_flux = flux * shares.y;
    return found;
}

@compute @workgroup_size(REFIT_PART_LANES)
fn refit_parts(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = refit_group(group, groups);
    if index >= refit_pass.count {
        return;
    }
    let source = lists[refit_pass.first + 2u * index];
    let part = lists[refit_pass.first + 2u * index + 1u] + lane;
    if part >= sources[source].record_count {
        return;
    }
    if part == 0u {
        measures[source].refused = atomicLoad(&sources[source].refused);
    }
    let record = sources[source].record_base + part;
    let child_bits = trees[record].child_bits;
    var found: RefitCluster;
    if child_bits == 0u {
        found = clusters[sources[source].root];
    } else if (child_bits & LIGHT_LEAF) != 0u {
        found = refit_light(source, child_bits & ~LIGHT_LEAF);
    } else {
        found = refit_unpacked(sources[source].node_base * LIGHT_WIDTH + trees[record].place);
    }
    trees[record].cluster = found.cluster;
    trees[record].punctual_flux = found.punctual_flux;
    trees[record].area_flux = found.area_flux;
}
