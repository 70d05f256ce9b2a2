//! The record of a light: 14 numbers of 32 bits, whatever the shape.
//!
//! | numbers | content |
//! |---|---|
//! | 1 | the kind of the shape, plus [`TWO_SIDED`] |
//! | 9 | the fields of the shape in the order in which [`Shape`] lists them, then zeros; of a profile its number |
//! | 3 | the emission |
//! | 1 | the range |

use glam::Vec3;

use super::error::BakeError;
use super::words::WORD;
use crate::light::{Light, Shape};
use crate::profile::Profile;

/// Numbers of a record.
pub(super) const WORDS: usize = 14;

/// Bytes of a record.
pub(super) const LIGHT_BYTES: usize = WORDS * WORD;

pub(super) const POINT: u32 = 0;
pub(super) const SPOT: u32 = 1;
pub(super) const RECTANGLE: u32 = 2;
pub(super) const TRIANGLE: u32 = 3;
pub(super) const SPHERE: u32 = 4;
pub(super) const PROFILE: u32 = 5;

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
        Shape::Profile { position, rotation: [x, y, z, w], .. } => {
            (PROFILE, [position, Vec3::new(x, y, z), Vec3::new(w, 0.0, 0.0)])
        }
    };
    let Light { emission, range, .. } = *light;
    let [a, b, c, emission] = [a, b, c, emission].map(|v| v.to_array().map(f32::to_bits));
    let [low, high] = match light.shape {
        Shape::Profile { profile, .. } => [profile.id() as u32, (profile.id() >> 32) as u32],
        _ => [c[1], c[2]],
    };
    [kind, a[0], a[1], a[2], b[0], b[1], b[2], c[0], low, high, emission[0], emission[1], emission[2], range.to_bits()]
}

/// The record of [`Light::REMOVED`].
pub(super) const REMOVED: Record = [0; WORDS];

/// The light of a record, if a tree accepts it. `index` is that of the light.
///
/// # Errors
/// [`BakeError::Record`] for a record that [`encode`] never makes: of an unknown kind, or with
/// numbers other than zero where the kind has no fields. [`BakeError::Light`] for an invalid light,
/// [`BakeError::Profile`] for one whose profile was not made in this process.
pub(super) fn decode(record: &Record, index: usize) -> Result<Light, BakeError> {
    let id = id_of(record);
    if record[0] == PROFILE && Profile::of_id(id).is_none() {
        return Err(BakeError::Profile { index, id });
    }
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
        PROFILE => match Profile::of_id(id_of(record)) {
            Some(profile) => Shape::Profile { position: point(1), rotation: [4, 5, 6, 7].map(number), profile },
            None => Shape::Point { position: point(1) },
        },
        _ => Shape::Point { position: point(1) },
    };
    Light { shape, emission: point(10), range: number(13) }
}

/// The number of the profile of a record.
fn id_of(record: &Record) -> u64 {
    u64::from(record[8]) | u64::from(record[9]) << 32
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
    use crate::profile::tests::{of_degrees, street_lamp};

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
    fn a_profile_is_found_by_its_number_and_refused_if_no_one_has_made_it() {
        let turn = glam::Quat::from_rotation_x(0.7);
        let lamp = Light::profile(Vec3::ONE, turn, street_lamp(33), Vec3::splat(0.5)).with_range(9.0);
        let record = encode(&lamp);
        assert_eq!(decode(&record, 0).ok(), Some(lamp));
        let mut unknown = record;
        unknown[9] ^= 1;
        let id = id_of(&unknown);
        assert_eq!(decode(&unknown, 7), Err(BakeError::Profile { index: 7, id }));
        // The same number in all versions, or files would not find their profiles.
        let known = of_degrees(&[0.0, 90.0], &[0.0], &[1.0, 2.0]);
        assert_eq!(known.id(), 0xb4b2_8028_0871_1fa7);
        let bright = encode(&Light::profile(Vec3::ONE, turn, known, Vec3::splat(0.6 * crate::light::MAX_EMISSION)));
        assert_eq!(decode(&bright, 7).map_err(|error| error.code()), Err(101));
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
        for (place, value) in [(0, 6), (0, u32::MAX), (0, TWO_SIDED), (4, 1), (9, 1 << 31)] {
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
