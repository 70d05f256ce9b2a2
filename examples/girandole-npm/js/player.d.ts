import type { PlanPlayer } from "./girandole.js";

/** Plays plans on a device. `GpuLights` has one; pages that make plans themselves need their own. */
export class Player implements PlanPlayer {
    constructor(device: GPUDevice);
    /** A buffer of a plan. */
    buffer(buffer: number): GPUBuffer | undefined;
    create(buffer: number, label: string, bytes: number, kind: "uniform" | "storage" | "indirect"): void;
    write(buffer: number, offset: number, bytes: Uint8Array): void;
    copy(from: number, to: number, offset: number, bytes: number): void;
    clear(buffer: number, offset: number, bytes: number): void;
    dispatch(kernel: string, buffers: Uint32Array, uniformOffset: number, x: number, y: number, z: number): void;
    dispatchIndirect(kernel: string, buffers: Uint32Array, uniformOffset: number, workgroups: number): void;
    free(buffer: number): void;
    /** Submits what was played since the last call. */
    finish(): void;
    /** Destroys all buffers. */
    destroy(): void;
}
