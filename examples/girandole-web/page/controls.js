// The input: keys and the pointer fly the camera.
"use strict";

const KEYS = {
    KeyW: [1, 0, 0], ArrowUp: [1, 0, 0], KeyS: [-1, 0, 0], ArrowDown: [-1, 0, 0],
    KeyD: [0, 1, 0], ArrowRight: [0, 1, 0], KeyA: [0, -1, 0], ArrowLeft: [0, -1, 0],
    KeyE: [0, 0, 1], KeyQ: [0, 0, -1],
};

/** Keeps the pressed keys and the drags since the last frame. */
class Controls {
    constructor(canvas) {
        this.pressed = new Set();
        this.drag = [0, 0];
        this.steps = 0;
        addEventListener("keydown", (event) => {
            const field = event.target.tagName;
            const isForField = field === "SELECT" || (field === "INPUT" && event.code.startsWith("Arrow"));
            if (isForField || event.ctrlKey || event.metaKey || event.altKey) {
                return;
            }
            if (event.code in KEYS || event.code.startsWith("Shift")) {
                this.pressed.add(event.code);
            }
            // Arrows would scroll.
            if (event.code.startsWith("Arrow")) {
                event.preventDefault();
            }
        });
        addEventListener("keyup", (event) => this.pressed.delete(event.code));
        addEventListener("blur", () => this.pressed.clear());
        canvas.addEventListener("pointerdown", (event) => {
            canvas.setPointerCapture(event.pointerId);
            canvas.focus();
        });
        canvas.addEventListener("pointermove", (event) => {
            if (canvas.hasPointerCapture(event.pointerId)) {
                this.drag[0] += event.movementX / canvas.clientHeight;
                this.drag[1] += event.movementY / canvas.clientHeight;
            }
        });
        canvas.addEventListener("wheel", (event) => {
            // A notch of a wheel is about 100; a trackpad sends many small events.
            this.steps -= Math.max(-1, Math.min(1, event.deltaY / 100));
            event.preventDefault();
        }, { passive: false });
    }

    /** Moves the camera by what happened in the last seconds. */
    apply(city, seconds) {
        const motion = [0, 0, 0];
        for (const code of this.pressed) {
            (KEYS[code] ?? [0, 0, 0]).forEach((x, axis) => motion[axis] += x);
        }
        if (motion.some((x) => x !== 0)) {
            const hurries = this.pressed.has("ShiftLeft") || this.pressed.has("ShiftRight");
            city.travel(...motion, hurries, seconds);
        }
        if (this.drag.some((x) => x !== 0)) {
            city.turn(...this.drag);
            this.drag = [0, 0];
        }
        if (this.steps !== 0) {
            city.change_speed(this.steps);
            this.steps = 0;
        }
    }
}
