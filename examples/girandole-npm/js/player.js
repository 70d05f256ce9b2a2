// Plays plans on a GPUDevice.

import { kernels } from "./girandole.js";

const STORAGE = 0x80 | 0x4 /* STORAGE, COPY_SRC */;
const USAGE = { uniform: 0x40 /* UNIFORM */, storage: STORAGE, indirect: STORAGE | 0x100 /* INDIRECT */ };
const COPY_DST = 0x8;
const COMPUTE = 0x4;

export class Player {
    #device;
    #kernels = new Map(kernels().map((kernel) => [kernel.entry, kernel]));
    #pipelines = new Map();
    #buffers = new Map();
    /** Bind groups by kernel and buffers: a handful, since a kernel binds the same buffers in every frame. */
    #groups = new Map();
    #encoder = null;
    #pass = null;
    /** The buffers that the encoder's commands use. */
    #used = new Set();
    #freed = [];

    constructor(device) {
        this.#device = device;
    }

    buffer(id) {
        return this.#buffers.get(id);
    }

    create(id, label, size, kind) {
        const usage = USAGE[kind] | COPY_DST;
        this.#buffers.set(id, this.#device.createBuffer({ label: `girandole ${label}`, size, usage }));
    }

    write(id, offset, bytes) {
        // A write through the queue goes ahead of commands that are submitted later.
        if (this.#used.has(id)) {
            this.#submit();
        }
        this.#device.queue.writeBuffer(this.#buffers.get(id), offset, bytes);
    }

    copy(from, to, offset, bytes) {
        this.#outsideOfPasses(from, to).copyBufferToBuffer(this.#buffers.get(from), 0, this.#buffers.get(to), offset, bytes);
    }

    clear(id, offset, bytes) {
        this.#outsideOfPasses(id).clearBuffer(this.#buffers.get(id), offset, bytes);
    }

    dispatch(entry, ids, uniformOffset, x, y, z) {
        this.#bound(entry, ids, uniformOffset).dispatchWorkgroups(x, y, z);
    }

    dispatchIndirect(entry, ids, uniformOffset, workgroups) {
        this.#used.add(workgroups);
        this.#bound(entry, ids, uniformOffset).dispatchWorkgroupsIndirect(this.#buffers.get(workgroups), 0);
    }

    free(id) {
        this.#freed.push(id);
    }

    /** Submits what was played. */
    finish() {
        this.#submit();
        for (const id of this.#freed) {
            this.#buffers.get(id).destroy();
            this.#buffers.delete(id);
            for (const [name, { ids }] of this.#groups) {
                if (ids.includes(id)) {
                    this.#groups.delete(name);
                }
            }
        }
        this.#freed = [];
    }

    destroy() {
        this.#buffers.forEach((buffer) => buffer.destroy());
        this.#buffers.clear();
        this.#groups.clear();
    }

    /** The pass, with a kernel and its buffers. */
    #bound(entry, ids, uniformOffset) {
        ids.forEach((id) => this.#used.add(id));
        const { pipeline, layout } = this.#pipeline(entry);
        this.#encoder ??= this.#device.createCommandEncoder({ label: "girandole" });
        this.#pass ??= this.#encoder.beginComputePass({ label: "girandole" });
        this.#pass.setPipeline(pipeline);
        this.#pass.setBindGroup(0, this.#group(entry, layout, ids), [uniformOffset]);
        return this.#pass;
    }

    #outsideOfPasses(...ids) {
        ids.forEach((id) => this.#used.add(id));
        this.#pass?.end();
        this.#pass = null;
        return this.#encoder ??= this.#device.createCommandEncoder({ label: "girandole" });
    }

    #submit() {
        this.#pass?.end();
        if (this.#encoder !== null) {
            this.#device.queue.submit([this.#encoder.finish()]);
        }
        this.#encoder = this.#pass = null;
        this.#used.clear();
    }

    /** The pipeline of a kernel, which is compiled at first use. */
    #pipeline(entry) {
        let made = this.#pipelines.get(entry);
        if (made === undefined) {
            const device = this.#device;
            const { bindings, uniformBytes, wgsl } = this.#kernels.get(entry);
            const entries = bindings.map((type, binding) => {
                const isUniform = type === "uniform";
                const buffer = { type, hasDynamicOffset: isUniform, minBindingSize: isUniform ? uniformBytes : 0 };
                return { binding, visibility: COMPUTE, buffer };
            });
            const layout = device.createBindGroupLayout({ label: entry, entries });
            const module = device.createShaderModule({ label: entry, code: wgsl });
            const pipeline = device.createComputePipeline({
                label: entry,
                layout: device.createPipelineLayout({ bindGroupLayouts: [layout] }),
                compute: { module, entryPoint: entry },
            });
            made = { pipeline, layout, bindings, uniformBytes };
            this.#pipelines.set(entry, made);
        }
        return made;
    }

    #group(entry, layout, ids) {
        const name = `${entry} ${ids.join()}`;
        let made = this.#groups.get(name);
        if (made === undefined) {
            const { bindings, uniformBytes } = this.#pipelines.get(entry);
            const entries = Array.from(ids, (id, binding) => {
                const size = bindings[binding] === "uniform" ? uniformBytes : undefined;
                return { binding, resource: { buffer: this.#buffers.get(id), size } };
            });
            const group = this.#device.createBindGroup({ label: entry, layout, entries });
            made = { group, ids: Array.from(ids) };
            this.#groups.set(name, made);
        }
        return made.group;
    }
}
