export { default as init, kernels, wgsl } from "./girandole.js";
export { Kernel, LightList, LightPlanner, LightWorld, UpdateReport } from "./girandole.js";
export type { PlanPlayer } from "./girandole.js";
export { GpuLights } from "./gpu-lights.js";
export type { SyncReport } from "./gpu-lights.js";
export { Player } from "./player.js";
