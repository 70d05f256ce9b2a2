// The table of cells is two storage buffers: light_cuts, which shaders read, and light_marks, which they write.

// The grid of cells and the places in both buffers. Twin of `GridRecord`.
struct LightCutGrid {
    // The edge of the smallest place in a cell, in metres, and its inverse.
    unit: f32,
    units_per_metre: f32,
    // What squares of distances to the eye are multiplied by: see `CutGrid`. 0 without an eye.
    edges_sq: f32,
    // The slots of the table less one.
    last_slot: u32,
    offset: vec3<f32>,
    // The marks that a cell needs to get a cut.
    min_marks: u32,
    first: vec3<u32>,
    // What is learnt: the quad at which it begins. 0, where there are zeros, if nothing is.
    learnt: u32,
    eye: vec3<f32>,
    // 1 if there is an eye.
    has_eye: u32,
    // The quad at which the first row begins.
    first_row: u32,
    // The numbers of free rows and the slots of cells to build: the words of light_marks at which they begin. The slots of
    // cells to look at follow, of as many.
    free_rows: u32,
    listed: u32,
    // The records of visibility: the word of light_marks at which they begin.
    records: u32,
}

// Behind the grid, a quad with the state, one for each slot of a cell, and the rows, of which shared.wgsl has the
// fields. The state: 0 while cuts are void, and then how many builds there were since, up to LIGHT_TURNS + 1; and
// whether anything was learnt since the last build. A slot: the tag of its cell, and the first quad of its row; both
// are 0 where there is no cut.
struct LightCutTable { grid: LightCutGrid, quads: array<vec4<u32>> }

// What tells cells apart. Twin of `CutCell`.
struct LightCutCell {
    corner: vec3<u32>,
    // LIGHT_NO_CELL for a point that shares no cell.
    kind: u32,
    mask: u32,
    // Which of a cell's words the point may become, and its word. Twin of `Place`.
    which: u32,
    word: u32,
    // 1 if the point marks its coarse cell as well.
    marks_coarse: u32,
}
