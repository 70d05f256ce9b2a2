import type { LightWorld } from "./girandole.js";

/** What a frame did. */
export interface SyncReport {
    /** Bytes that were written to buffers. */
    bytes: number;
    /** Writes, copies, clears and dispatches; 0 if nothing changed. */
    commands: number;
    /** Trees that were rebuilt. */
    rebuiltTrees: number;
    /** Trees whose rebuilds wait for later frames. */
    waitingTrees: number;
}

/** The lights of a world on the page's own device, for its own shaders. */
export class GpuLights {
    /**
     * Makes no buffer yet. The device needs WebGPU's default limits. It holds one world; a world may be on
     * several devices.
     */
    constructor(device: GPUDevice, world: LightWorld);
    /** The layout of the group, for compute and fragment stages. */
    readonly bindGroupLayout: GPUBindGroupLayout;
    /** The group with the lights of the last `sync`, which may replace it; `null` before. */
    readonly bindGroup: GPUBindGroup | null;
    /** The names of the effects that shaders must support: all before the first `sync`. */
    readonly effects: string[];
    /**
     * The text that the page puts before its own WGSL, with `light_sample` and the other functions. Without
     * `effects` it is right for all lights.
     */
    wgsl(group: number, effects?: string[]): string;
    /**
     * Call it in each frame, after the lights have changed, and submit the frame's commands before the next
     * call. Updates the world, sends what changed and nothing else, and builds the top level. Trees are
     * rebuilt within a budget of milliseconds, by default 0.3.
     */
    sync(milliseconds?: number): SyncReport;
    /** Destroys all buffers. The world stays as it is. */
    destroy(): void;
}
