// Copies records to another layout; a table tells the source of each word. One invocation for each
// 16 bytes that are written. The tests in src/plan/relayout.rs compare the copies with uploads.

// Twin of `RelayoutPass` in src/plan/relayout.rs.
struct RelayoutPass {
    // The number of records.
    records: u32,
    // The stride in the old layout, in words.
    words_before: u32,
    // The stride in the new layout, in units of 16 bytes.
    quads_after: u32,
    padding: u32,
    // For each word of the new record its offset in the old record, or RELAYOUT_NOT_STORED.
    sources: array<vec4<u32>, RELAYOUT_QUADS>,
    // For each word of the new record its value if it was not stored.
    values: array<vec4<u32>, RELAYOUT_QUADS>,
}

@group(0) @binding(0) var<uniform> relayout_pass: RelayoutPass;
@group(0) @binding(1) var<storage, read> before: array<u32>;
@group(0) @binding(2) var<storage, read_write> after: array<vec4<u32>>;

fn relayout_word(record: u32, source: u32, value: u32) -> u32 {
    if source == RELAYOUT_NOT_STORED {
        return value;
    }
    return before[record * relayout_pass.words_before + source];
}

@compute @workgroup_size(RELAYOUT_LANES)
fn relayout(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.y * groups.x * RELAYOUT_LANES + id.x;
    let record = index / relayout_pass.quads_after;
    let quad = index % relayout_pass.quads_after;
    if record >= relayout_pass.records {
        return;
    }
    let sources = relayout_pass.sources[quad];
    let values = relayout_pass.values[quad];
    after[index] = vec4(
        relayout_word(record, sources.x, values.x),
        relayout_word(record, sources.y, values.y),
        relayout_word(record, sources.z, values.z),
        relayout_word(record, sources.w, values.w),
    );
}
