// Attributes of triangles, textured surfaces and opacity. Twins of `render/textures.rs`. `render.wgsl`, which follows, declares
// the bindings, and `pipeline.rs` adds `sample_texture`.

// What `Triangle.flags` and `Record.words` of a material hold.
const TRANSLUCENT: u32 = 2u;
const TWO_SIDED: u32 = 1u;
const MASK: u32 = 2u;
const BLEND: u32 = 4u;
// Kinds of attributes, which `Triangle.flags` holds too.
const TEX_COORDS: u32 = 4u;
const COLORS: u32 = 8u;
const NORMALS: u32 = 16u;
const ATTRIBUTES: u32 = 28u;

// An attribute of a triangle that has one of this kind: a vector for each corner.
fn attribute_corners(facet: Triangle, kind: u32) -> mat3x4<f32> {
    // Those of the kinds before it come first.
    let before = countOneBits(facet.flags & ATTRIBUTES & (kind - 1u));
    let record = triangles[frame.first_attribute + facet.attributes + before];
    return mat3x4<f32>(
        vec4<f32>(record.corner, bitcast<f32>(record.material)),
        vec4<f32>(record.edge1, bitcast<f32>(record.flags)),
        vec4<f32>(record.edge2, bitcast<f32>(record.attributes)),
    );
}

// The same, at a point.
fn attribute_at(facet: Triangle, kind: u32, weights: vec2<f32>) -> vec4<f32> {
    let corners = attribute_corners(facet, kind);
    return corners[0] + (corners[1] - corners[0]) * weights.x + (corners[2] - corners[0]) * weights.y;
}

// The material of a triangle at a point, multiplied by its textures and the colours of its corners. The
// base colour of an unlit one is part of its emission.
fn textured(facet: Triangle, weights: vec2<f32>) -> Record {
    var found = records[facet.material];
    if (facet.flags & COLORS) != 0u {
        found.row0 *= vec4<f32>(attribute_at(facet, COLORS, weights).xyz, 1.0);
    }
    if (facet.flags & TEX_COORDS) != 0u {
        let coordinates = attribute_at(facet, TEX_COORDS, weights);
        if found.words.y != 0u {
            found.row0 *= vec4<f32>(sample_texture(found.words.y, coordinates).xyz, 1.0);
        }
        if found.words.z != 0u {
            found.row1 *= vec4<f32>(sample_texture(found.words.z, coordinates).xyz, 1.0);
        }
        if found.words.w != 0u {
            let color = sample_texture(found.words.w, coordinates);
            found.row0.w *= color.y;
            found.row1.w *= color.z;
        }
    }
    if found.row2.z > 0.0 {
        found.row1 += vec4<f32>(found.row0.xyz * frame.white, 0.0);
        found.row0 = vec4<f32>(vec3<f32>(0.0), found.row0.w);
    }
    return found;
}

// The share of the light that a triangle stops at a point.
fn coverage(facet: Triangle, weights: vec2<f32>) -> f32 {
    let material = records[facet.material];
    var opacity = material.row2.x;
    if material.words.y != 0u && (facet.flags & TEX_COORDS) != 0u {
        opacity *= sample_texture(material.words.y, attribute_at(facet, TEX_COORDS, weights)).w;
    }
    if (facet.flags & COLORS) != 0u {
        opacity *= attribute_at(facet, COLORS, weights).w;
    }
    if (material.words.x & MASK) != 0u {
        return select(0.0, 1.0, opacity >= material.row2.y);
    }
    return select(1.0, clamp(opacity, 0.0, 1.0), (material.words.x & BLEND) != 0u);
}

// What a camera ray decides by at translucent surfaces: a hash of the pixel, and the sample.
fn opacity_seed(pixel: u32, index: u32) -> vec2<u32> {
    return vec2<u32>(pcg4d(vec4<u32>(pixel, frame.seed, 0u, 0x3c6ef372u)).x, index);
}

// A random number in [0, 1) for a camera ray and a triangle of an object.
fn opacity_draw(seed: vec2<u32>, object: u32, triangle: u32) -> f32 {
    let bits = pcg4d(vec4<u32>(seed.x, object, triangle, 0xa54ff53au)).x + seed.y * 0x9e3779b9u;
    return f32(bits >> 8u) * (1.0 / 16777216.0);
}
