// The colours of textures. Twins of `scene/texture.rs`. `render.wgsl` declares the bindings. Scenes
// without textures leave this file out, since compilers copy it to each place that reads a texture.

// What `Record.words` of a texture holds: for each axis a wrap in two bits, then these.
const MIRROR: u32 = 1u;
const CLAMP: u32 = 2u;
const NEAREST: u32 = 16u;
const SRGB: u32 = 32u;
const SECOND_COORDINATES: u32 = 64u;

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
