// Writes records to scattered places of a pool. One invocation for each 16 bytes.

// Twin of `ScatterPass` in src/plan/scatter.rs.
struct ScatterPass {
    // The number of records.
    records: u32,
    // The size of a record, in units of 16 bytes.
    quads: u32,
    // Where the places begin in the staged data, four in each unit of 16 bytes.
    places: u32,
    // Where the records begin in the staged data, in units of 16 bytes.
    first: u32,
}

@group(0) @binding(0) var<uniform> scatter_pass: ScatterPass;
@group(0) @binding(1) var<storage, read> staged: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read_write> pool: array<vec4<u32>>;

@compute @workgroup_size(SCATTER_LANES)
fn scatter(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.y * groups.x * SCATTER_LANES + id.x;
    let record = index / scatter_pass.quads;
    if record >= scatter_pass.records {
        return;
    }
    let place = staged[scatter_pass.places + record / 4u][record % 4u];
    pool[place * scatter_pass.quads + index % scatter_pass.quads] = staged[scatter_pass.first + index];
}
