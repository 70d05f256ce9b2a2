// The scene: houses with lit windows, strings of coloured bulbs, a sign, street lamps, and cars that move.

import * as THREE from "three";

const STRINGS = 20;
const BULBS_OF_STRING = 50;
const COLORS = [0xff9a3c, 0xff4a3c, 0xffe08a, 0x5aff8a, 0x4ab8ff, 0xd070ff];
const WIDTH = 12;
/** three.js itself does not light its picture by objects in this layer. */
const LIGHTS = 1;

/** Random numbers that are the same on every visit. */
function generator(seed) {
    return (from = 0, to = 1) => {
        seed = Math.imul(seed, 1664525) + 1013904223 | 0;
        return from + (to - from) * (seed >>> 8) / 2 ** 24;
    };
}

function surface(color) {
    return new THREE.MeshStandardMaterial({ color });
}

/** A black surface that emits nits. */
function emitter(color, nits) {
    return new THREE.MeshStandardMaterial({ color: 0, emissive: color, emissiveIntensity: nits });
}

export class Street {
    constructor() {
        this.scene = new THREE.Scene();
        this.camera = new THREE.PerspectiveCamera(55, 1, 0.1, 200);
        this.camera.position.set(-22, 2.6, -0.6);
        this.camera.lookAt(0, 2.9, 0.4);
        this.random = generator(7);
        this.solids = [];
        this.cube = new THREE.BoxGeometry(1, 1, 1);
        this.pane = new THREE.PlaneGeometry(1, 1);
        this.add(new THREE.Mesh(new THREE.PlaneGeometry(120, 120), surface(0x505056))).rotation.x = -Math.PI / 2;
        [-1, 1].forEach((side) => this.addHouses(side));
        this.addBulbs();
        this.addSign();
        this.addStreetLamps();
        this.cars = [0, 1, 2].map((i) => this.addCar(i));
    }

    add(object, parent = this.scene) {
        parent.add(object);
        return object;
    }

    addBox(size, position, material, parent) {
        const box = this.add(new THREE.Mesh(this.cube, material), parent);
        box.scale.set(...size);
        box.position.set(...position);
        this.solids.push(box);
        return box;
    }

    addHouses(side) {
        const walls = [0x8a7a6a, 0x7a8288, 0x96826a, 0x847068].map(surface);
        const glass = [emitter(0xffb060, 3), emitter(0xffd090, 5), emitter(0x90b8ff, 3)];
        for (let x = -24, house = 0; x < 28; house++) {
            const [length, height] = [this.random(5, 8), this.random(6, 11)];
            const front = side * (WIDTH / 2 + this.random(0, 0.8));
            this.addBox([length - 0.3, height, 8], [x + length / 2, height / 2, front + side * 4], walls[house % 4]);
            for (let y = 1.6; y < height - 1; y += 2.6) {
                for (let across = 1.2; across < length - 1; across += 1.8) {
                    if (this.random() < 0.45) {
                        const kind = glass[Math.floor(this.random(0, 3))];
                        const pane = this.add(new THREE.Mesh(this.pane, kind));
                        pane.scale.set(0.9, 1.3, 1);
                        pane.position.set(x + across, y, front - side * 0.02);
                        pane.rotation.y = side > 0 ? Math.PI : 0;
                    }
                }
            }
            x += length;
        }
    }

    /** One mesh with many instances for each colour. All share a geometry. */
    addBulbs() {
        const ball = new THREE.OctahedronGeometry(0.09);
        const perColor = Math.ceil(STRINGS * BULBS_OF_STRING / COLORS.length);
        const meshes = COLORS.map((color) => {
            return this.add(new THREE.InstancedMesh(ball, emitter(color, 60), perColor));
        });
        const counts = COLORS.map(() => 0);
        const matrix = new THREE.Matrix4();
        for (let bulb = 0; bulb < STRINGS * BULBS_OF_STRING; bulb++) {
            const string = Math.floor(bulb / BULBS_OF_STRING);
            const along = (bulb % BULBS_OF_STRING + 0.5) / BULBS_OF_STRING;
            const sag = 1.4 * (1 - (2 * along - 1) ** 2);
            const x = -20 + 2.2 * string + 1.5 * (along - 0.5) * (string % 2 === 0 ? 1 : -1);
            matrix.makeTranslation(x, 5.9 - sag + 0.3 * (string % 3), (along - 0.5) * WIDTH);
            const color = bulb % COLORS.length;
            meshes[color].setMatrixAt(counts[color]++, matrix);
        }
        meshes.forEach((mesh, color) => {
            mesh.count = counts[color];
            // It would be that of the geometry otherwise.
            mesh.computeBoundingSphere();
        });
    }

    /** A light that three.js does not draw, and a surface that it draws. */
    addSign() {
        const [x, y, z] = [-7, 3.6, WIDTH / 2 - 0.9];
        const sign = this.add(new THREE.RectAreaLight(0xff40a0, 12, 1.2, 3.2));
        sign.position.set(x, y, z);
        sign.lookAt(x - 1, y, z);
        sign.layers.set(LIGHTS);
        this.addBox([0.2, 3.3, 1.3], [x + 0.12, y, z], surface(0x202020));
        const face = this.add(new THREE.Mesh(this.pane, surface(0xff40a0)));
        face.scale.set(1.2, 3.2, 1);
        face.position.set(x - 0.01, y, z);
        face.rotation.y = -Math.PI / 2;
    }

    addStreetLamps() {
        for (let x = -14; x < 30; x += 12) {
            const lamp = this.add(new THREE.SpotLight(0xffdcb0, 50, 20, 1.1, 0.5));
            lamp.position.set(x, 5.6, -WIDTH / 2 + 1.4);
            lamp.target.position.set(x, 0, -WIDTH / 2 + 2);
            lamp.layers.set(LIGHTS);
            this.add(lamp.target);
            this.addBox([0.12, 5.6, 0.12], [x, 2.8, -WIDTH / 2 + 0.9], surface(0x303030));
            this.addBox([0.12, 0.1, 0.9], [x, 5.7, -WIDTH / 2 + 1.3], surface(0x303030));
        }
    }

    addCar(number) {
        const car = this.add(new THREE.Group());
        const paint = surface([0xb03028, 0x3050a0, 0xc0b090][number]);
        this.addBox([3.8, 0.7, 1.7], [0, 0.65, 0], paint, car);
        this.addBox([2, 0.55, 1.5], [-0.2, 1.25, 0], paint, car);
        for (const z of [-0.6, 0.6]) {
            const head = this.add(new THREE.SpotLight(0xfff0d8, 250, 30, 0.45, 0.8), car);
            head.position.set(2, 0.7, z);
            head.target.position.set(8, 0.1, z);
            head.layers.set(LIGHTS);
            car.add(head.target);
            const tail = this.add(new THREE.Mesh(this.pane, emitter(0xff1808, 30)), car);
            tail.scale.set(0.35, 0.15, 1);
            tail.position.set(-1.92, 0.75, z);
            tail.rotation.y = -Math.PI / 2;
        }
        return car;
    }

    /** Places what moves, at a time in seconds. */
    move(seconds) {
        this.cars.forEach((car, i) => {
            car.position.x = ((i * 15 + seconds * (4 + i)) % 50) - 18;
            car.position.z = i % 2 === 0 ? 1.7 : -1.9;
        });
    }

    /** The boxes that cast shadows: pairs of corners. All are parallel to the axes. */
    boxes() {
        return this.solids.map((box) => {
            const corner = (x) => new THREE.Vector3(x, x, x).applyMatrix4(box.matrixWorld).toArray();
            return [corner(-0.5), corner(0.5)];
        });
    }
}
