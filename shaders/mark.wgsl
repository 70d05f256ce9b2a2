// Marks the cells that shading points need, and keeps a few points of each. Twin of src/sampling/cuts/marks.rs.

// The head, the slots of cells, free rows, and the slots of cells to look at and to build. cut_list.wgsl has the
// words of the head. A slot: tag, marks, row, points that its cut was made for, corner, kind, mask, points.
@group(LIGHT_GROUP) @binding(6) var<storage, read_write> light_marks: array<atomic<u32>>;

// Marks the cell of a shading point: it will have a cut from the next build on. Twin of `LightSampler::mark`.
fn light_mark(shading_point: LightShadingPoint) {
    // A loop, so that the text has one copy of the code for both cells.
    var end = 1u;
    for (var coarser = 0u; coarser < end; coarser += LIGHT_COARSER) {
        let cell = light_cut_cell(shading_point, coarser);
        light_mark_cell(cell);
        end = select(end, LIGHT_COARSER + 1u, cell.marks_coarse != 0u && coarser == 0u);
    }
}

fn light_mark_cell(cell: LightCutCell) {
    if cell.kind == LIGHT_NO_CELL {
        return;
    }
    let keys = light_cell_keys(cell);
    for (var step = 0u; step < LIGHT_PROBES; step++) {
        let at = LIGHT_CUT_HEAD + LIGHT_SLOT_WORDS * ((keys.x + step) & light_cuts.grid.last_slot);
        var found = atomicLoad(&light_marks[at]);
        // An exchange may fail for no reason.
        while found == 0u {
            let exchange = atomicCompareExchangeWeak(&light_marks[at], 0u, keys.y);
            found = exchange.old_value;
            if exchange.exchanged {
                atomicStore(&light_marks[at + 4u], cell.corner.x);
                atomicStore(&light_marks[at + 5u], cell.corner.y);
                atomicStore(&light_marks[at + 6u], cell.corner.z);
                atomicStore(&light_marks[at + 7u], cell.kind);
                atomicStore(&light_marks[at + 8u], cell.mask);
                found = keys.y;
            }
        }
        if found == keys.y {
            atomicAdd(&light_marks[at + 1u], 1u);
            atomicMax(&light_marks[at + 9u + cell.which], cell.word);
            return;
        }
    }
    atomicAdd(&light_marks[LIGHT_LOST_MARKS], 1u);
}
