// Top level, stage 3, after the sort: packs the nodes of all cells of the partition, and runs for cells
// that have more parts than a node holds. Twin of `Build::cell`. Eight invocations for each cell; all of
// a workgroup for a cell of more than TOP_MANY parts.

@group(0) @binding(0) var<uniform> top_pass: TopPass;
@group(0) @binding(1) var<storage, read_write> clusters: array<LightCluster>;
@group(0) @binding(2) var<storage, read_write> nodes: array<u32>;
@group(0) @binding(3) var<storage, read> keys: array<u32>;
@group(0) @binding(4) var<storage, read> order: array<u32>;
// As in top_leaves.wgsl.
@group(0) @binding(5) var<storage, read> parts_of: array<vec2<u32>>;
// For each node of the partition what it is as a child: see NodeChild.
@group(0) @binding(6) var<storage, read_write> units: array<u32>;

const CELLS: u32 = TOP_NODE_LANES / LIGHT_WIDTH;

// The first part of each cell in the order of the sort, and the number of its parts.
var<workgroup> cell_parts: array<vec2<u32>, CELLS>;
// The parts of each cell of at most TOP_MANY parts, in the order of their instances. Their numbers depend on the edits
// before.
var<workgroup> cell_order: array<u32, CELLS * TOP_MANY>;
// The greatest number of runs of a cell of at most TOP_MANY parts.
var<workgroup> cell_runs: u32;
// The next cell of more parts; CELLS if there is none.
var<workgroup> cell_next: u32;

// The number of keys below one.
fn cells_before(key: u32) -> u32 {
    var low = 0u;
    var high = top_pass.count;
    while low < high {
        let middle = (low + high) / 2u;
        if keys[middle] < key {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

// The number of parts of a cell that come before one of them.
fn cells_rank(parts: vec2<u32>, index: u32) -> u32 {
    let own = parts_of[order[parts.x + index]];
    var rank = 0u;
    for (var i = 0u; i < parts.y; i++) {
        let other = parts_of[order[parts.x + i]];
        rank += select(0u, 1u, other.x < own.x || (other.x == own.x && other.y < own.y));
    }
    return rank;
}

// A part of a cell of at most TOP_MANY parts.
fn cells_own_part(lane: u32, parts: vec2<u32>, index: u32) -> NodeChild {
    if index >= parts.y || parts.y > TOP_MANY {
        return NODE_NO_CHILD;
    }
    return NodeChild(LIGHT_LEAF | cell_order[lane / LIGHT_WIDTH * TOP_MANY + index], NODE_STORED);
}

// A part of a cell with `parts.y` parts from `parts.x` on.
fn cells_part(parts: vec2<u32>, index: u32) -> NodeChild {
    if index >= parts.y {
        return NODE_NO_CHILD;
    }
    return NodeChild(LIGHT_LEAF | order[parts.x + index], NODE_STORED);
}

fn cells_first_run(parts: vec2<u32>) -> u32 {
    return top_pass.runs + parts.x / TOP_PARTS_PER_RUN;
}

// The number of nodes that hold so many children.
fn cells_nodes(children: u32) -> u32 {
    return (children + LIGHT_WIDTH - 1u) / LIGHT_WIDTH;
}

// The number of runs of a cell, if eight invocations pack them.
fn cells_runs(parts: u32) -> u32 {
    return select(0u, cells_nodes(parts), parts > LIGHT_WIDTH && parts <= TOP_MANY);
}

// A node that eight invocations pack next: see node_pack.
struct CellsNode {
    node: u32,
    parent: u32,
    is_used: bool,
    child: NodeChild,
    held: u32,
}

// A run of a cell of at most TOP_MANY parts; beyond its last run, its node.
fn cells_own(lane: u32, cell: u32, parts: vec2<u32>, run: u32, is_last: bool) -> CellsNode {
    let slot = lane % LIGHT_WIDTH;
    // Each cell has room for TOP_MANY / LIGHT_WIDTH clusters.
    let held = lane / LIGHT_WIDTH * (TOP_MANY / LIGHT_WIDTH);
    let runs = cells_runs(parts.y);
    var own: CellsNode;
    own.is_used = parts.y <= TOP_MANY;
    if is_last {
        own.node = cell;
        own.parent = LIGHT_NO_PARENT;
        own.is_used &= parts.y > 1u || (cell == 0u && top_pass.is_divided == 0u);
        own.held = held;
        own.child = cells_own_part(lane, parts, slot);
        if runs > 0u {
            own.child = NODE_NO_CHILD;
            if slot < runs {
                own.child = NodeChild(cells_first_run(parts) + slot, held + slot);
            }
        }
    } else {
        own.node = cells_first_run(parts) + run;
        own.parent = cell * LIGHT_WIDTH + run;
        own.is_used &= run < runs;
        own.held = held + run;
        own.child = cells_own_part(lane, parts, run * LIGHT_WIDTH + slot);
    }
    return own;
}

// How far a workgroup has packed the nodes of a cell of more than TOP_MANY parts. It packs sixteen runs, then nodes
// above them for as long as all children of these nodes are packed, and then the next sixteen runs.
struct CellsWalk {
    // The first of the sixteen runs.
    run: u32,
    // The level of the children, from runs on; how many nodes it has, how many of these are packed, and the first of
    // them.
    level: u32,
    count: u32,
    packed: u32,
    first: u32,
}

// The clusters of runs are held from 0 on, and eight of each level above from there on.
fn cells_held(level: u32, index: u32) -> u32 {
    if level == 0u {
        return index % CELLS;
    }
    return CELLS + LIGHT_WIDTH * (level - 1u) + index % LIGHT_WIDTH;
}

// The node above a level, or the node of the cell above the highest.
fn cells_above(lane: u32, cell: u32, walk: CellsWalk) -> CellsNode {
    let slot = lane % LIGHT_WIDTH;
    let next = walk.first + walk.count;
    let count = cells_nodes(walk.count);
    var above: CellsNode;
    above.is_used = true;
    // Of runs, sixteen are packed at once, which make two nodes; of other nodes one.
    var index = lane / LIGHT_WIDTH + select((walk.packed - 1u) / LIGHT_WIDTH, walk.run / LIGHT_WIDTH, walk.level == 0u);
    if walk.count <= LIGHT_WIDTH {
        above.node = cell;
        above.parent = LIGHT_NO_PARENT;
        above.held = TOP_HELD - 1u;
        index = lane / LIGHT_WIDTH;
    } else {
        above.node = next + index;
        above.parent = (next + count + index / LIGHT_WIDTH) * LIGHT_WIDTH + index % LIGHT_WIDTH;
        if count <= LIGHT_WIDTH {
            above.parent = cell * LIGHT_WIDTH + index;
        }
        above.held = cells_held(walk.level + 1u, index);
    }
    let child = index * LIGHT_WIDTH + slot;
    above.is_used = index * LIGHT_WIDTH < walk.packed;
    above.child = NODE_NO_CHILD;
    if child < walk.packed {
        above.child = NodeChild(walk.first + child, cells_held(walk.level, child));
    }
    return above;
}

// A run of a cell of more than TOP_MANY parts.
fn cells_run(lane: u32, cell: u32, parts: vec2<u32>, first: u32) -> CellsNode {
    let run = first + lane / LIGHT_WIDTH;
    let runs = cells_nodes(parts.y);
    let above = select(cells_first_run(parts) + runs + run / LIGHT_WIDTH, cell, runs <= LIGHT_WIDTH);
    let child = cells_part(parts, run * LIGHT_WIDTH + lane % LIGHT_WIDTH);
    let parent = above * LIGHT_WIDTH + run % LIGHT_WIDTH;
    return CellsNode(cells_first_run(parts) + run, parent, run < runs, child, cells_held(0u, run));
}

// The first cell from a number on with more than TOP_MANY parts. Call from uniform control flow.
fn cells_next_many(lane: u32, first: u32) -> u32 {
    if lane == 0u {
        cell_next = first;
        while cell_next < CELLS && cell_parts[min(cell_next, CELLS - 1u)].y <= TOP_MANY {
            cell_next++;
        }
    }
    return workgroupUniformLoad(&cell_next);
}

@compute @workgroup_size(TOP_NODE_LANES)
fn top_cells(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let group = lane / LIGHT_WIDTH;
    let first_cell = (group_id.x + group_id.y * groups.x) * CELLS;
    let cell = first_cell + group;
    var parts = vec2(0u);
    if cell < top_pass.nodes {
        let start = cells_before(cell);
        parts = vec2(start, cells_before(cell + 1u) - start);
    }
    if parts.y <= TOP_MANY {
        for (var i = lane % LIGHT_WIDTH; i < parts.y; i += LIGHT_WIDTH) {
            cell_order[group * TOP_MANY + cells_rank(parts, i)] = order[parts.x + i];
        }
    }
    if lane % LIGHT_WIDTH == 0u {
        cell_parts[group] = parts;
        if cell < top_pass.nodes {
            units[cell] = select(cell, cells_part(parts, 0u).bits, parts.y <= 1u);
        }
    }
    workgroupBarrier();
    if lane == 0u {
        cell_runs = 0u;
        for (var i = 0u; i < CELLS; i++) {
            cell_runs = max(cell_runs, cells_runs(cell_parts[i].y));
        }
    }
    let most_runs = workgroupUniformLoad(&cell_runs);
    // All cells at once; then one by one those with more parts.
    var step = 0u;
    var other = cells_next_many(lane, 0u);
    var many = vec2(0u);
    var walk = CellsWalk();
    while step <= most_runs || other < CELLS {
        var next: CellsNode;
        var is_finished = false;
        if step <= most_runs {
            next = cells_own(lane, cell, parts, step, step == most_runs);
            step++;
        } else if walk.count == 0u {
            // Sixteen runs.
            many = workgroupUniformLoad(&cell_parts[other]);
            next = cells_run(lane, first_cell + other, many, walk.run);
            walk.count = cells_nodes(many.y);
            walk.packed = min(walk.run + CELLS, walk.count);
            walk.first = cells_first_run(many);
            walk.level = 0u;
        } else {
            next = cells_above(lane, first_cell + other, walk);
            let is_cell = walk.count <= LIGHT_WIDTH;
            walk.first += walk.count;
            walk.packed = cells_nodes(walk.packed);
            walk.count = cells_nodes(walk.count);
            walk.level++;
            if is_cell {
                walk = CellsWalk();
                is_finished = true;
            }
        }
        node_pack(lane, next.node, next.parent, next.is_used, next.child, next.held);
        if is_finished {
            other = cells_next_many(lane, other + 1u);
        }
        let is_whole = walk.packed % LIGHT_WIDTH == 0u || walk.packed == walk.count;
        let is_end = walk.packed == walk.count;
        if walk.count > 0u && (!is_whole || (walk.count <= LIGHT_WIDTH && !is_end)) {
            walk.run += CELLS;
            walk.count = 0u;
        }
    }
}
