// What the objects of a three.js scene emit.
//
// Lights are described by properties that three.js objects have, so any copy and any build of three.js will do.

import { LightList } from "./girandole.js";
import { emissiveTriangles, geometryName } from "./geometry.js";
import { facing, multiplied, positionOf } from "./matrices.js";

/**
 * The emission of lights in trees, in candela or nits. The factors of instances, which are at most 10,000, multiply
 * it.
 */
const UNIT = 1024;
const WHITE = [UNIT, UNIT, UNIT];
const ORIGIN = [0, 0, 0];
const BACK_SIDE = 1;
const DOUBLE_SIDE = 2;

function emitted(color, intensity, unit) {
    const scale = intensity / unit;
    return [color.r * scale, color.g * scale, color.b * scale];
}

/** Objects with the same name share a tree, which `fill` makes. */
function source(name, fill, matrices, color, intensity = 1) {
    const lights = () => {
        const list = new LightList();
        fill(list);
        return list;
    };
    return { name, lights, matrices, factor: emitted(color, intensity, UNIT) };
}

function pointSource(light) {
    const range = light.distance > 0 ? light.distance : undefined;
    const [x, y, z] = positionOf(light.matrixWorld);
    const matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1];
    const fill = (list) => list.point(ORIGIN, WHITE, range);
    return source(`point ${range}`, fill, matrix, light.color, light.intensity);
}

function spotSource(light) {
    const range = light.distance > 0 ? light.distance : undefined;
    const [outer, inner] = [light.angle, light.angle * (1 - light.penumbra)];
    const matrix = facing(positionOf(light.matrixWorld), positionOf(light.target.matrixWorld));
    const fill = (list) => list.spot(ORIGIN, [0, 0, -1], inner, outer, WHITE, range);
    return source(`spot ${inner} ${outer} ${range}`, fill, matrix, light.color, light.intensity);
}

function areaSource(light) {
    // The side of the cross product is that of -Z.
    const fill = (list) => list.rectangle(ORIGIN, [0, light.height / 2, 0], [light.width / 2, 0, 0], WHITE);
    const name = `area ${light.width} ${light.height}`;
    return source(name, fill, light.matrixWorld.elements, light.color, light.intensity);
}

/** A light at infinity has no tree. */
function sunSource(light) {
    const [from, to] = [positionOf(light.matrixWorld), positionOf(light.target.matrixWorld)];
    const direction = to.map((coordinate, axis) => coordinate - from[axis]);
    const length = Math.hypot(...direction);
    return { sun: { direction: direction.map((x) => x / length), lux: emitted(light.color, light.intensity, 1) } };
}

function meshSource(mesh) {
    const { geometry, material } = mesh;
    const isTwoSided = material.side === DOUBLE_SIDE;
    const isReversed = material.side === BACK_SIDE;
    const fill = (list) => list.triangles(emissiveTriangles(geometry, isReversed), WHITE, isTwoSided);
    const matrices = mesh.isInstancedMesh ? multiplied(mesh.matrixWorld, mesh.instanceMatrix.array, mesh.count)
        : mesh.matrixWorld.elements;
    const name = `${geometryName(geometry)} ${material.side}`;
    return source(name, fill, matrices, material.emissive, material.emissiveIntensity);
}

function shines(material) {
    const { emissive, emissiveIntensity = 1 } = material;
    return Boolean(material.emissiveNode) ||
        Boolean(emissive?.isColor) && emissiveIntensity > 0 && emissive.r + emissive.g + emissive.b > 0;
}

/** Why an object that shines is left out; `null` if it is not. */
function refusal(object) {
    if (object.isLight) {
        if (object.isAmbientLight || object.isHemisphereLight || object.isLightProbe) {
            return "ambient light comes from no place";
        }
        if (object.decay !== undefined && object.decay !== 2) {
            return `the decay is ${object.decay}; only 2 is physical`;
        }
        return object.map ? "the light projects a texture" : null;
    }
    const { material, geometry } = object;
    if (Array.isArray(material)) {
        return "the mesh has several materials";
    }
    if (material.emissiveMap || material.emissiveNode) {
        return "the emission varies over the mesh";
    }
    if (object.isSkinnedMesh || object.isBatchedMesh || geometry.morphAttributes.position) {
        return "the mesh is deformed or batched";
    }
    return geometry.attributes.position ? null : "the mesh has no positions";
}

/**
 * What an object emits: `null` for nothing, a string that says why the object is left out, or a source.
 */
export function sourceOf(object) {
    const isEmissive = object.isMesh && [object.material].flat().some(shines);
    if (!object.isLight && !isEmissive) {
        return null;
    }
    const why = refusal(object);
    if (why !== null) {
        return why;
    }
    if (isEmissive) {
        return meshSource(object);
    }
    const make = object.isPointLight ? pointSource : object.isSpotLight ? spotSource
        : object.isRectAreaLight ? areaSource : object.isDirectionalLight ? sunSource : null;
    return make === null ? `there is no light like ${object.type}` : make(object);
}
