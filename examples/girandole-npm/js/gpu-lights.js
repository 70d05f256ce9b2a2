// The lights of a world on the page's own device.

import { LightPlanner, wgsl } from "./girandole.js";
import { Player } from "./player.js";

const COMPUTE_AND_FRAGMENT = 0x4 | 0x2;

export class GpuLights {
    #device;
    #world;
    #planner;
    #player;
    #bound = "";

    constructor(device, world, cells) {
        const { maxStorageBufferBindingSize, maxBufferSize } = device.limits;
        this.#device = device;
        this.#world = world;
        this.#planner = new LightPlanner(Math.min(maxStorageBufferBindingSize, maxBufferSize), cells);
        this.#player = new Player(device);
        const types = ["uniform", ...Array(5).fill("read-only-storage"), "storage"];
        this.bindGroupLayout = device.createBindGroupLayout({
            label: "girandole lights",
            entries: types.map((type, binding) => ({ binding, visibility: COMPUTE_AND_FRAGMENT, buffer: { type } })),
        });
        this.bindGroup = null;
    }

    get effects() {
        return this.#planner.effects();
    }

    wgsl(group, effects) {
        return wgsl(group, effects);
    }

    setCutView(eye, pixel) {
        this.#planner.setCutView(eye, pixel);
    }

    sync(milliseconds = 0.3) {
        const report = this.#world.update(milliseconds);
        const { rebuiltTrees, waitingTrees } = report;
        report.free();
        let bytes;
        try {
            bytes = this.#planner.play(this.#world, this.#player);
            this.#bind();
        } finally {
            // After a refusal, the planner sends everything again.
            this.#player.finish();
        }
        return { bytes, rebuiltTrees, waitingTrees };
    }

    destroy() {
        this.#player.destroy();
        this.#planner.free();
        this.bindGroup = null;
    }

    #bind() {
        const ids = this.#planner.bindings();
        if (ids.join() !== this.#bound) {
            this.#bound = ids.join();
            this.bindGroup = this.#device.createBindGroup({
                label: "girandole lights",
                layout: this.bindGroupLayout,
                entries: Array.from(ids, (id, binding) => ({ binding, resource: { buffer: this.#player.buffer(id) } })),
            });
        }
    }
}
