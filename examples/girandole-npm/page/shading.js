// The page's own passes on the renderer's device: shade.wgsl samples lights, and present.wgsl shows the mean.

const SAMPLES = 4;
const GROUP_SIDE = 8;

async function text(name) {
    return (await fetch(new URL(name, import.meta.url))).text();
}

export class Shading {
    static async make(device, canvas) {
        const shading = new Shading();
        const format = navigator.gpu.getPreferredCanvasFormat();
        const context = canvas.getContext("webgpu");
        context.configure({ device, format });
        const [shade, present] = await Promise.all(["shade.wgsl", "present.wgsl"].map(text));
        Object.assign(shading, { device, canvas, context, format, shade, present, pipelines: new Map() });
        shading.layout = device.createBindGroupLayout({
            entries: [
                { binding: 0, visibility: GPUShaderStage.COMPUTE, buffer: {} },
                ...[1, 2, 3].map((binding) => {
                    const texture = { sampleType: "unfilterable-float" };
                    return { binding, visibility: GPUShaderStage.COMPUTE, texture };
                }),
                { binding: 4, visibility: GPUShaderStage.COMPUTE, buffer: { type: "read-only-storage" } },
                { binding: 5, visibility: GPUShaderStage.COMPUTE, buffer: { type: "storage" } },
            ],
        });
        const module = device.createShaderModule({ code: present });
        shading.presenting = device.createRenderPipeline({
            layout: "auto", vertex: { module }, fragment: { module, targets: [{ format }] },
        });
        const usage = GPUBufferUsage.COPY_DST;
        shading.uniform = device.createBuffer({ size: 32, usage: usage | GPUBufferUsage.UNIFORM });
        return shading;
    }

    /** The pipeline for the effects of the lights, which is compiled when a frame first needs it. */
    pipeline(gpuLights) {
        const { device } = this;
        const { effects } = gpuLights;
        const name = effects.join();
        if (!this.pipelines.has(name)) {
            const module = device.createShaderModule({ code: gpuLights.wgsl(1, effects) + this.shade });
            const layout = device.createPipelineLayout({ bindGroupLayouts: [this.layout, gpuLights.bindGroupLayout] });
            this.pipelines.set(name, device.createComputePipeline({ layout, compute: { module } }));
        }
        return this.pipelines.get(name);
    }

    /** A buffer of a name, which is made anew if its size changes. */
    buffer(name, size) {
        if (this[name]?.size !== size) {
            this[name]?.destroy();
            const usage = GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST | GPUBufferUsage.COPY_SRC;
            this[name] = this.device.createBuffer({ size, usage });
        }
        return this[name];
    }

    /** Adds samples to the mean, or begins a new one, and shows it. */
    draw(hits, gpuLights, { frame, averaged, boxes }) {
        const { device, canvas, context, uniform } = this;
        const [width, height] = hits.size;
        [canvas.width, canvas.height] = [width, height];
        const words = new Float32Array(boxes.flatMap(([low, high]) => [...low, 0, ...high, 0]));
        const boxBuffer = this.buffer("boxBuffer", words.byteLength);
        const mean = this.buffer("mean", 16 * width * height);
        device.queue.writeBuffer(boxBuffer, 0, words);
        device.queue.writeBuffer(uniform, 0, new Uint32Array([width, height, frame, averaged, SAMPLES, 0, 0, 0]));

        const encoder = device.createCommandEncoder();
        const compute = encoder.beginComputePass();
        compute.setPipeline(this.pipeline(gpuLights));
        const views = hits.textures().map((texture) => texture.createView());
        const resources = [{ buffer: uniform }, ...views, { buffer: boxBuffer }, { buffer: mean }];
        compute.setBindGroup(0, this.group(this.layout, resources));
        compute.setBindGroup(1, gpuLights.bindGroup);
        compute.dispatchWorkgroups(Math.ceil(width / GROUP_SIDE), Math.ceil(height / GROUP_SIDE));
        compute.end();
        const view = context.getCurrentTexture().createView();
        const pass = encoder.beginRenderPass({ colorAttachments: [{ view, loadOp: "clear", storeOp: "store" }] });
        pass.setPipeline(this.presenting);
        const presented = this.presenting.getBindGroupLayout(0);
        pass.setBindGroup(0, this.group(presented, [{ buffer: uniform }, { buffer: mean }]));
        pass.draw(3);
        pass.end();
        device.queue.submit([encoder.finish()]);
    }

    /** The mean of all pixels and colours, in nits. */
    async brightness() {
        const { device, mean } = this;
        const copy = device.createBuffer({ size: mean.size, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
        const encoder = device.createCommandEncoder();
        encoder.copyBufferToBuffer(mean, 0, copy, 0, mean.size);
        device.queue.submit([encoder.finish()]);
        await copy.mapAsync(GPUMapMode.READ);
        const words = new Float32Array(copy.getMappedRange());
        return words.reduce((sum, x, i) => i % 4 < 3 ? sum + x : sum, 0) / (0.75 * words.length);
    }

    group(layout, resources) {
        const entries = resources.map((resource, binding) => ({ binding, resource }));
        return this.device.createBindGroup({ layout, entries });
    }
}
