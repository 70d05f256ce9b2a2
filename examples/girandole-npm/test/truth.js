// The light that arrives at a point from all lights of a three.js scene, by closed forms, without shadows.

import { Vector3 } from "three";

const vertex = new Vector3();

function subtract(a, b) {
    return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

function dot(a, b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function cross(a, b) {
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function place(object) {
    return new Vector3().setFromMatrixPosition(object.matrixWorld).toArray();
}

function rgb(color, scale) {
    return [color.r * scale, color.g * scale, color.b * scale];
}

/** Lux of a point or spot light of one candela: the range and the falloff are those of KHR_lights_punctual. */
export function luxOfPoint(light, { position, normal }) {
    const from = subtract(place(light), position);
    const distance = Math.hypot(...from);
    const ratio = light.distance > 0 ? distance / light.distance : 0;
    let lux = Math.max(dot(from, normal), 0) / distance ** 3 * Math.max(1 - ratio ** 4, 0);
    if (light.isSpotLight) {
        const axis = subtract(place(light.target), place(light));
        const cosine = -dot(axis, from) / Math.hypot(...axis) / distance;
        const [outer, inner] = [Math.cos(light.angle), Math.cos(light.angle * (1 - light.penumbra))];
        lux *= Math.min(Math.max((cosine - outer) / Math.max(inner - outer, 0.001), 0), 1) ** 2;
    }
    return lux;
}

/** The part of a polygon above the plane through zero with a normal. */
function clip(polygon, normal) {
    const kept = [];
    polygon.forEach((corner, i) => {
        const next = polygon[(i + 1) % polygon.length];
        const [height, nextHeight] = [dot(corner, normal), dot(next, normal)];
        if (height >= 0) {
            kept.push(corner);
        }
        if (height * nextHeight < 0) {
            const part = height / (height - nextHeight);
            kept.push(corner.map((x, axis) => x + part * (next[axis] - x)));
        }
    });
    return kept;
}

/** Lux of an even polygon of one nit: Lambert's formula. */
export function luxOfPolygon(corners, { position, normal }) {
    const polygon = clip(corners.map((corner) => subtract(corner, position)), normal);
    let sum = 0;
    polygon.forEach((corner, i) => {
        const next = polygon[(i + 1) % polygon.length];
        const across = cross(corner, next);
        const length = Math.hypot(...across);
        if (length > 0) {
            sum += Math.atan2(length, dot(corner, next)) * dot(across, normal) / length;
        }
    });
    return Math.abs(sum) / 2;
}

function luxOfMesh(mesh, matrix, point) {
    const { geometry: { attributes: { position }, index }, material: { side } } = mesh;
    const mirror = Math.sign(matrix.determinant()) * (side === 1 ? -1 : 1);
    const vertexOf = (i) => index ? index.getX(i) : i;
    const corner = (i) => vertex.fromBufferAttribute(position, vertexOf(i)).applyMatrix4(matrix).toArray();
    let lux = 0;
    for (let i = 0; i < (index ?? position).count; i += 3) {
        const [a, b, c] = [corner(i), corner(i + 1), corner(i + 2)];
        const front = dot(cross(subtract(b, a), subtract(c, a)), subtract(point.position, a)) * mirror;
        lux += side === 2 || front > 0 ? luxOfPolygon([a, b, c], point) : 0;
    }
    return lux;
}

function luxOfArea(light, point) {
    const [x, y] = [light.width / 2, light.height / 2];
    const corners = [[-x, -y], [x, -y], [x, y], [-x, y]];
    const polygon = corners.map(([u, v]) => vertex.set(u, v, 0).applyMatrix4(light.matrixWorld).toArray());
    const away = new Vector3(0, 0, -1).transformDirection(light.matrixWorld).toArray();
    return dot(away, subtract(point.position, polygon[0])) > 0 ? luxOfPolygon(polygon, point) : 0;
}

function luxOf(object, point) {
    if (object.isPointLight || object.isSpotLight) {
        return rgb(object.color, object.intensity * luxOfPoint(object, point));
    }
    if (object.isDirectionalLight) {
        const back = subtract(place(object), place(object.target));
        return rgb(object.color, object.intensity * Math.max(dot(back, point.normal), 0) / Math.hypot(...back));
    }
    if (object.isRectAreaLight) {
        return rgb(object.color, object.intensity * luxOfArea(object, point));
    }
    if (object.isMesh && object.material.emissive) {
        const matrices = object.isInstancedMesh ? instanceMatrices(object) : [object.matrixWorld];
        const lux = matrices.reduce((sum, matrix) => sum + luxOfMesh(object, matrix, point), 0);
        return rgb(object.material.emissive, object.material.emissiveIntensity * lux);
    }
    return [0, 0, 0];
}

function instanceMatrices(mesh) {
    return Array.from({ length: mesh.count }, (_, i) => {
        const matrix = mesh.matrixWorld.clone();
        mesh.getMatrixAt(i, matrix);
        return matrix.premultiply(mesh.matrixWorld);
    });
}

/** Lux in three colours from all objects that are visible, but for those that are left out. */
export function luxOfScene(scene, leftOut, point) {
    scene.updateMatrixWorld();
    const sum = [0, 0, 0];
    scene.traverseVisible((object) => {
        if (!leftOut.has(object)) {
            luxOf(object, point).forEach((lux, channel) => sum[channel] += lux);
        }
    });
    return sum;
}
