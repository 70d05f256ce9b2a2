// Temporal reuse: each pixel keeps one sample from frame to frame. `docs/reuse.md` explains it.

struct Frame {
    number: u32,
    pixels_per_edge: u32,
    // New samples of a pixel.
    candidates: u32,
    // The caps on `Kept::frames`: the frame is drawn once with each. With 0, nothing is reused.
    @align(16) most_frames: vec4<f32>,
}

// A kept sample: a light, the numbers that choose the point on it, and a weight instead of 1 / pmf.
struct Kept {
    instance: u32,
    light: u32,
    generation: u32,
    weight: f32,
    u: vec2<f32>,
    // How many frames it stands for.
    frames: f32,
    // What the picture shows: the illuminance by this sample times its weight, in lux.
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

// The target of a sample that was picked with a pmf of 1: what it brings to the point, in lux. A renderer multiplies
// by its BRDF.
fn unshadowed(at: LightShadingPoint, s: LightSample) -> f32 {
    return select(0.0, s.radiance.y * dot(at.normal, s.direction) / s.pdf, s.pmf > 0.0);
}

// The same with shadows.
fn shadowed(at: LightShadingPoint, s: LightSample) -> f32 {
    let lux = unshadowed(at, s);
    if lux <= 0.0 || is_occluded(at.position, s.direction, 0.999 * s.dist) {
        return 0.0;
    }
    return lux;
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
    light_mark(at);
    let then = kept[place];
    var now: Kept;

    // One of the new samples, in proportion to what they bring without shadows. Its weight is 1 / pmf if it is the only
    // one.
    var total = 0.0;
    var kept_lux = 0.0;
    for (var i = 0u; i < frame.candidates; i++) {
        let pick = light_pick(at, vec2(random(), random()));
        let u = vec2(random(), random());
        let choice = random();
        let lux = unshadowed(at, light_sample_picked(at, pick, u));
        if lux > 0.0 {
            let weight = lux / (f32(frame.candidates) * pick.pmf);
            total += weight;
            if choice * total < weight {
                now = Kept(pick.instance, pick.light, 0u, 0.0, u, 0.0, 0.0);
                kept_lux = lux;
            }
        }
    }
    // That sample and the kept one share what lights bring: in proportion to the target now, and to that of the last
    // frame for each of the frames that the kept sample stands for. Both know shadows.
    let frames = min(then.frames, frame.most_frames[id.y]);
    if total > 0.0 {
        let pick = LightPick(now.instance, now.light, 1.0);
        let lux = shadowed(at, light_sample_picked(at, pick, now.u));
        let lux_then = shadowed(at, light_sample_picked_previous(at, pick, now.u));
        total *= select(0.0, lux / (lux + frames * lux_then) * (lux / kept_lux), lux > 0.0);
        kept_lux = lux;
    }
    // The kept sample, unless another light has its name now.
    if then.weight > 0.0 && frames > 0.0 && light_generation(then.instance, then.light) == then.generation {
        let pick = LightPick(then.instance, then.light, 1.0);
        let lux = shadowed(at, light_sample_picked(at, pick, then.u));
        let lux_then = shadowed(at, light_sample_picked_previous(at, pick, then.u));
        let share = frames * lux_then / (lux + frames * lux_then);
        let weight = select(0.0, share * lux * then.weight, lux > 0.0);
        total += weight;
        if random() * total < weight {
            now = then;
            kept_lux = lux;
        }
    }
    now.weight = 0.0;
    now.lux = total;
    if total > 0.0 {
        now.weight = total / kept_lux;
        now.generation = light_generation(now.instance, now.light);
    }
    now.frames = min(frames + 1.0, frame.most_frames[id.y]);
    kept[place] = now;
}
