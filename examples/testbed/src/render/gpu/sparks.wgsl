// The sparks of a fire: each invocation moves one, and writes it as a light.
//
// The library's text (group 1) precedes this file. `festival.rs` defines the constants in capitals that this
// file does not.

struct Step {
    // The numbers of the sources of the sparks and of the suit.
    sparks: u32,
    suit: u32,
    // The steps that this dispatch takes, and those before it.
    count: u32,
    before: u32,
}

struct Spark {
    // In metres from the middle of the fire.
    position: vec3<f32>,
    age: f32,
    // Candela; zero for a spark that is dead.
    intensity: vec3<f32>,
    life: f32,
    // How many sparks have lived in this place.
    births: u32,
}

@group(0) @binding(0) var<uniform> step_now: Step;
@group(0) @binding(1) var<storage, read_write> sparks: array<Spark>;

// Numbers from 0 to 1 by PCG3D (Jarzynski and Olano 2020).
fn random(key: vec3<u32>) -> vec3<f32> {
    var v = key * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> vec3<u32>(16u);
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return vec3<f32>(v >> vec3<u32>(8u)) * (1.0 / 16777216.0);
}

// A flow without sources, which is its own curl: that of Arnold, Beltrami and Childress. No component
// exceeds 2.
fn swirl(p: vec3<f32>) -> vec3<f32> {
    return sin(p.zxy) + cos(p.yzx);
}

fn born(place: u32, births: u32) -> Spark {
    let a = random(vec3<u32>(place, births, 0u));
    let b = random(vec3<u32>(place, births, 1u));
    let radius = FIRE_RADIUS * sqrt(a.x);
    let angle = 6.2831853 * a.y;
    var spark: Spark;
    spark.position = vec3<f32>(radius * cos(angle), FIRE_HEIGHT, radius * sin(angle));
    spark.life = SHORTEST_LIFE + (LONGEST_LIFE - SHORTEST_LIFE) * a.z * a.z;
    // The first ones die at once or later, so that not all are of one age.
    spark.life *= select(1.0, b.x, births == 1u);
    spark.births = births;
    return spark;
}

// Metres in a second: up, fastest where the fire is hottest; drawn inward there; and drifting.
fn velocity(spark: Spark, own: vec3<f32>, time: f32) -> vec3<f32> {
    let p = spark.position;
    let heat = exp(-1.4 * spark.age);
    let drift = 0.26 * swirl(0.7 * p - vec3<f32>(0.0, 0.9 * time, 0.3 * time))
        + 0.26 * swirl(1.9 * p.yzx + vec3<f32>(1.3 * time, 0.0, -2.1 * time))
        + 0.2 * swirl(4.3 * p.zxy + vec3<f32>(0.0, -4.0 * time, 2.0));
    let rise = vec3<f32>(0.15, 0.9 + 1.5 * heat, 0.05);
    let inward = vec3<f32>(-p.x, 0.0, -p.z) * (0.7 * heat);
    return rise + inward + drift + 0.5 * (own - 0.5);
}

// From yellow to deep red, ever darker. A few sparks are much brighter than most.
fn cooled(place: u32, spark: Spark) -> vec3<f32> {
    let heat = 1.0 - spark.age / spark.life;
    let color = mix(vec3<f32>(1.0, 0.07, 0.004), vec3<f32>(1.0, 0.34, 0.04), heat * heat);
    let chance = random(vec3<u32>(place, spark.births, 3u)).x;
    return color * (SPARK_BRIGHTNESS * heat * (0.15 + 7.6 * pow(chance, 8.0)));
}

@compute @workgroup_size(64)
fn move_sparks(@builtin(global_invocation_id) id: vec3<u32>) {
    let place = id.x;
    if place >= arrayLength(&sparks) {
        return;
    }
    var spark = sparks[place];
    let births = spark.births;
    for (var i = 0u; i < step_now.count; i += 1u) {
        if spark.age >= spark.life {
            // It was dark for one step.
            spark = born(place, spark.births + 1u);
        } else {
            let time = f32((step_now.before + i) % 65536u) * STEP;
            spark.position += STEP * velocity(spark, random(vec3<u32>(place, spark.births, 2u)), time);
            spark.age += STEP;
        }
    }
    let is_alive = spark.age < spark.life;
    spark.intensity = select(vec3<f32>(0.0), cooled(place, spark), is_alive);
    sparks[place] = spark;
    if spark.births != births {
        light_put_new(step_now.sparks, place);
    }
    if is_alive {
        light_put_point(step_now.sparks, place, spark.position, spark.intensity);
    } else {
        light_put_dark(step_now.sparks, place);
    }
}
