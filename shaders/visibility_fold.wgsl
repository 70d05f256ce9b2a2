// Folds the records of a frame into what is known about visibility. Twin of src/visibility/fold.rs
// and of `VisibilityTable::end_frame`, with the same bits: all of it is integers. One workgroup for
// each row, one invocation for each word of shares.

// As in visibility.wgsl.
@group(0) @binding(1) var<storage, read_write> learnt: array<u32>;
@group(0) @binding(2) var<storage, read_write> records: array<u32>;
// For each row and group, in the lower half of a word the visible records and in the upper half
// all.
@group(0) @binding(3) var<storage, read_write> known: array<u32>;

var<workgroup> fate: vec2<u32>;

// What is known after a frame, and the code of the share. Twin of `fold`.
fn fold(before: u32, hidden_samples: u32, visible_samples: u32) -> vec2<u32> {
    var hidden = hidden_samples;
    var visible = visible_samples;
    while visible > LIGHT_MAX_NEW || hidden > LIGHT_MAX_NEW || visible + hidden > LIGHT_MAX_NEW {
        visible /= 2u;
        hidden /= 2u;
    }
    let seen = (before & 0xffffu) + visible * LIGHT_UNITS;
    let all = (before >> 16u) + (visible + hidden) * LIGHT_UNITS;
    let code = (LIGHT_FULL_SHARE * (seen + LIGHT_PRIOR) + (all + LIGHT_PRIOR) / 2u) / (all + LIGHT_PRIOR);
    var kept = vec2(seen, all);
    if all > LIGHT_MEMORY {
        kept = vec2((seen * LIGHT_MEMORY + all / 2u) / all, LIGHT_MEMORY);
    }
    return vec2(kept.x | (kept.y << 16u), max(code, LIGHT_MIN_SHARE));
}

@compute @workgroup_size(32)
fn visibility_fold(
    @builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let row = group.x + group.y * groups.x;
    let rows = learnt[2];
    if lane == 0u && row < rows {
        fate = vec2(records[row], records[rows + row]);
    }
    let claim_and_touched = workgroupUniformLoad(&fate);
    if row >= rows {
        return;
    }
    let claim = claim_and_touched.x;
    let is_touched = claim_and_touched.y != 0u;
    let share_word = 4u * LIGHT_TABLE_HEAD + 2u * rows + row * (LIGHT_BINS / 4u) + lane;
    if is_touched {
        var shares = learnt[share_word];
        for (var i = 0u; i < 4u; i++) {
            let bin = row * LIGHT_BINS + 4u * lane + i;
            let counts = 2u * (rows + bin);
            let hidden = records[counts];
            let visible = records[counts + 1u];
            if (hidden | visible) != 0u {
                let folded = fold(known[bin], hidden, visible);
                known[bin] = folded.x;
                shares = (shares & ~(0xffu << (8u * i))) | (folded.y << (8u * i));
                records[counts] = 0u;
                records[counts + 1u] = 0u;
            }
        }
        learnt[share_word] = shares;
    } else if claim != 0u {
        for (var i = 0u; i < 4u; i++) {
            known[row * LIGHT_BINS + 4u * lane + i] = 0u;
        }
        learnt[share_word] = 0xffffffffu;
    }
    if lane == 0u {
        let tag = 4u * LIGHT_TABLE_HEAD + row;
        let idle = tag + rows;
        if is_touched || claim != 0u {
            learnt[idle] = 0u;
        } else {
            learnt[idle] = max(learnt[idle], learnt[idle] + 1u);
        }
        if !is_touched && claim != 0u {
            learnt[tag] = claim;
        }
        records[row] = 0u;
        records[rows + row] = 0u;
    }
}
