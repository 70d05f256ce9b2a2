// The random numbers of a picture. Twin of `sequence.rs`, which states the sources. `pipeline.rs`
// defines `sobol`, the four unscrambled coordinates of a point, from the direction numbers there.

struct PixelSequence {
    // The index of the pixel's first sample in the sequence of its tile.
    first: u32,
    block_bits: u32,
    tile: vec2<u32>,
}

struct SampleNumbers {
    // The choice of a light (xy) and of a point on it (zw).
    light: vec4<f32>,
    // The position within the pixel (xy), and which candidate is kept (w).
    pixel: vec4<f32>,
}

fn pcg4d(seed: vec4<u32>) -> vec4<u32> {
    var v = seed * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> vec4<u32>(16u);
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// Moves each of the lower 16 bits to twice its position.
fn spread_bits(value: vec2<u32>) -> vec2<u32> {
    var x = value;
    x = (x | (x << vec2<u32>(8u))) & vec2<u32>(0x00ff00ffu);
    x = (x | (x << vec2<u32>(4u))) & vec2<u32>(0x0f0f0f0fu);
    x = (x | (x << vec2<u32>(2u))) & vec2<u32>(0x33333333u);
    return (x | (x << vec2<u32>(1u))) & vec2<u32>(0x55555555u);
}

fn pixel_sequence(place: vec2<u32>, block_bits: u32, tile_bits: u32) -> PixelSequence {
    let spread = spread_bits(place & vec2<u32>((1u << tile_bits) - 1u));
    let first = (spread.x | (spread.y << 1u)) << block_bits;
    return PixelSequence(first, block_bits, place >> vec2<u32>(tile_bits));
}

// Flips each bit by a hash of the bits below it.
fn scramble_reversed(value: vec4<u32>, seed: vec4<u32>) -> vec4<u32> {
    var x = value;
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> vec4<u32>(16u)) | vec4<u32>(1u);
    x ^= x * 0x05526c56u;
    return x ^ (x * 0x53a22864u);
}

fn mix_bits(value: vec4<u32>) -> vec4<u32> {
    var x = value;
    x = (x ^ vec4<u32>(61u)) ^ (x >> vec4<u32>(16u));
    x *= 9u;
    x ^= x >> vec4<u32>(4u);
    x *= 0x27d4eb2du;
    return x ^ (x >> vec4<u32>(15u));
}

// A scrambled point of the shuffled sequence.
fn sequence_point(index: u32, shuffle: u32, scramble: u32) -> vec4<f32> {
    let shuffled = scramble_reversed(vec4<u32>(reverseBits(index)), vec4<u32>(shuffle)).x;
    let seeds = mix_bits(scramble + vec4<u32>(0u, 1u, 2u, 3u) * 0x9e3779b9u);
    let bits = reverseBits(scramble_reversed(reverseBits(sobol(reverseBits(shuffled))), seeds));
    return vec4<f32>(bits >> vec4<u32>(8u)) * (1.0 / 16777216.0);
}

fn sample_numbers(sequence: PixelSequence, index: u32) -> SampleNumbers {
    let scramble = pcg4d(vec4<u32>(sequence.tile, frame.seed, index >> sequence.block_bits));
    let place = sequence.first | (index & ((1u << sequence.block_bits) - 1u));
    return SampleNumbers(
        sequence_point(place, scramble.x, scramble.y),
        sequence_point(place, scramble.z, scramble.w),
    );
}
