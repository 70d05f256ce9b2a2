// The grid of cells and the sizes of the table, which lie ahead of its words. Twin of `GridRecord`.
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
    // The slots of cells to look at: the word at which they begin.
    looks: u32,
    eye: vec3<f32>,
    // 1 if there is an eye.
    has_eye: u32,
    // The quad at which the first row begins.
    first_row: u32,
    // The numbers of free rows and the slots of cells to build: the words at which they begin.
    free_rows: u32,
    listed: u32,
    padding: u32,
}

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
