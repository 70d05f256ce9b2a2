// The types of the package, as a page in TypeScript uses them. tsc checks it; it does not run.

import { init, kernels, GpuLights, LightList, LightPlanner, LightWorld, Player, wgsl } from "girandole";
import type { PlanPlayer, SyncReport } from "girandole";
import { SceneLights } from "girandole/three";
import type { Mesh, Scene } from "three";

export async function start(device: GPUDevice, own: GPUBindGroupLayout, code: string): Promise<GPUComputePipeline> {
    await init();
    const lights = new GpuLights(device, new LightWorld());
    const layout = device.createPipelineLayout({ bindGroupLayouts: [own, lights.bindGroupLayout] });
    const module = device.createShaderModule({ code: lights.wgsl(1, lights.effects) + code });
    return device.createComputePipelineAsync({ layout, compute: { module } });
}

export function frame(pass: GPUComputePassEncoder, scene: Scene, sceneLights: SceneLights, lights: GpuLights): SyncReport {
    sceneLights.sync(scene);
    lights.setCutView([0, 2, 0], 0.001);
    const report = lights.sync(0.5);
    pass.setBindGroup(1, lights.bindGroup);
    return report;
}

export function edit(world: LightWorld, mesh: Mesh, sceneLights: SceneLights): number | undefined {
    const list = new LightList();
    list.point([0, 6, 0], new Float32Array([800, 800, 800]), 60);
    list.triangles(new Float32Array(9), [1, 1, 1], true);
    const tree: bigint = world.addTree(list);
    const instance = world.addInstance(tree, mesh.matrixWorld.elements);
    world.setFactor(instance, [1, 0.5, 0.25]);
    const key = sceneLights.instanceOf(mesh);
    return key === undefined ? undefined : world.slot(key);
}

export function plans(device: GPUDevice, world: LightWorld): GPUBufferBindingType[][] {
    const player: PlanPlayer = new Player(device);
    const planner = new LightPlanner(device.limits.maxStorageBufferBindingSize, 10_000);
    planner.setCutView(new Float32Array(3), 0.001);
    const bytes: number = planner.play(world, player);
    console.log(bytes, planner.bindings()?.length, wgsl(0, planner.effects()));
    return kernels().map((kernel) => kernel.bindings);
}

// What the types refuse.
// @ts-expect-error: a key is a bigint.
new LightWorld().removeTree(1);
// @ts-expect-error: a follower edits a world.
new SceneLights();
// @ts-expect-error: a group has a number.
wgsl("1");
