// The library in a page: `await init()` once, then the rest.
export { default as init, kernels, Kernel, LightList, LightPlanner, LightWorld, wgsl } from "./girandole.js";
export { GpuLights } from "./gpu-lights.js";
export { Player } from "./player.js";
