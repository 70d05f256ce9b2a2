// A night street: three.js draws what each pixel sees, and a compute pass of the page samples the lights.
//
// Space stops and resumes time. While nothing moves, frames are averaged. Options in the address: `?size=WIDTHxHEIGHT`
// fixes the size of the picture, and `?frames=N` stops the time at `?time=SECONDS` and ends after N frames.

import { WebGPURenderer } from "three";
import { init, GpuLights, LightWorld } from "girandole";
import { SceneLights } from "girandole/three";
import { Hits } from "./hits.js";
import { Shading } from "./shading.js";
import { Street } from "./street.js";

const options = new URLSearchParams(location.search);
const canvas = document.getElementById("canvas");
const message = document.getElementById("message");
/** Frames that are averaged at most. */
const MOST_FRAMES = 4096;

function stop(sentence) {
    console.log(`stopped: ${sentence}`);
    message.textContent = sentence;
}

/** Delays the load event of the page, for which a browser that takes a screenshot waits. */
function delayLoad() {
    const frame = document.createElement("iframe");
    frame.hidden = true;
    document.body.append(frame);
    frame.contentDocument.open();
    frame.contentDocument.write("<p>");
    return () => frame.contentDocument.close();
}

function sizeOfCanvas() {
    const fixed = options.get("size")?.split("x").map(Number);
    return fixed ?? [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, side));
}

async function main() {
    if (!navigator.gpu) {
        return stop("This page needs WebGPU: open it in a recent browser, from localhost or over HTTPS.");
    }
    // Draws to textures only. The page draws the canvas.
    const renderer = new WebGPURenderer();
    await Promise.all([init(), renderer.init()]);
    const { device } = renderer.backend;
    if (device === undefined) {
        return stop("The browser has WebGPU, but it offers no adapter.");
    }
    device.addEventListener("uncapturederror", ({ error }) => stop(`WebGPU refused a command: ${error.message}`));

    const street = new Street();
    const world = new LightWorld();
    const sceneLights = new SceneLights(world);
    const gpuLights = new GpuLights(device, world);
    const hits = new Hits(renderer);
    const shading = await Shading.make(device, canvas);

    let time = Number(options.get("time") ?? 0);
    let isRunning = !options.has("frames");
    addEventListener("keydown", ({ code }) => isRunning = code === "Space" ? !isRunning : isRunning);
    const frames = Number(options.get("frames") ?? Infinity);
    let [averaged, last] = [0, undefined];
    for (let frame = 0; frame < frames; frame++) {
        const now = await new Promise(requestAnimationFrame);
        time += isRunning && last !== undefined ? (now - last) / 1000 : 0;
        last = now;
        street.move(time);
        sceneLights.sync(street.scene);
        const [width, height] = sizeOfCanvas();
        const { position, fov } = street.camera;
        gpuLights.setCutView(position.toArray(), 2 * Math.tan(fov * Math.PI / 360) / height);
        const { bytes } = gpuLights.sync();
        const isNew = hits.setSize(width, height);
        averaged = bytes > 0 || isNew ? 0 : averaged;
        if (averaged < MOST_FRAMES) {
            hits.draw(street, averaged);
            shading.draw(hits, gpuLights, { frame, averaged, boxes: street.boxes() });
            averaged++;
        }
        await device.queue.onSubmittedWorkDone();
        message.textContent = `${world.instanceCount} light sources, ${averaged} frames averaged. Space: stop time.`;
    }
    const brightness = await shading.brightness();
    message.hidden = true;
    const picture = { instances: world.instanceCount, trees: world.treeCount, averaged, brightness };
    console.log(`picture: ${JSON.stringify(picture)}`);
    stop("drawn");
}

const release = options.has("frames") ? delayLoad() : null;
main().catch((error) => stop(`An error has stopped the page: ${error.stack}`)).finally(() => release?.());
