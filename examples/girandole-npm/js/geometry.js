// The triangles of three.js geometries.

let count = 0;
const numbers = new WeakMap();

function numberOf(object) {
    if (!numbers.has(object)) {
        numbers.set(object, count++);
    }
    return numbers.get(object);
}

/** A name for an attribute and its present content. */
function attributeName(attribute) {
    const { version } = attribute.isInterleavedBufferAttribute ? attribute.data : attribute;
    return `${numberOf(attribute)}.${version}`;
}

/** A name for the triangles of a geometry, which changes when they do. */
export function geometryName({ attributes, index, drawRange }) {
    const names = [attributes.position, index].map((attribute) => attribute ? attributeName(attribute) : "-");
    return `mesh ${names.join(" ")} ${drawRange.start} ${drawRange.count}`;
}

/** The corners of all triangles, nine numbers each. */
export function emissiveTriangles({ attributes: { position }, index, drawRange }, isReversed) {
    const total = index ? index.count : position.count;
    const start = Math.min(drawRange.start, total);
    const triangles = Math.floor((Math.min(drawRange.count, total - start)) / 3);
    const corners = new Float32Array(9 * triangles);
    for (let corner = 0; corner < 3 * triangles; corner++) {
        // The second and the third corner change places.
        const place = isReversed ? corner - corner % 3 + (3 - corner % 3) % 3 : corner;
        const vertex = index ? index.getX(start + place) : start + place;
        corners.set([position.getX(vertex), position.getY(vertex), position.getZ(vertex)], 3 * corner);
    }
    return corners;
}
