// Opens the city, draws frames, and shows what they cost. A frame is submitted only when the last
// one is done, so the frame time is the time from its submission until the GPU has finished it.
//
// Options in the address: `?city=M` builds the larger city. `?dusk` shows the time after sunset, with a sky that is
// a light. `?picture=N&size=WIDTHxHEIGHT` stops the time, and delays the page's load event until N frames of that
// size have been averaged, so that a browser that takes a screenshot waits for them. `?test` runs the checks of
// examples/girandole-web/test.sh.
"use strict";

const element = (id) => document.getElementById(id);
const options = new URLSearchParams(location.search);
// Frames over which the shown time is averaged.
const SHOWN_FRAMES = 10;
// The resolution follows the frame time, in milliseconds, until the user sets it.
const SLOW_FRAME = 60;
const FAST_FRAME = 14;

/** Shows one sentence in place of the picture. */
function fail(sentence) {
    console.error(`stopped: ${sentence}`);
    element("panel").hidden = true;
    element("message").textContent = sentence;
    element("message").hidden = false;
}

/** A sentence if the browser cannot run the page. */
function missing() {
    if (!("gpu" in navigator)) {
        return isSecureContext
            ? "This browser has no WebGPU, which this page needs: open it in a recent Chrome, Edge, Firefox or Safari."
            : "WebGPU needs a secure page: open this one over HTTPS, from localhost, or from a file.";
    }
    return null;
}

async function open() {
    const bytes = Uint8Array.from(atob(girandole_web_wasm), (c) => c.charCodeAt(0));
    await wasm_bindgen({ module_or_path: bytes });
    // Each of the few pixels of the test shows a cell of its own.
    const minMarks = options.has("test") ? 1 : 8;
    return wasm_bindgen.City.open(element("canvas"), options.get("city") ?? "S", options.has("dusk"), minMarks);
}

/** Connects the controls of the panel to the city and to the state. */
function connectPanel(city, state) {
    const slider = (id, unit, set) => {
        const change = () => {
            element(`${id}-value`).textContent = `${element(id).value}${unit}`;
            set(Number(element(id).value));
        };
        element(id).addEventListener("input", change);
        change();
        return change;
    };
    slider("budget", " ms", (millis) => city.set_budget(millis));
    slider("samples", "", (count) => city.set_samples(count));
    state.showScale = slider("scale", " %", (percent) => state.scale = percent / 100);
    element("scale").addEventListener("input", () => state.followsTime = false);
    element("sampler").addEventListener("change", () => {
        city.set_uniform(element("sampler").value === "uniform");
        // The next key flies, and does not choose.
        element("canvas").focus();
    });
    element("frozen").addEventListener("change", () => city.set_frozen(element("frozen").checked));
    element("tour").addEventListener("click", () => city.start_tour());
    addEventListener("keydown", (event) => {
        if (event.code === "Space" && !["INPUT", "BUTTON", "SELECT"].includes(event.target.tagName)) {
            element("frozen").click();
            event.preventDefault();
        }
    });
}

function setScale(state, scale) {
    element("scale").value = Math.round(scale * 20) * 5;
    state.showScale();
}

/** Gives the canvas the size of its place on the page, times the scale. */
function fit(city, state) {
    const canvas = element("canvas");
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => side * devicePixelRatio);
    const largest = Math.min(Math.sqrt(city.max_pixels() / (width * height)), city.max_side() / Math.max(width, height));
    const scaled = (side) => Math.max(1, Math.floor(side * Math.min(state.scale, largest)));
    const [x, y] = state.size ?? [scaled(width), scaled(height)];
    if (canvas.width !== x || canvas.height !== y || !state.isSized) {
        [canvas.width, canvas.height] = [x, y];
        city.set_size(x, y);
        state.isSized = true;
    }
}

function show(city, state) {
    const status = JSON.parse(city.status());
    const count = (x) => x.toLocaleString("en");
    const mean = state.times.reduce((a, b) => a + b, 0) / state.times.length;
    const canvas = element("canvas");
    const shown = {
        lights: count(status.lights),
        instances: count(status.instances),
        time: `${mean.toFixed(1)} ms`,
        size: `${canvas.width} × ${canvas.height}`,
        moved: count(status.moved),
        refitted: `${status.refitted}, ${status.refit.toFixed(1)} ms`,
        rebuilt: `${status.rebuilt}, ${status.spent.toFixed(1)} ms`,
        waiting: count(status.waiting),
    };
    Object.entries(shown).forEach(([id, text]) => element(id).textContent = text);
    return status;
}

/** Lowers or raises the resolution if frames take too long or too little time. */
function followTime(state) {
    if (!state.followsTime || state.times.length < SHOWN_FRAMES) {
        return;
    }
    const median = [...state.times].sort((a, b) => a - b)[SHOWN_FRAMES / 2];
    const isSlow = median > SLOW_FRAME && state.scale > 0.1;
    const isFast = median < FAST_FRAME && state.scale < 1;
    if (isSlow || isFast) {
        const share = isSlow ? Math.max(0.5, Math.sqrt(SLOW_FRAME / median)) : 1.25;
        setScale(state, Math.min(1, Math.max(0.1, state.scale * share)));
        state.times = [];
    }
}

async function run(city, controls, state) {
    for (;;) {
        const now = await new Promise(requestAnimationFrame);
        controls.apply(city, state.last === null ? 0 : Math.min(0.1, (now - state.last) / 1000));
        fit(city, state);
        const begin = performance.now();
        city.frame(now);
        await city.done();
        // The first frame compiles the pipelines.
        element("message").hidden = true;
        state.times.push(performance.now() - begin);
        state.times.splice(0, state.times.length - SHOWN_FRAMES);
        state.last = now;
        const status = show(city, state);
        followTime(state);
        if (status.stillFrames >= state.picture) {
            console.log(`picture: ${JSON.stringify(status)}`);
            return;
        }
    }
}

/** Delays the load event of the page until the returned function is called. */
function delayLoad() {
    const frame = document.createElement("iframe");
    frame.hidden = true;
    document.body.append(frame);
    frame.contentDocument.open();
    frame.contentDocument.write("<p>");
    return () => frame.contentDocument.close();
}

async function main() {
    const release = options.has("picture") ? delayLoad() : null;
    const sentence = missing();
    if (sentence !== null) {
        return fail(sentence);
    }
    const city = await open();
    if (options.has("test")) {
        return test(city, element("canvas"));
    }
    const isSoftware = JSON.parse(city.status()).software;
    const state = { scale: 1, followsTime: true, isSized: false, times: [], last: null, picture: Infinity, size: undefined };
    connectPanel(city, state);
    setScale(state, isSoftware ? 0.3 : 1);
    element("panel").hidden = false;
    if (options.has("picture")) {
        state.picture = Number(options.get("picture"));
        state.followsTime = false;
        state.size = options.get("size")?.split("x").map(Number);
        element("frozen").click();
        // Ends the automatic flight.
        city.turn(0, 0);
    }
    await run(city, new Controls(element("canvas")), state);
    release?.();
}

// After a panic in the WebAssembly code, its promises never settle.
addEventListener("error", (event) => fail(`An error has stopped the page; see the console: ${event.message}.`));
addEventListener("unhandledrejection", (event) => fail(`An error has stopped the page: ${event.reason}`));
main().catch((error) => fail(typeof error === "string" ? error : `An error has stopped the page: ${error}`));
