// What the kernels share that refit trees. Binds nothing.

// A dispatch. Twin of `RefitPass` in src/plan/sources/records.rs.
struct RefitPass {
    // The first word of `lists` that the dispatch reads, and the number of its workgroups.
    first: u32,
    count: u32,
}

// What is known of a tree of a source after a refit. Twin of `MeasureRecord`.
struct LightMeasure {
    distance: f32,
    overlap: f32,
    variance: f32,
    splitting_cost: f32,
    // The squared diagonal of the box by the variance of position.
    spread: f32,
    axis_length: f32,
    flux: f32,
    refused: u32,
}

// The index of a workgroup in a dispatch of one or two dimensions.
fn refit_group(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.y * groups.x + group.x;
}
