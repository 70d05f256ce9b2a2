// A small scene with an object of every kind that SceneLights follows, and of some that it leaves out.

import * as THREE from "three";

/** Random numbers that are the same in every run. */
export function generator(seed) {
    return (from = 0, to = 1) => {
        seed = Math.imul(seed ^ seed >>> 15, 0x2c1b3c6d) + 0x9e3779b9 | 0;
        const mixed = Math.imul(seed ^ seed >>> 12, 0x297a2d39);
        return from + (to - from) * ((mixed ^ mixed >>> 15) >>> 0) / 2 ** 32;
    };
}

function inRoom(random) {
    return [random(-9, 9), random(1, 6), random(-9, 9)];
}

function emissive(random, side = THREE.FrontSide) {
    const emissive = new THREE.Color(random(), random(), random());
    return new THREE.MeshStandardMaterial({ emissive, emissiveIntensity: random(5, 20), side });
}

export function testScene() {
    const random = generator(1);
    const scene = new THREE.Scene();
    const color = () => new THREE.Color(random(), random(), random());
    const add = (object, position = inRoom(random)) => {
        object.position.set(...position);
        scene.add(object);
        return object;
    };
    const lamps = Array.from({ length: 200 }, (_, i) => {
        return add(new THREE.PointLight(color(), random(1, 30), i % 3 === 0 ? random(4, 12) : 0));
    });
    for (let i = 0; i < 20; i++) {
        const spot = new THREE.SpotLight(color(), random(50, 200), 0, random(0.3, 1), random(0.1, 0.9));
        add(spot).target.position.set(random(-9, 9), 0, random(-9, 9));
        scene.add(spot.target);
    }
    for (let i = 0; i < 2; i++) {
        add(new THREE.RectAreaLight(color(), random(10, 40), 1.5, 0.6)).lookAt(random(-9, 9), 0, random(-9, 9));
    }
    const sun = add(new THREE.DirectionalLight(color(), 2), [3, 8, 5]);

    const ball = new THREE.IcosahedronGeometry(0.4);
    const sides = [THREE.FrontSide, THREE.BackSide, THREE.DoubleSide, THREE.FrontSide, THREE.FrontSide];
    const balls = sides.map((side) => add(new THREE.Mesh(ball, emissive(random, side))));
    balls[3].scale.set(-1, 1.5, 0.7);
    const quad = add(new THREE.Mesh(new THREE.PlaneGeometry(2, 1), emissive(random, THREE.BackSide)));
    quad.lookAt(0, 20, 0);

    const group = add(new THREE.Group(), [0, 1, 0]);
    group.rotation.set(0.2, 0.5, 0.1);
    const shards = new THREE.InstancedMesh(new THREE.TetrahedronGeometry(0.3), emissive(random), 8);
    for (let i = 0; i < shards.count; i++) {
        shards.setMatrixAt(i, new THREE.Matrix4().makeRotationY(i).setPosition(...inRoom(random)));
    }
    group.add(shards);

    add(new THREE.Mesh(ball, new THREE.MeshStandardMaterial()));
    const dark = add(new THREE.PointLight(0xffffff, 500));
    dark.visible = false;
    const ambient = add(new THREE.AmbientLight(0xffffff, 5));
    const broken = add(new THREE.PointLight(0xffffff, 5), [NaN, 0, 0]);
    const textured = add(new THREE.Mesh(ball, emissive(random)));
    textured.material.emissiveMap = new THREE.Texture();
    return { scene, lamps, balls, quad, shards, sun, leftOut: [ambient, broken, textured] };
}

/** Changes some of everything. */
export function change({ scene, lamps, balls, quad, shards, sun }) {
    const random = generator(2);
    lamps.slice(0, 20).forEach((lamp) => lamp.position.set(...inRoom(random)));
    lamps.slice(20, 30).forEach((lamp) => lamp.intensity *= 4);
    lamps.slice(30, 40).forEach((lamp) => lamp.visible = false);
    lamps.slice(40, 50).forEach((lamp) => scene.remove(lamp));
    lamps.slice(50, 60).forEach((lamp) => lamp.distance = 5);
    balls[0].material.emissive.set(1, 0.2, 0.1);
    balls[4].material.side = THREE.DoubleSide;
    scene.remove(balls[1]);
    shards.count = 5;
    shards.parent.position.y += 1;
    quad.geometry.attributes.position.setXYZ(0, -2, 2, 0);
    quad.geometry.attributes.position.needsUpdate = true;
    sun.position.set(-4, 8, 1);
    const added = new THREE.PointLight(0x88ff44, 60);
    added.position.set(...inRoom(random));
    scene.add(added);
}

export function testPoints(count) {
    const random = generator(3);
    return Array.from({ length: count }, (_, i) => {
        const tilted = new THREE.Vector3(random(-1, 1), random(-1, 1), random(-1, 1)).normalize();
        const [x, y, z] = inRoom(random);
        const isOnFloor = i % 2 === 0;
        return { position: [x, isOnFloor ? 0 : y, z], normal: isOnFloor ? [0, 1, 0] : tilted.toArray() };
    });
}
