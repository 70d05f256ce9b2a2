// Shadow rays by ray queries of the device.

// Twin of `Structures` in shadows/structures.rs.
@group(2) @binding(4) var girandole_casters: acceleration_structure;

// All triangles count as opaque, from both sides, and the first that is found ends the search.
const GIRANDOLE_RAY_FLAGS: u32 = 0x05u;

// Whether nothing is in the way from a point along a direction of length 1, up to a distance.
fn girandole_is_free(origin: vec3<f32>, direction: vec3<f32>, dist: f32) -> bool {
    var query: ray_query;
    rayQueryInitialize(&query, girandole_casters, RayDesc(GIRANDOLE_RAY_FLAGS, 0xffu, 0.0, dist, origin, direction));
    rayQueryProceed(&query);
    return rayQueryGetCommittedIntersection(&query).kind == RAY_QUERY_INTERSECTION_NONE;
}

