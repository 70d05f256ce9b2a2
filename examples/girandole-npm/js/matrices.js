// 4 x 4 matrices in arrays, column by column.

/** The translation of a Matrix4. */
export function positionOf({ elements }) {
    return [elements[12], elements[13], elements[14]];
}

function cross(a, b) {
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function unit(a) {
    const length = Math.hypot(...a);
    return a.map((x) => x / length);
}

/** A matrix that places its origin at `from` and turns its -Z towards `to`. */
export function facing(from, to) {
    const z = unit(from.map((coordinate, axis) => coordinate - to[axis]));
    const x = unit(cross(Math.abs(z[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0], z));
    return [...x, 0, ...cross(z, x), 0, ...z, 0, ...from, 1];
}

/** The products of a Matrix4 and `count` matrices. */
export function multiplied({ elements: a }, matrices, count) {
    const products = new Float64Array(16 * count);
    for (let place = 0; place < products.length; place++) {
        const [row, column] = [place % 4, place - place % 4];
        for (let i = 0; i < 4; i++) {
            products[place] += a[4 * i + row] * matrices[column + i];
        }
    }
    return products;
}
