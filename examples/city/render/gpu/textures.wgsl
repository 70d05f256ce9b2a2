// Textures and opacity. Twins of `scene/texture.rs` and `render/textures.rs`. `render.wgsl`, which
// follows, declares the bindings.

// What `Triangle.flags` and `Record.words` of a material hold.
const TRANSLUCENT: u32 = 2u;
const TWO_SIDED: u32 = 1u;
const MASK: u32 = 2u;
const BLEND: u32 = 4u;
// What `Record.words` of a texture holds: for each axis a wrap in two bits, then these.
const MIRROR: u32 = 1u;
const CLAMP: u32 = 2u;
const NEAREST: u32 = 16u;
const SRGB: u32 = 32u;
const SECOND_COORDINATES: u32 = 64u;
const NO_TEX_COORDS: u32 = 0xffffffffu;

// The two texture coordinates of a point: xy and zw.
fn tex_coords_at(facet: Triangle, weights: vec2<f32>) -> vec4<f32> {
    // Three corners of the first coordinates, then three of the second.
    let record = triangles[frame.first_tex_coords + facet.tex_coords];
    let a = vec4<f32>(record.corner.xy, record.edge1.z, bitcast<f32>(record.flags));
    let b = vec4<f32>(record.corner.z, bitcast<f32>(record.material), record.edge2.xy);
    let c = vec4<f32>(record.edge1.xy, record.edge2.z, bitcast<f32>(record.tex_coords));
    return a + (b - a) * weights.x + (c - a) * weights.y;
}

fn srgb_to_linear(encoded: vec3<f32>) -> vec3<f32> {
    let power = pow((encoded + 0.055) / 1.055, vec3<f32>(2.4));
    return select(power, encoded / 12.92, encoded <= vec3<f32>(0.04045));
}

// The texel that shows at a place along an axis.
fn wrapped(place: i32, size: i32, wrap: u32) -> i32 {
    if wrap == CLAMP {
        return clamp(place, 0, size - 1);
    }
    let period = select(size, 2 * size, wrap == MIRROR);
    let rest = place % period;
    let inside = select(rest, rest + period, rest < 0);
    return min(inside, 2 * size - 1 - inside);
}

fn texel(words: vec4<u32>, x: i32, y: i32) -> vec4<f32> {
    let size = vec2<i32>(i32(words.y & 0xffffu), i32(words.y >> 16u));
    let column = wrapped(x, size.x, words.z & 3u);
    let row = wrapped(y, size.y, (words.z >> 2u) & 3u);
    let index = words.x + u32(row * size.x + column);
    let side = vec2<u32>(index % TEXEL_ROW, index / TEXEL_ROW % TEXEL_ROW);
    let color = unpack4x8unorm(textureLoad(texels, side, index / (TEXEL_ROW * TEXEL_ROW), 0).x);
    return select(color, vec4<f32>(srgb_to_linear(color.xyz), color.w), (words.z & SRGB) != 0u);
}

// The linear colour and the alpha of the texture in a record.
fn sample_texture(record: u32, coordinates: vec4<f32>) -> vec4<f32> {
    let use_of = records[record];
    let words = use_of.words;
    let at = vec3<f32>(select(coordinates.xy, coordinates.zw, (words.z & SECOND_COORDINATES) != 0u), 1.0);
    let size = vec2<f32>(f32(words.y & 0xffffu), f32(words.y >> 16u));
    let place = clamp(vec2<f32>(dot(use_of.row0.xyz, at), dot(use_of.row1.xyz, at)) * size, vec2<f32>(-1e9), vec2<f32>(1e9));
    if (words.z & NEAREST) != 0u {
        return texel(words, i32(floor(place.x)), i32(floor(place.y)));
    }
    let low = floor(place - 0.5);
    let share = place - 0.5 - low;
    let x = i32(low.x);
    let y = i32(low.y);
    let above = mix(texel(words, x, y), texel(words, x + 1, y), share.x);
    let below = mix(texel(words, x, y + 1), texel(words, x + 1, y + 1), share.x);
    return mix(above, below, share.y);
}

// The material of a triangle at a point, multiplied by its textures.
fn textured(facet: Triangle, weights: vec2<f32>) -> Record {
    var found = records[facet.material];
    if facet.tex_coords == NO_TEX_COORDS {
        return found;
    }
    let coordinates = tex_coords_at(facet, weights);
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
    return found;
}

// The share of the light that a triangle stops at a point.
fn coverage(facet: Triangle, weights: vec2<f32>) -> f32 {
    let material = records[facet.material];
    var opacity = material.row2.x;
    if material.words.y != 0u && facet.tex_coords != NO_TEX_COORDS {
        opacity *= sample_texture(material.words.y, tex_coords_at(facet, weights)).w;
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
