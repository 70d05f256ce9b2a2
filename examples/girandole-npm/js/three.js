// Follows the lights of a three.js scene.

import { sourceOf } from "./sources.js";

/** Whether numbers from `start` on are the same. */
function isSame(present, given, start = 0) {
    for (let i = 0; i < present.length; i++) {
        if (present[i] !== given[start + i]) {
            return false;
        }
    }
    return true;
}

/** The matrix with an index in a list of matrices. */
function matrixAt(matrices, index) {
    const matrix = new Float64Array(16);
    for (let i = 0; i < 16; i++) {
        matrix[i] = matrices[16 * index + i];
    }
    return matrix;
}

function isWithin(object, scene) {
    return object !== null && (object === scene || isWithin(object.parent, scene));
}

export class SceneLights {
    #world;
    /** Trees by name, with the number of objects that use each. */
    #trees = new Map();
    /** What the world has of each object. */
    #objects = new Map();
    #suns = new Map();

    constructor(world) {
        this.#world = world;
        this.leftOut = new Map();
    }

    sync(scene) {
        if (scene.matrixWorldAutoUpdate) {
            scene.updateMatrixWorld();
        }
        this.leftOut.clear();
        const seen = new Set();
        scene.traverseVisible((object) => {
            const source = sourceOf(object);
            if (typeof source === "string") {
                this.leftOut.set(object, source);
            } else if (source !== null) {
                try {
                    this.#follow(object, source);
                    seen.add(object);
                } catch (error) {
                    this.leftOut.set(object, error.message);
                }
            }
        });
        for (const object of this.#suns.keys()) {
            if (!seen.has(object)) {
                this.#removeSun(object);
            }
        }
        for (const object of this.#objects.keys()) {
            if (seen.has(object)) {
                continue;
            }
            // Objects that are dark or hidden may come back.
            if (isWithin(object, scene) && !this.leftOut.has(object)) {
                this.#enable(this.#objects.get(object), false);
            } else {
                this.#remove(object);
            }
        }
    }

    instanceOf(object, index = 0) {
        return this.#objects.get(object)?.instances[index]?.key;
    }

    #follow(object, { sun, ...source }) {
        if (sun !== undefined) {
            return this.#followSun(object, sun);
        }
        let present = this.#objects.get(object);
        if (present !== undefined && present.name !== source.name) {
            this.#remove(object);
            present = undefined;
        }
        if (present === undefined) {
            const tree = this.#use(source);
            present = { name: source.name, tree, instances: [], factor: [1, 1, 1], isEnabled: true };
            this.#objects.set(object, present);
        }
        this.#place(present, source.matrices);
        if (!isSame(present.factor, source.factor)) {
            present.instances.forEach(({ key }) => this.#world.setFactor(key, source.factor));
            present.factor = source.factor;
        }
        this.#enable(present, true);
    }

    /** Gives an object one instance for each matrix. */
    #place(present, matrices) {
        const { instances } = present;
        const count = matrices.length / 16;
        instances.splice(count).forEach(({ key }) => this.#world.removeInstance(key));
        for (let i = 0; i < count; i++) {
            if (instances[i] === undefined) {
                const matrix = matrixAt(matrices, i);
                const key = this.#world.addInstance(present.tree, matrix);
                instances.push({ key, matrix });
                this.#world.setFactor(key, present.factor);
                this.#world.setEnabled(key, present.isEnabled);
            } else if (!isSame(instances[i].matrix, matrices, 16 * i)) {
                instances[i].matrix = matrixAt(matrices, i);
                this.#world.moveInstance(instances[i].key, instances[i].matrix);
            }
        }
    }

    #enable(present, isEnabled) {
        if (present.isEnabled !== isEnabled) {
            present.instances.forEach(({ key }) => this.#world.setEnabled(key, isEnabled));
            present.isEnabled = isEnabled;
        }
    }

    #remove(object) {
        const { name, instances } = this.#objects.get(object);
        instances.forEach(({ key }) => this.#world.removeInstance(key));
        this.#objects.delete(object);
        const tree = this.#trees.get(name);
        tree.users--;
        if (tree.users === 0) {
            this.#world.removeTree(tree.key);
            this.#trees.delete(name);
        }
    }

    /** The tree of a source, which is built for its first user. */
    #use({ name, lights }) {
        if (!this.#trees.has(name)) {
            this.#trees.set(name, { key: this.#world.addTree(lights()), users: 0 });
        }
        const tree = this.#trees.get(name);
        tree.users++;
        return tree.key;
    }

    #followSun(object, { direction, lux }) {
        const present = this.#suns.get(object);
        if (present === undefined) {
            const key = this.#world.addDirectional(direction, lux);
            this.#suns.set(object, { key, direction, lux });
        } else if (!isSame(present.direction, direction) || !isSame(present.lux, lux)) {
            this.#world.setDirectional(present.key, direction, lux);
            Object.assign(present, { direction, lux });
        }
    }

    #removeSun(object) {
        this.#world.removeDirectional(this.#suns.get(object).key);
        this.#suns.delete(object);
    }
}
