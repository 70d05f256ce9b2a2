export { default as init, kernels, Kernel, LightList, LightPlanner, LightWorld, UpdateReport, wgsl } from "./girandole.js";
export type { PlanPlayer } from "./girandole.js";
export { GpuLights } from "./gpu-lights.js";
export type { SyncReport } from "./gpu-lights.js";
export { Player } from "./player.js";
