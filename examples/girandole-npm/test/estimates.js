// Estimates and probabilities at some points, by a shader on the page's device.

const INVOCATIONS = 64;
/** Samples of an invocation in one dispatch, so that it is short, and dispatches. */
const SAMPLES = 16;
const ROUNDS = 8;
/** Points at most. */
const POINTS = 16;

const WGSL = `
struct Point { position: vec3<f32>, normal: vec3<f32> }
struct Partial { lux: vec3<f32>, without_light: f32 }
@group(0) @binding(0) var<uniform> points: array<Point, ${POINTS}>;
@group(0) @binding(1) var<storage, read> lights: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> partials: array<Partial>;
@group(0) @binding(3) var<uniform> batch: vec4<u32>;

fn shading_point(index: u32) -> LightShadingPoint {
    return light_surface_point(points[index].position, points[index].normal);
}

// One invocation of ${INVOCATIONS} for each point.
@compute @workgroup_size(${INVOCATIONS})
fn estimate(@builtin(workgroup_id) point: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    let at = shading_point(point.x);
    light_mark(at);
    var sum = Partial();
    var state = light_hash(invocation ^ light_hash(point.x ^ light_hash(batch.x)));
    for (var i = 0; i < ${SAMPLES}; i++) {
        var u: vec4<f32>;
        for (var axis = 0; axis < 4; axis++) {
            state = light_hash(state);
            u[axis] = f32(state >> 8u) / 16777216.0;
        }
        let s = light_sample(at, u);
        if s.pmf > 0.0 {
            sum.lux += s.radiance * max(dot(at.normal, s.direction), 0.0) / (s.pmf * s.pdf);
        }
        sum.without_light += f32(light_resample(at, u, 0.5, 1u).weight == 0.0);
    }
    let index = (batch.x * batch.y + point.x) * ${INVOCATIONS} + invocation;
    partials[index] = Partial(sum.lux / ${SAMPLES}, sum.without_light / ${SAMPLES});
}

// One invocation for each pair of a point and a light; workgroups of one column for each point.
@compute @workgroup_size(${INVOCATIONS})
fn probability(@builtin(global_invocation_id) id: vec3<u32>) {
    let count = arrayLength(&lights);
    if id.x < count {
        let light = lights[id.x];
        partials[id.y * count + id.x].lux.x = light_pmf(shading_point(id.y), light.x, light.y);
    }
}`;

function uploaded(device, data, usage) {
    const buffer = device.createBuffer({ size: data.byteLength, usage: usage | GPUBufferUsage.COPY_DST });
    device.queue.writeBuffer(buffer, 0, data);
    return buffer;
}

async function read(device, buffer) {
    const usage = GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST;
    const copy = device.createBuffer({ size: buffer.size, usage });
    const encoder = device.createCommandEncoder();
    encoder.copyBufferToBuffer(buffer, 0, copy, 0, buffer.size);
    device.queue.submit([encoder.finish()]);
    await copy.mapAsync(GPUMapMode.READ);
    return new Float32Array(copy.getMappedRange());
}

/** The mean of numbers and its standard error. */
function statistics(numbers) {
    const mean = numbers.reduce((a, b) => a + b, 0) / numbers.length;
    const variance = numbers.reduce((sum, x) => sum + (x - mean) ** 2, 0) / (numbers.length - 1) / numbers.length;
    return { mean, error: Math.sqrt(variance) };
}

export class Estimates {
    /** Compiles for some effects, or for all. */
    constructor(device, gpuLights, effects) {
        this.device = device;
        const code = gpuLights.wgsl(1, effects) + WGSL;
        const buffer = (type, binding) => ({ binding, visibility: GPUShaderStage.COMPUTE, buffer: { type } });
        const types = ["uniform", "read-only-storage", "storage", "uniform"];
        this.layout = device.createBindGroupLayout({ entries: types.map(buffer) });
        const layout = device.createPipelineLayout({ bindGroupLayouts: [this.layout, gpuLights.bindGroupLayout] });
        const module = device.createShaderModule({ code });
        const pipeline = (entryPoint) => device.createComputePipeline({ layout, compute: { module, entryPoint } });
        this.pipelines = { estimate: pipeline("estimate"), probability: pipeline("probability") };
    }

    async run(name, gpuLights, { points, lights, results, rounds, workgroups }) {
        const { device } = this;
        const words = new Float32Array(8 * POINTS);
        words.set(points.flatMap(({ position, normal }) => [...position, 0, ...normal, 0]));
        const usage = GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC;
        const partials = device.createBuffer({ size: 16 * results, usage });
        const buffers = [
            uploaded(device, words, GPUBufferUsage.UNIFORM),
            uploaded(device, new Uint32Array(lights.flat()), GPUBufferUsage.STORAGE),
            partials,
        ];
        for (let round = 0; round < rounds; round++) {
            const uniform = uploaded(device, new Uint32Array([round, points.length, 0, 0]), GPUBufferUsage.UNIFORM);
            const entries = [...buffers, uniform].map((buffer, binding) => ({ binding, resource: { buffer } }));
            const encoder = device.createCommandEncoder();
            const pass = encoder.beginComputePass();
            pass.setPipeline(this.pipelines[name]);
            pass.setBindGroup(0, device.createBindGroup({ layout: this.layout, entries }));
            pass.setBindGroup(1, gpuLights.bindGroup);
            pass.dispatchWorkgroups(...workgroups);
            pass.end();
            device.queue.submit([encoder.finish()]);
            await device.queue.onSubmittedWorkDone();
        }
        return read(device, partials);
    }

    /** For each point: the means of three colours of lux, and of the cases without a light. */
    async means(gpuLights, points) {
        const results = INVOCATIONS * ROUNDS * points.length;
        const words = await this.run("estimate", gpuLights, {
            points, lights: [[0, 0]], results, rounds: ROUNDS, workgroups: [points.length],
        });
        return points.map((_, point) => {
            const channels = [[], [], [], []];
            for (let round = 0; round < ROUNDS; round++) {
                const start = 4 * INVOCATIONS * (round * points.length + point);
                words.subarray(start, start + 4 * INVOCATIONS).forEach((x, i) => channels[i % 4].push(x));
            }
            const [red, green, blue, without] = channels.map(statistics);
            return { lux: [red, green, blue], without, samples: INVOCATIONS * ROUNDS * SAMPLES };
        });
    }

    /** For each point: the probabilities of lights, pairs of a slot and an index. */
    async probabilities(gpuLights, points, lights) {
        const workgroups = [Math.ceil(lights.length / INVOCATIONS), points.length];
        const results = lights.length * points.length;
        const words = await this.run("probability", gpuLights, { points, lights, results, rounds: 1, workgroups });
        return points.map((_, point) => lights.map((_, light) => words[4 * (lights.length * point + light)]));
    }
}
