// Top level, stage 2: the cell of the partition in which each part that shines lies, as its key for the
// sort, which it counts. Twin of `Partition::cell`. One invocation for each part.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read> clusters: array<LightCluster>;
@group(0) @binding(2) var<storage, read> parts: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> planes: array<u32>;
@group(0) @binding(4) var<storage, read_write> keys: array<u32>;
@group(0) @binding(5) var<storage, read_write> order: array<u32>;
@group(0) @binding(6) var<storage, read_write> histogram: array<atomic<u32>>;

fn keys_hash(number: u32) -> u32 {
    let state = number * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// Twin of `Partition::cell` and `Planes::child`. A step for each plane: Mesa 26 crashes where a loop
// within a loop, or a branch in it, reads `planes`.
fn keys_cell(position: vec3<f32>, identity: u32) -> u32 {
    var node = 0u;
    var way = 0u;
    var is_divided = top_pass.is_divided != 0u;
    while is_divided {
        let record = top_planes(node);
        let code = (planes[record + TOP_PLANE_CODES + way / 2u] >> (16u * (way % 2u))) & 0xffffu;
        let at = planes[record + TOP_PLANE_PLACES + way];
        let axis = code & 3u;
        let home = select(0, top_pass.home[min(axis, 2u)], axis != TOP_BY_IDENTITY);
        let sectors = bitcast<i32>(planes[record + TOP_PLANE_SECTORS + way]) - home;
        // Edges of sectors have exact products.
        let place = bitcast<f32>(at) + f32(sectors) * LIGHT_SECTOR_EDGE;
        let is_below = select(position[min(axis, 2u)] < place, identity < at, axis == TOP_BY_IDENTITY);
        let next = (code >> select(6u, 2u, is_below)) & 15u;
        // Of a way to another plane, this is not used.
        let child = max(next, TOP_EXIT) - TOP_EXIT;
        let children = planes[record] >> (8u + child);
        let below = planes[record + TOP_PLANE_CHILDREN + child];
        let is_exit = next >= TOP_EXIT;
        is_divided = !is_exit || (children & 1u) != 0u;
        node = select(node, below, is_exit);
        way = select(next, 0u, is_exit);
    }
    return node;
}

@compute @workgroup_size(TOP_LANES)
fn top_keys(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let part = top_index(id, groups);
    if part >= top_pass.count {
        return;
    }
    var key = TOP_NO_KEY;
    if clusters[part].flux > 0.0 {
        let name = parts[part];
        key = keys_cell(clusters[part].mean, keys_hash(keys_hash(name.x) + name.y));
    }
    keys[part] = key;
    order[part] = part;
    // The sort begins with the lowest digit, whose counts are the first.
    sort_count_key(0u, top_pass.count, top_pass.sort_block, part, key & (SORT_LANES - 1u));
}
