import type { LightWorld } from "./girandole.js";

/** What a frame did. */
export interface SyncReport {
    /** Bytes that were written for the lights; 0 if nothing changed. */
    bytes: number;
    /** Trees that were rebuilt. */
    rebuiltTrees: number;
    /** Trees whose rebuilds wait for later frames. */
    waitingTrees: number;
}

/** The lights of a world on the page's own device, for its own shaders. */
export class GpuLights {
    /**
     * Makes no buffer yet. The device needs WebGPU's default limits. It holds one world; a world may be on
     * several devices. `cells` is the number of cells of neighbouring points that may share cuts, 1 to 65,536: by
     * default 32,768, which take 67 MB on the device.
     */
    constructor(device: GPUDevice, world: LightWorld, cells?: number);
    /** The layout of the group, for compute and fragment stages. */
    readonly bindGroupLayout: GPUBindGroupLayout;
    /** The group with the lights of the last `sync`, which may replace it; `null` before. */
    readonly bindGroup: GPUBindGroup | null;
    /** The names of the effects that shaders must support: all before the first `sync`. */
    readonly effects: string[];
    /**
     * The text that the page puts before its own WGSL, with `light_mark`, `light_sample` and the other functions. Without
     * `effects` it is right for all lights.
     */
    wgsl(group: number, effects?: string[]): string;
    /**
     * Makes cells follow the pixels of a camera from the next `sync` on. Call it when the camera has moved. `eye` is
     * its position, and `pixel` the size of a pixel at a distance of one metre, both in metres. Without it all cells
     * have the same size.
     */
    setCutView(eye: ArrayLike<number>, pixel: number): void;
    /**
     * Call it in each frame, after the lights have changed, and submit the frame's commands before the next
     * call. Updates the world, sends what changed and nothing else, builds the top level, and builds the cuts of the
     * cells that shaders have marked by `light_mark` since the last call. Trees are rebuilt within a budget of
     * milliseconds, by default 0.3.
     */
    sync(milliseconds?: number): SyncReport;
    /** Destroys all buffers. The world stays as it is. */
    destroy(): void;
}
