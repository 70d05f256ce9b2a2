// What each pixel sees, drawn by three.js into textures: colour, emission, position and normal.

import * as THREE from "three";
import { diffuseColor, emissive, mrt, normalWorld, positionWorld, vec4 } from "three/tsl";

// 32 bytes for each pixel, the most that WebGPU promises.
const TARGETS = { surface: THREE.UnsignedByteType, normal: THREE.HalfFloatType, place: THREE.FloatType };

/** Points of [0, 1)² that cover it evenly: R2, by Martin Roberts. */
function jitter(frame) {
    return [(0.7548776662 * frame) % 1, (0.5698402909 * frame) % 1];
}

export class Hits {
    constructor(renderer) {
        this.renderer = renderer;
        this.size = [0, 0];
        const filters = { minFilter: THREE.NearestFilter, magFilter: THREE.NearestFilter };
        this.target = new THREE.RenderTarget(1, 1, { count: 3, ...filters });
        Object.entries(TARGETS).forEach(([name, type], i) => Object.assign(this.target.textures[i], { name, type }));
        // A surface that emits is black, so one texture holds both colours. The emission is divided by `nits`.
        const nits = emissive.r.max(emissive.g).max(emissive.b);
        const emits = nits.greaterThan(0);
        this.outputs = mrt({
            surface: vec4(emits.select(emissive.div(nits.max(1e-6)), diffuseColor.rgb), 1),
            normal: vec4(normalWorld, nits),
            place: vec4(positionWorld, 1),
        });
    }

    /** Whether the size has changed. */
    setSize(width, height) {
        if (this.size[0] === width && this.size[1] === height) {
            return false;
        }
        this.size = [width, height];
        this.target.setSize(width, height);
        return true;
    }

    /** The GPU's textures, in the order of the targets. */
    textures() {
        return this.target.textures.map((texture) => this.renderer.backend.get(texture).texture);
    }

    draw({ scene, camera }, frame) {
        const [width, height] = this.size;
        const [x, y] = jitter(frame);
        camera.aspect = width / height;
        camera.setViewOffset(width, height, x - 0.5, y - 0.5, width, height);
        this.renderer.setClearColor(0, 0);
        this.renderer.setMRT(this.outputs);
        this.renderer.setRenderTarget(this.target);
        this.renderer.render(scene, camera);
    }
}
