//! The record of a light: 14 numbers of 32 bits, whatever the shape.
//!
//! | numbers | content |
//! |---|---|
//! | 1 | the kind of the shape, plus [`TWO_SIDED`] |
//! | 9 | the fields of the shape in the order in which [`Shape`] lists them, then zeros |
//! | 3 | the emission |
//! | 1 | the range |

use glam::Vec3;

use super::error::BakeError;
use super::words::WORD;
use crate::light::{Light, Shape};

/// Numbers of a record.
pub(super) const WORDS: usize = 14;

/// Bytes of a record.
pub(super) const LIGHT_BYTES: usize = WORDS * WORD;

pub(super) const POINT: u32 = 0;
pub(super) const SPOT: u32 = 1;
pub(super) const RECTANGLE: u32 = 2;
pub(super) const TRIANGLE: u32 = 3;
pub(super) const SPHERE: u32 = 4;

/// This bit is set in the kind of a rectangle or a triangle that emits from both sides.
pub(super) const TWO_SIDED: u32 = 1 << 8;

/// The numbers of a record.
pub(super) type Record = [u32; WORDS];

/// The record of a light.
pub(super) fn encode(light: &Light) -> Record {
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

/// The record of [`Light::REMOVED`].
pub(super) const REMOVED: Record = [0; WORDS];

/// The light of a record, if a tree accepts it. `index` is that of the light.
///
/// # Errors
/// [`BakeError::Record`] for a record that [`encode`] never makes: of an unknown kind, or with
/// numbers other than zero where the kind has no fields. [`BakeError::Light`] for an invalid light.
pub(super) fn decode(record: &Record, index: usize) -> Result<Light, BakeError> {
    let light = decode_accepted(record);
    if encode(&light) != *record {
        return Err(BakeError::Record { what: "a light: a field", index });
    }
    light.validate().map_err(|source| BakeError::Light { index, source })?;
    Ok(light)
}

/// The light of a record that [`decode`] accepts; some light for any other.
#[inline(always)]
pub(super) fn decode_accepted(record: &Record) -> Light {
    let number = |at: usize| f32::from_bits(record[at]);
    let point = |first: usize| Vec3::new(number(first), number(first + 1), number(first + 2));
    let two_sided = record[0] & TWO_SIDED != 0;
    let shape = match record[0] & !TWO_SIDED {
        SPOT => Shape::Spot { position: point(1), direction: point(4), inner_angle: number(7), outer_angle: number(8) },
        RECTANGLE => Shape::Rectangle { center: point(1), half_u: point(4), half_v: point(7), two_sided },
        TRIANGLE => Shape::Triangle { vertices: [point(1), point(4), point(7)], two_sided },
        SPHERE => Shape::Sphere { center: point(1), radius: number(4) },
        _ => Shape::Point { position: point(1) },
    };
    Light { shape, emission: point(10), range: number(13) }
}

/// The record in some bytes, which are [`LIGHT_BYTES`].
#[inline(always)]
pub(super) fn read(bytes: &[u8]) -> Record {
    let mut record: Record = bytemuck::pod_read_unaligned(bytes);
    record.iter_mut().for_each(|word| *word = u32::from_le(*word));
    record
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
                let back = decode_accepted(&encode(&light));
                assert_eq!(bits(&back), bits(&light));
            }
        }
    }

    #[test]
    fn the_record_of_a_removed_light_is_no_light() {
        assert_eq!(encode(&Light::REMOVED), REMOVED);
        assert!(decode_accepted(&REMOVED).is_removed() && decode(&REMOVED, 0).is_err());
    }

    #[test]
    fn records_that_are_never_written_are_refused() {
        let record = encode(&Light::point(Vec3::ONE, Vec3::ONE));
        assert!(decode(&record, 0).is_ok());
        let refused = |record: &Record| decode(record, 7).err();
        let expected = Some(BakeError::Record { what: "a light: a field", index: 7 });
        for (place, value) in [(0, 5), (0, u32::MAX), (0, TWO_SIDED), (4, 1), (9, 1 << 31)] {
            let mut wrong = record;
            wrong[place] = value;
            assert_eq!(refused(&wrong), expected, "{place} {value}");
        }
        let mut sphere = encode(&Light::sphere(Vec3::ONE, 1.0, Vec3::ONE));
        sphere[0] |= TWO_SIDED;
        assert_eq!(refused(&sphere), expected);
        let dim = encode(&Light::point(Vec3::ONE, -Vec3::ONE));
        assert_eq!(refused(&dim).map(|error| error.code()), Some(101));
    }
}
