//! The record of a light: 14 numbers of 32 bits, whatever the shape.
//!
//! | numbers | content |
//! |---|---|
//! | 1 | the kind of the shape, plus [`TWO_SIDED`] |
//! | 9 | the fields of the shape in the order in which [`Shape`] lists them, then zeros |
//! | 3 | the emission |
//! | 1 | the range |

use glam::Vec3;

use super::words::{self, WORD};
use crate::light::{Light, Shape};

/// Numbers of a record.
const WORDS: usize = 14;

/// Bytes of a record.
pub(super) const LIGHT_BYTES: usize = WORDS * WORD;

const POINT: u32 = 0;
const SPOT: u32 = 1;
const RECTANGLE: u32 = 2;
const TRIANGLE: u32 = 3;
const SPHERE: u32 = 4;

/// This bit is set in the kind of a rectangle or a triangle that emits from both sides.
const TWO_SIDED: u32 = 1 << 8;

/// The record of a light.
#[inline(always)]
pub(super) fn encode(light: &Light) -> [u32; WORDS] {
    let sided = |kind: u32, two_sided: bool| if two_sided { kind | TWO_SIDED } else { kind };
    let zero = Vec3::ZERO;
    let (kind, [a, b, c]) = match light.shape {
        Shape::Point { position } => (POINT, [position, zero, zero]),
        Shape::Spot { position, direction, inner_angle, outer_angle } => {
            (SPOT, [position, direction, Vec3::new(inner_angle, outer_angle, 0.0)])
        }
        Shape::Rectangle { center, half_u, half_v, two_sided } => {
            (sided(RECTANGLE, two_sided), [center, half_u, half_v])
        }
        Shape::Triangle { vertices, two_sided } => (sided(TRIANGLE, two_sided), vertices),
        Shape::Sphere { center, radius } => (SPHERE, [center, Vec3::new(radius, 0.0, 0.0), zero]),
    };
    let Light { emission, range, .. } = *light;
    let [a, b, c, emission] = [a, b, c, emission].map(|v| v.to_array().map(f32::to_bits));
    [kind, a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2], emission[0], emission[1], emission[2], range.to_bits()]
}

/// The light of a record, unchecked. `None` for a record that [`encode`] never makes: of an unknown
/// kind, or with numbers other than zero where the kind has no fields.
#[inline(always)]
pub(super) fn decode(record: [u32; WORDS]) -> Option<Light> {
    let light = decode_any(record);
    (encode(&light) == record).then_some(light)
}

/// The light of a record that [`decode`] accepts; some light for any other.
#[inline(always)]
fn decode_any(record: [u32; WORDS]) -> Light {
    let v = record.map(f32::from_bits);
    let point = |first: usize| Vec3::new(v[first], v[first + 1], v[first + 2]);
    let two_sided = record[0] & TWO_SIDED != 0;
    let shape = match record[0] & !TWO_SIDED {
        SPOT => Shape::Spot { position: point(1), direction: point(4), inner_angle: v[7], outer_angle: v[8] },
        RECTANGLE => Shape::Rectangle { center: point(1), half_u: point(4), half_v: point(7), two_sided },
        TRIANGLE => Shape::Triangle { vertices: [point(1), point(4), point(7)], two_sided },
        SPHERE => Shape::Sphere { center: point(1), radius: v[4] },
        _ => Shape::Point { position: point(1) },
    };
    Light { shape, emission: point(10), range: v[13] }
}

/// [`decode`] for the bytes of a record.
#[inline(always)]
pub(super) fn read(bytes: &[u8]) -> Option<Light> {
    decode(words::read_array(bytes))
}

/// The light in the bytes of a record that [`read`] accepts.
#[inline(always)]
pub(super) fn read_accepted(bytes: &[u8]) -> Light {
    decode_any(words::read_array(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bits(light: &Light) -> String {
        // Distinguishes the zeros, and shows NaN payloads as they are.
        format!("{light:?} {:?}", encode(light))
    }

    #[test]
    fn every_field_of_every_shape_keeps_its_bits() {
        // No two fields are equal, and some values are rare.
        let mut next = 0;
        let mut number = || {
            next += 1;
            [f32::from_bits(next), -0.0, f32::MAX, -1.5 * next as f32][next as usize % 4]
        };
        let mut vector = || Vec3::new(number(), number(), number());
        let mut shapes = vec![Shape::Point { position: vector() }];
        for two_sided in [false, true] {
            shapes.push(Shape::Rectangle { center: vector(), half_u: vector(), half_v: vector(), two_sided });
            shapes.push(Shape::Triangle { vertices: [vector(), vector(), vector()], two_sided });
        }
        let angles = vector();
        shapes.push(Shape::Spot {
            position: vector(),
            direction: vector(),
            inner_angle: angles.x,
            outer_angle: angles.y,
        });
        shapes.push(Shape::Sphere { center: vector(), radius: angles.z });
        for shape in shapes {
            for range in [f32::INFINITY, 7.0] {
                let light = Light { shape, emission: vector(), range };
                let back = decode(encode(&light)).expect("a record that was written");
                assert_eq!(bits(&back), bits(&light));
            }
        }
    }

    #[test]
    fn records_that_are_never_written_are_refused() {
        let record = encode(&Light::point(Vec3::ONE, Vec3::ONE));
        assert!(decode(record).is_some());
        for (place, value) in [(0, 5), (0, u32::MAX), (0, TWO_SIDED), (4, 1), (9, 1 << 31)] {
            let mut wrong = record;
            wrong[place] = value;
            assert_eq!(decode(wrong), None, "{place} {value}");
        }
        let mut sphere = encode(&Light::sphere(Vec3::ONE, 1.0, Vec3::ONE));
        sphere[0] |= TWO_SIDED;
        assert_eq!(decode(sphere), None);
    }
}
