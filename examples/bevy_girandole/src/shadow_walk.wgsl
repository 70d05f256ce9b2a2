// Shadow rays in software: a walk of the trees over entities, and below them of those over triangles. No walk needs a
// stack: a node says where to go on for a ray that misses its box.

// Meshes: two words for each node, and three for each triangle. Twin of `CasterMesh` in shadows/mesh.rs.
@group(2) @binding(4) var<storage, read> girandole_caster_meshes: array<vec4<u32>>;
// Entities: the number of nodes; two words for each node, and four for each entity. Twin of `Top` in shadows/top.rs.
@group(2) @binding(5) var<storage, read> girandole_casters: array<vec4<u32>>;

// By how much triangles are enlarged, as a share, so that no ray passes between two of them.
const GIRANDOLE_EDGE: f32 = 1.0e-6;

struct GirandoleRay {
    origin: vec3<f32>,
    direction: vec3<f32>,
    // One over each component, at most 1e20.
    inverse: vec3<f32>,
    far: f32,
}

fn girandole_ray(origin: vec3<f32>, direction: vec3<f32>, far: f32) -> GirandoleRay {
    let is_small = abs(direction) < vec3(1.0e-20);
    let inverse = 1.0 / select(direction, vec3(1.0e-20), is_small);
    return GirandoleRay(origin, direction, inverse, far);
}

fn girandole_meets_box(ray: GirandoleRay, lower: vec4<u32>, upper: vec4<u32>) -> bool {
    let a = (bitcast<vec3<f32>>(lower.xyz) - ray.origin) * ray.inverse;
    let b = (bitcast<vec3<f32>>(upper.xyz) - ray.origin) * ray.inverse;
    let enter = min(a, b);
    let leave = max(a, b);
    let first = max(max(enter.x, enter.y), max(enter.z, 0.0));
    let last = min(min(leave.x, leave.y), leave.z);
    return first <= last * 1.000001 && first <= ray.far;
}

fn girandole_meets_triangle(ray: GirandoleRay, corner: vec3<f32>, edge_a: vec3<f32>, edge_b: vec3<f32>) -> bool {
    let across = cross(ray.direction, edge_b);
    let volume = dot(edge_a, across);
    if volume == 0.0 {
        return false;
    }
    let to_origin = ray.origin - corner;
    let u = dot(to_origin, across) / volume;
    let around = cross(to_origin, edge_a);
    let v = dot(ray.direction, around) / volume;
    let t = dot(edge_b, around) / volume;
    return u >= -GIRANDOLE_EDGE && v >= -GIRANDOLE_EDGE && u + v <= 1.0 + GIRANDOLE_EDGE && t > 0.0 && t < ray.far;
}

// Whether a ray in the space of a mesh hits one of its triangles.
fn girandole_meets_mesh(ray: GirandoleRay, first: u32, nodes: u32) -> bool {
    let triangles = first + 2u * nodes;
    var node = 0u;
    while node < nodes {
        let lower = girandole_caster_meshes[first + 2u * node];
        let upper = girandole_caster_meshes[first + 2u * node + 1u];
        if !girandole_meets_box(ray, lower, upper) {
            node = lower.w;
            continue;
        }
        node += 1u;
        let end = (upper.w >> 3u) + (upper.w & 7u);
        for (var i = upper.w >> 3u; i < end; i++) {
            let at = triangles + 3u * i;
            let corner = bitcast<vec3<f32>>(girandole_caster_meshes[at].xyz);
            let edge_a = bitcast<vec3<f32>>(girandole_caster_meshes[at + 1u].xyz);
            let edge_b = bitcast<vec3<f32>>(girandole_caster_meshes[at + 2u].xyz);
            if girandole_meets_triangle(ray, corner, edge_a, edge_b) {
                return true;
            }
        }
    }
    return false;
}

// Whether nothing is in the way from a point along a direction of length 1, up to a distance.
fn girandole_is_free(origin: vec3<f32>, direction: vec3<f32>, dist: f32) -> bool {
    let ray = girandole_ray(origin, direction, dist);
    let nodes = girandole_casters[0].x;
    let records = 1u + 2u * nodes;
    var node = 0u;
    while node < nodes {
        let lower = girandole_casters[1u + 2u * node];
        let upper = girandole_casters[2u + 2u * node];
        if !girandole_meets_box(ray, lower, upper) {
            node = lower.w;
            continue;
        }
        node += 1u;
        let end = (upper.w >> 3u) + (upper.w & 7u);
        for (var i = upper.w >> 3u; i < end; i++) {
            let at = records + 4u * i;
            let x = bitcast<vec4<f32>>(girandole_casters[at]);
            let y = bitcast<vec4<f32>>(girandole_casters[at + 1u]);
            let z = bitcast<vec4<f32>>(girandole_casters[at + 2u]);
            let place = girandole_casters[at + 3u];
            // The direction keeps its length in the world, so that distances stay as they are.
            let turned = vec3(dot(x.xyz, direction), dot(y.xyz, direction), dot(z.xyz, direction));
            let moved = vec3(dot(x.xyz, origin) + x.w, dot(y.xyz, origin) + y.w, dot(z.xyz, origin) + z.w);
            if girandole_meets_mesh(girandole_ray(moved, turned, dist), place.x, place.y) {
                return false;
            }
        }
    }
    return true;
}

