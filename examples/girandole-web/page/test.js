// The checks of examples/girandole-web/test.sh, which reads the lines from the console.
"use strict";

// Frames of the moving city before its lights are compared.
const FRAMES = 20;
const FRAME_MILLIS = 1000 / 30;

async function test(city, canvas) {
    const log = (line) => console.log(`test: ${line}`);
    [canvas.width, canvas.height] = [12, 8];
    city.set_size(canvas.width, canvas.height);
    city.set_budget(1);
    let [begin, slowest] = [performance.now(), 0];
    for (let frame = 0; frame < FRAMES; frame++) {
        if (frame === 1) {
            log(`first frame: ${(performance.now() - begin).toFixed(0)} ms`);
            begin = performance.now();
        }
        const start = performance.now();
        city.frame(frame * FRAME_MILLIS);
        await city.done();
        slowest = frame > 0 ? Math.max(slowest, performance.now() - start) : 0;
    }
    log(`later frames: ${((performance.now() - begin) / (FRAMES - 1)).toFixed(1)} ms each, at most ${slowest.toFixed(0)} ms`);
    const status = JSON.parse(city.status());
    log(`status: ${JSON.stringify(status)}`);
    log(`rebuilds: ${status.rebuiltSoFar}`);
    log(`variants: ${status.hasVariant ? status.variants : 0}`);
    begin = performance.now();
    const lines = await city.check();
    lines.trim().split("\n").forEach(log);
    log(`compared in ${((performance.now() - begin) / 1000).toFixed(1)} s`);
    city.lose_device();
    await new Promise((resolve) => setTimeout(resolve, 500));
    city.frame(FRAMES * FRAME_MILLIS);
    throw "The device was destroyed, and the next frame did not fail.";
}
