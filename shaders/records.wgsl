// Reads the records of src/plan/layout.rs. A variant of the text skips the parts that it has no use for. Reads the
// buffers that sample.wgsl binds; binds nothing itself.

// #if COUNTS
// The nodes whose children this invocation has weighed.
var<private> light_nodes_read: u32;
// #endif

// 16 bytes of a node of the top level or of a tree.
fn light_quad(in_top: bool, at: u32) -> vec4<u32> {
    if in_top {
        return light_top[at];
    }
    return light_nodes[at];
}

// 16 bytes of an instance, of a light, and how many of these there are. shaders/previous.wgsl has others.
fn light_instance_quad(at: u32) -> vec4<u32> {
    return light_instances[at];
}

fn light_record_quad(at: u32) -> vec4<u32> {
    return light_records[at];
}

fn light_record_quads() -> u32 {
    return arrayLength(&light_records);
}

// The child in a slot of a node, which begins at `at`. One branch for all that is read, so that the
// reads do not wait for each other.
fn light_packed_child(in_top: bool, at: u32, slot: u32) -> LightPackedChild {
    let words_at = at + LIGHT_NODE_CHILDREN + slot;
    // #if CONES | RANGES
    // Two children share 16 bytes.
    let lobes_at = at + LIGHT_NODE_LOBES + slot / 2u;
    let half = 2u * (slot & 1u);
    var lobe: vec2<u32>;
    // #endif
    var words: vec4<u32>;
    // #if NON_RIGID
    var ratios: u32;
    // #endif
    if in_top {
        words = light_top[words_at];
        // #if CONES | RANGES
        lobe = vec2(light_top[lobes_at][half], light_top[lobes_at][half + 1u]);
        // #endif
        // #if NON_RIGID
        ratios = light_top[at + LIGHT_NODE_TAIL].y;
        // #endif
    } else {
        words = light_nodes[words_at];
        // #if CONES | RANGES
        lobe = vec2(light_nodes[lobes_at][half], light_nodes[lobes_at][half + 1u]);
        // #endif
        // #if NON_RIGID
        ratios = light_nodes[at + LIGHT_NODE_TAIL].y;
        // #endif
    }
    var child: LightPackedChild;
    child.child_bits = words.x;
    child.low = words.y;
    child.high = words.z;
    child.mean = words.w;
    // #if NON_RIGID
    child.area_ratio = (ratios >> (4u * slot)) & 15u;
    // #endif
    // #if CONES | RANGES
    child.lobe = lobe;
    // #endif
    return child;
}

// The place of a node in its parent: parent * LIGHT_WIDTH + slot.
fn light_parent(in_top: bool, index: u32) -> u32 {
    return light_quad(in_top, index * LIGHT_NODE_QUADS + LIGHT_NODE_TAIL).x;
}

// #if MASKS
// A bit for each child of a node: 1 if the masks of instances below it and a mask have a bit in
// common. All of them in a tree, whose lights have the mask of one instance. Twin of `weigh_masks`,
// with light_seen_share.
fn light_met_children(in_top: bool, index: u32, mask: u32) -> u32 {
    if !in_top || (light_params.masks == 0u && mask != 0u) {
        return 0xffu;
    }
    if light_params.masks == 0u {
        return 0u;
    }
    let at = light_params.masks + LIGHT_MASK_QUADS * index + 1u;
    let first = (light_top[at] & vec4(mask)) != vec4(0u);
    let last = (light_top[at + 1u] & vec4(mask)) != vec4(0u);
    let bits = select(vec4(0u), vec4(1u, 2u, 4u, 8u), first) | select(vec4(0u), vec4(16u, 32u, 64u, 128u), last);
    return bits.x | bits.y | bits.z | bits.w;
}

// The share of the flux below a child of a node that a mask sees, if the child is one of
// light_met_children. 1 for a part of an instance and in a tree. Twin of `MaskShares::seen`.
fn light_seen_share(in_top: bool, child_bits: u32, mask: u32) -> f32 {
    if !in_top || light_params.masks == 0u || mask == 0xffffffffu || (child_bits & LIGHT_LEAF) != 0u {
        return 1.0;
    }
    let words = light_top[light_params.masks + LIGHT_MASK_QUADS * child_bits].xyz;
    var bits = (words.x | words.y | words.z) & mask;
    var sum = 0u;
    while bits != 0u && sum < LIGHT_MASK_WHOLE {
        let code = (words >> vec3(firstTrailingBit(bits))) & vec3(1u);
        sum += (1u << (code.x | (code.y << 1u) | (code.z << 2u))) >> 1u;
        bits &= bits - 1u;
    }
    return f32(min(sum, LIGHT_MASK_WHOLE)) / f32(LIGHT_MASK_WHOLE);
}
// #endif

// The child bits of the child in a slot of a node.
fn light_child_bits(in_top: bool, index: u32, slot: u32) -> u32 {
    return light_quad(in_top, index * LIGHT_NODE_QUADS + LIGHT_NODE_CHILDREN + slot).x;
}

// A light; `index` counts from the start of the buffer.
fn light_record(index: u32) -> LightRecord {
    let at = index * LIGHT_RECORD_QUADS;
    let first = light_record_quad(at);
    let second = light_record_quad(at + 1u);
    var light: LightRecord;
    light.a = bitcast<vec3<f32>>(first.xyz);
    light.kind = first.w;
    light.emission = bitcast<vec3<f32>>(second.xyz);
    light.place = second.w;
    // #if CONES | AREAS | DIRECTIONAL | PROFILES
    light.b = bitcast<vec3<f32>>(light_record_quad(at + 2u).xyz);
    // #endif
    // #if RANGES
    light.range = bitcast<f32>(light_record_quad(at + 2u).w);
    // #endif
    // #if CONES | AREAS | PROFILES
    light.c = bitcast<vec3<f32>>(light_record_quad(at + 3u).xyz);
    // #endif
    // #if PROFILES
    light.profile = light_record_quad(at + 3u).w;
    // #endif
    return light;
}

// The place of a light's leaf in its tree.
fn light_place(index: u32) -> u32 {
    return light_record_quad(index * LIGHT_RECORD_QUADS + 1u).w;
}

// The instance in a slot, without its first part.
fn light_instance(slot: u32) -> LightInstance {
    let at = slot * LIGHT_INSTANCE_QUADS;
    let words = light_instance_quad(at + LIGHT_INSTANCE_TREE);
    var instance: LightInstance;
    instance.to_world = light_rows(light_instance_quad(at), light_instance_quad(at + 1u), light_instance_quad(at + 2u));
    let sector = bitcast<vec3<i32>>(light_instance_quad(at + LIGHT_INSTANCE_SECTOR).xyz);
    instance.to_world = light_from_home(instance.to_world, sector, light_params.home);
    instance.flags = words.x;
    instance.tree = words.y;
    instance.node_base = words.z;
    instance.light_base = words.w;
    // #if NON_RIGID
    // #if CONES
    instance.cos_turn = bitcast<f32>(light_instance_quad(at + LIGHT_INSTANCE_PART).y);
    instance.sin_turn = bitcast<f32>(light_instance_quad(at + LIGHT_INSTANCE_PART).z);
    // #endif
    let local = at + LIGHT_INSTANCE_LOCAL;
    instance.to_local =
        light_rows(light_instance_quad(local), light_instance_quad(local + 1u), light_instance_quad(local + 2u));
    // #endif
    // #if FACTORS
    instance.factor = bitcast<vec3<f32>>(light_instance_quad(at + LIGHT_INSTANCE_FACTOR).xyz);
    // #endif
    // #if MASKS
    instance.mask = light_instance_quad(at + LIGHT_INSTANCE_FACTOR).w;
    // #endif
    return instance;
}

// The first node of an instance's tree.
fn light_node_base(slot: u32) -> u32 {
    return light_instance_quad(slot * LIGHT_INSTANCE_QUADS + LIGHT_INSTANCE_TREE).z;
}

// Returns the 32 bits that the engine has given to an instance; 0 for LIGHT_DIRECTIONAL and for a
// slot without a shown instance. Twin of `LightWorld::user_data`.
fn light_user_data(instance: u32) -> u32 {
    if instance >= light_params.slots {
        return 0u;
    }
    return light_instance_quad(instance * LIGHT_INSTANCE_QUADS + LIGHT_INSTANCE_PART).w;
}

// Returns a number that changes when an instance and an index come to name another light, at least 1;
// 0 where no instance is shown, for an index beyond the lights of its tree, and where stand-ins are shown in place
// of its lights or the reverse.
// Twin of `LightWorld::generation`.
fn light_generation(instance: u32, light: u32) -> u32 {
    let index = light_find_any(instance, light);
    if index == LIGHT_NO_LIGHT {
        return 0u;
    }
    return light_generation_at(instance, index);
}

// The same for a light that is there; `index` counts from the start of the buffer.
fn light_generation_at(instance: u32, index: u32) -> u32 {
    var of_instance = 0u;
    if instance != LIGHT_DIRECTIONAL {
        of_instance = light_instance_quad(instance * LIGHT_INSTANCE_QUADS + LIGHT_INSTANCE_TREE).x;
    }
    let of_light = light_record_quad(index * LIGHT_RECORD_QUADS).w;
    let births = vec2(of_instance, of_light) >> vec2(LIGHT_BIRTH_SHIFT);
    return max(light_hash(births.x ^ light_hash(births.y)) >> 8u, 1u);
}

// Whether a light is there that once had a generation. Reads no node: the lights of an instance become fewer only with
// another tree, which has another birth number.
fn light_is_same(instance: u32, light: u32, generation: u32) -> bool {
    var index = light_params.directional_base + light;
    if instance == LIGHT_DIRECTIONAL {
        if light >= light_params.directional_count {
            return false;
        }
    } else {
        if instance >= light_params.slots {
            return false;
        }
        let words = light_instance_quad(instance * LIGHT_INSTANCE_QUADS + LIGHT_INSTANCE_TREE);
        let stands_in = (words.x & LIGHT_STANDS_IN) != 0u;
        index = words.w + light;
        if (words.x & LIGHT_LIVE) == 0u || stands_in != (light >= LIGHT_STAND_IN)
            || index >= light_record_quads() / LIGHT_RECORD_QUADS {
            return false;
        }
    }
    // #if SKY
    // While the tree of a new sky is on its way, the patches of the old one do not fit the map.
    let kind = light_record_quad(index * LIGHT_RECORD_QUADS).w & LIGHT_KIND_MASK;
    if kind == LIGHT_KIND_SKY && instance != light_params.sky {
        return false;
    }
    // #endif
    return light_generation_at(instance, index) == generation;
}

const LIGHT_NO_LIGHT: u32 = 0xffffffffu;

// The index of a light of an instance from the start of the buffer; LIGHT_NO_LIGHT where an engine asks for one
// that is not there: where no instance is shown, beyond the lights of its tree, and for stand-ins in place of the
// tree or the reverse. Dark and removed lights are there.
fn light_find(instance: u32, light: u32) -> u32 {
    if instance >= light_params.slots {
        return LIGHT_NO_LIGHT;
    }
    let words = light_instance_quad(instance * LIGHT_INSTANCE_QUADS + LIGHT_INSTANCE_TREE);
    if (words.x & LIGHT_LIVE) == 0u {
        return LIGHT_NO_LIGHT;
    }
    let lights = light_nodes[words.z * LIGHT_NODE_QUADS + LIGHT_NODE_TAIL].zw;
    return select(LIGHT_NO_LIGHT, words.w + light, light - lights.x < lights.y);
}

// The same for any light, which may be directional.
fn light_find_any(instance: u32, light: u32) -> u32 {
    if instance == LIGHT_DIRECTIONAL {
        return select(LIGHT_NO_LIGHT, light_params.directional_base + light, light < light_params.directional_count);
    }
    return light_find(instance, light);
}

// Whether the lights of an instance are stand-ins. Then their indices begin at LIGHT_STAND_IN, and
// the buffers do not hold the tree. Twin of `LightPlanner::stands_in`.
fn light_stands_in(instance: u32) -> bool {
    if instance >= light_params.slots {
        return false;
    }
    let flags = light_instance_quad(instance * LIGHT_INSTANCE_QUADS + LIGHT_INSTANCE_TREE).x;
    return (flags & LIGHT_STANDS_IN) != 0u;
}

// The part that a leaf of the top level is; `bits` are its child bits.
fn light_part(bits: u32) -> LightPart {
    if (bits & LIGHT_PART) == 0u {
        return LightPart(bits & LIGHT_PART_BITS, 0u, 0u, 0u);
    }
    let words = light_top[light_params.parts + (bits & LIGHT_PART_BITS)];
    return LightPart(words.x, words.y, words.z, words.w);
}

// Whether a walk up an instance's tree goes on in the top level: `place` is above the root or an opening.
fn light_leaves_tree(place: u32) -> bool {
    // LIGHT_NO_PARENT has the bit LIGHT_OPENING as well.
    return place >= LIGHT_OPENING;
}

// The place in the top level where it goes on.
fn light_place_above(slot: u32, place: u32) -> u32 {
    let first = light_instance_quad(slot * LIGHT_INSTANCE_QUADS + LIGHT_INSTANCE_PART).x;
    let index = select(place & ~LIGHT_OPENING, 0u, place == LIGHT_NO_PARENT);
    return light_top[light_params.parts + first + index].z;
}
