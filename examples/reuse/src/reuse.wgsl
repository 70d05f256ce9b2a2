// Temporal reuse: each pixel keeps one sample from frame to frame. `docs/reuse.md` explains it.

struct Frame {
    number: u32,
    pixels_per_edge: u32,
    // New samples of a pixel.
    candidates: u32,
    // The caps on `Kept::frames`: the frame is drawn once with each. With 0, nothing is reused.
    @align(16) most_frames: vec4<f32>,
}

// The least target of a sample, in lux.
const LEAST = 0.001;

// A kept sample: a light, the numbers that choose the point on it, and a weight instead of 1 / pmf.
struct Kept {
    instance: u32,
    light: u32,
    generation: u32,
    weight: f32,
    u: vec2<f32>,
    // How many frames it stands for.
    frames: f32,
    // The illuminance by this sample, in lux.
    lux: f32,
}

@group(0) @binding(0) var<storage, read_write> kept: array<Kept>;
@group(0) @binding(1) var<uniform> frame: Frame;

var<private> random_state: u32;

fn random() -> f32 {
    random_state = light_hash(random_state);
    return f32(random_state >> 8u) / 16777216.0;
}

// Whether a wall is in the way. Twin of `is_occluded` in main.rs.
fn is_occluded(origin: vec3<f32>, direction: vec3<f32>, max_dist: f32) -> bool {
    var is_hit = false;
    for (var i = 0u; i < 4u; i++) {
        let z = 4.0 * f32(i) - 6.0;
        let to_low = (vec3(-9.0, 0.0, z - 0.1) - origin) / direction;
        let to_high = (vec3(9.0, 4.0, z + 0.1) - origin) / direction;
        let nears = min(to_low, to_high);
        let fars = max(to_low, to_high);
        let near = max(max(nears.x, nears.y), max(nears.z, 0.0));
        is_hit = is_hit || near <= min(min(fars.x, fars.y), min(fars.z, max_dist));
    }
    return is_hit;
}

struct Value {
    // The illuminance in lux. A renderer multiplies it by its BRDF.
    lux: f32,
    // What the sample is kept in proportion to: a tenth of the illuminance where it is in shadow, for it may
    // come into the light. Greater than 0 wherever the light has a probability: so a light may be kept
    // exactly if light_pmf_previous is greater than 0.
    target_lux: f32,
}

// The value of a sample whose light was picked with probability 1.
fn value_of(at: LightShadingPoint, instance: u32, light: u32, u: vec2<f32>) -> Value {
    let s = light_sample_picked(at, LightPick(instance, light, 1.0), u);
    if s.pmf <= 0.0 {
        return Value(0.0, LEAST);
    }
    let unshadowed = s.radiance.y * dot(at.normal, s.direction) / s.pdf;
    let is_lit = !is_occluded(at.position, s.direction, 0.999 * s.dist);
    return Value(select(0.0, unshadowed, is_lit), LEAST + unshadowed * select(0.1, 1.0, is_lit));
}

// With how many samples times which probability the frames of a kept sample count, for a light and its
// probability now. That is 0 for a light that was not there. If the probability has risen, others have gone,
// and the noise that this leaves makes the frames count less: see docs/reuse.md.
fn pmf_of_kept(at: LightShadingPoint, frames: f32, pick: LightPick) -> f32 {
    let pmf_then = light_pmf_previous(at, pick.instance, pick.light);
    let risen = frames * max(pick.pmf - pmf_then, 0.0);
    return frames * pmf_then * (pmf_then / max(pmf_then + risen, 1e-30));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let pixels = frame.pixels_per_edge * frame.pixels_per_edge;
    let pixel = id.x % pixels;
    let x = f32(pixel % frame.pixels_per_edge) + 0.5 - 0.5 * f32(frame.pixels_per_edge);
    let z = f32(pixel / frame.pixels_per_edge) + 0.5 - 0.5 * f32(frame.pixels_per_edge);
    let at = light_surface_point(vec3(x, 0.0, z), vec3(0.0, 1.0, 0.0));
    let place = id.y * groups.x * 64u + id.x;
    random_state = light_hash(place ^ light_hash(frame.number));
    let then = kept[place];
    var now: Kept;

    // New samples. They share what they stand for with the kept sample: in proportion to the probability
    // now, and to that of the last frame for each of the frames that the kept sample stands for.
    var total = 0.0;
    for (var i = 0u; i < frame.candidates; i++) {
        let pick = light_pick(at, vec2(random(), random()));
        let u = vec2(random(), random());
        let choice = random();
        if pick.pmf > 0.0 {
            let value = value_of(at, pick.instance, pick.light, u);
            let pmf_then = pmf_of_kept(at, then.frames, pick);
            let weight = value.target_lux / (f32(frame.candidates) * (pick.pmf + pmf_then));
            total += weight;
            if choice * total < weight {
                now = Kept(pick.instance, pick.light, 0u, value.target_lux, u, 0.0, value.lux);
            }
        }
    }
    // The kept sample, unless another light has its name now. Its light is evaluated as it is now.
    let choice = random();
    if then.weight > 0.0 && light_generation(then.instance, then.light) == then.generation {
        let value = value_of(at, then.instance, then.light, then.u);
        let pmf = light_pmf(at, then.instance, then.light);
        let pmf_then = pmf_of_kept(at, then.frames, LightPick(then.instance, then.light, pmf));
        let share = pmf_then / (pmf + pmf_then);
        let weight = select(0.0, share * value.target_lux * then.weight, pmf_then > 0.0);
        total += weight;
        if choice * total < weight {
            now = Kept(then.instance, then.light, 0u, value.target_lux, then.u, 0.0, value.lux);
        }
    }
    if total > 0.0 {
        now.weight = total / now.weight;
        now.lux *= now.weight;
        now.generation = light_generation(now.instance, now.light);
    }
    // The frames that last, by a light that was picked for this alone: if they depended on the samples
    // above, the picture would be biased.
    var lasting = then.frames;
    let other = light_pick(at, vec2(random(), random()));
    if other.pmf > 0.0 {
        lasting = min(lasting, pmf_of_kept(at, then.frames, other) / other.pmf);
    }
    now.frames = min(lasting + 1.0, frame.most_frames[id.y]);
    kept[place] = now;
}
