// Looks at the rows of listed cells: a workgroup for each, with an invocation for four children of a node. Lists those to
// build that do not suit any more, and those whose turn it is. Twin of `SharedCut::is_kept`.

// As in cut_list.wgsl.
const LISTED: u32 = 0u;
const TO_LOOK_AT: u32 = 7u;
const KEPT: u32 = 10u;

var<workgroup> job: u32;
var<workgroup> state: u32;
var<workgroup> nodes: array<LightPlace, LIGHT_SHARED_NODES>;
var<workgroup> names: array<u32, 64>;
// A bit for each child that is one of the nodes.
var<workgroup> opened: array<atomic<u32>, LIGHT_SHARED_NODES / 4u>;
var<workgroup> faults: atomic<u32>;
var<workgroup> moves: atomic<u32>;

fn keep_word(word: u32) -> u32 {
    return atomicLoad(&light_marks[word]);
}

// A word of a row, from one of its quads on.
fn keep_row_word(quad: u32, word: u32) -> u32 {
    return light_cuts.quads[quad + word / 4u][word % 4u];
}

// The child that a node was.
fn keep_from(row: u32, node: u32) -> u32 {
    return (keep_row_word(row + LIGHT_ROW_FROM, node / 4u) >> (8u * (node % 4u))) & 0xffu;
}

// Where the node is that was a child; is_node is false if there is none.
struct KeepPlace {
    place: LightPlace,
    is_node: bool,
}

fn keep_place(child: u32) -> KeepPlace {
    if child == LIGHT_SKY_ROOT {
        return KeepPlace(light_sky_root(), true);
    }
    let above = nodes[child / LIGHT_WIDTH];
    let in_top = above.instance == LIGHT_NO_INSTANCE;
    let bits = light_child_bits(in_top, above.index, child % LIGHT_WIDTH);
    if (bits & select(LIGHT_LEAF, LIGHT_SINGLE, in_top)) != 0u {
        return KeepPlace(above, false);
    }
    return KeepPlace(light_place_below(above, bits), true);
}

@compute @workgroup_size(64)
fn cut_keep(
    @builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let number = group.x + group.y * groups.x;
    if lane == 0u {
        let slot = keep_word(2u * light_cuts.grid.listed - light_cuts.grid.free_rows + number);
        job = select(0u, LIGHT_CUT_HEAD + LIGHT_SLOT_WORDS * slot, number < keep_word(TO_LOOK_AT));
        atomicStore(&faults, 0u);
        atomicStore(&moves, 0u);
    }
    let at = workgroupUniformLoad(&job);
    if at == 0u {
        return;
    }
    let cell = row_cell(at);
    let row = row_quad(keep_word(at + 2u));
    let count = light_cuts.quads[row].x & 0xffffu;
    let contested = light_cuts.quads[1u + (at - LIGHT_CUT_HEAD) / LIGHT_SLOT_WORDS].zw;
    let state_at = row + LIGHT_ROW_STATE;
    if lane < LIGHT_SHARED_NODES / 2u {
        let pair = light_cuts.quads[row + LIGHT_ROW_NODES + lane];
        nodes[2u * lane] = LightPlace(pair.x, pair.y);
        nodes[2u * lane + 1u] = LightPlace(pair.z, pair.w);
    }
    if lane < LIGHT_SHARED_NODES / 4u {
        atomicStore(&opened[lane], 0u);
    }
    var sees_sky = light_params.sky != LIGHT_NO_INSTANCE;
    if sees_sky {
        sees_sky = (light_instance(light_params.sky).mask & cell.mask) != 0u;
    }
    let has_sky = count > 1u && keep_from(row, 1u) == LIGHT_SKY_ROOT;
    let has_sun = light_params.directional_count != 0u;
    if lane == 0u {
        let known = light_cuts.quads[state_at].w;
        let sky = row_sky();
        let is_other_sky = has_sky && (u32(abs(row_steps(sky, known))) >= LIGHT_FLUX_JUMP
            || row_sky_cosine(sky, known) < LIGHT_KEPT_VIEW_COSINE);
        let is_other_sun = has_sun != (bitcast<f32>(light_cuts.quads[row].z) > 0.0);
        if sees_sky != has_sky || is_other_sky || is_other_sun {
            atomicStore(&faults, 1u);
        }
    }
    workgroupBarrier();

    var from_child = LIGHT_SKY_ROOT;
    if lane > 0u && lane < count {
        from_child = keep_from(row, lane);
        if from_child != LIGHT_SKY_ROOT {
            atomicOr(&opened[from_child / 32u], 1u << (from_child % 32u));
        }
    }
    // Follow nodes that are stored elsewhere, and those below them.
    var round = 0u;
    loop {
        var found = KeepPlace(LightPlace(0u, 0u), true);
        var is_moved = false;
        if lane > 0u && lane < count {
            found = keep_place(from_child);
            is_moved = found.place.instance != nodes[lane].instance || found.place.index != nodes[lane].index;
        }
        workgroupBarrier();
        if !found.is_node {
            atomicStore(&faults, 1u);
        } else if is_moved {
            nodes[lane] = found.place;
            atomicStore(&moves, 1u);
        }
        workgroupBarrier();
        if lane == 0u {
            state = atomicExchange(&moves, 0u);
        }
        let moved = workgroupUniformLoad(&state);
        if moved == 0u || round == LIGHT_SHARED_NODES {
            break;
        }
        round++;
    }
    if lane < LIGHT_SHARED_NODES / 2u && round > 0u {
        let first = nodes[2u * lane];
        let second = nodes[2u * lane + 1u];
        light_cuts.quads[row + LIGHT_ROW_NODES + lane] =
            vec4(first.instance, first.index, second.instance, second.index);
    }

    // Compare names and fluxes. Points weigh contested children by what they are now.
    let node = lane / 2u;
    let first_slot = 4u * (lane % 2u);
    names[lane] = 0u;
    if node < count {
        let found = row_children(nodes[node], first_slot, cell.mask);
        names[lane] = found.name;
        let known = keep_row_word(row + LIGHT_ROW_FLUX, lane);
        let sums = light_cuts.quads[row + LIGHT_ROW_SUMS + lane];
        let least = LIGHT_JUMP_SHARE * f32(light_cuts.quads[row].w);
        var before = 0u;
        if lane > 0u {
            before = light_cuts.quads[row + LIGHT_ROW_SUMS + lane - 1u].w;
        }
        for (var i = 0u; i < 4u; i++) {
            let sum = sums[i];
            let units = sum - before;
            before = sum;
            let is_lit = ((found.lit >> i) & 1u) != 0u;
            let steps = row_steps(found.flux >> (8u * i), known >> (8u * i));
            let has_jumped = u32(abs(steps)) >= LIGHT_FLUX_JUMP;
            let child = node * LIGHT_WIDTH + first_slot + i;
            if units == 0u {
                let is_opened = ((atomicLoad(&opened[child / 32u]) >> (child % 32u)) & 1u) != 0u;
                let is_contested = light_is_contested(contested, node, first_slot + i);
                if is_lit && !is_contested && (!is_opened || has_jumped) {
                    atomicStore(&faults, 1u);
                }
            } else {
                let gain = select(1.0, exp2(0.5 * f32(max(steps, 0))), is_lit);
                if (!is_lit || has_jumped) && f32(units) * gain > least {
                    atomicStore(&faults, 1u);
                }
            }
        }
    }
    workgroupBarrier();
    if lane == 0u {
        var name = 0u;
        for (var i = 0u; i < 64u; i++) {
            name += names[i];
        }
        let known = light_cuts.quads[state_at];
        let age = known.y + 1u;
        light_cuts.quads[state_at].y = age;
        let is_young = age <= LIGHT_YOUNG && countOneBits(age) == 1u;
        let is_due = (age + keep_word(at)) % LIGHT_TURNS == 0u || (is_young && light_cuts.quads[0].y != 0u);
        let toward = row_toward(cell, row_center(cell));
        let has_view = all(toward == vec3(0.0))
            || dot(toward, row_direction_of(known.z)) >= LIGHT_KEPT_VIEW_COSINE;
        if is_due || !has_view || name != known.x || atomicLoad(&faults) != 0u {
            // It has no cut until it is built.
            let slot = (at - LIGHT_CUT_HEAD) / LIGHT_SLOT_WORDS;
            light_cuts.quads[1u + slot] = vec4(0u);
            atomicStore(&light_marks[at + 3u], 0u);
            let listed = atomicAdd(&light_marks[LISTED], 1u);
            atomicStore(&light_marks[light_cuts.grid.listed + listed], slot);
        } else {
            atomicAdd(&light_marks[KEPT], 1u);
            for (var i = 0u; i < LIGHT_CELL_POINTS; i++) {
                atomicStore(&light_marks[at + 9u + i], 0u);
            }
        }
    }
}
