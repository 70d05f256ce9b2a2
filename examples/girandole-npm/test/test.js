// The checks of examples/girandole-npm/test.sh, which reads the lines from the console.

import { init, GpuLights, LightList, LightWorld, wgsl } from "girandole";
import { SceneLights } from "girandole/three";
import { Estimates } from "./estimates.js";
import { change, testPoints, testScene } from "./scene.js";
import { luxOfPolygon, luxOfScene } from "./truth.js";

const POINTS = 16;
/**
 * The largest difference from the truth in standard errors: a correct sampler fails a comparison with a
 * probability of 6e-5. There are 204.
 */
const MOST_SIGMAS = 4;
/** The largest mean of the relative standard errors: a bias of 8 % is found at a typical point. */
const MOST_ERROR = 0.02;
/** Rounding of sums of some hundred numbers in f32. */
const ROUNDING = 1e-5;
const LIGHT_DIRECTIONAL = 0xffffffff;

let failures = 0;

function check(name, isRight, detail = "") {
    failures += isRight ? 0 : 1;
    console.log(`check: ${isRight ? "ok" : "FAILED"}: ${name}${detail ? ` (${detail})` : ""}`);
}

function message(call) {
    try {
        call();
        return "no error";
    } catch (error) {
        return `${error.message} ${error.code}`;
    }
}

/** Compares means with what arrives from all lights. */
function compare(name, means, truth) {
    let [worst, errors] = [0, []];
    means.forEach(({ lux }, point) => lux.forEach(({ mean, error }, channel) => {
        const right = truth[point][channel];
        const excess = Math.abs(mean - right) - ROUNDING * right;
        worst = Math.max(worst, excess <= 0 ? 0 : excess / error);
        errors.push(error / right);
    }));
    const error = errors.reduce((a, b) => a + b, 0) / errors.length;
    check(`${name}: the mean of samples is the sum over all lights`, worst <= MOST_SIGMAS && error < MOST_ERROR,
        `at most ${worst.toFixed(2)} standard errors, which are ${(100 * error).toFixed(2)} % on average`);
}

/** The names in shaders of all lights of a scene: pairs of a slot and an index. */
function lightsOf(scene, sceneLights, world) {
    const lights = [[LIGHT_DIRECTIONAL, 0]];
    scene.traverse((object) => {
        const { index, attributes } = object.geometry ?? {};
        const count = object.isMesh ? (index ?? attributes.position).count / 3 : 1;
        for (let i = 0, key; (key = sceneLights.instanceOf(object, i)) !== undefined; i++) {
            const slot = world.slot(key);
            lights.push(...Array.from({ length: count }, (_, light) => [slot, light]));
        }
    });
    return lights;
}

/** Returns the probabilities of all lights at each point. */
async function checkScene(name, { scene }, sceneLights, gpuLights, world, estimates) {
    const points = testPoints(POINTS);
    const means = await estimates.means(gpuLights, points);
    compare(name, means, points.map((point) => luxOfScene(scene, sceneLights.leftOut, point)));
    const lights = lightsOf(scene, sceneLights, world);
    const probabilities = await estimates.probabilities(gpuLights, points, lights);
    const sums = probabilities.map((row) => row.reduce((sum, pmf) => sum + pmf, 0));
    const excess = sums.map((sum, point) => {
        const { without, samples } = means[point];
        const chance = Math.max(1 - sum, 0);
        const error = Math.sqrt(chance * (1 - chance) / samples);
        return Math.abs(sum + without.mean - 1) - MOST_SIGMAS * error;
    });
    const most = Math.max(...sums.map((sum) => 1 - sum));
    check(`${name}: the probabilities of all lights and of none sum to 1`, Math.max(...excess) <= 1e-3,
        `${lights.length} lights, no light with at most ${most.toFixed(4)}`);
    return probabilities;
}

/** Counts calls of the device's queue. */
function countCalls(queue) {
    const calls = { writeBuffer: 0, submit: 0 };
    for (const name of Object.keys(calls)) {
        const real = queue[name].bind(queue);
        queue[name] = (...values) => {
            calls[name]++;
            return real(...values);
        };
    }
    return calls;
}

function checkStill(frame, calls) {
    Object.assign(calls, { writeBuffer: 0, submit: 0 });
    const reports = [frame(), frame()];
    // What is submitted builds cuts.
    const isQuiet = calls.writeBuffer === 0 && calls.submit === reports.length;
    check("a still frame sends nothing", reports.every(({ bytes }) => bytes === 0) && isQuiet, JSON.stringify(calls));
}

/** A world that is made without three.js, and a shader for its effects only. */
async function checkByHand(device) {
    const world = new LightWorld();
    const gpuLights = new GpuLights(device, world);
    const lamp = (y) => {
        const list = new LightList();
        list.point([0, y, 0], [100, 50, 25]);
        list.point([1, y, 0], [10, 20, 30]);
        return list;
    };
    const tree = world.addTree(lamp(1));
    const at = (x, z) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, 0, z, 1];
    world.addInstance(tree, at(0, 0));
    const second = world.addInstance(tree, at(3, 3));
    gpuLights.sync();
    world.setLights(tree, 0, lamp(2));
    world.moveInstance(second, at(4, 3));
    world.setFactor(second, [2, 1, 0.5]);
    const panel = new LightList();
    const [center, halfU, halfV] = [[-2, 3, 0], [1, 0, 0], [0, 0, 1]];
    panel.rectangle(center, halfU, halfV, [7, 8, 9]);
    const ball = { center: [4, 3, -3], radius: 0.5 };
    panel.sphere(ball.center, ball.radius, [40, 50, 60]);
    world.addInstance(world.addTree(panel), at(0, 0));
    world.setSky(4, Array(8).fill([0.1, 0.2, 0.3]).flat());
    gpuLights.sync();
    const effects = gpuLights.effects.join();
    check("by hand: the effects of the lights", effects === "CONES,AREAS,FACTORS,SKY", effects);
    const estimates = new Estimates(device, gpuLights, gpuLights.effects);
    const points = [[0, 0, 0], [2, 0, 1], [4, 0, 4], [-2, 0, 0]].map((position) => ({ position, normal: [0, 1, 0] }));
    const corners = [[-3, 3, -1], [-1, 3, -1], [-1, 3, 1], [-3, 3, 1]];
    const lamps = [
        [[0, 2, 0], [100, 50, 25]], [[1, 2, 0], [10, 20, 30]], [[4, 2, 3], [200, 50, 12.5]], [[5, 2, 3], [20, 20, 15]],
    ];
    const truth = points.map((point) => [0, 1, 2].map((channel) => {
        const lux = ([place, candela]) => {
            const distance = Math.hypot(...place.map((x, axis) => x - point.position[axis]));
            return candela[channel] * place[1] / distance ** 3;
        };
        const ofLamps = lamps.reduce((sum, lamp) => sum + lux(lamp), 0);
        const ofPanel = (7 + channel) * luxOfPolygon(corners, point);
        // A sphere shines like a point of its intensity, and the sky is the same everywhere.
        const ofBall = lux([ball.center, [40, 50, 60].map((nits) => nits * Math.PI * ball.radius ** 2)]);
        return ofLamps + ofPanel + ofBall + 0.1 * (channel + 1) * Math.PI;
    }));
    compare("by hand", await estimates.means(gpuLights, points), truth);
    gpuLights.destroy();

    const stale = message(() => world.moveInstance(1n, at(0, 0)));
    check("errors have the message and the code", stale.startsWith("no instance") && stale.endsWith(" 203"), stale);
    const wrong = new LightList();
    wrong.point([NaN, 0, 0], [1, 1, 1]);
    const refused = message(() => world.addTree(wrong));
    check("lights are checked", refused === "light 0: position is NaN; it must be from -1000000000 to 1000000000 100", refused);
    const short = message(() => world.addInstance(tree, [1]));
    check("matrices are checked", short === "matrix: 1 numbers instead of 16 undefined", short);
    check("effects are checked", message(() => wgsl(0, ["NONE"])).startsWith('there is no effect named "NONE"'));
}

async function test() {
    await init();
    const adapter = await navigator.gpu.requestAdapter();
    const device = await adapter.requestDevice();
    device.addEventListener("uncapturederror", ({ error }) => check("WebGPU", false, error.message));
    const calls = countCalls(device.queue);
    const begin = performance.now();
    const time = (what) => console.log(`time: ${what} after ${((performance.now() - begin) / 1000).toFixed(1)} s`);

    await checkByHand(device);
    time("by hand");
    const made = testScene();
    const world = new LightWorld();
    const sceneLights = new SceneLights(world);
    const gpuLights = new GpuLights(device, world);
    const frame = () => {
        sceneLights.sync(made.scene);
        return gpuLights.sync();
    };
    const first = frame();
    check("the first frame sends the lights", first.bytes > 0, `${first.bytes} bytes`);
    const leftOut = [...sceneLights.leftOut.keys()];
    check("objects that cannot be followed are named",
        leftOut.length === made.leftOut.length && made.leftOut.every((object) => leftOut.includes(object)),
        [...sceneLights.leftOut.values()].join("; "));
    const { instanceCount, treeCount } = world;
    check("objects share trees", treeCount < instanceCount / 2, `${instanceCount} instances, ${treeCount} trees`);
    checkStill(frame, calls);
    const estimates = new Estimates(device, gpuLights);
    const withoutCuts = await checkScene("scene", made, sceneLights, gpuLights, world, estimates);
    time("scene");
    frame();
    const withCuts = await checkScene("scene with cuts", made, sceneLights, gpuLights, world, estimates);
    const differs = (row, point) => row.some((pmf, light) => Math.abs(pmf - withCuts[point][light]) > 0.1 * pmf);
    check("all cells have cuts", withoutCuts.every(differs));
    time("scene with cuts");
    change(made);
    frame();
    await checkScene("changed scene", made, sceneLights, gpuLights, world, estimates);
    made.lamps[0].position.x += 0.1;
    const moved = frame();
    check("a moved lamp is sent", moved.bytes > 0 && moved.bytes < first.bytes / 10, `${moved.bytes} bytes`);
    checkStill(frame, calls);
    made.scene.clear();
    frame();
    check("an empty scene leaves nothing", world.instanceCount === 0 && world.treeCount === 0);
    time("all");
}

function stop(sentence) {
    console.log(`stopped: ${sentence}`);
}

function finish() {
    stop(failures === 0 ? "all checks passed" : `${failures} checks failed`);
}

test().then(finish, (error) => stop(`${error} ${error.stack}`));
