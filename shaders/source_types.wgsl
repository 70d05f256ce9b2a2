// What kernels of the engine and refits know of a tree whose lights are written on the GPU. Binds
// nothing.

// A tree with a source. Twin of `SourceRecord` in src/plan/sources/records.rs.
struct LightSourceRecord {
    // The first light of the tree in its buffer, and how many there are; 0 if the GPU does not hold
    // the tree whole.
    light_base: u32,
    light_count: u32,
    // The first node of the tree in its buffer.
    node_base: u32,
    // Where the cluster of all lights is.
    root: u32,
    // 1 if clusters are weighed for a map, by `weights`.
    flags: u32,
    // The parts of the tree, of which the top level reads the records.
    record_base: u32,
    record_count: u32,
    // How many writes were refused so far.
    refused: atomic<u32>,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
    padding_d: u32,
    // The columns of the matrix of cofactors of the map, see `Linear` in src/cluster/mod.rs.
    weights: array<vec4<f32>, 3>,
}

// The emitting area of a light in square metres, both sides counted; 0 for lights without size. Twin of
// `Light::area`. Scaled, because the squares of small areas would underflow.
fn light_emitting_area(kind: u32, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> f32 {
    var area = 0.0;
    switch kind & LIGHT_KIND_MASK {
        case LIGHT_KIND_RECTANGLE: {
            area = 4.0 * light_parallelogram(b, c);
        }
        case LIGHT_KIND_TRIANGLE: {
            area = 0.5 * light_parallelogram(b - a, c - a);
        }
        case LIGHT_KIND_SPHERE: {
            area = 4.0 * LIGHT_SOURCE_PI * c.x * c.x;
        }
        default: {}
    }
    return select(area, 2.0 * area, (kind & LIGHT_TWO_SIDED) != 0u);
}

fn light_parallelogram(u: vec3<f32>, v: vec3<f32>) -> f32 {
    let u_size = max(abs(u.x), max(abs(u.y), abs(u.z)));
    let v_size = max(abs(v.x), max(abs(v.y), abs(v.z)));
    if u_size <= 0.0 || v_size <= 0.0 {
        return 0.0;
    }
    return u_size * v_size * length(cross(u / u_size, v / v_size));
}
