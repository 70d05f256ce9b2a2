import type { Object3D } from "three";
import type { LightWorld } from "./girandole.js";

/**
 * Follows the lights and emissive meshes of a three.js scene into a world. Objects that share a geometry share a
 * tree, and each mesh and each instance of an InstancedMesh is an instance of it.
 */
export class SceneLights {
    constructor(world: LightWorld);
    /** Objects of the last scene that shine and were left out, and why. */
    readonly leftOut: Map<Object3D, string>;
    /**
     * Makes the lights that it has added to the world those of the scene. Call it in each frame. Finds changes by
     * comparing matrices, colours and the versions of attributes.
     */
    sync(scene: Object3D): void;
    /** The key of the instance of an object; `index` is that in an InstancedMesh. */
    instanceOf(object: Object3D, index?: number): bigint | undefined;
}
