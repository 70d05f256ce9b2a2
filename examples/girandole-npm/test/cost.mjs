// Measures what a frame costs on the CPU, without a GPU. Run examples/girandole-npm/test.sh, then copy this file to
// target/npm and run `node target/npm/cost.mjs`.

import { readFileSync } from "node:fs";
import * as THREE from "three";
import { init, LightList, LightPlanner, LightWorld } from "girandole";
import { SceneLights } from "girandole/three";

const FRAMES = 100;
const LAMPS = 10_000;
const TRIANGLES = 100_000;

const bytes = readFileSync(new URL(import.meta.resolve("girandole/girandole_bg.wasm")));
await init({ module_or_path: bytes });

function nothing() {}

/** Plays nothing. */
const player = {
    create: nothing, write: nothing, copy: nothing, clear: nothing, dispatch: nothing, dispatchIndirect: nothing,
    free: nothing,
};

/** The least of the times of calls, in milliseconds. */
function least(count, call) {
    const times = Array.from({ length: count }, (_, i) => {
        const begin = performance.now();
        call(i);
        return performance.now() - begin;
    });
    return Math.min(...times).toFixed(2);
}

function measure(moving) {
    const scene = new THREE.Scene();
    const lamps = Array.from({ length: LAMPS }, (_, i) => {
        const lamp = new THREE.PointLight(0xffffff, 10);
        lamp.position.set(i % 100, 3, Math.floor(i / 100));
        scene.add(lamp);
        return lamp;
    });
    const world = new LightWorld();
    const sceneLights = new SceneLights(world);
    const planner = new LightPlanner(2 ** 27);
    const send = () => {
        world.update(0.3).free();
        return planner.play(world, player);
    };
    sceneLights.sync(scene);
    send();
    const move = (frame) => lamps.slice(0, moving).forEach((lamp) => lamp.position.y = 3 + 0.01 * (frame + 1));
    const follow = least(FRAMES, (frame) => {
        move(frame);
        sceneLights.sync(scene);
    });
    const update = least(FRAMES, (frame) => {
        move(frame + FRAMES);
        sceneLights.sync(scene);
        send();
    });
    console.log(`${LAMPS} lamps, ${moving} move: SceneLights.sync ${follow} ms, with update and plan ${update} ms`);
}

measure(0);
measure(1_000);
measure(LAMPS);

const corners = Float32Array.from({ length: 9 * TRIANGLES }, (_, i) => (i * 7919) % 1009);
const build = least(5, () => {
    const [world, list] = [new LightWorld(), new LightList()];
    list.triangles(corners, [1, 1, 1]);
    world.addTree(list);
    world.free();
});
console.log(`a tree of ${TRIANGLES} triangles: ${build} ms`);
